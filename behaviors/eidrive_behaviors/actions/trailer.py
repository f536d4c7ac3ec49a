"""Actions on trailers: connection and disconnection."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_behaviors.actions.following import check_other_entity
from eidrive_scenario.api.actions import ActionBehaviour, model, trailers_behind


class ConnectTrailerAction(ActionBehaviour):
    """Immediate connection of a trailer, in place of a connected one. It follows the hitch from the next step."""

    action: model.ConnectTrailerAction

    def configure(self) -> None:
        """Check that the trailer is another entity."""
        check_other_entity(self, self.action.trailer_ref)

    def update(self) -> Status:
        """Connect the trailer, unless it tows the actor."""
        trailer = self.action.trailer_ref
        if self.actor.name in trailers_behind(self.context.actors, trailer):
            self.warn(f"no effect: {trailer!r} tows {self.actor.name!r}", "disconnect the actor first")
        else:
            self.context.connect_trailer(self.actor.name, trailer)
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe the trailer."""
        return f"couple trailer {self.action.trailer_ref}"


class DisconnectTrailerAction(ActionBehaviour):
    """Immediate disconnection of the trailer, which stops at its position."""

    action: model.DisconnectTrailerAction

    def update(self) -> Status:
        """Disconnect the trailer."""
        self.context.disconnect_trailer(self.actor.name)
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe the action."""
        return "uncouple the trailer"

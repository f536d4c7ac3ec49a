"""Actions on trailers: connection and disconnection."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, model


class ConnectTrailerAction(ActionBehaviour):
    """Immediate connection of a trailer, in place of a connected one. It follows the hitch from the next step."""

    action: model.ConnectTrailerAction

    def update(self) -> Status:
        """Connect the trailer."""
        for other in self.context.actors.values():
            if other.trailer == self.action.trailer_ref:
                other.set_trailer(None)
        self.actor.set_trailer(self.action.trailer_ref)
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe the trailer."""
        return f"couple trailer {self.action.trailer_ref}"


class DisconnectTrailerAction(ActionBehaviour):
    """Immediate disconnection of the trailer, which stops at its position."""

    action: model.DisconnectTrailerAction

    def update(self) -> Status:
        """Disconnect the trailer."""
        name = self.actor.trailer
        self.actor.set_trailer(None)
        if name is not None:
            trailer = self.context.actors[name].motion
            trailer.set_speed(0.0)
            trailer.snap_to_lane()
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe the action."""
        return "uncouple the trailer"

"""Actions on trailers: couple and uncouple."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, model


class ConnectTrailerAction(ActionBehaviour):
    """Couples a trailer at once, in place of one that is coupled; from the next step on it rolls behind the hitch."""

    action: model.ConnectTrailerAction

    def update(self) -> Status:
        """Couple it."""
        for other in self.context.actors.values():
            if other.trailer == self.action.trailer_ref:
                other.trailer = None
        self.actor.trailer = self.action.trailer_ref
        return Status.SUCCESS

    def describe(self) -> str:
        """Which one."""
        return f"couple trailer {self.action.trailer_ref}"


class DisconnectTrailerAction(ActionBehaviour):
    """Uncouples the trailer at once; it stops where it is."""

    action: model.DisconnectTrailerAction

    def update(self) -> Status:
        """Uncouple it."""
        name, self.actor.trailer = self.actor.trailer, None
        if name is not None:
            trailer = self.context.actors[name].motion
            trailer.speed = 0.0
            trailer.snap_to_lane()
        return Status.SUCCESS

    def describe(self) -> str:
        """What it does."""
        return "uncouple the trailer"

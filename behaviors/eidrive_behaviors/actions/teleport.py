"""TeleportAction: move an actor to a position at once."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_behaviors.actions.routing import describe_position, resume_route
from eidrive_scenario.api.actions import ActionBehaviour, model, resolve_position


class TeleportAction(ActionBehaviour):
    """Teleport of the actor to a position. An absent actor is added to the world; its speed is kept.

    An active controller continues the route there, or on a new way to the next waypoint if it does not lead along.
    """

    action: model.TeleportAction

    @property
    def at_once(self) -> bool:
        """True: a lateral step after it starts from its place."""
        return True

    def update(self) -> Status:
        """Teleport the actor."""
        target = resolve_position(self.action.position, self.context, self.actor.name)
        before = self.actor.motion.pose if self.actor.present else None
        self.context.add_actor(self.actor.name, target)
        resume_route(self, target, before)
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe the position."""
        return f"teleport to {describe_position(self.action.position)}"

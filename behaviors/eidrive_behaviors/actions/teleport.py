"""TeleportAction: move an actor to a position at once."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, model, resolve_position


class TeleportAction(ActionBehaviour):
    """Teleport of the actor to a position. An absent actor is added to the world; its speed is kept."""

    action: model.TeleportAction

    def update(self) -> Status:
        """Teleport the actor."""
        target = resolve_position(self.action.position, self.context, self.actor.name)
        self.context.add_actor(self.actor.name, target)
        return Status.SUCCESS

    def describe(self) -> str:
        """Describe the position."""
        return f"teleport to {describe_position(self.action.position)}"


def describe_position(position: model.Position) -> str:
    """Describe frame and values of a position, as `LanePosition road 0 lane -3 s 50`."""
    frame = position.chosen()
    words = [type(frame).__name__]
    for name, value in vars(frame).items():
        if isinstance(value, str | int | float) and name not in ("line", "source"):
            words.append(
                f"{name.removesuffix('_id').removesuffix('_ref')} {value if isinstance(value, str) else f'{value:g}'}"
            )
    return " ".join(words)

"""TeleportAction: put an actor at a position."""

from __future__ import annotations

from py_trees.common import Status

from eidrive_scenario.api.actions import ActionBehaviour, model, resolve_position


class TeleportAction(ActionBehaviour):
    """Puts the actor at a position at once, and brings it into the world if it was not there. Its speed stays."""

    action: model.TeleportAction

    def update(self) -> Status:
        """Put it there."""
        place = resolve_position(self.action.position, self.context, self.actor.name)
        self.context.add_actor(self.actor.name, place)
        return Status.SUCCESS

    def describe(self) -> str:
        """The kind of position."""
        return f"teleport to {position_in_words(self.action.position)}"


def position_in_words(position: model.Position) -> str:
    """A position's frame and numbers, as `LanePosition road 0 lane -3 s 50`."""
    frame = position.chosen()
    words = [type(frame).__name__]
    for name, value in vars(frame).items():
        if isinstance(value, str | int | float) and name not in ("line", "source"):
            words.append(
                f"{name.removesuffix('_id').removesuffix('_ref')} {value if isinstance(value, str) else f'{value:g}'}"
            )
    return " ".join(words)

"""Record of a scene that was run without a physics engine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from eidrive_scenario.storyboard.state.commands import Commands
from eidrive_scenario.storyboard.state.states import StateChange
from eidrive_scenario.world.actor import Placement


@dataclass
class RecordedScene:
    """Record of a scene: placements by tick and name, state changes, commands."""

    dt: float
    rows: list[dict[str, Placement]] = field(default_factory=list)
    changes: list[StateChange] = field(default_factory=list)
    commands: list[Commands] = field(default_factory=list)

    def at(self, time: float, name: str = "Ego") -> Placement:
        return self.rows[round(time / self.dt)][name]

    def when(self, element: str, state: str) -> float | None:
        """Return the time at which an element first reached a state [s]."""
        times = [c.time for c in self.changes if c.element == element and c.after.value == state]
        return times[0] if times else None

    def why(self, element: str) -> str:
        return next(c.why for c in self.changes if c.element == element and c.transition is not None)


RunScene = Callable[..., RecordedScene]

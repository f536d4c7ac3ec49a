"""Record of a scene that was run without a physics engine."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

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


class RunScene(Protocol):
    """A function that runs actions; see the fixture `scene`."""

    def __call__(
        self,
        seconds: float,
        *steps: tuple[str, ...],
        ego: tuple[int, float, float] = (-1, 100.0, 20.0),
        other: tuple[int, float, float] = (-1, 150.0, 10.0),
        dt: float = 0.1,
        driven: bool = False,
        cruise: str | None = None,
        controller_model: str = "adaptive_cruise",
        everywhere: str = "",
        edge: str = "none",
        performance: str = "",
        brakes: float = 10.0,
        executions: int = 1,
    ) -> RecordedScene: ...

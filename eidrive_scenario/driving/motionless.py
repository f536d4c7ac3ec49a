"""Detection of driving stations that do not move."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator

from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.world.view import WorldView

LEAST = 1.0
"""Minimum distance from the start that a driving station is expected to reach [m]."""
PATIENCE = 2.0
"""Minimum driving time before a warning [s]: most stations start from rest."""


class MotionlessStations:
    """Observer of driving stations until they are `LEAST` [m] away from their start.

    `watching` is False if no station is left, which saves the call in each tick.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._starts: dict[str, tuple[float, float] | None] = dict.fromkeys(names)
        self._reached: dict[str, float] = {}
        self._since: dict[str, float] = {}
        self.watching = bool(self._starts)

    def observe(self, view: WorldView, drivers: Collection[str]) -> None:
        """Process a view; `drivers` are the stations that drive in this tick."""
        for name, start in list(self._starts.items()):
            row = view.rows.get(name)
            if row is None:
                continue
            x, y = float(view.position[row, 0]), float(view.position[row, 1])
            if start is None:
                self._starts[name] = start = (x, y)
            if name in drivers:
                self._since.setdefault(name, view.time)
                self._reached[name] = max(self._reached.get(name, 0.0), math.hypot(x - start[0], y - start[1]))
            elif name not in self._reached:
                self._starts[name] = None  # The start of a scripted station is where it begins to drive
            if self._reached.get(name, 0.0) >= LEAST:
                del self._starts[name]
                self.watching = bool(self._starts)

    def warnings(self, scenario: Scenario, time: float) -> Iterator[Diagnostic]:
        """Yield a warning for each driving station that did not move until the end of the run at `time` [s]."""
        entities = scenario.document.entities
        lines = {one.name: one.line for one in entities.scenario_object} if entities is not None else {}
        for name in self._starts:
            if name in self._reached and time - self._since[name] >= PATIENCE:
                yield Diagnostic(
                    f"station {name!r} covered only {self._reached[name]:.2f} m in {time:.2f} s",
                    "check its target speed, its route and what it brakes for",
                    str(scenario.path or ""),
                    lines.get(name),
                )

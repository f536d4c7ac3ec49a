"""Values of an axis as columns of a table: single values, or ranges of many values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from eidrive_scenario.reporting.run_report.reported_run import ReportedRun

MOST_VALUES = 24
"""Maximum number of values that are shown one by one."""
RANGES = 10
"""Number of ranges of equal width of an axis with more values."""


@dataclass(frozen=True)
class Levels:
    """Values of an axis with numbers, in ascending order.

    centers  value, or center of the range, of each level
    labels   its text
    start, width  lower end of the first range and width of each; width 0 for single values
    """

    name: str
    centers: tuple[float, ...]
    labels: tuple[str, ...]
    start: float = 0.0
    width: float = 0.0

    def index(self, run: ReportedRun) -> int:
        """Return the position of the level of a run. Raise ValueError for a run without this value."""
        value = run.value_of(self.name)
        if not isinstance(value, int | float):
            raise ValueError(f"no number {self.name}")
        if self.width:
            return min(int((value - self.start) / self.width), len(self.centers) - 1)
        return self.centers.index(float(value))


def levels_of(runs: Sequence[ReportedRun], name: str) -> Levels | None:
    """Return the levels of an axis; None if a run has no number for it."""
    values = [run.value_of(name) for run in runs]
    numbers = {value for value in values if isinstance(value, int | float)}
    if not values or not all(isinstance(value, int | float) for value in values):
        return None
    if len(numbers) <= MOST_VALUES:
        ordered = sorted(numbers)
        return Levels(name, tuple(map(float, ordered)), tuple(map(_label, ordered)))
    start, end = float(min(numbers)), float(max(numbers))
    width = (end - start) / RANGES
    ends = [start + width * index for index in range(RANGES + 1)]
    centers = tuple((low + high) / 2.0 for low, high in pairwise(ends))
    labels = tuple(f"{low:.3g} … {high:.3g}" for low, high in pairwise(ends))
    return Levels(name, centers, labels, start, width)


def _label(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:.6g}"

"""Extreme of a quantity over time, compared with a limit."""

from __future__ import annotations

import math

from eidrive_scenario.api.criteria import Criterion, Verdict


class Extreme:
    """Largest or smallest value with its time [s], and the time of the first value beyond the limit."""

    def __init__(self, limit: float | None, *, largest: bool, tolerance: float = 0.0) -> None:
        self.limit = limit
        self._largest, self._tolerance = largest, tolerance
        self.value: float | None = None
        """The extreme; None before the first value."""
        self.when = math.nan
        self.violated: float | None = None
        """Time of the first violation [s]; None without one."""

    def add(self, value: float, time: float) -> bool:
        """Add a value, and return whether it is the new extreme."""
        sign = 1.0 if self._largest else -1.0
        if self.violated is None and self.limit is not None and sign * (value - self.limit) > self._tolerance:
            self.violated = time
        if self.value is not None and sign * (value - self.value) <= 0.0:
            return False
        self.value, self.when = value, time
        return True


def conclude_extreme(criterion: Criterion, extreme: Extreme, reason: str, *, measured: bool = True) -> Verdict:
    """Return the verdict on an extreme: failed by a violation, or unless it was `measured`."""
    return criterion.conclude(
        measured and extreme.violated is None,
        reason,
        value=extreme.value,
        limit=extreme.limit,
        first_violation=extreme.violated,
    )

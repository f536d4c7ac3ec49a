"""Sets of instants as ascending closed intervals [s], and the effect of edges and delays on them."""

from __future__ import annotations

import math
from collections.abc import Iterable

from eidrive_scenario.openscenario.model import Rule
from eidrive_scenario.tolerances import EPSILON

Intervals = tuple[tuple[float, float], ...]

NEVER: Intervals = ()
ALWAYS: Intervals = ((0.0, math.inf),)
STEP = 0.25
"""Assumed upper bound of the time step [s], five default steps: an edge is observed at the first tick after it."""


def times_that_satisfy(rule: Rule, value: float) -> Intervals:
    """Return the instants at which the simulation time satisfies a rule."""
    intervals = {
        Rule.GREATER_THAN: ((value + EPSILON, math.inf),),
        Rule.GREATER_OR_EQUAL: ((value - EPSILON, math.inf),),
        Rule.LESS_THAN: ((-math.inf, value - EPSILON),),
        Rule.LESS_OR_EQUAL: ((-math.inf, value + EPSILON),),
        Rule.EQUAL_TO: ((value - EPSILON, value + EPSILON),),
        Rule.NOT_EQUAL_TO: ((-math.inf, value - EPSILON), (value + EPSILON, math.inf)),
    }[rule]
    return clip_before(intervals, 0.0)


def clip_before(intervals: Intervals, first: float) -> Intervals:
    """Remove all instants before `first`."""
    return tuple((max(low, first), high) for low, high in intervals if high >= first)


def intersection(one: Intervals, other: Intervals) -> Intervals:
    """Return the instants that are in both."""
    overlaps = ((max(a, c), min(b, d)) for a, b in one for c, d in other)
    return tuple(sorted((low, high) for low, high in overlaps if low <= high))


def union(several: Iterable[Intervals]) -> Intervals:
    """Return the instants that are in at least one of them."""
    merged: list[tuple[float, float]] = []
    for low, high in sorted(interval for intervals in several for interval in intervals):
        if merged and low <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(high, merged[-1][1]))
        else:
            merged.append((low, high))
    return tuple(merged)


def shift(intervals: Intervals, delay: float) -> Intervals:
    """Shift all instants by a delay [s]."""
    return tuple((low + delay, high + delay) for low, high in intervals) if delay > 0.0 else intervals


def rising_edges(intervals: Intervals, first: float) -> Intervals:
    """Return when evaluations from `first` on observe a rising edge of a condition that is true in `intervals`."""
    return tuple((low, low + STEP) for low, _ in intervals if low > first)


def falling_edges(intervals: Intervals, first: float) -> Intervals:
    """Return when evaluations from `first` on observe a falling edge of a condition that is true in `intervals`."""
    return tuple((high, high + STEP) for _, high in intervals if first <= high < math.inf)


def format_intervals(intervals: Intervals) -> str:
    """Describe the first and the last instant."""
    if not intervals:
        return "never"
    low, high = round(intervals[0][0], 3), intervals[-1][1]
    if high == math.inf:
        return f"from {low:g} s on" if low > 0.0 else "at any time"
    if high - low <= STEP + 2 * EPSILON:
        return f"at {low:g} s"
    return f"until {round(high, 3):g} s" if low <= 0.0 else f"from {low:g} s to {round(high, 3):g} s"

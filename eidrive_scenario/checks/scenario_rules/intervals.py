"""Sets of instants, as ascending closed intervals [s], and what edges and delays make of them."""

from __future__ import annotations

import math
from collections.abc import Iterable

from eidrive_scenario.openscenario.model import Rule
from eidrive_scenario.tolerances import EPSILON

Intervals = tuple[tuple[float, float], ...]

NEVER: Intervals = ()
ALWAYS: Intervals = ((0.0, math.inf),)
STEP = 0.25
"""An edge is seen at the first tick after it: no later than one step, which is shorter than this [s]."""


def compared(rule: Rule, value: float) -> Intervals:
    """The instants at which the time is as the rule says."""
    spans = {
        Rule.GREATER_THAN: ((value + EPSILON, math.inf),),
        Rule.GREATER_OR_EQUAL: ((value - EPSILON, math.inf),),
        Rule.LESS_THAN: ((-math.inf, value - EPSILON),),
        Rule.LESS_OR_EQUAL: ((-math.inf, value + EPSILON),),
        Rule.EQUAL_TO: ((value - EPSILON, value + EPSILON),),
        Rule.NOT_EQUAL_TO: ((-math.inf, value - EPSILON), (value + EPSILON, math.inf)),
    }[rule]
    return clip_before(spans, 0.0)


def clip_before(spans: Intervals, first: float) -> Intervals:
    """What of the spans is not before `first`."""
    return tuple((max(low, first), high) for low, high in spans if high >= first)


def intersection(one: Intervals, other: Intervals) -> Intervals:
    """The instants that are in both."""
    met = ((max(a, c), min(b, d)) for a, b in one for c, d in other)
    return tuple(sorted((low, high) for low, high in met if low <= high))


def union(several: Iterable[Intervals]) -> Intervals:
    """The instants that are in one of them."""
    joined: list[tuple[float, float]] = []
    for low, high in sorted(span for spans in several for span in spans):
        if joined and low <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(high, joined[-1][1]))
        else:
            joined.append((low, high))
    return tuple(joined)


def shifted(spans: Intervals, delay: float) -> Intervals:
    """The spans, later by a delay."""
    return tuple((low + delay, high + delay) for low, high in spans) if delay > 0.0 else spans


def rising_edges(spans: Intervals, first: float) -> Intervals:
    """Where something that is true in these spans is seen to become true by one who looks from `first` on."""
    return tuple((low, low + STEP) for low, _ in spans if low > first)


def falling_edges(spans: Intervals, first: float) -> Intervals:
    """Where it is seen to become false."""
    return tuple((high, high + STEP) for _, high in spans if first <= high < math.inf)


def format_intervals(spans: Intervals) -> str:
    """The first and the last instant in words."""
    if not spans:
        return "never"
    low, high = round(spans[0][0], 3), spans[-1][1]
    if high == math.inf:
        return f"from {low:g} s on" if low > 0.0 else "at any time"
    if high - low <= STEP + 2 * EPSILON:
        return f"at {low:g} s"
    return f"until {round(high, 3):g} s" if low <= 0.0 else f"from {low:g} s to {round(high, 3):g} s"

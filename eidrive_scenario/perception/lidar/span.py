"""Extent of an object along one axis, as far as lidar points determine it."""

from __future__ import annotations

import math
from typing import NamedTuple

RANGE_NOISE = 0.03
"""Standard deviation of the points on a surface [m]."""


class Span(NamedTuple):
    """Extent of a box along one axis, as far as the points determine it."""

    low: float
    high: float
    gap: float
    """Maximum extent of the object beyond its points; inf if the side along this axis is not visible [m]."""
    open_low: bool
    """Whether the object may extend beyond its points at either end."""
    open_high: bool
    hidden: bool
    """Whether something nearer hides one of the ends."""


def size_cost(span: Span, mean: float, deviation: float) -> float:
    """Return the squared deviation of the size from the usual one; 0 if the unseen part may explain it."""
    measured = span.high - span.low
    if measured > mean:
        return ((measured - mean) / deviation) ** 2
    least = mean - measured - span.gap
    if span.hidden or least <= 0.0:
        return 0.0
    return (least / deviation) ** 2


def blend_size(measured: float, gap: float, mean: float, deviation: float) -> float:
    """Return the fusion of a measured size, which may be up to `gap` too small, with the usual one [m]."""
    if not math.isfinite(gap):
        return max(measured, mean)
    expected, variance = measured + gap / 2.0, gap**2 / 12.0 + RANGE_NOISE**2
    return max(measured, (expected * deviation**2 + mean * variance) / (variance + deviation**2))


def complete_span(span: Span, mean: float, deviation: float) -> tuple[float, float, float]:
    """Return size, middle and variance of the middle along one axis."""
    measured = span.high - span.low
    if span.hidden or span.gap > 2.0 * mean:
        size, spread = max(measured, mean), deviation**2
    else:
        size = blend_size(measured, span.gap, mean, deviation)
        variance = span.gap**2 / 12.0
        spread = variance * deviation**2 / (variance + deviation**2)
    if span.open_low == span.open_high:
        unseen = size - measured
        return size, (span.low + span.high) / 2.0, unseen**2 / 12.0 + RANGE_NOISE**2
    middle = span.low + size / 2.0 if span.open_high else span.high - size / 2.0
    return size, middle, spread / 4.0 + RANGE_NOISE**2

"""Time until two boxes with constant velocities touch."""

from __future__ import annotations

import math
from collections.abc import Sequence


def time_to_contact(a: Sequence[float], b: Sequence[float], velocity: Sequence[float]) -> float:
    """Return the time until two boxes (7,) with constant headings touch [s]; `velocity` (3,) of `b` relative to `a`
    [m/s].

    The result is 0 if they overlap, and infinite if they never touch. Swept separating axes: the projections on each
    axis overlap during one interval. The boxes touch when the last interval begins, if no interval has ended before
    (Ericson, Real-Time Collision Detection, 2005, section 5.5.8, for upright boxes).
    """
    dx, dy, vx, vy = b[0] - a[0], b[1] - a[1], velocity[0], velocity[1]
    enter, leave = _overlap_time(b[2] - a[2], a[5] / 2 + b[5] / 2, velocity[2])
    ca, sa, cb, sb = math.cos(a[6]), math.sin(a[6]), math.cos(b[6]), math.sin(b[6])
    for x, y in ((ca, sa), (-sa, ca), (cb, sb), (-sb, cb)):
        if enter > leave:
            return math.inf
        # Both are `half_projection`, with the same sines and cosines for all axes
        half_a = (abs(ca * x + sa * y) * a[3] + abs(ca * y - sa * x) * a[4]) / 2
        half_b = (abs(cb * x + sb * y) * b[3] + abs(cb * y - sb * x) * b[4]) / 2
        first, last = _overlap_time(x * dx + y * dy, half_a + half_b, x * vx + y * vy)
        if first > enter:
            enter = first
        if last < leave:
            leave = last
    return enter if enter <= leave else math.inf


def _overlap_time(gap: float, reach: float, rate: float) -> tuple[float, float]:
    """Return the interval, not before 0, in which a gap that changes at this rate is within the reach [s]."""
    if rate == 0.0:
        return (0.0, math.inf) if abs(gap) <= reach else (math.inf, 0.0)
    first, last = (-reach - gap) / rate, (reach - gap) / rate
    if first > last:
        first, last = last, first
    return (first if first > 0.0 else 0.0), last


def separating_axes(a: Sequence[float], b: Sequence[float]) -> list[tuple[float, float, float]]:
    """Return the separating axes of two upright boxes."""
    axes = [(0.0, 0.0, 1.0)]
    for yaw in (a[6], b[6]):
        cos, sin = math.cos(yaw), math.sin(yaw)
        axes += [(cos, sin, 0.0), (-sin, cos, 0.0)]
    return axes


def half_projection(box: Sequence[float], x: float, y: float, z: float) -> float:
    """Return half the length of the projection of a box on an axis [m]."""
    cos, sin = math.cos(box[6]), math.sin(box[6])
    return (abs(cos * x + sin * y) * box[3] + abs(cos * y - sin * x) * box[4] + abs(z) * box[5]) / 2

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
    enter, leave = 0.0, math.inf
    for x, y, z in separating_axes(a, b):
        gap = x * (b[0] - a[0]) + y * (b[1] - a[1]) + z * (b[2] - a[2])
        reach = half_projection(a, x, y, z) + half_projection(b, x, y, z)
        rate = x * velocity[0] + y * velocity[1] + z * velocity[2]
        if rate == 0.0:
            if abs(gap) > reach:
                return math.inf
            continue
        first, last = sorted(((-reach - gap) / rate, (reach - gap) / rate))
        enter, leave = max(enter, first), min(leave, last)
    return enter if enter <= leave else math.inf


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

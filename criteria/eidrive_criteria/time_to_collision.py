"""Criterion: minimum time to collision of two actors at constant velocity."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from eidrive_criteria.pair import PairCriterion, PairSettings
from eidrive_scenario.api.common import WorldView


class TimeToCollisionSettings(PairSettings):
    """Settings: `{of: Ego, to: Incoming, at_least: 1.5}` [s]. Without `at_least` it only measures and passes."""


class TimeToCollision(PairCriterion):
    """Criterion that fails if the time to collision falls below `at_least`; no collision course is no violation."""

    settings_type = TimeToCollisionSettings
    name = "time_to_collision"
    unit = "s"

    def measure(self, view: WorldView, of: int, to: int) -> float:
        velocity = (view.velocity[to] - view.velocity[of]).tolist()
        return time_to_contact(view.boxes[of].tolist(), view.boxes[to].tolist(), velocity)

    def describe_smallest(self) -> str:
        if not math.isfinite(self.smallest):
            return f"{self.of} and {self.to} were never on a collision course"
        return f"{self.of} and {self.to} were {self.smallest:.2f} s from a collision at {self.when:.2f} s"

    def metrics(self) -> Mapping[str, float]:
        """Return the minimum time to collision [s]; empty without a collision course."""
        pair = f"time_to_collision.{self.of}.{self.to}"
        return {pair: self.smallest} if math.isfinite(self.smallest) else {}


def time_to_contact(a: Sequence[float], b: Sequence[float], velocity: Sequence[float]) -> float:
    """Return the time until two boxes (7,) with constant headings touch [s]; `velocity` (3,) of `b` relative to `a`
    [m/s].

    The result is 0 if they overlap, and infinite if they never touch. Swept separating axes: the projections on each
    axis overlap during one interval. The boxes touch when the last interval begins, if no interval has ended before
    (Ericson, Real-Time Collision Detection, 2005, section 5.5.8, for upright boxes).
    """
    enter, leave = 0.0, math.inf
    for x, y, z in _axes(a, b):
        gap = x * (b[0] - a[0]) + y * (b[1] - a[1]) + z * (b[2] - a[2])
        reach = _half_projection(a, x, y, z) + _half_projection(b, x, y, z)
        rate = x * velocity[0] + y * velocity[1] + z * velocity[2]
        if rate == 0.0:
            if abs(gap) > reach:
                return math.inf
            continue
        first, last = sorted(((-reach - gap) / rate, (reach - gap) / rate))
        enter, leave = max(enter, first), min(leave, last)
    return enter if enter <= leave else math.inf


def _axes(a: Sequence[float], b: Sequence[float]) -> list[tuple[float, float, float]]:
    axes = [(0.0, 0.0, 1.0)]
    for yaw in (a[6], b[6]):
        cos, sin = math.cos(yaw), math.sin(yaw)
        axes += [(cos, sin, 0.0), (-sin, cos, 0.0)]
    return axes


def _half_projection(box: Sequence[float], x: float, y: float, z: float) -> float:
    """Return half the length of the projection of a box on an axis [m]."""
    cos, sin = math.cos(box[6]), math.sin(box[6])
    return (abs(cos * x + sin * y) * box[3] + abs(cos * y - sin * x) * box[4] + abs(z) * box[5]) / 2

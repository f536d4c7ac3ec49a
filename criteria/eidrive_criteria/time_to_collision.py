"""How soon two actors would touch if both kept their velocity."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from eidrive_criteria.pair import PairCriterion, PairSettings
from eidrive_scenario.api.common import WorldView


class TimeToCollisionSettings(PairSettings):
    """`{of: Ego, to: Incoming, at_least: 1.5}` [s]; without `at_least` it measures and passes."""


class TimeToCollision(PairCriterion):
    """Fails where the time to collision falls below `at_least`; no course towards each other is no violation."""

    settings_type = TimeToCollisionSettings
    name = "time_to_collision"
    unit = "s"

    def measure(self, view: WorldView, of: int, to: int) -> float:
        velocity = (view.velocity[to] - view.velocity[of]).tolist()
        return time_to_contact(view.boxes[of].tolist(), view.boxes[to].tolist(), velocity)

    def words(self) -> str:
        if not math.isfinite(self.smallest):
            return f"{self.of} and {self.to} were never on a collision course"
        return f"{self.of} and {self.to} were {self.smallest:.2f} s from a collision at {self.when:.2f} s"

    def metrics(self) -> Mapping[str, float]:
        """The smallest time to collision [s], where there was one."""
        pair = f"time_to_collision.{self.of}.{self.to}"
        return {pair: self.smallest} if math.isfinite(self.smallest) else {}


def time_to_contact(a: Sequence[float], b: Sequence[float], velocity: Sequence[float]) -> float:
    """When two boxes (7,) touch that keep their headings, `b` moving by `velocity` (3,) [m/s] relative to `a` [s].

    0 where they overlap already, infinity where they never meet. Swept separating axes: the shadows on each axis
    overlap during one interval; the boxes touch when the last of the intervals begins, if none has ended by then
    (Ericson, Real-Time Collision Detection, 2005, section 5.5.8, for boxes that stand upright).
    """
    enter, leave = 0.0, math.inf
    for x, y, z in _axes(a, b):
        gap = x * (b[0] - a[0]) + y * (b[1] - a[1]) + z * (b[2] - a[2])
        reach = _half_shadow(a, x, y, z) + _half_shadow(b, x, y, z)
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


def _half_shadow(box: Sequence[float], x: float, y: float, z: float) -> float:
    """Half the length of the box's shadow on an axis [m]."""
    cos, sin = math.cos(box[6]), math.sin(box[6])
    return (abs(cos * x + sin * y) * box[3] + abs(cos * y - sin * x) * box[4] + abs(z) * box[5]) / 2

"""How soon two actors would touch if both kept their velocity."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated

from pydantic import Field

from eidrive_scenario.api import Criterion, CriterionSettings, Frame, Verdict, never_appeared


class TimeToCollisionSettings(CriterionSettings):
    """`{of: Ego, to: Incoming, at_least: 1.5}` [s]; without `at_least` it measures and passes."""

    of: str
    to: str
    at_least: Annotated[float, Field(ge=0)] | None = None


class TimeToCollision(Criterion):
    """Fails where the time to collision falls below `at_least`; no course towards each other is no violation."""

    settings_type = TimeToCollisionSettings
    name = "time_to_collision"

    def __init__(self, settings: TimeToCollisionSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self.subjects = (settings.of, settings.to)
        self._missing = set(self.subjects)
        self._together = False
        self._smallest, self._when = math.inf, math.nan
        self._violated: float | None = None

    def observe(self, frame: Frame) -> None:
        view = frame.view
        if self._missing:
            self._missing.difference_update(view.names)
        of, to = view.rows.get(self._settings.of), view.rows.get(self._settings.to)
        if of is None or to is None:
            return
        self._together = True
        velocity = (view.velocity[to] - view.velocity[of]).tolist()
        soon = time_to_contact(view.boxes[of].tolist(), view.boxes[to].tolist(), velocity)
        if soon < self._smallest:
            self._smallest, self._when = soon, view.time
        limit = self._settings.at_least
        if self._violated is None and limit is not None and soon < limit:
            self._violated = view.time

    def verdict(self) -> Verdict:
        of, to, found = self._settings.of, self._settings.to, math.isfinite(self._smallest)
        if found:
            reason = f"{of} and {to} were {self._smallest:.2f} s from a collision at {self._when:.2f} s"
        elif self._together:
            reason = f"{of} and {to} were never on a collision course"
        else:
            reason = never_appeared(self._missing) if self._missing else f"{of} and {to} were never there together"
        return Verdict(
            name=self.name,
            passed=self._together and self._violated is None,
            value=self._smallest if found else None,
            limit=self._settings.at_least,
            unit="s",
            first_violation=self._violated,
            reason=reason,
            fatal=self.fatal and self._violated is not None,
        )

    def metrics(self) -> Mapping[str, float]:
        """The smallest time to collision [s], where there was one."""
        pair = f"time_to_collision.{self._settings.of}.{self._settings.to}"
        return {pair: self._smallest} if math.isfinite(self._smallest) else {}


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

"""Speeds that limits and walls allow to a proposal along the line."""

from __future__ import annotations

import math
from bisect import bisect_right

import msgspec
import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.driving.planning.behavior.proposals import Wall

FREE, LIMIT, WALL = -1, -2, -3
"""Cause of the motion of a proposal in a step: nothing, a speed limit, or a wall (WALL - its index); an index from 0
on is that of a leading hypothesis."""
BEFORE = 1e9
"""Length of the line before its first point, where the first limit holds [m]."""

WallsOverTime = list[list[tuple[int, float]]]
"""Causes and places of the walls at each time [m]."""


class Course(msgspec.Struct, frozen=True):
    """Limits of the motion along the line: speed limits (M,) [m/s] at distances along it (M,) [m]."""

    along: Array
    limits: Array
    wanted: float
    """Wanted speed [m/s]."""


class Limits:
    """Speed limits within reach of a vehicle, interpolated between the points of the line."""

    def __init__(self, along: Array, limits: Array) -> None:
        # The first and the last entry stand for what is before and beyond the points.
        self._along: list[float] = [float(along[0]) - BEFORE, *along.tolist()]
        self._limits: list[float] = [float(limits[0]), *limits.tolist()]
        self._slopes: list[float] = [0.0, *(np.diff(limits) / np.diff(along)).tolist(), 0.0]

    @classmethod
    def ahead(cls, course: Course, s: float, reach: float) -> Limits | None:
        """Return the limits from s to s + reach [m]; None if none is below the wanted speed."""
        first = max(int(course.along.searchsorted(s, side="right")) - 1, 0)
        last = int(course.along.searchsorted(s + reach)) + 1
        limits = course.limits[first:last]
        return cls(course.along[first:last], limits) if float(limits.min()) < course.wanted else None

    def at(self, s: float) -> float:
        """Return the limit at a distance along the line [m/s]."""
        index = bisect_right(self._along, s) - 1
        return self._slopes[index] * (s - self._along[index]) + self._limits[index]


def walls_over_time(walls: list[Wall], times: list[float]) -> WallsOverTime:
    """Return the walls that exist at each time; without walls an empty list."""
    if not walls:
        return []
    return [[(WALL - number, wall.s) for number, wall in enumerate(walls) if time < wall.until] for time in times]


class Bounds:
    """Speeds that the wanted speed, speed limits and walls allow to one proposal.

    wanted  wanted speed [m/s];  gain  twice the deceleration before a wall [m/s²]
    """

    def __init__(self, wanted: float, limits: Limits | None, walls: WallsOverTime, gain: float) -> None:
        self.wanted = wanted
        self.are_free = wanted <= 0.0 or (limits is None and not walls)
        """Whether the wanted speed is the only bound."""
        self._limits = limits
        self._walls = walls
        self._gain = gain

    def allow(self, s: float, step: int) -> tuple[float, int]:
        """Return the speed at a distance along the line [m/s], and what determines it."""
        speed, cause = self.wanted, FREE
        if self._limits is not None:
            limit = self._limits.at(s)
            if limit < speed:
                speed, cause = limit, LIMIT
        if self._walls:
            for number, place in self._walls[step]:
                allowed = math.sqrt(self._gain * max(place - s, 0.0))
                if allowed < speed:
                    speed, cause = allowed, number
        return speed, cause

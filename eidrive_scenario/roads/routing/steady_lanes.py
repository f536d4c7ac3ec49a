"""Steps along lanes of constant t on lines and arcs, the form of most lanes.

The equations are those of `Movement.advance` and `pose_in_lane` without the terms that are zero there, in the same
order, so that both give the same bits.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import NamedTuple

from eidrive_scenario.roads.geometry.poses import LEAST_STRETCH, lane_t
from eidrive_scenario.roads.model.curves import Arc
from eidrive_scenario.roads.model.location import LaneLocation, Pose
from eidrive_scenario.roads.model.polynomials import Polynomials
from eidrive_scenario.roads.model.road_map import Road

_NEW = tuple.__new__
"""Constructor of named tuples; their own ones take twice as long."""
LEAST_REST = 1e-12
"""Minimum length that is integrated at the end of a step [m]."""


class SteadyLane:
    """Steps along the steady parts of a lane: on a line or arc, of constant t, and level across the road.

    way  +1 if its traffic drives in the direction of s, else -1
    """

    __slots__ = ("_lane", "_parts", "_road", "_starts", "_way")

    def __init__(self, road: Road, lane: int, way: int) -> None:
        starts = sorted({*road.section_starts, *road.reference.starts, 0.0, road.length})
        self._road, self._lane, self._way = road.id, lane, way
        self._starts = starts
        self._parts = [
            _steady_part(road, lane, start, end) for start, end in zip(starts, [*starts[1:], math.inf], strict=True)
        ]

    def step(self, s: float, offset: float, distance: float) -> tuple[LaneLocation, Pose] | None:
        """Return the location a distance [m] further, backwards if negative, and the pose there with the heading of s.

        The result is None if the step does not begin and end within one steady part.
        """
        part = self._parts[bisect_right(self._starts, s, 1) - 1]
        if part is None:
            return None
        start, end, center, curve, elevation, height = part
        direction = self._way
        if distance < 0.0:
            direction, distance = -direction, -distance
        t, curvature, stretch = center + offset, curve.curvature, 1.0
        if curvature:
            stretch = 1.0 - curvature * t
            if stretch < LEAST_STRETCH:
                stretch = LEAST_STRETCH
            ahead = distance / stretch
            if distance - ahead * stretch >= LEAST_REST:
                return None
        else:
            ahead = distance
        if ahead >= (end - s if direction > 0 else s - start):
            return None
        s += direction * ahead
        if not start < s < end:
            return None
        ds = s - curve.s
        half = 0.5 * curvature * ds
        if -1e-9 < half < 1e-9:
            u, v = ds, ds * half
        else:
            chord = ds * math.sin(half) / half
            u, v = chord * math.cos(half), chord * math.sin(half)
        h = curve.h + 2.0 * half
        sin, cos = math.sin(h), math.cos(h)
        z, pitch = height, 0.0
        if z is None:
            z, climb = elevation.value_and_slope(s)
            if climb:
                pitch = -math.atan2(climb, math.hypot(stretch, 0.0))
        x = curve.x + curve.cos * u - curve.sin * v + 0.0 * cos - t * sin
        y = curve.y + curve.sin * u + curve.cos * v + 0.0 * sin + t * cos
        here = _NEW(LaneLocation, (self._road, self._lane, s, offset, t))
        return here, _NEW(Pose, (x, y, z, h, pitch, 0.0))


class _SteadyPart(NamedTuple):
    """Part of a lane within one lane section and one curve of the reference line.

    t       of the center line of the lane [m]
    height  constant elevation of the road [m]; None if it varies
    """

    start: float
    end: float
    t: float
    curve: Arc
    elevation: Polynomials
    height: float | None


def _steady_part(road: Road, number: int, start: float, end: float) -> _SteadyPart | None:
    """Return a part of a lane between two values of s; None if it is not steady or the lane does not exist there."""
    section, (curve, _) = road.section_at(start), road.reference.ahead(start, 1)
    lane = section.lanes.get(number)
    if lane is None or lane.heights or not isinstance(curve, Arc) or not 0.0 <= start < end <= road.length:
        return None
    is_steady = road.lane_offset.is_constant and (number == 0 or lane.center.is_constant)
    if not is_steady or not road.superelevation.is_zero:
        return None
    is_last = section.index == len(road.sections) - 1
    end = end if is_last else min(end, section.end)
    t = lane_t(road, section, lane, start)[0]
    return _SteadyPart(start, end, t, curve, road.elevation, road.elevation.constant_value)

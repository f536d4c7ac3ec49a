"""Steps along lanes of constant t, the form of most lanes.

The equations are those of `Movement.travel` and `pose_in_lane` without the terms that are zero there, in the same
order, so that both give the same bits.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import NamedTuple

from eidrive_scenario.roads.geometry.poses import LEAST_STRETCH, lane_t
from eidrive_scenario.roads.model.curves import Arc, Curve
from eidrive_scenario.roads.model.location import LaneLocation, Pose
from eidrive_scenario.roads.model.polynomials import Polynomials
from eidrive_scenario.roads.model.road_map import Road

_NEW = tuple.__new__
"""Constructor of named tuples; their own ones take twice as long."""
STRIDE = 2.0
"""Maximum step of the integration along a curved lane [m]."""
LEAST_REST = 1e-12
"""Minimum length that is integrated at the end of a step [m]."""


class SteadyLane:
    """Steps along the steady parts of a lane: on one curve, of constant t, and level across the road.

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
        start, end, center, curve, arc, elevation, height = part
        direction = self._way
        if distance < 0.0:
            direction, distance = -direction, -distance
        t, origin, stretch = center + offset, curve.s, 1.0
        reach = end - s if direction > 0 else s - start
        if arc is None:
            # The midpoint rule, as the stretch of the lane changes along the curve.
            curvature, speed = curve.bend(s - origin)
            ahead = min(distance / max(speed * (1.0 - curvature * t), LEAST_STRETCH), reach)
            curvature, speed = curve.bend(s + 0.5 * direction * ahead - origin)
            stretch = max(speed * (1.0 - curvature * t), LEAST_STRETCH)
        elif arc.curvature:
            stretch = max(1.0 - arc.curvature * t, LEAST_STRETCH)
        ahead = distance / stretch
        if ahead >= reach or distance - ahead * stretch >= LEAST_REST or (arc is None and distance > STRIDE):
            return None
        s += direction * ahead
        if not start < s < end:
            return None
        if arc is None:
            x, y, h, curvature, speed = curve.at(s - origin)
            stretch = max(speed * (1.0 - curvature * t), LEAST_STRETCH)
        else:
            ds = s - origin
            half = 0.5 * arc.curvature * ds
            if -1e-9 < half < 1e-9:
                u, v = ds, ds * half
            else:
                chord = ds * math.sin(half) / half
                u, v = chord * math.cos(half), chord * math.sin(half)
            x, y, h = arc.x + arc.cos * u - arc.sin * v, arc.y + arc.sin * u + arc.cos * v, arc.h + 2.0 * half
        sin, cos = math.sin(h), math.cos(h)
        z, pitch = height, 0.0
        if z is None:
            z, climb = elevation.value_and_slope(s)
            if climb:
                pitch = -math.atan2(climb, math.hypot(stretch, 0.0))
        x, y = x + 0.0 * cos - t * sin, y + 0.0 * sin + t * cos
        here = _NEW(LaneLocation, (self._road, self._lane, s, offset, t))
        return here, _NEW(Pose, (x, y, z, h, pitch, 0.0))


class _SteadyPart(NamedTuple):
    """Part of a lane within one lane section and one curve of the reference line.

    t       of the center line of the lane [m]
    arc     the curve if it is a line or arc, on which the stretch of the lane is constant
    height  constant elevation of the road [m]; None if it varies
    """

    start: float
    end: float
    t: float
    curve: Curve
    arc: Arc | None
    elevation: Polynomials
    height: float | None


def _steady_part(road: Road, number: int, start: float, end: float) -> _SteadyPart | None:
    """Return a part of a lane between two values of s; None if it is not steady or the lane does not exist there."""
    section, (curve, _) = road.section_at(start), road.reference.ahead(start, 1)
    lane = section.lanes.get(number)
    if lane is None or lane.heights or not 0.0 <= start < end <= road.length:
        return None
    if road.lane_offset.constant_value is None or not road.superelevation.is_zero:
        return None
    if number and lane.center.constant_value is None:
        return None
    is_last = section.index == len(road.sections) - 1
    end = end if is_last else min(end, section.end)
    t = lane_t(road, section, lane, start)[0]
    arc = curve if isinstance(curve, Arc) else None
    return _SteadyPart(start, end, t, curve, arc, road.elevation, road.elevation.constant_value)

"""Scalar conversion of road and lane coordinates to poses, in plain floats for speed.

The t-axis is rotated by heading, slope and superelevation, in this order (OpenDRIVE 1.8, 8.3): z-y'-x''. It is in the
inclined surface. On a banked slope the cross section is not vertical: it leans back by t·sin·sin.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.roads.model.location import Pose, PositionError
from eidrive_scenario.roads.model.road_map import Lane, LaneSection, Road

BEYOND = 0.1
"""Maximum distance beyond an end of a road at which a position counts as that end [m]."""
LEAST_STRETCH = 0.05
"""Minimum path length per meter of s. Inside the center of a bend, a lane has no length and no heading."""


def road_pose_at(road: Road, s: float, t: float) -> Pose:
    """Return the pose at road coordinates with the heading of the reference line. Raise PositionError."""
    if not -BEYOND <= s <= road.length + BEYOND:
        raise off_road(road, s)
    x, y, h, _, _ = road.reference.at(s)
    z, slope = road.elevation.value_and_slope(s)
    pitch = -math.atan(slope) if slope else 0.0
    if road.superelevation.is_zero:
        return Pose(x - t * math.sin(h), y + t * math.cos(h), z, h, pitch, 0.0)
    roll = road.superelevation.value(s)
    sin, cos = math.sin(h), math.cos(h)
    ahead, left, up = lateral_axis(slope, roll)
    ahead, left = t * ahead, t * left
    return Pose(x + ahead * cos - left * sin, y + ahead * sin + left * cos, z + t * up, h, pitch, roll)


def lateral_axis(slope: float, roll: float) -> tuple[float, float, float]:
    """Return the unit vector of the t-axis: ahead along the reference line, to its left, and up."""
    steep = math.hypot(1.0, slope)
    sin = math.sin(roll)
    return -sin * slope / steep, math.cos(roll), sin / steep


class Tangent(NamedTuple):
    """Point of a lane on a banked road and its derivative by s.

    The axes are those of the reference line in plan view: ahead, left, and up [m].
    """

    ahead: float
    left: float
    z: float
    along: float
    sideways: float
    climb: float
    roll: float


def banked_tangent(road: Road, s: float, t: float, sideways: float, curvature: float, speed: float) -> Tangent:
    """Return the point and tangent of a lane at t, which changes by `sideways` per meter of s.

    `curvature` and `speed` are those of the reference line at s.
    """
    z, slope, bend = road.elevation.to_second_order(s)
    roll, twist = road.superelevation.value_and_slope(s)
    sin, cos = math.sin(roll), math.cos(roll)
    square = 1.0 + slope * slope
    level = 1.0 / math.sqrt(square)
    steep, steeper = slope * level, bend * level / square
    rise = sideways * sin + t * cos * twist
    ahead, left = -t * sin * steep, t * cos
    along = speed * (1.0 - curvature * left) - rise * steep - t * sin * steeper
    lateral = sideways * cos - t * sin * twist + curvature * speed * ahead
    climb = slope + rise * level - t * sin * slope * steeper
    along = max(along, LEAST_STRETCH)
    # The normal of the surface is the product of the tangent and the t-axis, which is (-sin·steep, cos, sin·level).
    nx, ny = lateral * sin * level - climb * cos, -climb * sin * steep - along * sin * level
    nz = along * cos + lateral * sin * steep
    left_z = nx * lateral - ny * along
    lean = math.atan2(left_z, nz * math.sqrt(along * along + lateral * lateral + climb * climb))
    return Tangent(ahead, left, z + t * sin * level, along, lateral, climb, lean)


def lane_pose_at(road: Road, lane_id: int, s: float, offset: float = 0.0) -> Pose:
    """Return the pose at the center line of a lane plus `offset`, with heading and pitch of the lane along s.

    A lane with <height>, such as a sidewalk, is above the road surface. Raise PositionError.
    """
    section, lane = lane_at(road, lane_id, s)
    t, sideways = lane_t(road, section, lane, s)
    return pose_in_lane(road, section, lane, s, offset, t + offset, sideways)


def pose_in_lane(
    road: Road, section: LaneSection, lane: Lane, s: float, offset: float, t: float, sideways: float
) -> Pose:
    """Return the pose in a lane at s, t, with heading and pitch of the lane.

    offset    offset from the center line of the lane [m], which is part of t
    sideways  derivative of t by s
    """
    x, y, h, curvature, speed = road.reference.at(s)
    ahead, left, roll = 0.0, t, 0.0
    if road.superelevation.is_zero:
        z, climb = road.elevation.value_and_slope(s)
        along = speed * (1.0 - curvature * t)
        if along < LEAST_STRETCH:
            along = LEAST_STRETCH
        if sideways and climb:
            length = math.sqrt(along * along + sideways * sideways + climb * climb)
            roll = math.atan2(-climb * sideways, along * length)
    else:
        ahead, left, z, along, sideways, climb, roll = banked_tangent(road, s, t, sideways, curvature, speed)
    if lane.heights:
        z += lane_height(lane, s - section.s, offset)
    sin, cos = math.sin(h), math.cos(h)
    return Pose(
        x + ahead * cos - left * sin,
        y + ahead * sin + left * cos,
        z,
        h + math.atan2(sideways, along) if sideways else h,
        -math.atan2(climb, math.hypot(along, sideways)) if climb else 0.0,
        roll,
    )


def lane_height(lane: Lane, ds: float, offset: float) -> float:
    """Return the height of a lane above the road [m], `offset` from its center line, `ds` after the start of its
    section.
    """
    record = None
    for height in lane.heights:
        if height.s_offset <= ds + 1e-9:
            record = height
    if record is None:
        return 0.0
    width = lane.width.value(ds)
    share = min(max(0.5 + lane.side * offset / width, 0.0), 1.0) if width > 0.0 else 0.5
    return record.inner + share * (record.outer - record.inner)


def lane_t(road: Road, section: LaneSection, lane: Lane, s: float) -> tuple[float, float]:
    """Return t of the center line of a lane at s, and its derivative."""
    steady, steady_center = road.lane_offset.constant_value, lane.center.constant_value
    if steady is not None and steady_center is not None and lane.id:
        return (steady + steady_center if lane.id > 0 else steady - steady_center), 0.0
    t, slope = road.lane_offset_in(section, s)
    if lane.id == 0:
        return t, slope
    center, center_slope = lane.center.value_and_slope(s - section.s)
    return (t + center, slope + center_slope) if lane.id > 0 else (t - center, slope - center_slope)


def lane_at(road: Road, lane_id: int, s: float) -> tuple[LaneSection, Lane]:
    """Return the lane with this id at s. Raise PositionError if the road is shorter or has no such lane at s."""
    if not -BEYOND <= s <= road.length + BEYOND:
        raise off_road(road, s)
    section = road.section_at(s)
    lane = section.lanes.get(lane_id)
    if lane is None:
        lanes = ", ".join(str(number) for number in section.lanes)
        message = f"road {road.id!r} has no lane {lane_id} at s = {s:g} m"
        raise PositionError(Diagnostic(message, f"its lanes are {lanes}"))
    return section, lane


def lane_beside(road: Road, s: float, t: float) -> tuple[LaneSection, Lane, float]:
    """Return the lane at road coordinates and the distance from the road edge, 0 on the road.

    Outside the road it is the outermost lane.
    """
    section = road.section_at(s)
    offset = t - road.lane_offset.value(s)
    ds = s - section.s
    side = 1 if offset > 0.0 else -1
    best: Lane | None = None
    lanes = list(section.lanes.values())
    for lane in lanes if side < 0 else reversed(lanes):
        if lane.side == side:
            best = lane
            if abs(offset) < lane.outer.value(ds):
                return section, lane, 0.0
    if best is not None:
        return section, best, abs(offset) - best.outer.value(ds)
    other = [lane for lane in section.lanes.values() if lane.side == -side]
    nearest = min(other, key=lambda lane: abs(lane.id)) if other else section.lanes[0]
    return section, nearest, abs(offset)


REFINEMENTS = 40
"""Maximum number of iterations of a projection; bisection alone reduces 500 km to 1 µm."""
FAR = 1e300
"""Bound of s while the nearest point is not between two iterations."""


def project(road: Road, x: float, y: float, s: float) -> tuple[float, float, float]:
    """Return road coordinates s, t of a point and its distance beyond an end of the road [m].

    Newton's method on the distance to the reference line starts from `s`; bisection bounds its steps, as it would
    oscillate where the curvature jumps.
    """
    length = road.length
    along = across = t = 0.0
    low, high = -FAR, FAR
    banked = not road.superelevation.is_zero
    for _ in range(REFINEMENTS):
        px, py, h, curvature, speed = road.reference.at(s)
        cos, sin = math.cos(h), math.sin(h)
        along, across = cos * (x - px) + sin * (y - py), cos * (y - py) - sin * (x - px)
        t = across
        if banked:
            ahead, left, _ = lateral_axis(road.elevation.value_and_slope(s)[1], road.superelevation.value(s))
            t = across / left
            along -= t * ahead
            stretch = banked_tangent(road, s, t, 0.0, curvature, speed).along
        else:
            stretch = speed * (1.0 - curvature * across)
        moved = s + along / max(stretch, 0.2 * speed, 2e-4)
        is_between = low < moved < high
        low, high = (s, high) if along > 0.0 else (low, s)
        moved = moved if is_between else (low + high) / 2.0
        before, s = s, min(max(moved, 0.0), length)
        if abs(s - before) < 1e-7:
            break
    beyond = abs(along) if s <= 0.0 or s >= length else 0.0
    return s, t, beyond if beyond > 1e-6 else 0.0


def off_road(road: Road, s: float) -> PositionError:
    """Return the error for a position beyond the ends of a road."""
    hint = f"the road extends from 0 to {road.length:g} m"
    return PositionError(Diagnostic(f"s = {s:g} m is not on road {road.id!r}", hint))

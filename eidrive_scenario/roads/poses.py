"""Road and lane coordinates to poses, one at a time: plain floats, as fast as Python goes.

Superelevation turns the cross section about the reference line, so t runs along the inclined surface.
"""

from __future__ import annotations

import math

from eidrive_scenario.errors import Problem, suggestion
from eidrive_scenario.roads.location import Pose, PositionError
from eidrive_scenario.roads.model import Lane, LaneSection, Road

BEYOND = 0.1
"""How far beyond an end of a road a place may lie and still count as its end [m]."""
LEAST_STRETCH = 0.05
"""A lane inside the centre of a bend has no length to speak of, and no heading of its own: so many metres of path count
per metre of s."""


def road_pose_at(road: Road, s: float, t: float) -> Pose:
    """The pose at road coordinates; its heading is that of the reference line. Raises PositionError."""
    if not -BEYOND <= s <= road.length + BEYOND:
        raise off_road(road, s)
    x, y, h, _, _ = road.reference.at(s)
    z, slope = road.elevation.value_and_slope(s)
    pitch = -math.atan(slope) if slope else 0.0
    if road.superelevation.is_zero:
        return Pose(x - t * math.sin(h), y + t * math.cos(h), z, h, pitch, 0.0)
    roll = road.superelevation.value(s)
    across = t * math.cos(roll)
    return Pose(x - across * math.sin(h), y + across * math.cos(h), z + t * math.sin(roll), h, pitch, roll)


def lane_pose_at(road: Road, lane_id: int, s: float, offset: float = 0.0) -> Pose:
    """The pose at a lane's centre line plus `offset`; heading and pitch are the lane's, in the direction of growing s.

    A lane that the map lifts (a sidewalk) is higher than the road beneath it. Raises PositionError.
    """
    section, lane = lane_at(road, lane_id, s)
    t, sideways = lane_t(road, section, lane, s)
    t += offset
    x, y, h, curvature, speed = road.reference.at(s)
    z, climb = road.elevation.value_and_slope(s)
    roll, across = 0.0, t
    if not road.superelevation.is_zero:
        roll, twist = road.superelevation.value_and_slope(s)
        cos, sin = math.cos(roll), math.sin(roll)
        across, z = t * cos, z + t * sin
        climb += sideways * sin + t * cos * twist
        sideways = sideways * cos - t * sin * twist
    along = speed * (1.0 - curvature * across)
    if along < LEAST_STRETCH:
        along = LEAST_STRETCH
    if lane.heights:
        z += lane_height(lane, s - section.s, offset)
    return Pose(
        x - across * math.sin(h),
        y + across * math.cos(h),
        z,
        h + math.atan2(sideways, along) if sideways else h,
        -math.atan2(climb, math.hypot(along, sideways)) if climb else 0.0,
        roll,
    )


def lane_height(lane: Lane, ds: float, offset: float) -> float:
    """How much a lane is lifted above the road, `offset` off its centre line, ds behind its section's start [m]."""
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
    """t of a lane's centre line at s, and its derivative."""
    t, slope = road.lane_offset.value_and_slope(s)
    if lane.id == 0:
        return t, slope
    centre, centre_slope = lane.centre.value_and_slope(s - section.s)
    return (t + centre, slope + centre_slope) if lane.id > 0 else (t - centre, slope - centre_slope)


def lane_at(road: Road, lane_id: int, s: float) -> tuple[LaneSection, Lane]:
    """The lane with this id at s. Raises PositionError if the road is shorter, or has no such lane there."""
    if not -BEYOND <= s <= road.length + BEYOND:
        raise off_road(road, s)
    section = road.section_at(s)
    lane = section.lanes.get(lane_id)
    if lane is None:
        known = ", ".join(str(number) for number in section.lanes)
        raise PositionError(Problem(f"road {road.id!r} has no lane {lane_id} at s = {s:g} m", f"its lanes are {known}"))
    return section, lane


def lane_beside(road: Road, s: float, t: float) -> tuple[LaneSection, Lane, float]:
    """The lane at road coordinates and the distance from the road's edge (0 on the road); beyond it, the last lane."""
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


def project(road: Road, x: float, y: float, s: float) -> tuple[float, float, float]:
    """Road coordinates s, t of a point, searched from a first guess, and how far it lies beyond an end of the road.

    Newton's method on the distance to the reference line.
    """
    length = road.length
    along = across = 0.0
    for _ in range(12):
        px, py, h, curvature, speed = road.reference.at(s)
        cos, sin = math.cos(h), math.sin(h)
        along, across = cos * (x - px) + sin * (y - py), cos * (y - py) - sin * (x - px)
        step = along / (max(speed, 1e-3) * max(1.0 - curvature * across, 0.2))
        before, s = s, min(max(s + step, 0.0), length)
        if abs(s - before) < 1e-7:
            break
    r = road.superelevation.value(s)
    beyond = abs(along) if s <= 0.0 or s >= length else 0.0
    return s, across / math.cos(r) if r else across, beyond if beyond > 1e-6 else 0.0


def off_road(road: Road, s: float) -> PositionError:
    """The error for a place beyond the ends of a road."""
    return PositionError(
        Problem(f"s = {s:g} m is not on road {road.id!r}", f"the road runs from 0 to {road.length:g} m")
    )


def unknown_road(number: str, known: list[str]) -> PositionError:
    """The error for a road that does not exist."""
    return PositionError(Problem(f"there is no road {number!r}", suggestion(number, known)))

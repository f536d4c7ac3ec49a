"""Free space between bounding boxes along the axes of entities, roads and trajectories."""

from __future__ import annotations

import math

from eidrive_scenario.roads import LaneLocation, RoadNetwork
from eidrive_scenario.storyboard.context.protocols import ConditionContext

Box = tuple[float, float, float, float, float, float, float]
"""x, y, z of the center, length, width, height [m], yaw [rad]."""


def entity_box(context: ConditionContext, name: str) -> Box:
    """Return the bounding box of an actor at its current pose."""
    pose = context.pose(name)
    bounds = context.actors[name].entity.bounding_box
    center, size = bounds.center, bounds.dimensions
    cos, sin = math.cos(pose.h), math.sin(pose.h)
    return (
        pose.x + center.x * cos - center.y * sin,
        pose.y + center.x * sin + center.y * cos,
        pose.z + center.z,
        size.length,
        size.width,
        size.height,
        pose.h,
    )


def free_space(context: ConditionContext, a: str, b: str | None, frame: str, kind: str, value: float) -> float:
    """Return the free space along one axis [m]: the distance `value` of the reference points without both extents.

    `b` is an actor, or None for a position.
    """
    axis = _own_axis(context, a, frame)
    mine = _extent(context, a, axis, frame, kind)
    theirs = (0.0, 0.0) if b is None else _extent(context, b, _axis_at(context, a, b, frame, axis), frame, kind)
    if value + theirs[0] > mine[1]:
        return value + theirs[0] - mine[1]
    if value + theirs[1] < mine[0]:
        return value + theirs[1] - mine[0]
    return 0.0


def _own_axis(context: ConditionContext, name: str, frame: str) -> float:
    """Return the heading of the longitudinal axis at an actor [rad]."""
    if frame == "world":
        return 0.0
    heading = context.pose(name).h
    if frame in ("lane", "road") and context.roads is not None:
        here = context.location(name)
        if here is not None:
            lane = context.roads.pose(here).h
            heading = lane if math.cos(lane - heading) >= 0.0 else lane + math.pi
    return heading


def _axis_at(context: ConditionContext, a: str, b: str, frame: str, axis: float) -> float:
    """Return the heading at actor `b` [rad] of the axis that has the heading `axis` at actor `a`.

    Roads and trajectories may turn by any angle between both.
    """
    roads = context.roads
    if frame in ("lane", "road") and roads is not None:
        here, there = context.location(a), context.location(b)
        runs = None if here is None or there is None else roads.orientation(here, there)
        if here is not None and there is not None and runs is not None:
            ways = [roads.driving_direction(place.road, place.lane) for place in (here, there)]
            is_along = math.cos(axis - roads.pose(here).h) >= 0.0
            return roads.pose(there).h + (0.0 if is_along == (ways[0] * ways[1] * runs > 0) else math.pi)
    progress = context.actors[a].progress if frame == "trajectory" else None
    if progress is not None:
        station, pose = progress.at(context.view.tick), context.pose(b)
        layout = progress.layout
        turn = layout.tangent(layout.project(pose.x, pose.y, station)[0]) - layout.tangent(station)
        return pose.h if math.cos(pose.h - turn - axis) >= 0.0 else pose.h + math.pi
    return axis


def _extent(context: ConditionContext, name: str, axis: float, frame: str, kind: str) -> tuple[float, float]:
    """Return minimum and maximum of the box of an actor along an axis or the road, from its reference point [m]."""
    if frame in ("lane", "road") and context.roads is not None:
        here = context.location(name)
        if here is not None and context.roads.curvature(here.road, here.s) != 0.0:
            return _extent_on_bend(context, context.roads, name, here, axis, kind)
    bounds = context.actors[name].entity.bounding_box
    turn = context.pose(name).h - axis
    cos, sin = math.cos(turn), math.sin(turn)
    x, y = bounds.center.x, bounds.center.y
    length, width = 0.5 * bounds.dimensions.length, 0.5 * bounds.dimensions.width
    if kind == "longitudinal":
        center, half = x * cos - y * sin, abs(length * cos) + abs(width * sin)
    else:
        center, half = x * sin + y * cos, abs(length * sin) + abs(width * cos)
    return center - half, center + half


def _extent_on_bend(
    context: ConditionContext, roads: RoadNetwork, name: str, here: LaneLocation, axis: float, kind: str
) -> tuple[float, float]:
    """Return the extent along a curved road, from the corners of the box in road coordinates [m]."""
    x, y, _, length, width, _, yaw = entity_box(context, name)
    cos, sin = math.cos(yaw), math.sin(yaw)
    sign = 1.0 if math.cos(roads.pose(here).h - axis) >= 0.0 else -1.0
    extents = []
    for along, across in ((0.5, 0.5), (0.5, -0.5), (-0.5, 0.5), (-0.5, -0.5)):
        dx, dy = along * length, across * width
        corner = roads.locate_at(x + dx * cos - dy * sin, y + dx * sin + dy * cos, here)
        found = None if corner is None else roads.distance(here, corner)
        if found is not None:
            extents.append(sign * found[0 if kind == "longitudinal" else 1])
    return min(extents, default=0.0), max(extents, default=0.0)

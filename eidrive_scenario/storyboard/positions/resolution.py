"""Resolution of all position types of the standard."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose
from eidrive_scenario.roads.model.location import PositionError
from eidrive_scenario.storyboard.context.contexts import ConditionContext, PositionCache
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.kinematics.route import build_route, faces_traffic
from eidrive_scenario.storyboard.kinematics.trajectory import TrajectoryCurve
from eidrive_scenario.storyboard.kinematics.trajectory_sampling import sample_trajectory
from eidrive_scenario.storyboard.positions.position_types import (
    angles,
    geo_position,
    in_lane,
    in_road,
    lane_id,
    lane_position,
    on_ground,
    position_error,
    relative_lane_position,
    relative_object_position,
    relative_road_position,
    relative_world_position,
    road_origin,
    road_position,
    roads_of,
    world_position,
)

STATIC = (model.WorldPosition, model.RoadPosition, model.LanePosition, model.GeoPosition)
"""Types of static positions."""
MAX_DEPTH = 10
"""Maximum depth of nested positions."""
MAX_POSITIONS = 2000
"""Maximum number of nested positions within one position."""


def resolve_position(position: model.Position, context: ConditionContext, actor: str | None = None) -> ResolvedPosition:
    """Resolve a position at this instant. `actor` is the entity that moves there; some positions depend on its route.

    Raise ScenarioError if the position does not exist in the road network, EntityAbsentError if it refers to an absent
    entity.
    """
    cache = context.position_cache
    cached = cache.static.get(id(position))
    if cached is not None and cached[0] is position:
        return cached[1]
    frame = position.chosen()
    along_curve = ALONG_CURVES.get(type(frame))
    try:
        if along_curve is None:
            resolved = RESOLVERS[type(frame)](frame, context)
        else:
            _enter(frame, cache)
            resolved = along_curve(frame, context, actor)
    except PositionError as error:
        reason = error.diagnostics[0]
        raise position_error(frame, f"not resolvable: {reason.message}", reason.hint) from error
    finally:
        if along_curve is not None:
            cache.depth -= 1
    if _is_static(frame, context):
        cache.static[id(position)] = (position, resolved)
    return resolved


def _enter(frame: model.Element, cache: PositionCache) -> None:
    """Count a nested position. Raise ScenarioError if there are too many."""
    cache.nested = cache.nested + 1 if cache.depth else 0
    cache.depth += 1
    if cache.depth > MAX_DEPTH or cache.nested > MAX_POSITIONS:
        message = f"nested too deeply (maximum depth {MAX_DEPTH}, maximum number {MAX_POSITIONS})"
        raise position_error(frame, message, "use RoadPosition or LanePosition")


def referenced_entities(position: model.Position) -> tuple[str, ...]:
    """Return the names of the entities that a position refers to."""
    return tuple(name for below in position.walk() if (name := getattr(below, "entity_ref", None)) is not None)


def _route(frame: model.RoutePosition, context: ConditionContext, actor: str | None) -> ResolvedPosition:
    roads = roads_of(frame, context)
    within = frame.in_route_position.chosen()
    route = _route_element(frame, context)
    build = partial(
        build_route, route, roads, lambda position: resolve_position(position, context, actor), seed=context.seed
    )
    try:
        path = build()
    except ScenarioError:
        if not faces_traffic(roads, resolve_position(route.waypoint[0].position, context, actor)):
            raise
        path = build(against_traffic=True)
    if isinstance(within, model.PositionOfCurrentEntity):
        here = road_origin(within, context)
        return in_lane(roads, here.road, here.lane, here.s, here.offset, frame.orientation)
    if not isinstance(within, model.PositionInRoadCoordinates | model.PositionInLaneCoordinates):
        raise position_error(frame, f"unsupported coordinates {type(within).__name__}")
    here, length = path.location_by_reference_line(within.path_s), path.reference_length
    if not -1e-3 <= within.path_s <= length + 1e-3:
        raise position_error(
            frame, "pathS is outside of the route", f"got {within.path_s:g} m; expected 0 to {length:.1f} m"
        )
    if isinstance(within, model.PositionInRoadCoordinates):
        return in_road(roads, here.road, here.s, within.t, frame.orientation, here.lane)
    lane = lane_id(frame, within.lane_id)
    return in_lane(roads, here.road, lane, here.s, within.lane_offset or 0.0, frame.orientation)


def _trajectory(frame: model.TrajectoryPosition, context: ConditionContext, actor: str | None) -> ResolvedPosition:
    """Resolve a position at s and t of a curve; relative headings refer to its tangent (1.3.1, TrajectoryPosition)."""
    layout = trajectory_of(frame, context, actor)
    at, tangent = layout.at(frame.s), layout.tangent(frame.s)
    offset = frame.t or 0.0
    x, y = at.x - offset * math.sin(tangent), at.y + offset * math.cos(tangent)
    h, p, r = angles(frame.orientation, at.turned(wrap_angle(tangent - at.h))._replace(h=tangent))
    return on_ground(context, Pose(x, y, at.z, h, p, r), z_given=True)


def trajectory_of(
    frame: model.TrajectoryPosition, context: ConditionContext, actor: str | None = None
) -> TrajectoryCurve:
    """Return the trajectory of a position, with its points resolved at this instant.

    Raise ScenarioError if the position is outside of it.
    """
    trajectory = _trajectory_element(frame, context)
    layout = sample_trajectory(
        trajectory, lambda position: resolve_position(position, context, actor).pose, roads=context.roads
    )
    if not -1e-3 <= frame.s <= layout.length + 1e-3:
        raise position_error(
            frame, "s is outside of the trajectory", f"got {frame.s:g} m; expected 0 to {layout.length:.1f} m"
        )
    return layout


def _route_element(frame: model.RoutePosition, context: ConditionContext) -> model.Route:
    holder = frame.route_ref
    return holder.route or context.catalog_entry(holder.catalog_reference, model.Route, frame)


def _trajectory_element(frame: model.TrajectoryPosition, context: ConditionContext) -> model.Trajectory:
    holder = frame.trajectory_ref
    return holder.trajectory or context.catalog_entry(holder.catalog_reference, model.Trajectory, frame)


def _is_static(frame: model.Element, context: ConditionContext) -> bool:
    """Whether a position is static; one along a curve is, if the positions of the curve are."""
    if isinstance(frame, model.TrajectoryPosition):
        curve: model.Element = _trajectory_element(frame, context)
    elif isinstance(frame, model.RoutePosition):
        if isinstance(frame.in_route_position.chosen(), model.PositionOfCurrentEntity):
            return False
        curve = _route_element(frame, context)
    else:
        return isinstance(frame, STATIC)
    inner = (nested for nested in curve.walk() if isinstance(nested, model.Position))
    return all(_is_static(nested.chosen(), context) for nested in inner)


ALONG_CURVES: dict[type[model.Element], Callable[[Any, ConditionContext, str | None], ResolvedPosition]] = {
    model.RoutePosition: _route,
    model.TrajectoryPosition: _trajectory,
}
"""Resolvers of positions along a route or trajectory, whose points are positions that may depend on the actor."""
RESOLVERS: dict[type[model.Element], Callable[[Any, ConditionContext], ResolvedPosition]] = {
    model.WorldPosition: world_position,
    model.RelativeWorldPosition: relative_world_position,
    model.RelativeObjectPosition: relative_object_position,
    model.RoadPosition: road_position,
    model.RelativeRoadPosition: relative_road_position,
    model.LanePosition: lane_position,
    model.RelativeLanePosition: relative_lane_position,
    model.GeoPosition: geo_position,
}

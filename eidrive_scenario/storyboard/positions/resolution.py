"""Positions of the standard, in all their frames, as places in the world."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Pose
from eidrive_scenario.roads.model.location import PositionError
from eidrive_scenario.storyboard.context.protocols import ConditionContext, PositionCache
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.kinematics.route import build_route
from eidrive_scenario.storyboard.kinematics.trajectory import TrajectoryCurve, sample_trajectory
from eidrive_scenario.storyboard.positions.geographic import geo_position
from eidrive_scenario.storyboard.positions.orientations import angles
from eidrive_scenario.storyboard.positions.position_errors import position_error, road_origin, roads_of
from eidrive_scenario.storyboard.positions.road_positions import (
    in_lane,
    in_road,
    lane_id,
    lane_position,
    relative_lane_position,
    relative_road_position,
    road_position,
)
from eidrive_scenario.storyboard.positions.world_positions import (
    on_ground,
    relative_object_position,
    relative_world_position,
    world_position,
)

FIXED = (model.WorldPosition, model.RoadPosition, model.LanePosition, model.GeoPosition)
"""Positions that mean the same place all the time."""
NESTING = (model.RoutePosition, model.TrajectoryPosition)
"""Positions along a route or trajectory, whose own points are positions."""
MAX_DEPTH = 10
"""Maximum number of such positions within each other."""
MAX_POSITIONS = 2000
"""Maximum number of such positions that one position leads through."""


def resolve_position(position: model.Position, context: ConditionContext, actor: str | None = None) -> ResolvedPosition:
    """The place that a position means now. `actor` is the entity that goes there; its route counts for some positions.

    Raises ScenarioError if the road network does not have it, Absent if it refers to an entity that is not in the
    world.
    """
    cache = context.position_cache
    held = cache.static.get(id(position))
    if held is not None and held[0] is position:
        return held[1]
    frame = position.chosen()
    nesting = isinstance(frame, NESTING)
    try:
        if nesting:
            _enter(frame, cache)
        place = FRAMES[type(frame)](frame, context, actor)
    except PositionError as error:
        raise position_error(
            frame, f"means no place: {error.diagnostics[0].message}", error.diagnostics[0].hint
        ) from error
    finally:
        if nesting:
            cache.depth -= 1
    if _stands_still(frame, context):
        cache.static[id(position)] = (position, place)
    return place


def _enter(frame: model.Element, cache: PositionCache) -> None:
    """Count a position along a curve whose own points are positions. Raise ScenarioError if they multiply."""
    cache.nested = cache.nested + 1 if cache.depth else 0
    cache.depth += 1
    if cache.depth > MAX_DEPTH or cache.nested > MAX_POSITIONS:
        what = f"lies on curves of positions on curves, more than {MAX_DEPTH} deep or {MAX_POSITIONS} in total"
        raise position_error(frame, what, "name the places by roads and lanes")


def referenced_entities(position: model.Position) -> tuple[str, ...]:
    """The entities that a position refers to."""
    return tuple(name for below in position.walk() if (name := getattr(below, "entity_ref", None)) is not None)


def _route(frame: model.RoutePosition, context: ConditionContext, actor: str | None) -> ResolvedPosition:
    roads = roads_of(frame, context)
    within = frame.in_route_position.chosen()
    route = frame.route_ref.route or context.catalog_entry(frame.route_ref.catalog_reference, model.Route, frame)
    path = build_route(route, roads, lambda position: resolve_position(position, context, actor), seed=context.seed)
    if isinstance(within, model.PositionOfCurrentEntity):
        here = road_origin(within, context)
        return in_lane(roads, here.road, here.lane, here.s, here.offset, frame.orientation)
    if not isinstance(within, model.PositionInRoadCoordinates | model.PositionInLaneCoordinates):
        raise position_error(frame, f"says {type(within).__name__}, which is not known here")
    here = path.location_at(within.path_s)
    if not -1e-3 <= within.path_s <= path.length + 1e-3:
        raise position_error(frame, f"leads {within.path_s:g} m along a route of {path.length:.1f} m")
    if isinstance(within, model.PositionInRoadCoordinates):
        return in_road(roads, here.road, here.s, within.t, frame.orientation, here.lane)
    lane = lane_id(frame, within.lane_id)
    return in_lane(roads, here.road, lane, here.s, within.lane_offset or 0.0, frame.orientation)


def _trajectory(frame: model.TrajectoryPosition, context: ConditionContext, actor: str | None) -> ResolvedPosition:
    """s and t along and beside the curve; a relative heading counts from its tangent (1.3.1, TrajectoryPosition)."""
    layout = trajectory_of(frame, context, actor)
    at, tangent = layout.at(frame.s), layout.tangent(frame.s)
    offset = frame.t or 0.0
    x, y = at.x - offset * math.sin(tangent), at.y + offset * math.cos(tangent)
    h, p, r = angles(frame.orientation, at._replace(h=tangent))
    return on_ground(context, Pose(x, y, at.z, h, p, r), z_given=True)


def trajectory_of(
    frame: model.TrajectoryPosition, context: ConditionContext, actor: str | None = None
) -> TrajectoryCurve:
    """Return the trajectory along which a position counts, as it lies now."""
    trajectory = _trajectory_in(frame, context)
    return sample_trajectory(trajectory, lambda position: resolve_position(position, context, actor).pose)


def _trajectory_in(frame: model.TrajectoryPosition, context: ConditionContext) -> model.Trajectory:
    if frame.trajectory_ref.trajectory is not None:
        return frame.trajectory_ref.trajectory
    return context.catalog_entry(frame.trajectory_ref.catalog_reference, model.Trajectory, frame)


def _stands_still(frame: model.Element, context: ConditionContext) -> bool:
    """Whether a position means the same place all the time."""
    if not isinstance(frame, model.TrajectoryPosition):
        return isinstance(frame, FIXED)
    inner = (one for one in _trajectory_in(frame, context).walk() if isinstance(one, model.Position))
    return all(_stands_still(one.chosen(), context) for one in inner)


FRAMES: dict[type[model.Element], Callable[[Any, ConditionContext, str | None], ResolvedPosition]] = {
    model.WorldPosition: world_position,
    model.RelativeWorldPosition: relative_world_position,
    model.RelativeObjectPosition: relative_object_position,
    model.RoadPosition: road_position,
    model.RelativeRoadPosition: relative_road_position,
    model.LanePosition: lane_position,
    model.RelativeLanePosition: relative_lane_position,
    model.RoutePosition: _route,
    model.TrajectoryPosition: _trajectory,
    model.GeoPosition: geo_position,
}

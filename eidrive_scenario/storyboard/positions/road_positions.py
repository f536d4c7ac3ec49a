"""Positions in road and lane coordinates, absolute or relative to an entity on a road."""

from __future__ import annotations

import math

from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import LaneLocation, RoadNetwork, Route
from eidrive_scenario.storyboard.context.protocols import ConditionContext
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.positions.world_positions import oriented, position_error, road_origin, roads_of


def road_position(frame: model.RoadPosition, context: ConditionContext, actor: str | None) -> ResolvedPosition:
    """Resolve a RoadPosition. Raise ScenarioError if the road does not exist."""
    roads = roads_of(frame, context)
    return in_road(roads, frame.road_id, _s_on_road(frame, context, roads), frame.t, frame.orientation)


def relative_road_position(
    frame: model.RelativeRoadPosition, context: ConditionContext, actor: str | None
) -> ResolvedPosition:
    """Resolve a position in the frame of the road of an entity: `ds` along the reference line, `dt` along t."""
    roads, origin = roads_of(frame, context), road_origin(frame, context)
    here = along_reference(roads, origin, frame.ds, context.actors[frame.entity_ref].motion.route)
    if here is None:
        raise position_error(frame, f"beyond the end of the road: {frame.ds:g} m from entity {frame.entity_ref!r}")
    sign = roads.driving_direction(origin.road, origin.lane) * roads.driving_direction(here.road, here.lane)
    return in_road(roads, here.road, here.s, here.t + frame.dt * sign, frame.orientation)


def lane_position(frame: model.LanePosition, context: ConditionContext, actor: str | None) -> ResolvedPosition:
    """Resolve a LanePosition. Raise ScenarioError if the road or lane does not exist there."""
    roads = roads_of(frame, context)
    s = _s_on_road(frame, context, roads)
    lane = lane_id(frame, frame.lane_id)
    lanes = roads.lane_ids(frame.road_id, s)
    if lane not in lanes and lane != 0:
        names = ", ".join(str(number) for number in lanes)
        raise position_error(
            frame, f"unknown lane {lane} of road {frame.road_id!r} at s = {s:g}", f"expected one of {names}"
        )
    return in_lane(roads, frame.road_id, lane, s, frame.offset or 0.0, frame.orientation)


def relative_lane_position(
    frame: model.RelativeLanePosition, context: ConditionContext, actor: str | None
) -> ResolvedPosition:
    """Resolve a position relative to the lane of an entity, with all offsets in one frame.

    With `dsLane` it is that of the entity: ahead in its lane, lanes and lateral offset to its left. With `ds` it is
    that of the road: along the reference line, lanes and lateral offset in the direction of t.
    """
    roads, origin = roads_of(frame, context), road_origin(frame, context)
    route = context.actors[frame.entity_ref].motion.route
    ahead = facing(context, frame.entity_ref, origin)
    if frame.ds_lane is not None:
        axis = ahead
        there = roads.advance(origin._replace(offset=0.0), frame.ds_lane * ahead, route=route)
    else:
        axis = roads.driving_direction(origin.road, origin.lane)
        there = along_reference(roads, origin, frame.ds or 0.0, route)
    if there is None:
        raise position_error(frame, f"beyond the end of the road of entity {frame.entity_ref!r}")
    sign = axis * roads.driving_direction(there.road, there.lane)
    lane = count_lanes(there.lane, frame.d_lane * sign)
    if lane not in roads.lane_ids(there.road, there.s):
        raise position_error(frame, f"unknown lane {lane} of road {there.road!r} at s = {there.s:.1f}")
    place = in_lane(roads, there.road, lane, there.s, (frame.offset or 0.0) * sign, frame.orientation)
    if frame.orientation is None and ahead < 0:
        return place._replace(pose=place.pose.turned(math.pi))
    return place


def along_reference(
    roads: RoadNetwork, here: LaneLocation, ds: float, route: Route | None = None
) -> LaneLocation | None:
    """Return the location at `ds` [m] along the reference line, in the same or the connected lane, at the same offset.

    The route selects the branch at junctions. A lane that ends before its road is replaced by the lane at the same t.
    """
    road = roads.roads[here.road]
    s = here.s + ds
    if 0.0 <= s <= road.length:
        return here._replace(s=s)
    rest = s - road.length if s > road.length else s
    edge = here._replace(s=road.length if s > road.length else 0.0)
    if here.lane not in roads.lane_ids(here.road, edge.s):
        edge = roads.road_location(here.road, edge.s, here.t)
    return roads.advance(
        edge, rest * roads.driving_direction(here.road, here.lane), route=route, by_reference_line=True
    )


def count_lanes(lane: int, steps: int) -> int:
    """Return the lane `steps` to the left of a lane, towards larger ids; lane 0 does not count."""
    target = lane + steps
    if steps and (target == 0 or (target > 0) != (lane > 0)):
        target += 1 if steps > 0 else -1
    return target


def facing(context: ConditionContext, name: str, here: LaneLocation) -> int:
    """Return +1 if an actor points along the driving direction of its lane, otherwise -1."""
    if context.roads is None:
        return 1
    lane = context.roads.lane_pose_at(here.road, here.lane, here.s, here.offset).h
    along = math.cos(context.pose(name).h - lane) * context.roads.driving_direction(here.road, here.lane)
    return 1 if along >= 0.0 else -1


def in_lane(
    roads: RoadNetwork, road: str, lane: int, s: float, offset: float, orientation: model.Orientation | None
) -> ResolvedPosition:
    """Resolve lane coordinates; a relative orientation refers to the lane."""
    here = roads.location(road, lane, s, offset)
    return ResolvedPosition(oriented(orientation, roads.pose(here)), here)


def in_road(
    roads: RoadNetwork, road: str, s: float, t: float, orientation: model.Orientation | None, lane: int | None = None
) -> ResolvedPosition:
    """Resolve road coordinates, referred to `lane`, by default to the lane at this position.

    A relative orientation refers to the reference line. Without an orientation the heading is the driving direction.
    """
    here = roads.road_location(road, s, t)
    if lane is not None:
        here = roads.location(road, lane, s, t - roads.location(road, lane, s).t)
    surface = roads.road_pose_at(road, s, t)
    along = orientation is not None or roads.driving_direction(road, here.lane) > 0
    return ResolvedPosition(oriented(orientation, surface if along else surface.turned(math.pi)), here)


def _s_on_road(frame: model.RoadPosition | model.LanePosition, context: ConditionContext, roads: RoadNetwork) -> float:
    """Return s of a position, limited to its road; a warning reports a value beyond an end of the road."""
    road, s = frame.road_id, frame.s
    if road not in roads.roads:
        names = ", ".join(sorted(roads.roads)[:12])
        raise position_error(frame, f"unknown road {road!r}", f"expected one of {names}")
    length = roads.roads[road].length
    on_road = min(max(s, 0.0), length)
    if abs(on_road - s) > 1e-3:
        message = f"{type(frame).__name__}: moved to the end of road {road!r}"
        hint = f"got s = {s:g}; expected 0 to {length:.2f}"
        context.warn(Diagnostic(message, hint, frame.source, frame.line))
    return on_road


def lane_id(frame: model.Element, text: str) -> int:
    """Return a lane id as an integer. Raise ScenarioError if it is none."""
    try:
        return int(text)
    except ValueError:
        raise position_error(frame, "invalid laneId", f"got {text!r}; expected an integer") from None

"""Positions of each type: on roads and lanes, in world and geographic coordinates; their orientations and errors."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.errors import Diagnostic, InputError, ScenarioError
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import LaneLocation, Pose, RoadNetwork, Route
from eidrive_scenario.storyboard.context.contexts import ConditionContext
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition


def oriented(orientation: model.Orientation | None, base: Pose) -> Pose:
    """Return `base` with an orientation; missing pitch and roll follow the surface at the base."""
    h, p, r = angles(orientation, base)
    level = base.turned(wrap_angle(h - base.h))
    if orientation is None:
        p, r = level.p, level.r
    elif orientation.type is model.ReferenceContext.RELATIVE:
        p, r = level.p + (orientation.p or 0.0), level.r + (orientation.r or 0.0)
    else:
        p, r = level.p if orientation.p is None else p, level.r if orientation.r is None else r
    return Pose(base.x, base.y, base.z, h, p, r)


def angles(orientation: model.Orientation | None, base: Pose) -> tuple[float, float, float]:
    """Return heading, pitch and roll [rad]; relative ones are added to those of the base, missing ones are 0."""
    if orientation is None:
        return base.h, base.p, base.r
    h, p, r = orientation.h or 0.0, orientation.p or 0.0, orientation.r or 0.0
    if orientation.type is model.ReferenceContext.RELATIVE:
        return wrap_angle(base.h + h), base.p + p, base.r + r
    return h, p, r


def roads_of(frame: model.Element, context: ConditionContext) -> RoadNetwork:
    """Return the road network. Raise ScenarioError if the scenario has none."""
    if context.roads is None:
        raise position_error(
            frame, "the scenario has no road network", "specify RoadNetwork/LogicFile, or use a WorldPosition"
        )
    return context.roads


def road_origin(frame: Any, context: ConditionContext) -> LaneLocation:
    """Return the lane location of the entity that `frame` refers to. Raise ScenarioError if it is outside of roads."""
    here = context.location(frame.entity_ref)
    if here is None:
        raise position_error(frame, f"entity {frame.entity_ref!r} is not on a road")
    return here


def position_error(frame: model.Element, message: str, hint: str = "") -> ScenarioError:
    """Return an error of a position with its file and line."""
    return ScenarioError(Diagnostic.at(frame, f"{type(frame).__name__}: {message}", hint))


CARLA_PREFIX = "CARLA:"
"""Prefix of the description of a scenario in the axes of CARLA."""


def world_position(frame: model.WorldPosition, context: ConditionContext) -> ResolvedPosition:
    """Resolve a WorldPosition; without z it is on the road."""
    side = -1.0 if left_handed(context) else 1.0
    h, p, r = side * (frame.h or 0.0), side * (frame.p or 0.0), frame.r or 0.0
    pose = Pose(frame.x, side * frame.y, frame.z or 0.0, h, p, r)
    return on_ground(context, pose, z_given=frame.z is not None, h_given=frame.h is not None)


def relative_world_position(frame: model.RelativeWorldPosition, context: ConditionContext) -> ResolvedPosition:
    """Resolve a position relative to an entity, along the axes of the world."""
    origin, side = context.pose(frame.entity_ref), -1.0 if left_handed(context) else 1.0
    x, y, z = origin.x + frame.dx, origin.y + side * frame.dy, origin.z + (frame.dz or 0.0)
    h, p, r = angles(_in_standard_axes(frame.orientation, side), origin)
    return on_ground(context, Pose(x, y, z, h, p, r), z_given=bool(frame.dz), near=frame.entity_ref)


def relative_object_position(frame: model.RelativeObjectPosition, context: ConditionContext) -> ResolvedPosition:
    """Resolve a position relative to an entity, along its heading."""
    origin, side = context.pose(frame.entity_ref), -1.0 if left_handed(context) else 1.0
    cos, sin, dy = math.cos(origin.h), math.sin(origin.h), side * frame.dy
    x = origin.x + frame.dx * cos - dy * sin
    y = origin.y + frame.dx * sin + dy * cos
    h, p, r = angles(_in_standard_axes(frame.orientation, side), origin)
    return on_ground(
        context, Pose(x, y, origin.z + (frame.dz or 0.0), h, p, r), z_given=bool(frame.dz), near=frame.entity_ref
    )


def left_handed(context: ConditionContext) -> bool:
    """Whether the world coordinates of the scenario have CARLA's axes: y to the right, headings clockwise, pitch up.

    As in ScenarioRunner, that is so if the description begins with `CARLA:`. Coordinates of roads and lanes keep the
    axes of the standard.
    """
    return str(context.scenario.document.file_header.description).startswith(CARLA_PREFIX)


def _in_standard_axes(orientation: model.Orientation | None, side: float) -> model.Orientation | None:
    """Convert an orientation to the axes of the standard; headings and pitches have the opposite sign in CARLA."""
    if orientation is None or side > 0.0:
        return orientation
    return replace(orientation, h=side * (orientation.h or 0.0), p=side * (orientation.p or 0.0))


def on_ground(
    context: ConditionContext, pose: Pose, *, z_given: bool, h_given: bool = True, near: str | None = None
) -> ResolvedPosition:
    """Return the position of a pose, on the road if there is one; the search begins at the actor `near`."""
    if context.roads is None:
        return ResolvedPosition(pose)
    hint, height = (None, pose.z if z_given else None) if near is None else (context.location(near), pose.z)
    here = context.roads.locate_pose(pose.x, pose.y, pose.h if h_given else None, height, hint)
    if here is not None and not z_given:
        level = context.roads.laid(pose, here)
        pose = level._replace(p=pose.p or level.p, r=pose.r or level.r)
    return ResolvedPosition(pose, here)


LEVEL_SEPARATION = 0.5
"""Maximum difference in height of roads on one level [m]."""


def geo_position(frame: model.GeoPosition, context: ConditionContext) -> ResolvedPosition:
    """Resolve a GeoPosition by the projection of the road network.

    Relative and missing angles refer to the lane at the position. `altitude` is above the surface of the selected road,
    `height` of older versions above the zero of the projection.
    """
    roads = roads_of(frame, context)
    x, y = plane_coordinates(frame, roads, context)
    if frame.altitude is None and frame.height is not None:
        level: float | None = frame.height - roads.header.offset[2]
    else:
        level = height_of_level(frame, roads, x, y)
    z = level if frame.altitude is None else (level or 0.0) + frame.altitude
    given = frame.orientation
    heading = None if given is None or given.type is model.ReferenceContext.RELATIVE else given.h
    here = roads.locate_pose(x, y, heading, level)
    base = roads.pose(here) if here is not None else Pose(x, y, 0.0, 0.0, 0.0, 0.0)
    return ResolvedPosition(oriented(frame.orientation, base._replace(x=x, y=y, z=base.z if z is None else z)), here)


def plane_coordinates(frame: model.GeoPosition, roads: RoadNetwork, context: ConditionContext) -> tuple[float, float]:
    """Return x and y of a GeoPosition [m]. Raise ScenarioError if the road network has no geoReference."""
    latitude, longitude = _angles(frame, context)
    try:
        return roads.geographic(latitude, longitude)
    except InputError as error:
        reason = error.diagnostics[0]
        message = Diagnostic.at(frame, f"GeoPosition: not resolvable: {reason.message}", reason.hint)
        raise ScenarioError(message) from error


def height_of_level(frame: model.GeoPosition, roads: RoadNetwork, x: float, y: float) -> float | None:
    """Return z of the road selected by verticalRoadSelection [m]; None without a road.

    0 is the top-most road, -1 the next one below (1.3.1, GeoPosition). Raise ScenarioError if the level does not exist.
    """
    nearest = roads.locate_at(x, y)
    if nearest is None:
        return None
    levels: list[float] = []
    for height in sorted(roads.pose(location).z for location in roads.locations_at(x, y) or [nearest]):
        if not levels or height > levels[-1] + LEVEL_SEPARATION:
            levels.append(height)
    below = -(frame.vertical_road_selection or 0)
    if not 0 <= below < len(levels):
        message = "GeoPosition: the selected road level does not exist"
        hint = f"got {-below}; expected {1 - len(levels)} to 0, the top-most"
        raise ScenarioError(Diagnostic.at(frame, message, hint))
    return levels[-1 - below]


def _angles(frame: model.GeoPosition, context: ConditionContext) -> tuple[float, float]:
    """Return latitude and longitude [rad]: since 1.2 given in degrees, before in radians.

    Older values beyond the range of radians are read as degrees, with a warning.
    """
    if frame.latitude_deg is not None and frame.longitude_deg is not None:
        latitude, longitude, in_degrees = frame.latitude_deg, frame.longitude_deg, True
    elif frame.latitude is not None and frame.longitude is not None:
        latitude, longitude = frame.latitude, frame.longitude
        in_degrees = abs(latitude) > math.pi / 2.0 or abs(longitude) > math.pi
        if in_degrees:
            message = f"GeoPosition: latitude {latitude:g}, longitude {longitude:g} are read as degrees, not radians"
            context.warn(Diagnostic.at(frame, message, "use latitudeDeg and longitudeDeg"))
    else:
        hint = "give latitudeDeg and longitudeDeg"
        raise ScenarioError(Diagnostic.at(frame, "GeoPosition: latitude or longitude is missing", hint))
    if in_degrees:
        latitude, longitude = math.radians(latitude), math.radians(longitude)
    if abs(latitude) > math.pi / 2.0 or abs(longitude) > 2.0 * math.pi:
        message = f"GeoPosition: invalid latitude {math.degrees(latitude):g}° or longitude {math.degrees(longitude):g}°"
        raise ScenarioError(Diagnostic.at(frame, message, "expected latitudes within ±90°, longitudes within ±360°"))
    return latitude, longitude


def road_position(frame: model.RoadPosition, context: ConditionContext) -> ResolvedPosition:
    """Resolve a RoadPosition. Raise ScenarioError if the road does not exist."""
    roads = roads_of(frame, context)
    return in_road(roads, frame.road_id, _s_on_road(frame, context, roads), frame.t, frame.orientation)


def relative_road_position(frame: model.RelativeRoadPosition, context: ConditionContext) -> ResolvedPosition:
    """Resolve a position in the frame of the road of an entity: `ds` along the reference line, `dt` along t."""
    roads, origin = roads_of(frame, context), road_origin(frame, context)
    there = along_reference(roads, origin, frame.ds, context.actors[frame.entity_ref].motion.route)
    if there is None:
        raise position_error(frame, f"beyond the end of the road: {frame.ds:g} m from entity {frame.entity_ref!r}")
    here, sign = there
    return in_road(roads, here.road, here.s, here.t + frame.dt * sign, frame.orientation)


def lane_position(frame: model.LanePosition, context: ConditionContext) -> ResolvedPosition:
    """Resolve a LanePosition. Raise ScenarioError if the road or lane does not exist there."""
    roads = roads_of(frame, context)
    s = _s_on_road(frame, context, roads)
    lane = lane_id(frame, frame.lane_id)
    lanes = roads.lane_ids(frame.road_id, s)
    if lane not in lanes and lane != 0:
        names = ", ".join(map(str, lanes))
        expected = f"expected one of {names}" if names else "the road has no lanes there"
        raise position_error(frame, f"unknown lane {lane} of road {frame.road_id!r} at s = {s:g}", expected)
    return in_lane(roads, frame.road_id, lane, s, frame.offset or 0.0, frame.orientation)


def relative_lane_position(frame: model.RelativeLanePosition, context: ConditionContext) -> ResolvedPosition:
    """Resolve a position relative to the lane of an entity, with all offsets in one frame.

    With `dsLane` it is that of the entity: ahead in its lane, lanes and lateral offset to its left. With `ds` it is
    that of the road: along the reference line, lanes and lateral offset in the direction of t.
    """
    roads, origin = roads_of(frame, context), road_origin(frame, context)
    route = context.actors[frame.entity_ref].motion.route
    ahead = facing(context, frame.entity_ref, origin)
    by_road = frame.ds_lane is None
    axis = roads.driving_direction(origin.road, origin.lane) if by_road else ahead
    distance = ((frame.ds if by_road else frame.ds_lane) or 0.0) * axis
    there = roads.advance(origin._replace(offset=0.0), distance, route=route, by_reference_line=by_road)
    if there is None:
        raise position_error(frame, f"beyond the end of the road of entity {frame.entity_ref!r}")
    sign = axis * roads.driving_direction(there.road, there.lane)
    lane = count_lanes(there.lane, frame.d_lane * sign)
    if lane not in roads.lane_ids(there.road, there.s):
        raise position_error(frame, f"unknown lane {lane} of road {there.road!r} at s = {there.s:.1f}")
    position = in_lane(roads, there.road, lane, there.s, (frame.offset or 0.0) * sign, frame.orientation)
    if frame.orientation is None and ahead < 0:
        return position._replace(pose=position.pose.turned(math.pi))
    return position


def along_reference(
    roads: RoadNetwork, here: LaneLocation, ds: float, route: Route | None = None
) -> tuple[LaneLocation, int] | None:
    """Return the location at `ds` [m] along the reference line: at the same t of its road, or beyond it at the same
    offset from the lane connected to that at its end. The second result is +1 if s increases there in the direction of
    s of this road, else -1.

    The route selects the branch at junctions.
    """
    length, s = roads.roads[here.road].length, here.s + ds
    if 0.0 <= s <= length:
        return here._replace(s=s), 1
    way, end = (1, length) if s > length else (-1, 0.0)
    edge = roads.road_location(here.road, end, here.t)
    rest = (s - end) * roads.driving_direction(edge.road, edge.lane)
    there = roads.movement.travel(edge, rest, route, by_reference_line=True)
    return None if there is None else (there[0], there[1] * way)


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
        context.warn(Diagnostic.at(frame, message, hint))
    return on_road


def lane_id(frame: model.Element, text: str) -> int:
    """Return a lane id as an integer. Raise ScenarioError if it is none."""
    try:
        return int(text)
    except ValueError:
        raise position_error(frame, "invalid laneId", f"got {text!r}; expected an integer") from None

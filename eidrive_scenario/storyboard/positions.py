"""Positions of the standard, in all their frames, as places in the world."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from eidrive_scenario.errors import Problem, ScenarioError
from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import LaneLocation, Pose, RoadNetwork, Route
from eidrive_scenario.roads.location import PositionError
from eidrive_scenario.storyboard.geographic import height_of_level, plane_coordinates
from eidrive_scenario.storyboard.motion import Place
from eidrive_scenario.storyboard.route import route_of
from eidrive_scenario.storyboard.stage import Stage
from eidrive_scenario.storyboard.trajectory import Layout, lay_out

FIXED = (model.WorldPosition, model.RoadPosition, model.LanePosition, model.GeoPosition)
"""Positions that mean the same place all the time."""
NESTING = (model.RoutePosition, model.TrajectoryPosition)
"""Positions along a route or trajectory, whose own points are positions."""
MAX_DEPTH = 10
"""Maximum number of such positions within each other."""
MAX_POSITIONS = 2000
"""Maximum number of such positions that one position leads through."""
CARLA = "CARLA:"
"""How the description of a scenario in CARLA's axes begins."""


def resolve(position: model.Position, stage: Stage, actor: str | None = None) -> Place:
    """The place that a position means now. `actor` is the entity that goes there; its route counts for some positions.

    Raises ScenarioError if the road network does not have it, Absent if it refers to an entity that is not in the
    world.
    """
    held = stage.fixed_places.get(id(position))
    if held is not None and held[0] is position:
        return held[1]
    frame = position.chosen()
    nesting = isinstance(frame, NESTING)
    try:
        if nesting:
            _enter(frame, stage)
        place = FRAMES[type(frame)](frame, stage, actor)
    except PositionError as error:
        raise _missing(frame, f"means no place: {error.problems[0].message}", error.problems[0].remedy) from error
    finally:
        if nesting:
            stage.position_depth -= 1
    if _stands_still(frame, stage):
        stage.fixed_places[id(position)] = (position, place)
    return place


def _enter(frame: model.Element, stage: Stage) -> None:
    """Count a position along a curve whose own points are positions. Raise ScenarioError if they multiply."""
    stage.positions_within = stage.positions_within + 1 if stage.position_depth else 0
    stage.position_depth += 1
    if stage.position_depth > MAX_DEPTH or stage.positions_within > MAX_POSITIONS:
        what = f"lies on curves of positions on curves, more than {MAX_DEPTH} deep or {MAX_POSITIONS} in total"
        raise _missing(frame, what, "name the places by roads and lanes")


def references(position: model.Position) -> tuple[str, ...]:
    """The entities that a position refers to."""
    return tuple(name for below in position.walk() if (name := getattr(below, "entity_ref", None)) is not None)


def left_handed(stage: Stage) -> bool:
    """True for a scenario whose world has CARLA's axes: y to the right, headings clockwise, pitch nose up.

    ScenarioRunner reads a description that begins with `CARLA:` so. Roads and lanes have the standard's axes all the
    same.
    """
    return str(stage.scenario.document.file_header.description).startswith(CARLA)


def _world(frame: model.WorldPosition, stage: Stage, actor: str | None) -> Place:
    side = -1.0 if left_handed(stage) else 1.0
    h, p, r = side * (frame.h or 0.0), side * (frame.p or 0.0), frame.r or 0.0
    return _on_ground(stage, Pose(frame.x, side * frame.y, frame.z or 0.0, h, p, r), z_given=frame.z is not None)


def _relative_world(frame: model.RelativeWorldPosition, stage: Stage, actor: str | None) -> Place:
    origin, side = stage.pose(frame.entity_ref), -1.0 if left_handed(stage) else 1.0
    x, y, z = origin.x + frame.dx, origin.y + side * frame.dy, origin.z + (frame.dz or 0.0)
    h, p, r = _angles(_turned(frame.orientation, side), origin)
    return _on_ground(stage, Pose(x, y, z, h, p, r), z_given=bool(frame.dz), near=frame.entity_ref)


def _relative_object(frame: model.RelativeObjectPosition, stage: Stage, actor: str | None) -> Place:
    origin, side = stage.pose(frame.entity_ref), -1.0 if left_handed(stage) else 1.0
    cos, sin, dy = math.cos(origin.h), math.sin(origin.h), side * frame.dy
    x = origin.x + frame.dx * cos - dy * sin
    y = origin.y + frame.dx * sin + dy * cos
    h, p, r = _angles(_turned(frame.orientation, side), origin)
    return _on_ground(
        stage, Pose(x, y, origin.z + (frame.dz or 0.0), h, p, r), z_given=bool(frame.dz), near=frame.entity_ref
    )


def _turned(orientation: model.Orientation | None, side: float) -> model.Orientation | None:
    """An orientation in the standard's axes, whose headings and pitches count to the other side in CARLA's."""
    if orientation is None or side > 0.0:
        return orientation
    return replace(orientation, h=side * (orientation.h or 0.0), p=side * (orientation.p or 0.0))


def _road(frame: model.RoadPosition, stage: Stage, actor: str | None) -> Place:
    roads = _roads(frame, stage)
    return _in_road(roads, frame.road_id, _on_road(frame, stage, roads), frame.t, frame.orientation)


def _relative_road(frame: model.RelativeRoadPosition, stage: Stage, actor: str | None) -> Place:
    roads, origin = _roads(frame, stage), _origin(frame, stage)
    here = along_reference(roads, origin, frame.ds, stage.actors[frame.entity_ref].motion.route)
    if here is None:
        raise _missing(frame, f"leads {frame.ds:g} m from {frame.entity_ref}, beyond the end of the road")
    return _in_road(roads, here.road, here.s, here.t + frame.dt, frame.orientation)


def _lane(frame: model.LanePosition, stage: Stage, actor: str | None) -> Place:
    roads = _roads(frame, stage)
    s = _on_road(frame, stage, roads)
    lane = _lane_id(frame, frame.lane_id)
    known = roads.lane_ids(frame.road_id, s)
    if lane not in known and lane != 0:
        shown = ", ".join(str(number) for number in known)
        raise _missing(frame, f"names lane {lane} of road {frame.road_id!r} at s = {s:g}", f"its lanes there: {shown}")
    return _in_lane(roads, frame.road_id, lane, s, frame.offset or 0.0, frame.orientation)


def _relative_lane(frame: model.RelativeLanePosition, stage: Stage, actor: str | None) -> Place:
    """`ds` runs along the reference line, `dsLane` along the lane as the entity faces; lanes count to its left."""
    roads, origin = _roads(frame, stage), _origin(frame, stage)
    route = stage.actors[frame.entity_ref].motion.route
    ahead = facing(stage, frame.entity_ref, origin)
    if frame.ds_lane is not None:
        there = roads.advance(origin._replace(offset=0.0), frame.ds_lane * ahead, route=route)
    else:
        there = along_reference(roads, origin, frame.ds or 0.0, route)
    if there is None:
        raise _missing(frame, f"lies beyond the end of the road of {frame.entity_ref}")
    sign = ahead * roads.driving_direction(there.road, there.lane)
    lane = count_lanes(there.lane, frame.d_lane * sign)
    if lane not in roads.lane_ids(there.road, there.s):
        raise _missing(frame, f"names lane {lane} of road {there.road!r}, which it does not have at s = {there.s:.1f}")
    place = _in_lane(roads, there.road, lane, there.s, frame.offset or 0.0, frame.orientation)
    if frame.orientation is None and ahead < 0:
        return place._replace(pose=place.pose.turned(math.pi))
    return place


def _route(frame: model.RoutePosition, stage: Stage, actor: str | None) -> Place:
    roads = _roads(frame, stage)
    within = frame.in_route_position.chosen()
    route = frame.route_ref.route or stage.catalog_entry(frame.route_ref.catalog_reference, model.Route, frame)
    path = route_of(route, roads, lambda position: resolve(position, stage, actor), seed=stage.seed)
    if isinstance(within, model.PositionOfCurrentEntity):
        here = _origin(within, stage)
        return _in_lane(roads, here.road, here.lane, here.s, here.offset, frame.orientation)
    if not isinstance(within, model.PositionInRoadCoordinates | model.PositionInLaneCoordinates):
        raise _missing(frame, f"says {type(within).__name__}, which is not known here")
    here = path.location_at(within.path_s)
    if not -1e-3 <= within.path_s <= path.length + 1e-3:
        raise _missing(frame, f"leads {within.path_s:g} m along a route of {path.length:.1f} m")
    if isinstance(within, model.PositionInRoadCoordinates):
        return _in_road(roads, here.road, here.s, within.t, frame.orientation, here.lane)
    lane = _lane_id(frame, within.lane_id)
    return _in_lane(roads, here.road, lane, here.s, within.lane_offset or 0.0, frame.orientation)


def _trajectory(frame: model.TrajectoryPosition, stage: Stage, actor: str | None) -> Place:
    """s and t along and beside the curve; a relative heading counts from its tangent (1.3.1, TrajectoryPosition)."""
    layout = trajectory_of(frame, stage, actor)
    at, tangent = layout.at(frame.s), layout.tangent(frame.s)
    offset = frame.t or 0.0
    x, y = at.x - offset * math.sin(tangent), at.y + offset * math.cos(tangent)
    h, p, r = _angles(frame.orientation, at._replace(h=tangent))
    return _on_ground(stage, Pose(x, y, at.z, h, p, r), z_given=True)


def trajectory_of(frame: model.TrajectoryPosition, stage: Stage, actor: str | None = None) -> Layout:
    """Return the trajectory along which a position counts, as it lies now."""
    trajectory = _trajectory_in(frame, stage)
    return lay_out(trajectory, lambda position: resolve(position, stage, actor).pose)


def _trajectory_in(frame: model.TrajectoryPosition, stage: Stage) -> model.Trajectory:
    if frame.trajectory_ref.trajectory is not None:
        return frame.trajectory_ref.trajectory
    return stage.catalog_entry(frame.trajectory_ref.catalog_reference, model.Trajectory, frame)


def _stands_still(frame: model.Element, stage: Stage) -> bool:
    """Whether a position means the same place all the time."""
    if not isinstance(frame, model.TrajectoryPosition):
        return isinstance(frame, FIXED)
    inner = (one for one in _trajectory_in(frame, stage).walk() if isinstance(one, model.Position))
    return all(_stands_still(one.chosen(), stage) for one in inner)


def _geo(frame: model.GeoPosition, stage: Stage, actor: str | None) -> Place:
    """By the road network's projection. Relative angles, and missing ones, refer to the lane there."""
    roads = _roads(frame, stage)
    x, y = plane_coordinates(frame, roads, stage)
    height = frame.altitude if frame.altitude is not None else frame.height
    z = height_of_level(frame, roads, x, y) if height is None else height - roads.header.offset[2]
    here = roads.locate_at(x, y, z=z)
    base = roads.pose(here) if here is not None else Pose(x, y, 0.0, 0.0, 0.0, 0.0)
    return Place(_oriented(frame.orientation, base._replace(x=x, y=y, z=base.z if z is None else z)), here)


FRAMES: dict[type[model.Element], Callable[[Any, Stage, str | None], Place]] = {
    model.WorldPosition: _world,
    model.RelativeWorldPosition: _relative_world,
    model.RelativeObjectPosition: _relative_object,
    model.RoadPosition: _road,
    model.RelativeRoadPosition: _relative_road,
    model.LanePosition: _lane,
    model.RelativeLanePosition: _relative_lane,
    model.RoutePosition: _route,
    model.TrajectoryPosition: _trajectory,
    model.GeoPosition: _geo,
}


def count_lanes(lane: int, steps: int) -> int:
    """The lane `steps` to the left (towards larger ids) of a lane; lane 0 is no lane and does not count."""
    target = lane + steps
    if steps and (target == 0 or (target > 0) != (lane > 0)):
        target += 1 if steps > 0 else -1
    return target


def along_reference(
    roads: RoadNetwork, here: LaneLocation, ds: float, route: Route | None = None
) -> LaneLocation | None:
    """The place `ds` metres further along the reference line, in the same or the connected lane, at the same offset.

    At forks the route decides.
    """
    road = roads.roads[here.road]
    s = here.s + ds
    if 0.0 <= s <= road.length:
        return here._replace(s=s)
    rest = s - road.length if s > road.length else s
    edge = here._replace(s=road.length if s > road.length else 0.0)
    return roads.advance(edge, rest * roads.driving_direction(here.road, here.lane), route=route)


def facing(stage: Stage, name: str, here: LaneLocation) -> int:
    """+1 where an actor points along the driving direction of its lane, -1 where against it."""
    if stage.roads is None:
        return 1
    lane = stage.roads.lane_pose_at(here.road, here.lane, here.s, here.offset).h
    along = math.cos(stage.pose(name).h - lane) * stage.roads.driving_direction(here.road, here.lane)
    return 1 if along >= 0.0 else -1


def _in_lane(
    roads: RoadNetwork, road: str, lane: int, s: float, offset: float, orientation: model.Orientation | None
) -> Place:
    here = roads.location(road, lane, s, offset)
    return Place(_oriented(orientation, roads.pose(here)), here)


def _in_road(
    roads: RoadNetwork, road: str, s: float, t: float, orientation: model.Orientation | None, lane: int | None = None
) -> Place:
    here = roads.road_location(road, s, t)
    if lane is not None:
        here = roads.location(road, lane, s, t - roads.location(road, lane, s).t)
    surface = roads.road_pose_at(road, s, t)
    along = orientation is not None or roads.driving_direction(road, here.lane) > 0
    return Place(_oriented(orientation, surface if along else surface.turned(math.pi)), here)


def _oriented(orientation: model.Orientation | None, base: Pose) -> Pose:
    h, p, r = _angles(orientation, base)
    level = base.turned(wrap_angle(h - base.h))
    if orientation is None:
        p, r = level.p, level.r
    elif orientation.type is model.ReferenceContext.RELATIVE:
        p, r = level.p + (orientation.p or 0.0), level.r + (orientation.r or 0.0)
    else:
        p, r = level.p if orientation.p is None else p, level.r if orientation.r is None else r
    return Pose(base.x, base.y, base.z, h, p, r)


def _angles(orientation: model.Orientation | None, base: Pose) -> tuple[float, float, float]:
    """Heading, pitch and roll; relative ones are added to the base's, missing ones are 0."""
    if orientation is None:
        return base.h, base.p, base.r
    h, p, r = orientation.h or 0.0, orientation.p or 0.0, orientation.r or 0.0
    if orientation.type is model.ReferenceContext.RELATIVE:
        return wrap_angle(base.h + h), base.p + p, base.r + r
    return h, p, r


def _on_ground(stage: Stage, pose: Pose, *, z_given: bool, near: str | None = None) -> Place:
    """The place of a pose in the world: on the road below it where there is one, first looked for `near` an actor."""
    if stage.roads is None:
        return Place(pose)
    here = stage.roads.locate_at(pose.x, pose.y, None if near is None else stage.location(near))
    if here is None:
        return Place(pose)
    if not z_given:
        ground = stage.roads.lane_pose_at(here.road, here.lane, here.s, here.offset)
        level = ground.turned(wrap_angle(pose.h - ground.h))
        pose = Pose(pose.x, pose.y, ground.z, pose.h, pose.p or level.p, pose.r or level.r)
    return Place(pose, here)


def _origin(frame: Any, stage: Stage) -> LaneLocation:
    here = stage.location(frame.entity_ref)
    if here is None:
        raise _missing(frame, f"starts from {frame.entity_ref}, which is not on a road")
    return here


def _roads(frame: model.Element, stage: Stage) -> RoadNetwork:
    if stage.roads is None:
        raise _missing(frame, "needs a road network", "name one in RoadNetwork/LogicFile, or use a WorldPosition")
    return stage.roads


def _on_road(frame: model.RoadPosition | model.LanePosition, stage: Stage, roads: RoadNetwork) -> float:
    """The position's s; one that lies beyond an end of its road means that end, with a warning."""
    road, s = frame.road_id, frame.s
    if road not in roads.roads:
        shown = ", ".join(sorted(roads.roads)[:12])
        raise _missing(frame, f"names road {road!r}, which the road network does not have", f"it has {shown}")
    length = roads.roads[road].length
    on_road = min(max(s, 0.0), length)
    if abs(on_road - s) > 1e-3:
        message = f"{type(frame).__name__} says s = {s:g} on road {road!r}: its end is meant"
        problem = Problem(message, f"that road is {length:.2f} m long", frame.source, frame.line)
        if problem not in stage.warnings:
            stage.warnings.append(problem)
    return on_road


def _lane_id(frame: model.Element, text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise _missing(frame, f"says laneId {text!r}", "give a whole number") from None


def _missing(frame: model.Element, message: str, remedy: str = "") -> ScenarioError:
    return ScenarioError(Problem(f"{type(frame).__name__} {message}", remedy, frame.source, frame.line))

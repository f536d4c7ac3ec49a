"""Distances between entities and to positions as defined by the standard for conditions and actions."""

from __future__ import annotations

import math

from eidrive_scenario.base.geometry import box_distance
from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import Chain, LaneLocation, Pose, RoadNetwork
from eidrive_scenario.storyboard.context.contexts import ConditionContext, EntityAbsentError
from eidrive_scenario.storyboard.kinematics.motion import ACROSS
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.kinematics.trajectory import TrajectoryProgress

Box = tuple[float, float, float, float, float, float, float]
"""x, y, z of the center, length, width, height [m], yaw [rad]."""

Velocity = tuple[float, float, float]
"""Velocity along x, y and z [m/s]."""


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
    theirs = (0.0, 0.0)
    if b is not None:
        there, heading = _axis_at(context, a, b, frame, axis), context.pose(b).h
        if frame == "trajectory" and context.actors[a].progress is not None:
            # Beside a trajectory a box counts with its own length and width.
            there = heading if math.cos(heading - there) >= 0.0 else heading + math.pi
        theirs = _extent(context, b, there, frame, kind)
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
    progress = context.actors[name].progress if frame == "trajectory" else None
    if progress is not None:
        along = progress.layout.tangent(progress.at(context.view.tick))
        heading = along if progress.way > 0 else along + math.pi
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
            ways = [roads.driving_direction(location.road, location.lane) for location in (here, there)]
            is_along = math.cos(axis - roads.pose(here).h) >= 0.0
            return roads.pose(there).h + (0.0 if is_along == (ways[0] * ways[1] * runs > 0) else math.pi)
    progress = context.actors[a].progress if frame == "trajectory" else None
    if progress is not None:
        station, pose = progress.at(context.view.tick), context.pose(b)
        layout = progress.layout
        return axis + layout.tangent(layout.project(pose.x, pose.y, station)[0]) - layout.tangent(station)
    return axis


def _extent(context: ConditionContext, name: str, axis: float, frame: str, kind: str) -> tuple[float, float]:
    """Return minimum and maximum of the box of an actor along an axis or the road, from its reference point [m]."""
    if frame in ("lane", "road") and context.roads is not None:
        here = context.location(name)
        if here is not None and context.roads.curvature(here.road, here.s) != 0.0:
            return _extent_on_bend(context, context.roads, name, here, axis, frame, kind)
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
    context: ConditionContext, roads: RoadNetwork, name: str, here: LaneLocation, axis: float, frame: str, kind: str
) -> tuple[float, float]:
    """Return the extent along a curved road or lane, from the corners of the box in road coordinates [m]."""
    x, y, _, length, width, _, yaw = entity_box(context, name)
    cos, sin = math.cos(yaw), math.sin(yaw)
    sign = 1.0 if math.cos(roads.pose(here).h - axis) >= 0.0 else -1.0
    extents = []
    for along, across in ((0.5, 0.5), (0.5, -0.5), (-0.5, 0.5), (-0.5, -0.5)):
        dx, dy = along * length, across * width
        corner = roads.locate_at(x + dx * cos - dy * sin, y + dx * sin + dy * cos, here)
        distances = None if corner is None else roads.distance(here, corner, along_lane=frame == "lane")
        if distances is not None:
            extents.append(sign * distances[0 if kind == "longitudinal" else 1])
    return min(extents, default=0.0), max(extents, default=0.0)


TIME_DELTA = 1e-3
"""Time step of the finite difference of a distance [s]."""

ROUTE_CRITERIA: dict[model.RoutingAlgorithm | None, Chain] = {
    model.RoutingAlgorithm.FASTEST: "fastest",
    model.RoutingAlgorithm.LEAST_INTERSECTIONS: "leastIntersections",
}
"""Criterion of the route by algorithm; the default is the shortest route."""


def resolve_distance_type(kind: model.RelativeDistanceType | None) -> str:
    """Return longitudinal, lateral or euclidianDistance, the default."""
    if kind is None or kind is model.RelativeDistanceType.CARTESIAN_DISTANCE:
        return "euclidianDistance"
    return str(kind.value)


def resolve_coordinate_system(system: model.CoordinateSystem | None) -> str:
    """Return entity (the default), lane, road, trajectory or world."""
    return "entity" if system is None else str(system.value)


def distance(
    context: ConditionContext,
    a: str,
    b: str | ResolvedPosition,
    *,
    frame: str,
    kind: str,
    freespace: bool,
    algorithm: model.RoutingAlgorithm | None = None,
) -> float:
    """Return the distance from actor `a` to `b`, an actor or a position [m]; NaN if the frame defines none.

    The Euclidean distance is three-dimensional. Longitudinal distances are positive ahead of `a`, lateral ones to its
    left. Free space is 0 if both overlap along the axis. In the frames of lane and road the algorithm selects the route
    to measure along. In that of the trajectory the axis of `a` is the trajectory that it follows; without one its
    heading.
    """
    if kind == "euclidianDistance":
        if not freespace:
            return math.dist(context.pose(a)[:3], _pose(context, b)[:3])
        box = entity_box(context, b) if isinstance(b, str) else (*b.pose[:3], 0.0, 0.0, 0.0, 0.0)
        return box_distance(entity_box(context, a), box)
    here = ResolvedPosition(context.pose(a), context.location(a) if frame in ("lane", "road") else None)
    along, across = _offsets(context, a, here, b, frame, algorithm)
    value = along if kind == "longitudinal" else across
    if not freespace or math.isnan(value):
        return value
    return free_space(context, a, b if isinstance(b, str) else None, frame, kind, value)


def same_way(context: ConditionContext, a: str, b: str, frame: str) -> float:
    """Return +1.0 if actor `b` points in the direction of `a`, -1.0 for the opposite direction.

    The frames of lane and road compare directions along the road between both, that of the world directions along x,
    other frames the headings.
    """
    if frame == "world":
        return math.copysign(1.0, math.cos(context.pose(a).h) * math.cos(context.pose(b).h))
    turn = context.pose(b).h - context.pose(a).h
    if frame in ("lane", "road") and context.roads is not None:
        here, there = context.location(a), context.location(b)
        relative_direction = None if here is None or there is None else context.roads.orientation(here, there)
        if relative_direction is not None and here is not None and there is not None:
            headings = [context.roads.road_pose_at(location.road, location.s).h for location in (here, there)]
            turn += headings[0] - headings[1] + (0.0 if relative_direction > 0 else math.pi)
    return 1.0 if math.cos(turn) >= 0.0 else -1.0


def axis_headings(context: ConditionContext, a: str, b: str, frame: str) -> tuple[float, float]:
    """Return the headings of the longitudinal axis of actor `a` at `a` and at actor `b` [rad].

    In the entity frame the axis of an actor that drives along its road turns with the road.
    """
    axis = _own_axis(context, a, frame)
    here, roads = context.location(a), context.roads
    if frame == "entity" and here is not None and roads is not None:
        frame = "road" if abs(math.cos(axis - roads.pose(here).h)) >= ACROSS else frame
    return axis, _axis_at(context, a, b, frame, axis)


class MovedContext(ConditionContext):
    """State of the run whose actors have moved for a duration [s] at their current velocities and yaw rates."""

    def __init__(self, context: ConditionContext, duration: float) -> None:
        self.__dict__.update(vars(context))
        self._now, self._duration = context, duration

    def pose(self, name: str) -> Pose:
        """Return the pose of an actor after the duration. Raise EntityAbsentError if it is not in the view."""
        pose = self._position(name).pose
        return pose.turned(float(self.view.yaw_rate[self.view.row(name)]) * self._duration)

    def location(self, name: str) -> LaneLocation | None:
        """Return the lane location of an actor after the duration. Raise EntityAbsentError if it is not in the view."""
        return self._position(name).location

    def _position(self, name: str) -> ResolvedPosition:
        now = self._now
        if name not in now.view:
            raise EntityAbsentError(name)
        position = ResolvedPosition(now.pose(name), now.location(name))
        return _moved(now, position, _velocity(now, name), self._duration)


def closing_speed(
    context: ConditionContext,
    a: str,
    b: str | ResolvedPosition,
    *,
    frame: str,
    kind: str,
    freespace: bool = False,
    algorithm: model.RoutingAlgorithm | None = None,
    velocity: Velocity = (0.0, 0.0, 0.0),
) -> float:
    """Return the closing speed of actor `a` and `b` [m/s] in the frame and kind of their distance.

    Return NaN if the frame defines no distance. Both move at their current velocities, also along roads and
    trajectories; that of a position is `velocity`.
    """
    mine, theirs = _velocity(context, a), _velocity(context, b) if isinstance(b, str) else velocity
    here, there = (ResolvedPosition(_pose(context, target), _location(context, target)) for target in (a, b))
    if kind == "euclidianDistance":

        def space_after(duration: float) -> float:
            other = b if isinstance(b, str) else _moved(context, b, theirs, duration)
            return distance(MovedContext(context, duration), a, other, frame=frame, kind=kind, freespace=True)

        if freespace and space_after(0.0) > 0.0:
            # The nearest points of both boxes change while these pass each other
            return (space_after(-TIME_DELTA) - space_after(TIME_DELTA)) / (2.0 * TIME_DELTA)
        gap = math.dist(here.pose[:3], there.pose[:3])
        axes = zip(here.pose[:3], there.pose[:3], mine, theirs, strict=True)
        return sum((b - a) * (v - w) for a, b, v, w in axes) / gap if gap > 0.0 else 0.0
    axis = 0 if kind == "longitudinal" else 1
    now = _offsets(context, a, here, there, frame, algorithm)[axis]
    sign = math.copysign(1.0, now)

    def after(duration: float) -> float:
        own, other = _moved(context, here, mine, duration), _moved(context, there, theirs, duration)
        return _offsets(context, a, own, other, frame, algorithm)[axis]

    if kind == "longitudinal":
        return sign * (now - after(TIME_DELTA)) / TIME_DELTA
    # A motion along a bend changes lateral distances in second order of time, which cancels between both directions.
    return 0.0 if abs(now) < EPSILON else sign * (after(-TIME_DELTA) - after(TIME_DELTA)) / (2.0 * TIME_DELTA)


def _velocity(context: ConditionContext, name: str) -> Velocity:
    x, y, z = context.view.velocity[context.view.row(name)].tolist()
    return x, y, z


def _moved(
    context: ConditionContext, position: ResolvedPosition, velocity: Velocity, duration: float
) -> ResolvedPosition:
    """Return the position after a duration [s] at this velocity."""
    x, y, z = (now + rate * duration for now, rate in zip(position.pose[:3], velocity, strict=True))
    location = context.roads.locate_at(x, y, position.location) if context.roads is not None else None
    return ResolvedPosition(position.pose._replace(x=x, y=y, z=z), location)


def _offsets(
    context: ConditionContext,
    a: str,
    mine: ResolvedPosition,
    b: str | ResolvedPosition,
    frame: str,
    algorithm: model.RoutingAlgorithm | None,
) -> tuple[float, float]:
    """Return the longitudinal and the lateral offset of `b` from actor `a` at `mine` [m]."""
    here, there = mine.pose, _pose(context, b)
    if frame in ("lane", "road") and context.roads is not None:
        start, end, along_lane = mine.location, _location(context, b), frame == "lane"
        if start is None or end is None:
            return math.nan, math.nan
        if algorithm is model.RoutingAlgorithm.ASSIGNED_ROUTE:
            route = context.actors[a].motion.route
            distances = None
            if route is not None:
                distances = context.roads.distance(start, end, route=route, along_lane=along_lane)
        else:
            criterion = ROUTE_CRITERIA.get(algorithm, "shortest")
            distances = context.roads.distance(start, end, criterion, along_lane=along_lane)
        if distances is None:
            return math.nan, math.nan
        lane = context.roads.pose(start)
        sign = 1.0 if math.cos(here.h - lane.h) >= 0.0 else -1.0
        return distances[0] * sign, distances[1] * sign
    if frame == "world":
        return there.x - here.x, there.y - here.y
    progress = context.actors[a].progress if frame == "trajectory" else None
    if progress is not None:
        return _along_trajectory(progress, progress.at(context.view.tick), here, there)
    dx, dy = there.x - here.x, there.y - here.y
    cos, sin = math.cos(here.h), math.sin(here.h)
    return dx * cos + dy * sin, dy * cos - dx * sin


def _along_trajectory(progress: TrajectoryProgress, station: float, here: Pose, there: Pose) -> tuple[float, float]:
    """Return the offsets along a trajectory and to its left [m]; on a closed one the shorter of both directions.

    `here` is at the station of the actor or beside it, as the trajectory may pass the same point several times.
    """
    trajectory = progress.layout
    origin, tangent = trajectory.extended(station), trajectory.tangent(station)
    dx, dy, cos, sin = here.x - origin.x, here.y - origin.y, math.cos(tangent), math.sin(tangent)
    s, t = station + dx * cos + dy * sin, dy * cos - dx * sin
    other_s, other_t = trajectory.project(there.x, there.y, s)
    along = other_s - s
    if trajectory.closed and trajectory.length > 0.0:
        along = math.remainder(along, trajectory.length)
    return along * progress.way, (other_t - t) * progress.way


def _pose(context: ConditionContext, target: str | ResolvedPosition) -> Pose:
    return context.pose(target) if isinstance(target, str) else target.pose


def _location(context: ConditionContext, target: str | ResolvedPosition) -> LaneLocation | None:
    if isinstance(target, str):
        return context.location(target)
    if target.location is None and context.roads is not None:
        return context.roads.locate_at(target.pose.x, target.pose.y)
    return target.location

"""Scripted motion of actors along their lane, along a trajectory or freely.

Integration is semi-implicit: the distance of a step is the speed at its end times the time step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.roads import BranchSelector, LaneKey, LaneLocation, Pose, RoadNetwork, Route
from eidrive_scenario.roads.geometry.poses import lane_t
from eidrive_scenario.roads.routing.route import LANE_CHANGE_LENGTH, smoothstep
from eidrive_scenario.storyboard.kinematics.motion_state import MotionState, ResolvedPosition
from eidrive_scenario.world.actor import Placement

ACROSS = math.cos(math.radians(50.0))
"""Cosine of the maximum angle to the lane, 50°: an actor that is placed at a larger angle crosses the road."""
STEEPEST = math.sqrt(0.5)
"""Maximum ratio of lateral speed to speed: an actor moves at 45° to its lane at most."""


class LateralStep(NamedTuple):
    """Lateral part of the motion of one step.

    offset     offset from the lane center at the end of the step [m], left of the driving direction positive
    heading    angle to the lane after the step [rad]; None derives it from the motion
    shortens_distance  whether the lateral distance is part of the distance that the speed covers
    distance   distance of the step [m]; None derives it from the speed
    rate       rate of the offset at the end of the step [m/s]: the heading is that of this instant. None: the heading
               is the mean of the step
    """

    offset: float
    heading: float | None = None
    shortens_distance: bool = True
    distance: float | None = None
    rate: float | None = None


class Motion(MotionState):
    """Motion of one scripted actor. Actions request changes by methods; attributes of the state are read-only."""

    def __init__(self, roads: RoadNetwork | None) -> None:
        super().__init__(roads)
        self._visit = 0
        self._route_lanes = RouteLanes(roads) if roads is not None else None
        self._lateral_step: LateralStep | None = None
        self._next_pose: Pose | None = None
        self._snaps_to_lane = False
        self._pose_at_distance: Callable[[float], Pose] | None = None
        self._lane_distance: float | None = None
        self._carried = True
        self._crosses = False
        self._teleport = False
        self._leaves_curve = False
        """Whether the speed refers to the heading after the current step, and no longer to a trajectory."""
        self._stops = False
        """Whether the actor stops in the next step, unless an action moves it."""

    @property
    def course(self) -> float:
        """Direction in which a positive speed moves the actor [rad]: that of its lane, or along or against its heading.

        On a trajectory with other headings it is that of the trajectory instead.
        """
        if self._location is not None and not self._crosses:
            return self._pose.h - self._heading + (0.0 if self.direction > 0 else math.pi)
        return self._pose.h + math.pi if self._backs else self._pose.h

    def set_speed(self, speed: float, sense: int | None = None) -> None:
        """Set the speed [m/s] from the current step on.

        sense  sense to which the sign of the speed refers; by default the present one
        """
        self._speed = speed if sense is None or sense == self._sense else 0.0 - speed
        self._rests = self._stops = False

    def set_backing(self, backs: bool) -> None:
        """Set whether a positive speed moves the actor against its heading, as on a trajectory with such headings."""
        self._backs, self._rests = backs, False

    def leave_curve(self, *, after_step: bool) -> None:
        """Let the speed refer to the heading, at once or after the current step, which is on the trajectory.

        The actor continues its motion: where it moves against its heading, the sense of its speed is inverted.
        """
        self._leaves_curve = after_step
        if not after_step:
            if self._backs:
                self._sense = -self._sense
            self._speed, self._backs, self._rests = self.speed_along_heading, False, False

    def set_route(self, route: Route | None, branch_selector: BranchSelector | None = None) -> None:
        """Set the route, and the selector of branches at junctions that the route does not cover."""
        self._route, self._visit, self._branch_selector, self._rests = route, 0, branch_selector, False

    def teleport(self, position: ResolvedPosition) -> None:
        """Teleport the actor; its speed is kept.

        The current step covers no distance, as the next view shows this pose, unless a later action requests one.
        """
        self._pose = position.pose
        self._set_location(position.location)
        self._crosses = self._location is not None and abs(math.cos(self._heading)) < ACROSS
        self._end_of_road = False
        if self._route_lanes is not None:
            self._route_lanes.forget()
        self._rests, self._lane_distance = False, None
        self._teleport = self._teleported = True
        self._teleports += 1

    def initialize(self) -> None:
        """Set the pose of the first view after Init; the first step of the run moves the actor from this pose."""
        self._teleport = False
        self.step(0.0)

    def set_lateral_step(self, steering: LateralStep) -> None:
        """Set the lateral part of the current step."""
        self._lateral_step, self._rests = steering, False

    def apply_lateral_step(self) -> None:
        """Execute the lateral part of the current step at once, so that later actions of the tick start from it."""
        steering = self._lateral_step
        if steering is None or self._location is None or self._crosses:
            return
        self._lateral_step = None
        if self._route_lanes is not None:
            self._route_lanes.forget()
        self._move_along_lane(0.0, steering, 0.0)

    def move_to(
        self, pose: Pose, *, land: bool = False, jump: bool = False, rail: Callable[[float], Pose] | None = None
    ) -> None:
        """Set the pose at the end of the current step, independent of lanes.

        land   assign the actor to the lane at this pose, which it then follows; without roads it stops there unless an
               action moves it on
        jump   teleport: the distance does not count as covered
        rail   returns the pose after a given distance [m]; used if `move_along_lane` sets the distance of the step
        """
        self._next_pose, self._pose_at_distance, self._rests = pose, rail, False
        self._snaps_to_lane = land
        self._teleported = self._teleported or jump

    def move_along_lane(self, distance: float, *, carried: bool = True) -> None:
        """Set the distance of the current step along lane or trajectory [m], independent of the speed.

        carried  whether an actor that crosses the road moves along the lane as well, and not along its heading
        """
        self._lane_distance, self._carried, self._rests = distance, carried, False

    def discard_requests(self, *, lateral: bool, longitudinal: bool) -> None:
        """Discard requests for the current step whose action ends before the step."""
        if lateral:
            self._lateral_step = self._next_pose = None
        if longitudinal:
            self._lane_distance = None

    def set_reference_lane(self, lane: int) -> LaneLocation | None:
        """Refer the location to another lane of the same road. Return it with the offset from that lane."""
        here = self._location
        if here is not None and self.roads is not None and here.lane != lane:
            directions = [self.roads.driving_direction(here.road, number) for number in (here.lane, lane)]
            if directions[0] != directions[1]:
                self._heading = wrap_angle(self._heading + math.pi)
            self._rests = False
            here = here._replace(lane=lane, offset=here.t - self.roads.location(here.road, lane, here.s).t)
            self._location = here
        return here

    def set_observed_state(self, pose: Pose, speed: float) -> None:
        """Set pose and speed [m/s] of a driven vehicle to those of the view."""
        self._pose, self._speed, self._rests = pose, speed, False

    def set_towed_state(self, pose: Pose, front: Motion) -> None:
        """Set the pose of a trailer, which teleports with its towing vehicle. Requests of the current step are void."""
        self._pose, self._speed = pose, front.speed_along_heading * math.cos(pose.h - front.pose.h)
        self._teleported = self._teleported or front.teleported
        self._location = self._lateral_step = self._next_pose = self._lane_distance = None
        self._teleport = self._crosses = self._end_of_road = self._backs = self._rests = False

    def clear_teleported(self) -> None:
        """Clear `teleported`, as a view shows the new pose."""
        self._teleported = False

    def snap_to_lane(self) -> None:
        """Assign the actor to the lane at its pose, on its route if lanes overlap; it follows it at its present angle.

        An actor outside the road that does not point along it keeps its heading.
        """
        self._crosses = self._rests = False
        x, y, z, h, _, _ = self._pose
        before = self._location if self._route is None else self._route.location_at(self._route.project(x, y)[0])
        location = self.roads.locate_pose(x, y, h, z, before) if self.roads is not None else None
        self._set_location(location)
        if self._location is not None and self.roads is not None and abs(math.cos(self._heading)) < ACROSS:
            self._crosses = not self.roads.on_road(self._location)

    def step(self, dt: float) -> Placement:
        """Execute the requests of the step of `dt` [s]; return the placement after it."""
        steering, self._lateral_step = self._lateral_step, None
        target, self._next_pose = self._next_pose, None
        lane_distance, self._lane_distance = self._lane_distance, None
        if steering is not None and lane_distance is not None:
            # The requested distance applies, not that of the speed at which the lateral action decided.
            steering = steering._replace(distance=None)
        if self._stops and target is None:
            self._speed = 0.0
        self._stops = False
        distance = self._speed * dt if lane_distance is None else lane_distance
        along_lane = not self._crosses or (lane_distance is not None and self._carried)
        if self._teleport:
            self._teleport = False
            if lane_distance is not None and target is None:
                self._move(distance, None, dt, along_lane=along_lane)
            placement = self.placement()
            if self._leaves_curve:
                self.leave_curve(after_step=False)
            return placement
        if target is not None and lane_distance is not None and self._pose_at_distance is not None:
            target = self._pose_at_distance(lane_distance)
        if self._route is not None and self._route_lanes is not None:
            if steering is None and target is None and lane_distance is None and distance > 0.0 and not self._crosses:
                steering = self._step_towards_route(distance)
            else:
                self._route_lanes.forget()
        if target is not None:
            self._pose = target
            self._location = None
            self._end_of_road = False
            if self._snaps_to_lane:
                self.snap_to_lane()
                self._stops = self.roads is None
        elif distance == 0.0 and steering is None:
            stands = self._speed == 0.0 and math.copysign(1.0, self._speed) == 1.0
            self._rests = stands and not self._end_of_road and not self._teleported
        else:
            self._move(distance, steering, dt, along_lane=along_lane)
        x, y, z, h, p, r = self._pose
        across = distance == 0.0 or target is not None or lane_distance is not None
        speed = self.speed_along_heading
        if self._leaves_curve:
            self.leave_curve(after_step=False)
        return Placement(x, y, z, h, p, r, speed, target is not None and self._teleported, across)

    def placement(self, *, teleport: bool = True) -> Placement:
        """Return the current placement."""
        x, y, z, h, p, r = self._pose
        return Placement(x, y, z, h, p, r, self.speed_along_heading, teleport)

    def _move(self, distance: float, steering: LateralStep | None, dt: float, *, along_lane: bool) -> None:
        if along_lane and self._location is not None:
            self._move_along_lane(distance, steering, dt)
        else:
            self._move_freely(distance)

    def _move_along_lane(self, distance: float, steering: LateralStep | None, dt: float) -> None:
        assert self.roads is not None
        assert self._location is not None
        here, left, total = self._location, 0.0, distance
        if steering is not None:
            way = self.roads.driving_direction(here.road, here.lane)
            left = steering.offset - here.offset * way
            here = here._replace(offset=steering.offset * way, t=here.t + left * way)
            if steering.distance is not None:
                distance = total = math.copysign(steering.distance, distance)
            if steering.shortens_distance:
                distance = math.copysign(math.sqrt(max(0.0, distance * distance - left * left)), distance)
        lane_pose: Pose | None = None
        if distance != 0.0:
            direction = self.direction
            here, lane_pose = self._advance(here, distance * direction)
            if left and self.direction != direction:
                left = -left
        if steering is not None:
            self._heading = wrap_angle(
                (0.0 if self.direction > 0 else math.pi) + self._angle_to_lane(steering, left, distance, total, dt)
            )
        if lane_pose is None:
            lane_pose = self.roads.lane_pose_at(here.road, here.lane, here.s, here.offset)
        self._location = here
        against = self.roads.roads[here.road].directions[here.lane] < 0
        turn = self._heading + math.pi if against else self._heading
        x, y, z, h, p, r = lane_pose
        if p == 0.0 and r == 0.0:
            h += turn
        else:
            _, _, _, h, p, r = lane_pose.turned(turn)
        # twice as fast as the constructor of the named tuple
        self._pose = tuple.__new__(Pose, (x, y, z if self._lift == 0.0 else z + self._lift, wrap_angle(h), p, r))

    def _advance(self, here: LaneLocation, distance: float) -> tuple[LaneLocation, Pose | None]:
        """Return the location at a distance along lane and route [m] or at the end of the lane, where the actor stops.

        The actor turns by 180° to its lane where it enters one against the traffic, so that it keeps its yaw.
        The pose with the heading of the lane along s is returned as well if the actor remains in its lane section.
        """
        assert self.roads is not None
        within = self.roads.movement.step_in_section(here, distance)
        if within is not None:
            self._end_of_road = False
            if self._route is not None:
                self._enter_lap(here, within[0])
            return within
        travel = partial(self.roads.movement.travel, here, distance, self._route, self._branch_selector, self._visit)
        end = travel()
        if end is None:
            end = travel(to_end=True)
            assert end is not None
            if self._end_of_road:
                self._speed = 0.0
            self._end_of_road = True
        else:
            self._end_of_road = False
        reached, direction = end
        if (direction > 0) != (self.roads.driving_direction(reached.road, reached.lane) * distance > 0.0):
            self._heading = wrap_angle(self._heading + math.pi)
        if self._route is not None and reached.road != here.road:
            self._visit = self._route.visit(reached.road, self._visit)
        self._enter_lap(here, reached)
        return reached, None

    def _step_towards_route(self, distance: float) -> LateralStep | None:
        """Return the lateral step towards a lane that continues along the route; None if the current one does."""
        assert self._route is not None
        assert self._route_lanes is not None
        if self._location is None or self.direction < 0 or self.roads is None:
            return None
        step = self._route_lanes.step(self._location, distance, self._route, self._visit)
        if step is None:
            return None
        lane, offset, done = step
        self.set_reference_lane(lane)
        way = self.roads.driving_direction(self._location.road, lane)
        return LateralStep(offset * way, heading=0.0 if done else None)

    def _enter_lap(self, before: LaneLocation, after: LaneLocation) -> None:
        """Set the lap of a closed route as the route once a step passes the start of the lap."""
        lap = self._route.lap if self._route is not None else None
        if lap is None or self.roads is None or after.road != lap.start.road:
            return
        way = self.roads.driving_direction(after.road, after.lane) * (-1 if lap.against_traffic else 1)
        reached = (after.s - lap.start.s) * way >= 0.0
        if reached and (before.road != after.road or (before.s - lap.start.s) * way < 0.0):
            self._route, self._visit = lap, 0

    def _angle_to_lane(self, steering: LateralStep, left: float, distance: float, total: float, dt: float) -> float:
        """Return the angle to the lane [rad] in a step of `total` [m]: `distance` along the lane, `left` across it."""
        if steering.heading is not None:
            return steering.heading
        if steering.rate is not None:
            left = steering.rate * dt
            if steering.shortens_distance:
                distance = math.copysign(math.sqrt(max(0.0, total * total - left * left)), total)
        if distance == 0.0 or left == 0.0:
            return 0.0
        return math.atan(left * self.direction / distance)

    def _move_freely(self, distance: float) -> None:
        x, y, z, h, p, r = self._pose
        self._pose = Pose(x + distance * math.cos(h), y + distance * math.sin(h), z, h, p, r)
        if self.roads is None or distance == 0.0:
            return
        before = self._location
        location = self.roads.locate_at(self._pose.x, self._pose.y, before)
        if location is not None:
            ground = self.roads.lane_pose_at(*location[:4])
            self._pose = Pose(*self._pose[:2], ground.z, h, *ground.turned(wrap_angle(h - ground.h))[4:])
        self._set_location(location)
        if before is None and self._location is not None:
            self._crosses = abs(math.cos(self._heading)) < ACROSS


MIN_LANE_CHANGE_LENGTH = 1.0
"""Minimum length of a lane change [m]."""


@dataclass(frozen=True)
class LaneChange:
    """Lane change within one lane section.

    s       start [m]
    span    length [m]
    offset  offset from the lane center that is kept [m]
    """

    road: str
    section: int
    before: int
    after: int
    s: float
    span: float
    offset: float


class RouteLanes:
    """Lateral motion of an actor that keeps it on its route."""

    def __init__(self, roads: RoadNetwork) -> None:
        self._roads = roads
        self._queried: tuple[Route, int, str, int] | None = None
        self._leading: list[frozenset[int]] = []
        self._change: LaneChange | None = None

    def forget(self) -> None:
        """Discard the current lane change, as another source moves the actor laterally."""
        self._change = None

    def step(self, here: LaneLocation, distance: float, route: Route, visit: int) -> tuple[int, float, bool] | None:
        """Return lane, offset from its center after `distance` [m], and whether the lane change is complete.

        Return None if the lane is kept. The actor moves in driving direction, on road number `visit` of the route.
        """
        road = self._roads.roads[here.road]
        section = road.section_at(here.s)
        way = self._roads.driving_direction(here.road, here.lane)
        change = self._change
        if change is None or (change.road, change.section) != (here.road, section.index):
            change = self._change = self._required_change(here, section.index, way, route, visit)
            if change is None:
                return None
        s = min(max(here.s + way * distance, section.s), section.end)
        part = min(abs(s - change.s) / change.span, 1.0)
        lanes = (section.lanes[change.before], section.lanes[change.after])
        before, after = (lane_t(road, section, lane, s)[0] for lane in lanes)
        done = part >= 1.0
        if done:
            self._change = None
        offset = change.offset + smoothstep(part) * (after - before)
        return (change.after, offset + before - after, done) if part > 0.5 else (change.before, offset, done)

    def _required_change(
        self, here: LaneLocation, section: int, way: int, route: Route, visit: int
    ) -> LaneChange | None:
        query = (route, visit, here.road, way)
        if self._queried is None or self._queried[0] is not route or self._queried[1:] != query[1:]:
            self._queried, self._leading = query, self._lanes_to_next(here.road, way, route, visit)
        leading = self._leading[section] if section < len(self._leading) else frozenset()
        if not leading or here.lane in leading:
            return None
        road = self._roads.roads[here.road]
        lane_section = road.sections[section]
        nearest = min(leading, key=lambda lane: abs(lane - here.lane))
        rest = lane_section.end - here.s if way > 0 else here.s - lane_section.s
        rest_of_road = road.length - here.s if way > 0 else here.s
        wanted = LANE_CHANGE_LENGTH * abs(nearest - here.lane)
        if rest_of_road > wanted and (rest_of_road == rest or self._has_successor(here, section, way)):
            return None
        if rest < MIN_LANE_CHANGE_LENGTH:
            return None
        return LaneChange(here.road, section, here.lane, nearest, here.s, min(wanted, rest), here.offset)

    def _has_successor(self, here: LaneLocation, section: int, way: int) -> bool:
        key = LaneKey(here.road, section, here.lane)
        return any(other.road == here.road for other, _ in self._roads.links.beyond(key, way))

    def _lanes_to_next(self, road_id: str, way: int, route: Route, visit: int) -> list[frozenset[int]]:
        """Return for each lane section of a road the lanes that are linked to the next road of the route."""
        road, following = self._roads.roads[road_id], route.passes(visit + 1)
        if following is None or route.passes(visit) != road_id:
            return []
        leading: list[frozenset[int]] = [frozenset()] * len(road.sections)
        for section in reversed(road.sections) if way > 0 else road.sections:
            leading_here = set()
            for lane in section.lanes.values():
                if lane.id == 0 or not lane.drivable or self._roads.driving_direction(road_id, lane.id) != way:
                    continue
                for key, _ in self._roads.links.beyond(LaneKey(road_id, section.index, lane.id), way):
                    inside = key.road == road_id and key.section == section.index + way
                    if key.lane in leading[key.section] if inside else key.road == following:
                        leading_here.add(lane.id)
            leading[section.index] = frozenset(leading_here)
        return leading

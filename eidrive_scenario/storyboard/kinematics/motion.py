"""Scripted motion: where an actor without an engine of its own goes, along its lane or freely.

Speeds are applied as in a semi-implicit step: the speed at the end of a step covers the step's distance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.roads import BranchSelector, LaneLocation, Pose, RoadNetwork, Route
from eidrive_scenario.storyboard.kinematics.motion_state import MotionState, ResolvedPosition
from eidrive_scenario.storyboard.kinematics.route_lanes import RouteLanes
from eidrive_scenario.world.actor import Placement

ACROSS = math.cos(math.radians(50.0))
"""An actor that is placed pointing further away from its lane than 50° crosses the road instead of following it."""
STEEPEST = math.sqrt(0.5)
"""Share of its speed that an actor goes sideways at most: as fast as forwards, at 45° to its lane."""


class LateralStep(NamedTuple):
    """The lateral motion of one step: the offset from the center of its lane at the end of the step [m].

    offset   left of the lane's driving direction positive
    heading  angle to the lane's direction after the step [rad]; None follows from the motion
    slows    True: the way sideways is part of the distance that the speed covers
    way      distance of the step [m], where it is that of the speed at which the offset was chosen
    rate     how fast the offset grows at the end of the step [m/s], where that is known: the heading is then that of
             this instant, else that of the step as a whole
    """

    offset: float
    heading: float | None = None
    shortens_distance: bool = True
    distance: float | None = None
    rate: float | None = None


class Motion(MotionState):
    """Motion of one scripted actor. Actions request it by methods; the state can only be read from outside."""

    def __init__(self, roads: RoadNetwork | None) -> None:
        super().__init__(roads)
        self._visit = 0
        self._route_lanes = RouteLanes(roads) if roads is not None else None
        self._steering: LateralStep | None = None
        self._next_pose: Pose | None = None
        self._landing = False
        self._rail: Callable[[float], Pose] | None = None
        self._carried: float | None = None
        self._crosses = False
        self._teleport = False

    def set_speed(self, speed: float) -> None:
        """Set the speed along the heading [m/s], from the step that begins now on."""
        self._speed = speed

    def set_route(self, route: Route | None, branch_selector: BranchSelector | None = None) -> None:
        """Set the route. At junctions that it leaves open, `branch_selector` selects the branch."""
        self._route, self._visit, self._branch_selector = route, 0, branch_selector

    def ahead(self, place: LaneLocation, distance: float) -> LaneLocation | None:
        """The place so many meters further along the lane [m], by the way that it takes; None where the lane ends."""
        assert self.roads is not None
        return self.roads.advance(place, distance, route=self._route, choose=self._branch_selector, visit=self._visit)

    def teleport(self, place: ResolvedPosition) -> None:
        """Place it there at once; its speed stays. The next view shows it there, so the step that begins is used up."""
        self._pose = place.pose
        self._adopt(place.location)
        self._crosses = self._location is not None and abs(math.cos(self._heading)) < ACROSS
        self._end_of_road = False
        if self._route_lanes is not None:
            self._route_lanes.forget()
        self._teleport = self._teleported = True

    def initialize(self) -> None:
        """Come to rest at the place before the first view, which shows it there: the next step moves it."""
        self._teleport = False
        self.step(0.0)

    def set_lateral_step(self, steering: LateralStep) -> None:
        """Lateral motion of the step that begins now."""
        self._steering = steering

    def move_to(
        self, pose: Pose, *, land: bool = False, jump: bool = False, rail: Callable[[float], Pose] | None = None
    ) -> None:
        """The pose at the end of the step that begins now, wherever it is (a trajectory).

        With `land` the actor looks for its lane there, to follow it from then on; where there are no roads at all it
        has nothing left to follow, and stops. With `jump` it is put there: the way is none that it covers. `rail`
        returns the pose after another distance than that of its speed, for `move_along_lane`.
        """
        self._next_pose, self._rail = pose, rail
        self._landing = land
        self._teleported = self._teleported or jump

    def move_along_lane(self, distance: float) -> None:
        """Move by a distance along the lane or trajectory in this step, whatever speed and heading say [m]."""
        self._carried = distance

    def set_reference_lane(self, lane: int) -> LaneLocation | None:
        """Express the place on the road by another lane of the same road; the answer has its offset."""
        here = self._location
        if here is not None and self.roads is not None and here.lane != lane:
            ways = [self.roads.driving_direction(here.road, number) for number in (here.lane, lane)]
            if ways[0] != ways[1]:
                self._heading = wrap_angle(self._heading + math.pi)
            here = here._replace(lane=lane, offset=here.t - self.roads.location(here.road, lane, here.s).t)
            self._location = here
        return here

    def set_observed_state(self, pose: Pose, speed: float) -> None:
        """Set pose and speed [m/s] of a driven vehicle, as the view shows them."""
        self._pose, self._speed = pose, speed

    def set_towed_state(self, pose: Pose, front: Motion) -> None:
        """Set the pose of a trailer; its speed is that of the towing vehicle, whose teleport it shares."""
        self._pose, self._speed, self._teleported = pose, front.speed, front.teleported

    def clear_teleported(self) -> None:
        """Clear `teleported`: a view shows the new pose."""
        self._teleported = False

    def resume_from(self, pose: Pose, speed: float) -> None:
        """Go on from where another one brought the actor."""
        self._pose, self._speed = pose, speed
        self.snap_to_lane()

    def snap_to_lane(self) -> None:
        """Find the lane again after free motion; the actor follows it at the angle at which it arrived.

        One that is beside the road, and does not point along it, goes on in its heading.
        """
        self._crosses = False
        hint = self._location
        place = self.roads.locate_at(self._pose.x, self._pose.y, hint) if self.roads is not None else None
        self._adopt(place)
        if self._location is not None and self.roads is not None and abs(math.cos(self._heading)) < ACROSS:
            self._crosses = not self.roads.on_road(self._location)

    def step(self, dt: float) -> Placement:
        """Move for dt seconds by what was asked since the last step; where it then is."""
        steering, self._steering = self._steering, None
        target, self._next_pose = self._next_pose, None
        carried, self._carried = self._carried, None
        if target is not None and carried is not None and self._rail is not None:
            target = self._rail(carried)
        distance = self._speed * dt if carried is None else carried
        if self._teleport:
            self._teleport = False
            return self.placement()
        if self._route is not None and self._route_lanes is not None:
            if steering is None and target is None and carried is None and distance > 0.0 and not self._crosses:
                steering = self._to_route(distance)
            else:
                self._route_lanes.forget()
        if target is not None:
            self._pose = target
            self._location = None
            self._end_of_road = False
            if self._landing:
                self.snap_to_lane()
                if self.roads is None:
                    self._speed = 0.0
        elif distance == 0.0 and steering is None:
            pass
        elif self._location is not None and (carried is not None or not self._crosses):
            self._along_lane(distance, steering, dt)
        else:
            self._freely(distance)
        x, y, z, h, p, r = self._pose
        across = distance == 0.0 or target is not None or carried is not None
        return Placement(x, y, z, h, p, r, self._speed, target is not None and self._teleported, across)

    def placement(self) -> Placement:
        """Where it is now."""
        x, y, z, h, p, r = self._pose
        return Placement(x, y, z, h, p, r, self._speed, True)

    def _along_lane(self, distance: float, steering: LateralStep | None, dt: float) -> None:
        assert self.roads is not None
        assert self._location is not None
        here, left, total = self._location, 0.0, distance
        way = self.roads.driving_direction(here.road, here.lane)
        if steering is not None:
            left = steering.offset - here.offset * way
            here = here._replace(offset=steering.offset * way, t=here.t + left * way)
            if steering.distance is not None:
                distance = total = math.copysign(steering.distance, distance)
            if steering.shortens_distance:
                distance = math.copysign(math.sqrt(max(0.0, distance * distance - left * left)), distance)
        if distance != 0.0:
            there = self.ahead(here, distance * self.direction)
            if there is None:
                there = self._last_place(here, distance * self.direction)
                if self._end_of_road:
                    self._speed = 0.0
                self._end_of_road = True
            else:
                self._end_of_road = False
            if self._route is not None and there.road != here.road:
                self._visit = self._route.visit(there.road, self._visit)
            self._begin_lap(here, there)
            here = there
        if steering is not None:
            self._heading = wrap_angle(
                (0.0 if self.direction > 0 else math.pi) + self._turn(steering, left, distance, total, dt)
            )
        self._location = here
        pose = self.pose_on(here, self._heading)
        self._pose = pose if self._lift == 0.0 else pose._replace(z=pose.z + self._lift)

    def _to_route(self, distance: float) -> LateralStep | None:
        """How to change to a lane that leads on along the route, where this one does not."""
        assert self._route is not None
        assert self._route_lanes is not None
        if self._location is None or self.direction < 0 or self.roads is None:
            return None
        found = self._route_lanes.step(self._location, distance, self._route, self._visit)
        if found is None:
            return None
        lane, offset, done = found
        self.set_reference_lane(lane)
        way = self.roads.driving_direction(self._location.road, lane)
        return LateralStep(offset * way, heading=0.0 if done else None)

    def _begin_lap(self, before: LaneLocation, after: LaneLocation) -> None:
        """Where a step passes the start of the route's lap, the lap is the route from then on."""
        lap = self._route.lap if self._route is not None else None
        if lap is None or self.roads is None or after.road != lap.start.road:
            return
        way = self.roads.driving_direction(after.road, after.lane)
        reached = (after.s - lap.start.s) * way >= 0.0
        if reached and (before.road != after.road or (before.s - lap.start.s) * way < 0.0):
            self._route, self._visit = lap, 0

    def _turn(self, steering: LateralStep, left: float, distance: float, total: float, dt: float) -> float:
        """The angle to the lane where `distance` along it and `left` make up a step of `total` meters in dt seconds."""
        if steering.heading is not None:
            return steering.heading
        if steering.rate is not None:
            left = steering.rate * dt
            if steering.shortens_distance:
                distance = math.copysign(math.sqrt(max(0.0, total * total - left * left)), total)
        if distance == 0.0 or left == 0.0:
            return 0.0
        return math.atan(left * self.direction / distance)

    def _last_place(self, here: LaneLocation, distance: float) -> LaneLocation:
        """Where the lane ends, in a section inside its road or at the road's end, within the distance [m]."""
        assert self.roads is not None
        last = self.roads.advance(
            here, distance, route=self._route, choose=self._branch_selector, visit=self._visit, to_end=True
        )
        assert last is not None
        return last

    def _freely(self, distance: float) -> None:
        x, y, z, h, p, r = self._pose
        x, y = x + distance * math.cos(h), y + distance * math.sin(h)
        if self.roads is not None and distance != 0.0:
            self._location = self.roads.locate_at(x, y, self._location)
            if self._location is not None:
                ground = self.roads.lane_pose_at(*self._location[:4])
                z, p, r = ground.z, *ground.turned(wrap_angle(h - ground.h))[4:]
                self._heading = self._heading_at(self._location, h)
        self._pose = Pose(x, y, z, h, p, r)

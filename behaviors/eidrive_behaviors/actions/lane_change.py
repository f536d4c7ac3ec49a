"""LaneChangeAction: move an actor to another lane."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray
from py_trees.common import Status

from eidrive_behaviors.actions.following import (
    DelayWarning,
    RateLimitedValue,
    closing_rate,
    is_follow_mode,
    largest_curvature,
)
from eidrive_behaviors.actions.speed import describe_dynamics
from eidrive_scenario.api.actions import (
    STEEPEST,
    ActionBehaviour,
    Domain,
    Goal,
    LateralStep,
    TransitionProfile,
    count_lanes,
    facing,
    lane_number,
    model,
)
from eidrive_scenario.api.common import EPSILON, LaneLocation, Pose, ScenarioError

SPACING = 2.0
"""Spacing of the points of a path [m]."""


@dataclass(frozen=True)
class LanePath:
    """Line in which the offset from a lane changes by a transition and then keeps its target.

    points  (M, 3) [m]
    end     index of the first point with the target
    """

    points: NDArray[np.float64]
    end: int

    def errors(self, pose: Pose) -> tuple[float, bool]:
        """Return the distance of a pose from the line [m], and whether it is beyond the end of the transition."""
        apart = self.points[:, :2] - (pose.x, pose.y)
        nearest = int(np.argmin(np.einsum("ij,ij->i", apart, apart)))
        first = max(min(nearest, len(self.points) - 2), 0)
        along = self.points[first + 1, :2] - self.points[first, :2]
        length = math.hypot(*along.tolist())
        across = abs(float(along[0] * apart[first, 1] - along[1] * apart[first, 0])) / length
        return across, nearest >= self.end


STANDING = 1e-6
"""Minimum speed of a lateral motion [m/s]. A slower actor waits."""
FORWARD_LIMIT = "the lateral speed is at most the forward speed"
VEHICLE_LIMIT = "maxSteering and maxDeceleration limit the lateral acceleration"
SHIFTED = 1e-3
"""Offset change above which the offset refers to a neighboring lane after the lane has ended [m]."""
NEAR = 0.2
"""Maximum distance to the target in the new lane at which a driven vehicle has arrived [m]."""
LOOKOUT, LOOKOUT_TIME = 100.0, 20.0
"""Length of the path on the new lane that is handed to a driven vehicle without a route: distance [m], and time [s] at
its speed. The vehicle reaches the new lane before it brakes for the end of the path."""
SLOWEST = 1.0
"""Minimum speed for which the path of a driven vehicle is planned [m/s]."""
STRAYED = 5.0
"""Distance from the path above which a driven vehicle was teleported, and its path is planned again [m]."""


class LaneChangeAction(ActionBehaviour):
    """Transition of the lateral offset to `targetLaneOffset` of the target lane by the given dynamics.

    A distance is measured along the lane. The actor covers the distance of its speed on the oblique path. A lateral
    speed above the forward speed is reduced to the forward speed. A standing actor waits. In the following mode
    `follow` the lateral acceleration of a vehicle is limited by its front wheels and by its tires. The limit of the
    tires is the maximum deceleration of the Performance.
    """

    domains = Domain.LATERAL
    action: model.LaneChangeAction

    def configure(self) -> None:
        """Check the target and require a road network."""
        self._dynamics = self.action.lane_change_action_dynamics
        self._transition = TransitionProfile(model.DynamicsShape.STEP, 0.0, 0.0, 0.0)
        target = self.action.lane_change_target.absolute_target_lane
        self._absolute = None if target is None else lane_number(target.value)
        if target is not None and self._absolute is None:
            raise self.error(f"the target lane is not a number (got {target.value!r}; expected the id of a lane)")
        self._roads = self.require_roads()
        self._lane = 0
        self._path: LanePath | None = None
        self._goal_before = Goal()
        self._limited_offset: RateLimitedValue | None = None
        self._delay_warning = DelayWarning(self)

    @property
    def at_once(self) -> bool:
        """True for a step that is not limited by the vehicle."""
        return model.is_immediate(self._dynamics) and not self.actor.driven

    @property
    def _is_by_distance(self) -> bool:
        return self._dynamics.dynamics_dimension is model.DynamicsDimension.DISTANCE

    def initialise(self) -> None:
        """Find the target lane and express the actor's position as an offset from its center."""
        here = self.context.location(self.actor.name)
        if here is None:
            raise off_road_error(self)
        self._lane = self._target_lane(here)
        if self._lane not in self._roads.lane_ids(here.road, here.s):
            lanes = ", ".join(str(lane) for lane in self._roads.lane_ids(here.road, here.s))
            raise self.error(
                f"the target lane does not exist on road {here.road!r} at s = {here.s:.1f} m "
                f"(got {self._lane}; expected one of {lanes})"
            )
        if self.actor.motion.location is None:
            self.actor.motion.snap_to_lane()
        if self.actor.motion.location is None and not self.actor.driven:
            raise off_road_error(self)
        moved = self.actor.motion.set_reference_lane(self._lane) or here
        way = self._roads.driving_direction(moved.road, self._lane)
        start, target = moved.offset * way, (self.action.target_lane_offset or 0.0) * way
        self._transition = self._build_transition(start, target)
        self._path = None
        self._progress = 0.0
        """Parameter of the transition before the last step."""
        self._offset = start
        self._road, self._teleports = here.road, self.actor.motion.teleports
        if is_follow_mode(self._dynamics) and isinstance(self.actor.entity, model.Vehicle):
            sideways = self.actor.motion.speed * math.sin(self.actor.motion.heading)
            self._limited_offset = RateLimitedValue(start, sideways, up=math.inf, down=math.inf)
            self._speed = self.actor.motion.speed

    def _build_transition(self, start: float, target: float) -> TransitionProfile:
        shape, value = self._dynamics.dynamics_shape, abs(self._dynamics.value)
        if self._dynamics.dynamics_dimension is model.DynamicsDimension.RATE:
            return TransitionProfile.from_rate(shape, start, target, value)
        return TransitionProfile(shape, start, target, value)

    def update(self) -> Status:
        """Set the offset at the end of the step."""
        if self.actor.driven:
            return self._set_driver_goal()
        # The step of a teleport covers no distance
        stays = self._is_by_distance and self.actor.motion.teleported
        way = 0.0 if stays else abs(self.actor.motion.speed) * self.context.dt
        if self._transition.extent <= 0.0 and self._limited_offset is None:
            self.actor.motion.set_lateral_step(LateralStep(self._transition.target, 0.0, shortens_distance=False))
            return Status.SUCCESS
        if abs(self.actor.motion.speed) < STANDING or way == 0.0:
            self._progress = self._transition.progress
            if self.context.dt > 0.0 and not self._is_by_distance:
                self._delay_warning.add("waits while the actor stands", FORWARD_LIMIT)
            return Status.RUNNING
        self._switch_reference_lane()
        self._progress = self._transition.progress
        wanted = self._next_offset(way)
        rate: float | None = self._rate(way)
        if self._limited_offset is not None:
            followed = self._limit_to_vehicle(self._limited_offset, wanted)
            wanted, rate = followed, rate if followed == wanted else None
        most = STEEPEST * way
        steep = abs(wanted - self._offset) > most
        if steep:
            wanted, rate = self._offset + math.copysign(most, wanted - self._offset), None
        self._offset = wanted
        arrived = self._transition.done and abs(wanted - self._transition.target) < EPSILON
        if self._transition.done and not arrived and self._transition.extent > 0.0:
            self._delay_warning.add("takes longer than requested", FORWARD_LIMIT if steep else VEHICLE_LIMIT)
        self.actor.motion.set_lateral_step(LateralStep(wanted, 0.0 if arrived else None, distance=way, rate=rate))
        return Status.SUCCESS if arrived else Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        """Let the actor follow the lane that it is in, or its route, if the action is stopped."""
        if self.status is not Status.RUNNING or new_status is not Status.INVALID or not self.actor.present:
            return
        if self._path is not None:
            self.actor.end_path(self._path.points, self._goal_before)
        here, followed = self.context.location(self.actor.name), self.actor.motion.location
        if followed is not None and here is not None and here.road == followed.road:
            self.actor.motion.set_reference_lane(here.lane)

    def _switch_reference_lane(self) -> None:
        """Continue from the new offset after a teleport, or after the neighbor of an ended lane became the target."""
        motion, transition = self.actor.motion, self._transition
        here = motion.location
        if here is None:
            return
        if motion.teleports != self._teleports:
            self._teleports = motion.teleports
            if self._is_by_distance:
                transition.progress = self._progress  # The teleport replaced the last step
            if self._has_target_lane(here):
                here = motion.set_reference_lane(self._lane) or here
        offset = here.offset * self._roads.driving_direction(here.road, here.lane)
        if abs(offset - self._offset) <= SHIFTED:
            return
        if self._dynamics.dynamics_dimension is model.DynamicsDimension.RATE:
            self._transition = self._build_transition(offset, transition.target)
        else:
            left = max(transition.extent - transition.progress, EPSILON)
            self._transition = TransitionProfile(transition.shape, offset, transition.target, left)
        if self._limited_offset is not None:
            self._limited_offset = RateLimitedValue(offset, self._limited_offset.rate, up=math.inf, down=math.inf)
        self._offset = offset

    def _has_target_lane(self, here: LaneLocation) -> bool:
        """Whether the target lane exists beside a location; ids of a relative target refer to the first road only."""
        is_known = here.road == self._road or self.action.lane_change_target.absolute_target_lane is not None
        return is_known and self._lane in self._roads.lane_ids(here.road, here.s)

    def _next_offset(self, way: float) -> float:
        transition = self._transition
        if not self._is_by_distance:
            return transition.advance(self.context.dt)
        before = transition.progress
        sideways = transition.advance(way) - self._offset
        along = math.sqrt(max(0.0, way * way - sideways * sideways))
        transition.progress = before
        return transition.advance(along)

    def _rate(self, way: float) -> float:
        """Return the rate of the offset at the end of a step of this distance [m/s]."""
        slope = self._transition.slope
        if not self._is_by_distance:
            return slope
        return way / self.context.dt * slope / math.hypot(1.0, slope)

    def _limit_to_vehicle(self, limited: RateLimitedValue, wanted: float) -> float:
        vehicle, speed = self.actor.entity, self.actor.motion.speed
        assert isinstance(vehicle, model.Vehicle)
        bound = min(largest_curvature(vehicle) * speed * speed, vehicle.performance.max_deceleration)
        limited.up = limited.down = bound
        limited.highest = STEEPEST * abs(speed)
        limited.lowest = -limited.highest
        # A transition may end faster than the vehicle can follow, which does not overshoot its target
        rest = self._transition.target - limited.value
        closing = closing_rate(abs(rest), bound, self.context.dt)
        if rest > 0.0:
            limited.highest = min(limited.highest, closing)
        else:
            limited.lowest = max(limited.lowest, -closing)
        if abs(speed) < abs(self._speed) or speed * self._speed < 0.0:
            # At the same angle to the lane the rate of a slower vehicle is lower
            limited.rate *= max(speed / self._speed, -1.0)
        self._speed = speed
        return limited.advance(wanted, self.context.dt)

    def _target_lane(self, here: LaneLocation) -> int:
        """Return the id of the target lane on the road of the actor.

        Lanes are followed along their links to the road of the reference entity, where ids and directions may differ.
        """
        if self._absolute is not None:
            return self._absolute
        target = self.action.lane_change_target
        assert target.relative_target_lane is not None
        name = target.relative_target_lane.entity_ref
        reference = self.context.location(name)
        if reference is None:
            raise self.error(f"the reference entity {name!r} is off the road")
        left = facing(self.context, name, reference) * self._roads.driving_direction(reference.road, reference.lane)
        count, runs = target.relative_target_lane.value * left, self._roads.orientation(here, reference)
        between = self._roads.lanes_between(here, reference)
        if runs is None or between is None:
            return count_lanes(reference.lane, count)
        lane = count_lanes(here.lane, between + count * runs)
        if all(lane * other * runs < 0 for other in (reference.lane, count_lanes(reference.lane, count))):
            # A lane beside the middle of the road has no counterpart; the next lane is on the other side of the road
            where = f"road {here.road!r} at s = {here.s:.1f} m, as it begins or ends between the actor and {name!r}"
            raise self.error(f"the target lane does not exist on {where}")
        return lane

    def _set_driver_goal(self) -> Status:
        """Hand the path of the transition to the driver. It is complete when the vehicle drives in the new lane.

        A vehicle without a route then follows the new lane; a route continues in it, and an offset is kept.
        """
        here, pose = self.context.location(self.actor.name), self.actor.motion.pose
        if here is None:
            return Status.RUNNING
        if self._path is not None:
            error, beyond = self._path.errors(pose)
            if beyond and error < NEAR:
                if not self._needs_path(here):
                    self.actor.set_goal(replace(self.actor.goal or Goal(), path=None, lap=None))
                return Status.SUCCESS
            if error < STRAYED:
                return Status.RUNNING
        goal = self.actor.goal or Goal()
        if self._path is None or goal.path is not self._path.points:
            self._goal_before = goal
        self._path = self._plan_path(here)
        if self._path is not None:
            lap = None if self.actor.motion.route is None else goal.lap
            self.actor.set_goal(replace(goal, path=self._path.points, lap=lap, is_route=False))
        return Status.RUNNING

    def _plan_path(self, here: LaneLocation) -> LanePath | None:
        """Return the path of the transition from a location; None if the target lane is not beside it, or ends."""
        if self._lane not in self._roads.lane_ids(here.road, here.s):
            return None
        center = self._roads.location(here.road, self._lane, here.s)
        way = self._roads.driving_direction(here.road, self._lane)
        transition = self._build_transition((here.t - center.t) * way, (self.action.target_lane_offset or 0.0) * way)
        goal, pose, route = self.actor.goal, self.actor.motion.pose, self.actor.motion.route
        speed = max(self.context.speed(self.actor.name), (goal.speed if goal is not None else None) or 0.0, SLOWEST)
        per_meter = 1.0 if self._is_by_distance else 1.0 / speed  # Progress of the transition along the lane
        if route is None:
            length = transition.extent / per_meter + LOOKOUT + LOOKOUT_TIME * speed
        else:
            length = route.length - route.project(pose.x, pose.y)[0]
        # Against its heading the path leads along the lane backwards
        step = SPACING if math.cos(self._roads.pose(center).h - pose.h) >= 0.0 else -SPACING
        location: LaneLocation | None = center
        points: list[tuple[float, float, float]] = []
        end: int | None = None
        while location is not None and SPACING * len(points) <= length:
            end = len(points) if end is None and transition.done else end
            side = self._roads.driving_direction(location.road, location.lane)
            points.append(self._roads.pose(location._replace(offset=transition.value * side))[:3])
            transition.advance(SPACING * per_meter)
            location = self._roads.advance(location, step, route=route)
        if len(points) < 2:
            return None
        return LanePath(np.array(points), len(points) - 1 if end is None else end)

    def _needs_path(self, here: LaneLocation) -> bool:
        """Whether the vehicle cannot follow its lane from now on: a route, an offset, or an oncoming lane."""
        motion = self.actor.motion
        oncoming = math.cos(self._roads.pose(here).h - motion.pose.h) < 0.0
        return motion.route is not None or bool(self.action.target_lane_offset) or oncoming

    def describe(self) -> str:
        """Describe target and dynamics."""
        target = self.action.lane_change_target
        if target.absolute_target_lane is not None:
            where = f"lane {target.absolute_target_lane.value}"
        else:
            assert target.relative_target_lane is not None
            count, name = target.relative_target_lane.value, target.relative_target_lane.entity_ref
            where = f"the lane of {name}" if count == 0 else f"{count:+d} lanes from {name}"
        offset = self.action.target_lane_offset
        aside = f", {offset:g} m off its center" if offset else ""
        return f"change to {where}{aside}, {describe_dynamics(self._dynamics, 'm/s')}"


def off_road_error(action: ActionBehaviour) -> ScenarioError:
    """Return the error of a lateral action whose actor is off the road at its start."""
    return action.error(f"actor {action.actor_name!r} is off the road at the start", "place the actor on a lane first")

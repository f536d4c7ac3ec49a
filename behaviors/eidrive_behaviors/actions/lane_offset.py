"""LaneOffsetAction: change the lateral offset of an actor within its lane."""

from __future__ import annotations

import math

from py_trees.common import Status

from eidrive_behaviors.actions.following import RateLimitedValue, warn_without_effect
from eidrive_behaviors.actions.lane_change import SHIFTED, STANDING, off_road_error
from eidrive_scenario.api.actions import (
    STEEPEST,
    ActionBehaviour,
    Domain,
    LateralStep,
    TransitionProfile,
    facing,
    model,
    same_way,
)
from eidrive_scenario.api.common import LaneLocation


class LaneOffsetAction(ActionBehaviour):
    """Transition of the offset from the lane center to its target, limited by `maxLateralAcc`.

    The shape is a function of time. Without `maxLateralAcc` the target applies at once. With it the lateral speed is at
    most the forward speed, so that a standing actor waits. A relative offset refers to the lateral position of the
    entity and is positive to the left of its heading. A continuous action holds the offset and follows the entity until
    a later action ends it, also within `maxLateralAcc` (1.3.1, LaneOffsetActionDynamics).
    """

    domains = Domain.LATERAL
    action: model.LaneOffsetAction

    @property
    def at_once(self) -> bool:
        """True for an offset that is reached at once and not kept."""
        is_immediate = model.is_immediate(self.action.lane_offset_action_dynamics)
        return is_immediate and not self.action.continuous and not self.actor.driven

    def initialise(self) -> None:
        """Start the transition from the current offset."""
        motion = self.actor.motion
        if motion.location is None:
            motion.snap_to_lane()
        if motion.location is None:
            raise off_road_error(self)
        self._start_transition(motion.location)

    def _start_transition(self, here: LaneLocation) -> None:
        """Start the transition from the offset of a location."""
        way = self._way(here)
        start, target = here.offset * way, self._target(here) * way
        limit, shape = self.action.lane_offset_action_dynamics.max_lateral_acc, self._shape()
        if limit is None:
            self._transition = TransitionProfile(shape, start, target, 0.0)
        else:
            self._transition = TransitionProfile.from_second_derivative(shape, start, target, limit)
        self._offset = start
        self._limited_offset: RateLimitedValue | None = None
        """Offset after the transition that follows the entity; None before its end, and without `maxLateralAcc`."""

    def update(self) -> Status:
        """Set the offset at the end of the step."""
        here = self.actor.motion.location
        if self.actor.driven:
            warn_without_effect(self)
        if self.actor.driven or here is None:
            return Status.RUNNING if self.action.continuous else Status.SUCCESS
        if abs(here.offset * self._way(here) - self._offset) > SHIFTED:
            self._start_transition(here)  # in another lane, or after a teleport
        if self._limited_offset is not None:
            self._follow(self._limited_offset, here)
            return Status.RUNNING
        transition, speed, dt = self._transition, self.actor.motion.speed, self.context.dt
        if transition.extent > 0.0 and abs(speed) < STANDING:
            return Status.RUNNING
        relative = self.action.lane_offset_target.relative_target_lane_offset
        follows = self.action.continuous and relative is not None and relative.entity_ref != self.actor_name
        limit = self.action.lane_offset_action_dynamics.max_lateral_acc
        if transition.done and follows and limit is None:
            transition.target = self._target(here) * self._way(here)
        offset, most = transition.advance(dt), STEEPEST * abs(speed) * dt
        steep = transition.extent > 0.0 and abs(offset - self._offset) > most
        if steep:
            offset = self._offset + math.copysign(most, offset - self._offset)
        self._offset = offset
        done = transition.done and not steep
        if done and follows and limit is not None:
            self._limited_offset = RateLimitedValue(offset, 0.0, up=limit, down=limit)
        heading = 0.0 if done or abs(speed) < STANDING else None
        rate = None if steep else transition.slope
        self.actor.motion.set_lateral_step(LateralStep(offset, heading, shortens_distance=steep, rate=rate))
        return Status.SUCCESS if done and not self.action.continuous else Status.RUNNING

    def _follow(self, limited: RateLimitedValue, here: LaneLocation) -> None:
        """Set the offset at the end of a step after the transition."""
        limited.highest = STEEPEST * abs(self.actor.motion.speed)
        limited.lowest = -limited.highest
        target = self._target(here) * self._way(here)
        self._offset = limited.advance(target, self.context.dt, final=target, moves=True)
        self.actor.motion.set_lateral_step(LateralStep(self._offset, shortens_distance=False, rate=limited.rate))

    def _shape(self) -> model.DynamicsShape:
        return self.action.lane_offset_action_dynamics.dynamics_shape

    def _way(self, here: LaneLocation) -> int:
        return 1 if self.context.roads is None else self.context.roads.driving_direction(here.road, here.lane)

    def _target(self, here: LaneLocation) -> float:
        """Return the target offset, in the direction of t [m]."""
        target = self.action.lane_offset_target
        if target.absolute_target_lane_offset is not None:
            return target.absolute_target_lane_offset.value
        assert target.relative_target_lane_offset is not None
        name, roads = target.relative_target_lane_offset.entity_ref, self.context.roads
        other = self.context.location(name)
        if other is None or roads is None:
            raise self.error(f"the reference entity {name!r} is off the road")
        offset = roads.distance(here, other)
        if offset is None:
            raise self.error(f"the reference entity {name!r} is not reachable along the roads")
        along = facing(self.context, self.actor.name, here) * same_way(self.context, self.actor.name, name, "lane")
        left = target.relative_target_lane_offset.value * along
        return here.offset + (offset[1] + left) * self._way(here)

    def describe(self) -> str:
        """Describe target and shape."""
        target = self.action.lane_offset_target
        if target.absolute_target_lane_offset is not None:
            where = f"{target.absolute_target_lane_offset.value:g} m"
        else:
            assert target.relative_target_lane_offset is not None
            relative = target.relative_target_lane_offset
            where = f"{relative.value:g} m beside {relative.entity_ref}"
        held = ", kept up" if self.action.continuous else ""
        return f"offset from the lane's center to {where}, {self._shape().value}{held}"

"""LaneOffsetAction: move an actor sideways within its lane."""

from __future__ import annotations

import math

from py_trees.common import Status

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

STANDING = 1e-6
SHIFTED = 1e-3
"""An offset that differs by more from the one before, in a lane that goes on there, counts from a lane beside [m]."""


class LaneOffsetAction(ActionBehaviour):
    """Takes the offset from the lane's center over to its target, as fast as `maxLateralAcc` lets it.

    The shape runs over time; without `maxLateralAcc` the target holds at once. With it an actor goes sideways no faster
    than forwards, so that one that stands waits. An offset relative to an entity counts
    from that entity's lateral place, left of its heading positive. A continuous action holds the offset, and follows
    the entity, until a younger action ends it.
    """

    domains = Domain.LATERAL
    action: model.LaneOffsetAction

    def initialise(self) -> None:
        """Lay the transition from the present offset."""
        motion = self.actor.motion
        if motion.location is None:
            motion.snap_to_lane()
        if motion.location is None:
            raise self.error(f"starts while {self.actor.name} is on no road", "place the actor on a lane first")
        self._lane = motion.location.road, motion.location.lane
        self._lay(motion.location)

    def _lay(self, here: LaneLocation) -> None:
        """Lay the transition from a place, whose offset counts from its lane's center."""
        way = self._way(here)
        start, target = here.offset * way, self._target(here) * way
        limit, shape = self.action.lane_offset_action_dynamics.max_lateral_acc, self._shape()
        if limit is None:
            self._transition = TransitionProfile(shape, start, target, 0.0)
        else:
            self._transition = TransitionProfile.from_second_derivative(shape, start, target, limit)
        self._offset = start

    def update(self) -> Status:
        """The offset at the end of the step."""
        here = self.actor.motion.location
        if self.actor.driven or here is None:
            return Status.RUNNING if self.action.continuous else Status.SUCCESS
        if (here.road, here.lane) != self._lane:
            self._lane = here.road, here.lane
            if abs(here.offset * self._way(here) - self._offset) > SHIFTED:
                self._lay(here)
        transition, speed, dt = self._transition, self.actor.motion.speed, self.context.dt
        if transition.extent > 0.0 and abs(speed) < STANDING:
            return Status.RUNNING
        if transition.done and self.action.continuous:
            transition.target = self._target(here) * self._way(here)
        offset, most = transition.advance(dt), STEEPEST * abs(speed) * dt
        steep = transition.extent > 0.0 and abs(offset - self._offset) > most
        if steep:
            offset = self._offset + math.copysign(most, offset - self._offset)
        self._offset = offset
        done = transition.done and not steep
        heading = 0.0 if done or abs(speed) < STANDING else None
        rate = None if steep else transition.slope
        self.actor.motion.set_lateral_step(LateralStep(offset, heading, shortens_distance=steep, rate=rate))
        return Status.SUCCESS if done and not self.action.continuous else Status.RUNNING

    def _shape(self) -> model.DynamicsShape:
        return self.action.lane_offset_action_dynamics.dynamics_shape

    def _way(self, here: LaneLocation) -> int:
        return 1 if self.context.roads is None else self.context.roads.driving_direction(here.road, here.lane)

    def _target(self, here: LaneLocation) -> float:
        """The offset to reach, in the direction of t [m]."""
        target = self.action.lane_offset_target
        if target.absolute_target_lane_offset is not None:
            return target.absolute_target_lane_offset.value
        assert target.relative_target_lane_offset is not None
        name, roads = target.relative_target_lane_offset.entity_ref, self.context.roads
        other = self.context.location(name)
        if other is None or roads is None:
            raise self.error(f"counts from {name}, which is on no road")
        found = roads.distance(here, other)
        if found is None:
            raise self.error(f"counts from {name}, to which no road leads")
        along = facing(self.context, self.actor.name, here) * same_way(self.context, self.actor.name, name, "lane")
        left = target.relative_target_lane_offset.value * along
        return here.offset + (found[1] + left) * self._way(here)

    def describe(self) -> str:
        """Target and shape."""
        target = self.action.lane_offset_target
        if target.absolute_target_lane_offset is not None:
            where = f"{target.absolute_target_lane_offset.value:g} m"
        else:
            assert target.relative_target_lane_offset is not None
            relative = target.relative_target_lane_offset
            where = f"{relative.value:g} m beside {relative.entity_ref}"
        held = ", kept up" if self.action.continuous else ""
        return f"offset from the lane's center to {where}, {self._shape().value}{held}"

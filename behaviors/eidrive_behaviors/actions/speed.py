"""SpeedAction: change the speed of an actor."""

from __future__ import annotations

import math

from msgspec.structs import replace
from py_trees.common import Status

from eidrive_behaviors.actions.following import (
    DelayWarning,
    RateLimitedValue,
    check_presence,
    is_follow_mode,
    speed_limiter,
    warn_of_reverse,
)
from eidrive_scenario.api.actions import ActionBehaviour, Domain, Goal, TransitionProfile, model
from eidrive_scenario.api.common import EPSILON

REACHED = 0.2
"""Maximum speed error at which a driven vehicle has reached the target speed [m/s]."""


class SpeedAction(ActionBehaviour):
    """Transition of the speed to an absolute or relative target by the given dynamics.

    The shape is a function of time; for a distance it is the time in which that distance is covered. A relative
    target is read in each step, one relative to the actor itself at the start. Where that target jumps, the speed
    follows within the limits of the vehicle, and within the rate if one is given. A continuous target is kept until a
    later action ends it. The vehicle's Performance limits the target, and the maximum slope of all shapes except
    the step. In the following mode `follow` it limits all accelerations and jerks. An active controller receives
    the speed as its goal. The goal is reached when the vehicle drives at that speed; a vehicle that was just
    teleported starts with it.
    """

    domains = Domain.LONGITUDINAL
    action: model.SpeedAction

    def configure(self) -> None:
        """Read target and dynamics."""
        self._dynamics = self.action.speed_action_dynamics
        self._absolute = self.action.speed_action_target.absolute_target_speed
        self._relative = self.action.speed_action_target.relative_target_speed
        self._transition = TransitionProfile(model.DynamicsShape.STEP, 0.0, 0.0, 0.0)
        self._limiter: RateLimitedValue | None = None
        self._start = 0.0
        self._delay_warning = DelayWarning(self)

    @property
    def _continuous(self) -> bool:
        return self._relative is not None and self._relative.continuous

    @property
    def at_once(self) -> bool:
        """True for a step that is neither continuous nor limited by the vehicle."""
        return model.is_immediate(self._dynamics) and not self._continuous

    @property
    def speed_reference(self) -> str | None:
        """Entity of a relative target, unless it is the actor itself."""
        name = None if self._relative is None else self._relative.entity_ref
        return None if name == self.actor_name else name

    def initialise(self) -> None:
        """Start the transition from the current speed."""
        self._start = start = self._current_speed()
        self._sense = self.actor.motion.sense if self._relative is None else None
        target = self._target()
        self._transition = self._build_transition(start, target)
        vehicle = self.actor.entity
        if is_follow_mode(self._dynamics) and isinstance(vehicle, model.Vehicle):
            self._limiter = speed_limiter(vehicle, start, backwards=start + target < 0.0)
        self._warn_of_limits(start, target)

    def _build_transition(self, start: float, target: float) -> TransitionProfile:
        transition = self._requested_transition(start, target)
        transition.limit_rate(slope_limit(start, target, *self.actor.limits()[1:]))
        return transition

    def _requested_transition(self, start: float, target: float) -> TransitionProfile:
        """Return the transition of the file, regardless of the vehicle."""
        shape, value = self._dynamics.dynamics_shape, abs(self._dynamics.value)
        if self._dynamics.dynamics_dimension is model.DynamicsDimension.RATE:
            return TransitionProfile.from_rate(shape, start, target, value)
        if self._dynamics.dynamics_dimension is model.DynamicsDimension.DISTANCE:
            return TransitionProfile(shape, start, target, duration_over(start, target, value))
        return TransitionProfile(shape, start, target, value)

    def _warn_of_limits(self, start: float, target: float) -> None:
        """Add a warning to the result if the Performance delays the transition, or reduces its target."""
        extent, requested = self._transition.extent, self._requested_transition(start, target).extent
        top, faster, slower = self.actor.limits()
        if extent > requested + EPSILON:
            least = "" if self._limiter is None or not self._limiter.has_finite_bounds else "at least "
            late = f"takes {least}{extent:.2f} s instead of {requested:.2f} s"
            self._delay_warning.add(late, describe_slope_limit(start, target, faster, slower))
        if self._absolute is not None and abs(self._absolute.value) > top:
            message = f"the target speed is reduced to {top:g} m/s (got {self._absolute.value:g} m/s)"
            self.warn(message, "increase maxSpeed of the Performance")

    def update(self) -> Status:
        """Set the speed at the end of the step."""
        transition = self._transition
        if self._relative is not None:
            self._retarget(self._target())
        if self.actor.driven:
            return self._set_driver_goal()
        ends = not transition.done
        speed = transition.advance(self.context.dt)
        ends &= transition.done
        if self._relative is not None and transition.extent > 0.0:
            speed = self._approach(speed)
        reached = abs(speed - transition.target) < EPSILON
        if self._limiter is not None and self.context.dt > 0.0:
            speed = self._limiter.advance(speed, self.context.dt, transition.target)
            reached = self._limiter.rests_at(transition.target, self.context.dt)
            if ends and not reached and self._limiter.has_finite_bounds:
                limit = f"limited to {self._limiter.up:g} and {self._limiter.down:g} m/s³"
                late = f"takes longer than {transition.extent:.2f} s"
                self._delay_warning.add(late, f"the rates of the acceleration are {limit}")
        self.actor.motion.set_speed(speed, self._sense)
        return Status.SUCCESS if transition.done and reached and not self._continuous else Status.RUNNING

    def _retarget(self, target: float) -> None:
        """Change the target. A rate keeps its slope and changes its duration; a time or distance keeps its duration."""
        transition = self._transition
        transition.target = target
        if self._dynamics.dynamics_dimension is model.DynamicsDimension.RATE and not transition.done:
            transition.extent = self._build_transition(transition.start, target).extent

    def _set_driver_goal(self) -> Status:
        """Set the goal to speed and slope of the transition. It is complete when the vehicle has that speed."""
        transition = self._transition
        warn_of_reverse(self, transition.target)
        before = transition.value
        speed = transition.advance(self.context.dt)
        slope = 0.0 if transition.done or self.context.dt == 0.0 else (speed - before) / self.context.dt
        self.actor.set_goal(replace(self.actor.goal or Goal(), speed=speed, acceleration=slope))
        # Init may command its speed before its position
        starts = self.actor.motion.teleported or not self.actor.present
        if starts and transition.done:
            self.actor.motion.set_speed(speed)
            return Status.RUNNING if self._continuous else Status.SUCCESS
        reached = transition.done and abs(self.context.speed(self.actor.name) - transition.target) < REACHED
        return Status.SUCCESS if reached and not self._continuous else Status.RUNNING

    def _current_speed(self) -> float:
        return self.context.speed(self.actor.name) if self.actor.driven else self.actor.motion.speed

    def _approach(self, wanted: float) -> float:
        """Return the next speed toward a moving target, within the limits of the vehicle and a given rate [m/s]."""
        present = self.actor.motion.speed
        slope = slope_limit(present, wanted, *self.actor.limits()[1:])
        if self._dynamics.dynamics_dimension is model.DynamicsDimension.RATE:
            slope = min(slope, abs(self._dynamics.value))
        change, most = wanted - present, slope * self.context.dt  # NaN for no limit in a step of 0 s
        return present + math.copysign(most, change) if abs(change) > most else wanted

    def _target(self) -> float:
        top = self.actor.limits()[0]
        if self._absolute is not None:
            speed = self._absolute.value
        else:
            assert self._relative is not None
            name = self._relative.entity_ref
            check_presence(self, name)
            reference = self._start if name == self.actor_name else self.context.speed(name)
            speed = relative_speed(reference, self._relative.value, self._relative.speed_target_value_type)
        return math.copysign(min(abs(speed), top), speed)

    def describe(self) -> str:
        """Describe target and dynamics."""
        if self._absolute is not None:
            target = f"{self._absolute.value:g} m/s"
        else:
            assert self._relative is not None
            is_factor = self._relative.speed_target_value_type is model.SpeedTargetValueType.FACTOR
            unit = "times" if is_factor else "m/s above"
            target = f"{self._relative.value:g} {unit} the speed of {self._relative.entity_ref}"
            target += ", kept up" if self._continuous else ""
        return f"speed to {target}, {describe_dynamics(self._dynamics, 'm/s²')}"


def relative_speed(reference: float, value: float, kind: model.SpeedTargetValueType) -> float:
    """Return the speed that a value specifies relative to a reference speed, as a factor or a difference [m/s]."""
    return reference * value if kind is model.SpeedTargetValueType.FACTOR else reference + value


def slope_limit(start: float, target: float, faster: float, slower: float) -> float:
    """Return the maximum change of a signed speed [m/s²]: `slower` toward 0, `faster` away from it.

    A change of the direction of travel has both parts, and the smaller limit applies.
    """
    if start * target < 0.0:
        return min(faster, slower)
    return faster if abs(target) > abs(start) else slower


def describe_slope_limit(start: float, target: float, faster: float, slower: float) -> str:
    """Describe the limit that `slope_limit` returns."""
    accelerates = faster <= slower if start * target < 0.0 else abs(target) > abs(start)
    limit = slope_limit(start, target, faster, slower)
    return f"{'maxAcceleration' if accelerates else 'maxDeceleration'} is {limit:g} m/s²"


def duration_over(start: float, target: float, distance: float) -> float:
    """Return the time in which a speed change covers a distance [s].

    All shapes except the step have the mean of both speeds. If the direction of travel changes, the distances before
    and after the reversal are proportional to the squares of the speeds.
    """
    if abs(target - start) < EPSILON:
        return 0.0
    if start * target < 0.0:
        before = distance * start * start / (start * start + target * target)
        return 2.0 * before / abs(start) + 2.0 * (distance - before) / abs(target)
    return 2.0 * distance / abs(start + target)


def describe_dynamics(dynamics: model.TransitionDynamics, rate: str) -> str:
    """Describe shape and extent, as `linear in 3 s`."""
    shape = dynamics.dynamics_shape.value
    if dynamics.dynamics_shape is model.DynamicsShape.STEP:
        return "at once"
    value = f"{abs(dynamics.value):g}"
    return {
        model.DynamicsDimension.TIME: f"{shape} in {value} s",
        model.DynamicsDimension.DISTANCE: f"{shape} over {value} m",
        model.DynamicsDimension.RATE: f"{shape} at {value} {rate}",
    }[dynamics.dynamics_dimension]

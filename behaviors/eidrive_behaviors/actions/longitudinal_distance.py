"""LongitudinalDistanceAction: keep a distance or a time gap to an entity."""

from __future__ import annotations

import math

from py_trees.common import Status

from eidrive_behaviors.actions.following import check_other_entity, check_presence, warn_without_effect
from eidrive_scenario.api.actions import (
    ActionBehaviour,
    Domain,
    axis_headings,
    distance,
    model,
    resolve_coordinate_system,
)

STIFFNESS = 0.4
"""Stiffness of the spring between actual and wanted distance, per m/s² of the maximum acceleration [1/m]."""
REACHED = 0.1
"""Maximum distance error at which an action that is not continuous ends [m]."""
LEAST_SHARE = 0.1
"""Minimum share of a motion that changes the distance: across the axis of the distance the action has no effect."""


class LongitudinalDistanceAction(ActionBehaviour):
    """Distance of `distance` meters, or of `timeGap` seconds of the other's speed, behind or ahead of an entity.

    Trailing is behind the other entity with respect to its heading in each step, leading is ahead of it, also if both
    face each other.

    Without acceleration limits the actor moves to the wanted distance at once, or at `maxSpeed`, and assumes the speed
    of the other entity. With them it follows like a critically damped spring, whose stiffness is proportional to the
    limit, within the limits of speed, acceleration and its rate. Deceleration is a speed change toward 0, also
    backwards. The standard does not specify the course of the distance.

    An actor that moves at an angle to the axis of the distance moves so much farther. A distance along the road without
    limits carries an actor that faces across it along the road. Only the speed of the other entity along this axis
    counts.
    """

    domains = Domain.LONGITUDINAL
    action: model.LongitudinalDistanceAction

    @property
    def at_once(self) -> bool:
        """True for a distance that is reached at once and not kept."""
        return model.is_immediate(self.action) and not self.action.continuous and not self.actor.driven

    def initialise(self) -> None:
        """Reset the acceleration; without a displacement select the current side of the other entity."""
        check_other_entity(self, self.action.entity_ref)
        self._acceleration, self._sense = 0.0, self.actor.motion.sense
        self._frame = resolve_coordinate_system(self.action.coordinate_system)
        self._axis = self._axes()[0]
        self._nearest_side = -1.0 if self._gap() < 0.0 else 1.0

    def update(self) -> Status:
        """Set the speed for the step."""
        if self.actor.driven:
            warn_without_effect(self)
        check_presence(self, self.action.entity_ref)
        if not self.context.actors[self.action.entity_ref].present or self.actor.driven:
            return Status.RUNNING if self.action.continuous else Status.SUCCESS
        axes = self._axes()
        if math.cos(axes[0] - self._axis) < 0.0:
            self._nearest_side = -self._nearest_side
        self._axis = axes[0]
        error = self._gap() - self._wanted(axes)
        if math.isnan(error):
            return Status.RUNNING
        share = 1.0 if self._carried else math.cos(self._course() - axes[0])
        if abs(share) < LEAST_SHARE:
            self.warn(f"no effect while {self.actor.name!r} moves across the axis of the distance")
            return Status.RUNNING
        error /= share
        other = self.context.speed(self._other) * math.cos(self.context.pose(self._other).h - axes[1])
        then = self._move(error, other / share)
        reached = abs(then * share) < REACHED or then * error < 0.0
        return Status.SUCCESS if reached and not self.action.continuous else Status.RUNNING

    @property
    def _other(self) -> str:
        return self.action.entity_ref

    def _axes(self) -> tuple[float, float]:
        """Return the headings of the axis of the distance at the actor and at the other entity [rad]."""
        return axis_headings(self.context, self.actor.name, self._other, self._frame)

    @property
    def _carried(self) -> bool:
        """Whether the distance applies at once along the lane, regardless of the heading of the actor."""
        follows_road = self._frame in ("lane", "road") and self.actor.motion.location is not None
        return follows_road and self.action.dynamic_constraints is None

    def _course(self) -> float:
        """Return the direction in which a positive speed moves the actor [rad]."""
        progress = self.actor.progress
        if progress is None or not progress.layout.given:
            return self.actor.motion.course
        tangent = progress.layout.tangent(progress.at(self.context.view.tick))
        return tangent if progress.way > 0 else tangent + math.pi

    def _move(self, error: float, other: float) -> float:
        """Set the speed. Return the remaining error at the end of the step [m].

        error  distance along the course of the actor to its wanted place [m]
        other  speed of this place [m/s]
        """
        limits, motion = self.action.dynamic_constraints, self.actor.motion
        if motion.sense != self._sense:
            self._acceleration, self._sense = -self._acceleration, motion.sense
        faster = infinite_if_none(limits.max_acceleration if limits is not None else None)
        slower = infinite_if_none(limits.max_deceleration if limits is not None else None)
        top = infinite_if_none(limits.max_speed if limits is not None else None)
        dt = self.context.dt
        if math.isinf(faster) and math.isinf(slower):
            way = error + other * dt
            if math.isfinite(top) and abs(way) > top * dt:
                top = min(top, self.actor.limits()[0])
                motion.set_speed(math.copysign(top, way))
                return error + (other - motion.speed) * dt
            motion.move_along_lane(way, carried=self._carried)
            motion.set_speed(other)
            return 0.0
        assert limits is not None
        up, down = faster, slower
        more, less = _max_change(limits.max_acceleration_rate, dt), _max_change(limits.max_deceleration_rate, dt)
        if motion.speed < 0.0 or (motion.speed == 0.0 and error < 0.0):
            up, down, more, less = down, up, less, more
        wanted = self._spring(error, motion.speed - other, up if error < 0.0 else down)
        wanted = min(max(wanted, -down), up)
        if wanted < min(self._acceleration, 0.0):
            wanted = max(wanted, self._acceleration - less)
        elif wanted > max(self._acceleration, 0.0):
            wanted = min(wanted, self._acceleration + more)
        self._acceleration = wanted
        top = min(top, self.actor.limits()[0])
        motion.set_speed(min(max(motion.speed + wanted * dt, -top), top))
        return error + (other - motion.speed) * dt

    @staticmethod
    def _spring(error: float, faster_by: float, limit: float) -> float:
        stiffness = STIFFNESS * (limit if math.isfinite(limit) else 10.0)
        return stiffness * error - 2.0 * math.sqrt(stiffness) * faster_by

    def _gap(self) -> float:
        """Return the distance to the other entity, positive ahead [m]."""
        me, freespace = self.actor.name, self.action.freespace
        return distance(self.context, me, self._other, frame=self._frame, kind="longitudinal", freespace=freespace)

    def _side(self, axes: tuple[float, float]) -> float:
        """Return +1.0 if the other entity is to be ahead of the actor, -1.0 if it is to be behind it."""
        displacement = self.action.displacement
        if displacement is model.LongitudinalDisplacement.ANY:
            return self._nearest_side
        leading = displacement is model.LongitudinalDisplacement.LEADING_REFERENCED_ENTITY
        along = math.cos(self.context.pose(self._other).h - axes[1]) >= 0.0
        return -1.0 if along == leading else 1.0

    def _wanted(self, axes: tuple[float, float]) -> float:
        if self.action.time_gap is not None:
            return self._side(axes) * self.action.time_gap * abs(self.context.speed(self._other))
        return self._side(axes) * (self.action.distance or 0.0)

    def describe(self) -> str:
        """Describe distance and entity."""
        gap = (
            f"{self.action.time_gap:g} s" if self.action.time_gap is not None else f"{self.action.distance or 0.0:g} m"
        )
        held = "keep" if self.action.continuous else "reach"
        return f"{held} {gap} to {self.action.entity_ref}"


def _max_change(rate: float | None, dt: float) -> float:
    """Return the maximum change of an acceleration in a step [m/s²]."""
    return math.inf if rate is None else rate * dt


def infinite_if_none(value: float | None) -> float:
    """Return a limit; infinity if it is not specified."""
    return math.inf if value is None else value

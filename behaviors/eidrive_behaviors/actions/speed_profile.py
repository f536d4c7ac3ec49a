"""SpeedProfileAction: a series of speeds over time."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise

from msgspec.structs import replace
from py_trees.common import Status

from eidrive_behaviors.actions.following import DelayWarning, RateLimitedValue, check_presence, warn_of_reverse
from eidrive_behaviors.actions.speed import describe_slope_limit, slope_limit
from eidrive_behaviors.conditions.motion import component_of
from eidrive_scenario.api.actions import ActionBehaviour, Domain, Goal, model
from eidrive_scenario.api.common import EPSILON


@dataclass(frozen=True)
class SpeedSegment:
    """Segment of a speed profile from `time` [s]: speed [m/s], slope [m/s²] and change of the slope [m/s³]."""

    time: float
    speed: float
    slope: float
    bend: float = 0.0

    def at(self, time: float) -> float:
        """Return the speed at a time [m/s]."""
        t = time - self.time
        return self.speed + self.slope * t + 0.5 * self.bend * t * t

    def slope_at(self, time: float) -> float:
        """Return the slope at a time [m/s²]."""
        return self.slope + self.bend * (time - self.time)


STEADY = 0.1
"""Maximum acceleration of an actor whose speed counts as constant [m/s²]: numerical differences in curves are not 0."""


class SpeedProfileAction(ActionBehaviour):
    """Sequence of entry speeds, each reached after its `time` or as fast as the limits allow.

    The limits are those of the action, which have precedence over those of the vehicle's Performance (1.3.1,
    SpeedProfileAction). An entry that they do not allow in its time is reached later. In the following mode `position`
    the speed is linear between entries. In `follow` the acceleration begins as it was before the action and ends with
    zero, and its change respects the rate limits: corners of the profile become parabolas. Where corners are too close
    for that, the speed follows the linear profile as fast as the limits allow. A first entry at time 0 is a step in
    `position`, and the current speed in `follow`. With an entity, speeds are relative to its speed at the start.
    """

    domains = Domain.LONGITUDINAL
    action: model.SpeedProfileAction

    def configure(self) -> None:
        """Prepare the warning of delays, at most one per action."""
        self._delay_warning = DelayWarning(self)

    @property
    def speed_reference(self) -> str | None:
        """Entity to whose speed the entries are relative."""
        element = self.action.entity_ref_element
        return element.entity_ref if self.action.entity_ref is None and element is not None else self.action.entity_ref

    def initialise(self) -> None:
        """Build the profile from the current speed."""
        start, self._sense = self.actor.motion.speed, self.actor.motion.sense
        corners = self._corners(start)
        self._segments = linear_segments(corners)
        self._limiter: RateLimitedValue | None = None
        if self.action.following_mode is model.FollowingMode.FOLLOW:
            self._smooth(corners)
        self._elapsed = 0.0

    def _smooth(self, corners: list[tuple[float, float]]) -> None:
        """Limit the change of the acceleration: by parabolic corners, or by a limiter where these would overlap."""
        rates = self._limit("max_acceleration_rate"), self._limit("max_deceleration_rate")
        slopes = self._limit("max_acceleration"), self._limit("max_deceleration")
        if min(speed for _, speed in corners) < 0.0:
            forwards = max(speed for _, speed in corners) > 0.0
            rates = (min(rates),) * 2 if forwards else (rates[1], rates[0])
            slopes = (min(slopes),) * 2 if forwards else (slopes[1], slopes[0])
        up, down = rates
        rate = self._acceleration()
        segments = smoothed_segments(corners, up, down, *slopes, slope_before=rate)
        if segments is None or (len(corners) == 2 and segments[-1].time > corners[-1][0] + EPSILON):
            late = "entries are reached later than at their times"
            self._delay_warning.add(late, f"the rates of the acceleration are limited to {up:g} and {down:g} m/s³")
        if segments is None:
            start = corners[0][1]
            self._limiter = RateLimitedValue(start, rate, up=up, down=down, lowest=-slopes[1], highest=slopes[0])
        else:
            self._segments = segments

    def _acceleration(self) -> float:
        """Return the acceleration of the actor along its heading in the last step [m/s²]; 0 if it is steady."""
        view, name = self.context.view, self.actor.name
        if name not in view or self.context.dt == 0.0:
            return 0.0
        index = view.row(name)
        vector, yaw = view.acceleration[index].tolist(), float(view.yaw[index])
        rate = component_of(vector, yaw, model.DirectionalDimension.LONGITUDINAL)
        return rate if abs(rate) > STEADY else 0.0

    def update(self) -> Status:
        """Set the speed at the end of the step."""
        dt = self.context.dt
        self._elapsed += dt
        index = max(0, bisect_right([piece.time for piece in self._segments], self._elapsed + EPSILON) - 1)
        segment, last = self._segments[index], self._segments[-1]
        done = segment is last
        speed, slope = (last.speed, 0.0) if done else (segment.at(self._elapsed), segment.slope_at(self._elapsed))
        if self._limiter is not None and dt > 0.0:
            speed = self._limiter.advance(speed, dt, self._next_turn(index))
            slope = self._limiter.rate
            done = done and self._limiter.rests_at(last.speed, dt)
        if self.actor.driven:
            warn_of_reverse(self, speed)
            self.actor.set_goal(replace(self.actor.goal or Goal(), speed=speed, acceleration=0.0 if done else slope))
        else:
            self.actor.motion.set_speed(speed, self._sense)
        return Status.SUCCESS if done else Status.RUNNING

    def _next_turn(self, index: int) -> float:
        """Return the next speed from a segment on at which the profile stops or turns [m/s]."""
        slope = self._segments[index].slope
        return next(piece.speed for piece in self._segments[index:] if piece.slope * slope <= 0.0)

    def _corners(self, start: float) -> list[tuple[float, float]]:
        """Return times [s] and speeds [m/s] of the corners of the profile, the current one first."""
        name = self.speed_reference
        if name is not None:
            check_presence(self, name)
        base = self.context.speed(name) if name is not None else 0.0
        top, faster = self._limit("max_speed"), self._limit("max_acceleration")
        slower = self._limit("max_deceleration")
        corners = [(0.0, start)]
        for number, entry in enumerate(self.action.speed_profile_entry):
            time, speed = corners[-1]
            target = min(max(entry.speed + base, -top), top)
            if number == 0 and entry.time is not None and entry.time < EPSILON:
                if self.action.following_mode is model.FollowingMode.POSITION:
                    corners[-1] = (time, target)
                continue
            limit = slope_limit(speed, target, faster, slower)
            shortest = abs(target - speed) / limit
            span = max(entry.time or 0.0, shortest)
            if entry.time is not None and shortest > entry.time + EPSILON:
                late = f"entry {number + 1} takes {shortest:.2f} s instead of {entry.time:.2f} s"
                self._delay_warning.add(late, describe_slope_limit(speed, target, faster, slower))
            if span > EPSILON:
                corners.append((time + span, target))
            else:
                corners[-1] = (time, target)
        return corners

    def _limit(self, name: str) -> float:
        """Return the limit of the action, else that of the vehicle's Performance; infinite without one.

        A limit of 0 is replaced by a tiny one, with which the speed remains as it is.
        """
        entity = self.actor.entity
        performance = entity.performance if isinstance(entity, model.Vehicle) else None
        limits = (getattr(limits, name, None) for limits in (self.action.dynamic_constraints, performance))
        return max(next((float(limit) for limit in limits if limit is not None), math.inf), EPSILON)

    def describe(self) -> str:
        """Describe the speeds."""
        return f"speeds {', '.join(f'{entry.speed:g}' for entry in self.action.speed_profile_entry)} m/s in turn"


def linear_segments(corners: list[tuple[float, float]]) -> list[SpeedSegment]:
    """Return linear segments between the corners and a constant segment after the last one."""
    segments = []
    for (time, speed), (later, after) in pairwise(corners):
        segments.append(SpeedSegment(time, speed, (after - speed) / (later - time)))
    return [*segments, SpeedSegment(corners[-1][0], corners[-1][1], 0.0)]


def smoothed_segments(
    corners: list[tuple[float, float]],
    up: float,
    down: float,
    rise: float = math.inf,
    fall: float = math.inf,
    slope_before: float = 0.0,
) -> list[SpeedSegment] | None:
    """Return the profile with parabolic corners and slope changes of `up` and `down` [m/s³]; None if they overlap.

    The lines between the corners are within the limits `rise` and `fall` of the slope [m/s²], which begins with that
    before the profile.
    """
    if len(corners) < 2:
        return linear_segments(corners)
    if len(corners) == 2:
        return _smoothed_change(corners[0], corners[1], up, down, rise, fall, slope_before)
    lines = linear_segments(corners)
    segments: list[SpeedSegment] = []
    time, speed, slope = 0.0, corners[0][1], slope_before
    for number, line in enumerate(lines):
        bend = up if line.slope > slope else -down
        span = (line.slope - slope) / bend
        if number == 0:
            start = time
        else:
            gap = line.slope - slope
            meet = max(time, line.time) if abs(gap) < EPSILON else time + (speed - line.at(time)) / gap
            start = meet - 0.5 * span
        if start < time - EPSILON:
            return None
        speed += slope * (start - time)
        if span > 0.0:
            segments.append(SpeedSegment(start, speed, slope, bend))
        speed += 0.5 * (slope + line.slope) * span
        time, slope = start + span, line.slope
        segments.append(SpeedSegment(time, speed, slope))
    segments[-1] = SpeedSegment(time, corners[-1][1], 0.0)
    return segments


def _smoothed_change(
    first: tuple[float, float],
    last: tuple[float, float],
    up: float,
    down: float,
    rise: float,
    fall: float,
    slope_before: float,
) -> list[SpeedSegment]:
    """Return one speed change that ends without acceleration, in the given time or the shortest possible one.

    The slope changes from that before to a at j1, and to 0 at j2, with a segment of constant slope between. The shorter
    the time T, the larger is a, up to the limit of the slope, or the value at which the segment between vanishes. With
    b = T + a0 / j1 and c = change + a0² / (2 j1) it solves c = a b - a² / 2 (1 / j1 + 1 / j2). If a0 is above a, the
    slope falls to a at j2 instead.
    """
    change, span = last[1] - first[1], last[0] - first[0]
    settling = 0.5 * slope_before * abs(slope_before) / (down if slope_before > 0.0 else up)
    sign = math.copysign(1.0, change - settling)
    start, end, limit = (up, down, rise) if sign > 0.0 else (down, up, fall)
    change, before = sign * change, sign * slope_before
    held, rest = span - before / end, change - 0.5 * before * before / end
    if before > 0.0 and (before > limit or rest <= before * held):
        slope = min(rest / held if held > 0.0 else math.inf, before, limit)
        span = before / end + (rest / slope if slope > 0.0 else max(held, 0.0))
        t1, bend = (before - slope) / end, -sign * end
    else:
        inverse = 0.5 * (1.0 / start + 1.0 / end)
        b, c = span + before / start, change + 0.5 * before * before / start
        discriminant = b * b - 4.0 * inverse * c
        slope = 2.0 * c / (b + math.sqrt(discriminant)) if b > 0.0 and discriminant >= 0.0 else math.inf
        largest = min(limit, math.sqrt(c / inverse) if inverse > 0.0 else math.inf)
        if slope > largest:
            slope = largest
            span = c / slope + inverse * slope - before / start
        t1, bend = (slope - before) / start, sign * start
    t2 = span - slope / end
    v1 = first[1] + sign * 0.5 * (before + slope) * t1
    v2 = v1 + sign * slope * (t2 - t1)
    segments = [
        SpeedSegment(0.0, first[1], slope_before, bend),
        SpeedSegment(t1, v1, sign * slope),
        SpeedSegment(t2, v2, sign * slope, -sign * end),
        SpeedSegment(span, last[1], 0.0),
    ]
    return [piece for piece, after in pairwise(segments) if after.time > piece.time] + segments[-1:]

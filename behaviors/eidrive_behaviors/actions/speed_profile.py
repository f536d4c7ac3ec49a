"""SpeedProfileAction: a series of speeds over time."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise

from msgspec.structs import replace
from py_trees.common import Status

from eidrive_behaviors.actions.driven_vehicles import warn_of_reverse
from eidrive_behaviors.actions.reference_entities import check_presence
from eidrive_behaviors.actions.speed import slope_limit
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


class SpeedProfileAction(ActionBehaviour):
    """Sequence of entry speeds, each reached after its `time` or as fast as the limits allow.

    In the following mode `position` the speed is linear between entries. In `follow` the acceleration starts at zero
    and its change respects the rate limits: corners of the profile become parabolas. A profile whose corners are too
    close for that is driven linearly. The limits of the action precede those of the vehicle's Performance. With an
    entity, speeds are relative to its speed at the start.
    """

    domains = Domain.LONGITUDINAL
    action: model.SpeedProfileAction

    def initialise(self) -> None:
        """Build the profile from the current speed."""
        start = self.actor.motion.speed
        corners = self._corners(start)
        self._segments = linear_segments(corners)
        if self.action.following_mode is model.FollowingMode.FOLLOW:
            up, down = self._limit("max_acceleration_rate"), self._limit("max_deceleration_rate")
            if min(speed for _, speed in corners) < 0.0:
                up, down = (down, up) if max(speed for _, speed in corners) <= 0.0 else (min(up, down),) * 2
            if 0.0 < up < math.inf and 0.0 < down < math.inf:
                self._segments = smoothed_segments(corners, up, down) or self._segments
        self._elapsed = 0.0

    def update(self) -> Status:
        """Set the speed at the end of the step."""
        self._elapsed += self.context.dt
        index = max(0, bisect_right([piece.time for piece in self._segments], self._elapsed + EPSILON) - 1)
        done = index == len(self._segments) - 1
        speed = self._segments[-1].speed if done else self._segments[index].at(self._elapsed)
        if self.actor.driven:
            warn_of_reverse(self, speed)
            slope = 0.0 if done else self._segments[index].slope
            self.actor.set_goal(replace(self.actor.goal or Goal(), speed=speed, acceleration=slope))
        else:
            self.actor.motion.set_speed(speed)
        return Status.SUCCESS if done else Status.RUNNING

    def _corners(self, start: float) -> list[tuple[float, float]]:
        """Return times [s] and speeds [m/s] of the corners of the profile, the current one first."""
        name = self.action.entity_ref
        if name is None and self.action.entity_ref_element is not None:
            name = self.action.entity_ref_element.entity_ref
        if name is not None:
            check_presence(self, name)
        base = self.context.speed(name) if name is not None else 0.0
        top = self._limit("max_speed")
        corners = [(0.0, start)]
        for number, entry in enumerate(self.action.speed_profile_entry):
            time, speed = corners[-1]
            target = min(max(entry.speed + base, -top), top)
            span = entry.time
            if span is None:
                limit = slope_limit(speed, target, self._limit("max_acceleration"), self._limit("max_deceleration"))
                span = abs(target - speed) / limit if math.isfinite(limit) and limit > 0.0 else 0.0
            if span > EPSILON:
                corners.append((time + span, target))
            elif number > 0 or self.action.following_mode is model.FollowingMode.POSITION:
                corners[-1] = (time, target)
        return corners

    def _limit(self, name: str) -> float:
        """Return a limit of the action, else of the vehicle's Performance; infinite if neither specifies it."""
        entity = self.actor.entity
        performance = entity.performance if isinstance(entity, model.Vehicle) else None
        stated = (getattr(limits, name, None) for limits in (self.action.dynamic_constraints, performance))
        return next((float(limit) for limit in stated if limit is not None), math.inf)

    def describe(self) -> str:
        """Describe the speeds."""
        return f"speeds {', '.join(f'{entry.speed:g}' for entry in self.action.speed_profile_entry)} m/s in turn"


def linear_segments(corners: list[tuple[float, float]]) -> list[SpeedSegment]:
    """Return linear segments between the corners and a constant segment after the last one."""
    segments = []
    for (time, speed), (later, after) in pairwise(corners):
        segments.append(SpeedSegment(time, speed, (after - speed) / (later - time)))
    return [*segments, SpeedSegment(corners[-1][0], corners[-1][1], 0.0)]


def smoothed_segments(corners: list[tuple[float, float]], up: float, down: float) -> list[SpeedSegment] | None:
    """Return the profile with parabolic corners and slope changes of `up` and `down` [m/s³]; None if they overlap."""
    if len(corners) < 2:
        return linear_segments(corners)
    if len(corners) == 2:
        return _smoothed_change(corners[0], corners[1], up, down)
    lines = linear_segments(corners)
    segments: list[SpeedSegment] = []
    time, speed, slope = 0.0, corners[0][1], 0.0
    for number, line in enumerate(lines):
        bend = up if line.slope > slope else -down
        span = (line.slope - slope) / bend
        if number == 0:
            start = time
        else:
            gap = line.slope - slope
            meet = time if abs(gap) < EPSILON else time + (speed - line.at(time)) / gap
            start = meet - 0.5 * span
        if start < time - EPSILON:
            return None
        speed += slope * (start - time)
        segments.append(SpeedSegment(start, speed, slope, bend))
        speed += slope * span + 0.5 * bend * span * span
        time, slope = start + span, line.slope
        segments.append(SpeedSegment(time, speed, slope))
    return segments


def _smoothed_change(
    first: tuple[float, float], last: tuple[float, float], up: float, down: float
) -> list[SpeedSegment]:
    """Return one speed change without acceleration at its ends, in the given time or the shortest possible one.

    The slope changes at j1 at the start and at j2 at the end, with a segment of constant slope a between. The speed
    change is a (T - a/2 (1/j1 + 1/j2)).
    """
    change, span = last[1] - first[1], last[0] - first[0]
    sign = math.copysign(1.0, change)
    start, end = (up, down) if change > 0.0 else (down, up)
    inverse = 0.5 * (1.0 / start + 1.0 / end)
    discriminant = span * span - 4.0 * inverse * abs(change)
    slope = (
        (span - math.sqrt(discriminant)) / (2.0 * inverse) if discriminant > 0.0 else math.sqrt(abs(change) / inverse)
    )
    if discriminant <= 0.0:
        span = slope * 2.0 * inverse
    t1, t2 = slope / start, span - slope / end
    v1 = first[1] + sign * 0.5 * start * t1 * t1
    v2 = v1 + sign * slope * (t2 - t1)
    return [
        SpeedSegment(0.0, first[1], 0.0, sign * start),
        SpeedSegment(t1, v1, sign * slope),
        SpeedSegment(t2, v2, sign * slope, -sign * end),
        SpeedSegment(span, last[1], 0.0),
    ]

"""SpeedProfileAction: a series of speeds over time."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace
from itertools import pairwise

from py_trees.common import Status

from eidrive_behaviors.actions.speed import slope_limit
from eidrive_scenario.api.actions import ActionBehaviour, Domain, Goal, model
from eidrive_scenario.api.common import EPSILON


@dataclass(frozen=True)
class SpeedSegment:
    """From `time` [s] on: speed [m/s], its slope [m/s²] and the slope's slope [m/s³]."""

    time: float
    speed: float
    slope: float
    bend: float = 0.0

    def at(self, time: float) -> float:
        """The speed at a time."""
        t = time - self.time
        return self.speed + self.slope * t + 0.5 * self.bend * t * t


class SpeedProfileAction(ActionBehaviour):
    """Drives through the entries' speeds, each reached after its `time` or as fast as the limits allow.

    In the following mode `position` speeds go in straight lines from entry to entry. In `follow` the acceleration
    starts at zero and changes no faster than its rate limits: corners of the profile become parabolas about them. A
    profile whose corners lie too close for that is driven in straight lines. Limits are those of the action, else those
    of the vehicle's Performance. With an entity, speeds are relative to the speed that it has at the start.
    """

    domains = Domain.LONGITUDINAL
    action: model.SpeedProfileAction

    def initialise(self) -> None:
        """Lay the profile out from the present speed."""
        start = self.actor.motion.speed
        corners = self._corners(start)
        self._pieces = straight(corners)
        if self.action.following_mode is model.FollowingMode.FOLLOW:
            up, down = self._limit("max_acceleration_rate"), self._limit("max_deceleration_rate")
            if min(speed for _, speed in corners) < 0.0:
                up, down = (down, up) if max(speed for _, speed in corners) <= 0.0 else (min(up, down),) * 2
            if 0.0 < up < math.inf and 0.0 < down < math.inf:
                self._pieces = rounded(corners, up, down) or self._pieces
        self._elapsed = 0.0

    def update(self) -> Status:
        """The speed at the end of the step."""
        self._elapsed += self.context.dt
        index = max(0, bisect_right([piece.time for piece in self._pieces], self._elapsed + EPSILON) - 1)
        done = index == len(self._pieces) - 1
        speed = self._pieces[-1].speed if done else self._pieces[index].at(self._elapsed)
        if self.actor.driven:
            slope = 0.0 if done else self._pieces[index].slope
            self.actor.goal = replace(self.actor.goal or Goal(), speed=speed, acceleration=slope)
        else:
            self.actor.motion.speed = speed
        return Status.SUCCESS if done else Status.RUNNING

    def _corners(self, start: float) -> list[tuple[float, float]]:
        """Times [s] and speeds [m/s] of the profile's corners, the present one first."""
        name = self.action.entity_ref
        if name is None and self.action.entity_ref_element is not None:
            name = self.action.entity_ref_element.entity_ref
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
        """A limit of the action, else of the vehicle's Performance; infinite where neither states it."""
        entity = self.actor.entity
        performance = entity.performance if isinstance(entity, model.Vehicle) else None
        stated = (getattr(limits, name, None) for limits in (self.action.dynamic_constraints, performance))
        return next((float(limit) for limit in stated if limit is not None), math.inf)

    def describe(self) -> str:
        """Its speeds."""
        return f"speeds {', '.join(f'{entry.speed:g}' for entry in self.action.speed_profile_entry)} m/s in turn"


def straight(corners: list[tuple[float, float]]) -> list[SpeedSegment]:
    """Straight lines from corner to corner, constant after the last."""
    pieces = []
    for (time, speed), (later, after) in pairwise(corners):
        pieces.append(SpeedSegment(time, speed, (after - speed) / (later - time)))
    return [*pieces, SpeedSegment(corners[-1][0], corners[-1][1], 0.0)]


def rounded(corners: list[tuple[float, float]], up: float, down: float) -> list[SpeedSegment] | None:
    """The profile with parabolas at its corners, slopes changing at `up` and `down` [m/s³]; None where they overlap."""
    if len(corners) < 2:
        return straight(corners)
    if len(corners) == 2:
        return _swung(corners[0], corners[1], up, down)
    lines = straight(corners)
    pieces: list[SpeedSegment] = []
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
        pieces.append(SpeedSegment(start, speed, slope, bend))
        speed += slope * span + 0.5 * bend * span * span
        time, slope = start + span, line.slope
        pieces.append(SpeedSegment(time, speed, slope))
    return pieces


def _swung(first: tuple[float, float], last: tuple[float, float], up: float, down: float) -> list[SpeedSegment]:
    """One change of speed that begins and ends without acceleration, in the given time or, if too short, the least.

    With slopes that change at j1 at the start and j2 at the end and a stretch of constant slope a between, the change
    is a (T - a/2 (1/j1 + 1/j2)).
    """
    change, span = last[1] - first[1], last[0] - first[0]
    sign = math.copysign(1.0, change)
    start, end = (up, down) if change > 0.0 else (down, up)
    inverse = 0.5 * (1.0 / start + 1.0 / end)
    room = span * span - 4.0 * inverse * abs(change)
    slope = (span - math.sqrt(room)) / (2.0 * inverse) if room > 0.0 else math.sqrt(abs(change) / inverse)
    if room <= 0.0:
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

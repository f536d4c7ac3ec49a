"""Rollout of proposals: motion along the line with limits, walls and leaders."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.base.car_following import IntelligentDriver
from eidrive_scenario.driving.planning.behavior.proposals import HASTY, Bend, Body, Option, Proposal, Wall
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings

FREE, LIMIT, WALL = -1, -2, -3
"""Cause of the motion of a proposal in a step: nothing, a speed limit, or a wall (WALL - its index); an index from 0
on is that of a leading hypothesis."""
BEFORE = 1e9
"""Length of the line before its first point, where the first limit holds [m]."""

WallsOverTime = list[list[tuple[int, float]]]
"""Causes and places of the walls at each time [m]."""


class SpeedLimits(msgspec.Struct, frozen=True):
    """Speed limits (M,) [m/s] at distances along the line (M,) [m], and the wanted speed [m/s]."""

    along: Array
    values: Array
    wanted: float

    def at(self, s: Array) -> Array:
        """Return the limits at distances along the line, with constant decelerations between its points [m/s]."""
        return np.asarray(np.sqrt(np.interp(s, self.along, self.values**2)))


class LimitsAhead:
    """Speed limits within reach of a vehicle; between the points of the line their squares are linear, as with constant
    deceleration."""

    def __init__(self, along: Array, limits: Array) -> None:
        squares = limits**2
        # The first and the last entry stand for what is before and beyond the points.
        self._along: list[float] = [float(along[0]) - BEFORE, *along.tolist()]
        self._squares: list[float] = [float(squares[0]), *squares.tolist()]
        self._slopes: list[float] = [0.0, *(np.diff(squares) / np.diff(along)).tolist(), 0.0]

    @classmethod
    def of(cls, limits: SpeedLimits, s: float, reach: float) -> LimitsAhead | None:
        """Return the limits from s to s + reach [m]; None if none is below the wanted speed."""
        first = max(int(limits.along.searchsorted(s, side="right")) - 1, 0)
        last = int(limits.along.searchsorted(s + reach)) + 1
        part = limits.values[first:last]
        return cls(limits.along[first:last], part) if float(part.min()) < limits.wanted else None

    def at(self, s: float) -> tuple[float, float]:
        """Return the square of the limit at a distance along the line [m²/s²], and its derivative [m/s²]."""
        index = bisect_right(self._along, s) - 1
        slope = self._slopes[index]
        return slope * (s - self._along[index]) + self._squares[index], slope


def speed_after(square: float, slope: float, dt: float) -> float:
    """Return the speed v at the end of a time step with constant acceleration, at which v² reaches a linear bound.

    square  bound at the place that the vehicle reaches with half of its present speed [m²/s²]; slope  its derivative

    The vehicle is v dt / 2 farther at the end: v² = square + slope v dt / 2.
    """
    half = 0.25 * slope * dt
    root = half * half + square
    return max(half + math.sqrt(root), 0.0) if root > 0.0 else 0.0


def walls_over_time(walls: Sequence[Wall], times: list[float]) -> WallsOverTime:
    """Return the walls that exist at each time; without walls an empty list."""
    if not walls:
        return []
    return [[(WALL - number, wall.s) for number, wall in enumerate(walls) if time < wall.until] for time in times]


class Bounds:
    """Speeds that the wanted speed, speed limits, lateral motions and walls allow to one proposal.

    wanted  wanted speed [m/s];  gain  twice the deceleration before a wall or a lateral motion [m/s²]
    bends   lateral motions, between places of the reference point
    """

    def __init__(
        self, wanted: float, limits: LimitsAhead | None, walls: WallsOverTime, gain: float, bends: Sequence[Bend] = ()
    ) -> None:
        self.wanted = wanted
        self.are_free = wanted <= 0.0 or (limits is None and not walls and not bends)
        """Whether the wanted speed is the only bound."""
        self._limits = limits
        self._walls = walls
        self._bends = bends
        self._gain = gain

    def allow(self, s: float, speed: float, step: int, dt: float) -> tuple[float, int]:
        """Return the speed after a time step from a distance along the line [m] at a speed [m/s], and what determines
        it."""
        after, cause, gain = self.wanted, FREE, self._gain
        middle = s + 0.5 * speed * dt
        if self._limits is not None:
            limit = speed_after(*self._limits.at(middle), dt)
            if limit < after:
                after, cause = limit, LIMIT
        for begin, end, limit in self._bends:
            if middle < end:
                if middle < begin:
                    limit = max(speed_after(limit**2 + gain * (begin - middle), -gain, dt), limit)
                if limit < after:
                    after, cause = limit, LIMIT
        if self._walls:
            for number, end in self._walls[step]:
                allowed = speed_after(gain * (end - middle), -gain, dt)
                if allowed < after:
                    after, cause = allowed, number
        return after, cause


ROLLED = 6
"""Number of first steps whose causes are kept."""
NEGLIGIBLE = 1e-6
"""Deceleration due to a leader below which there is none [m/s²], and difference of accelerations that is none."""
BRISK = 2.4
"""Acceleration past standing objects in a lane of the opposite direction, where the vehicle should not stay long, if it
does not accelerate more anyway [m/s²]; nuPlan's limit of comfort. Not before curves and lower limits, and not to
overtake: it would have to slow down again."""
LEAST_GAP, LEAST_SPEED, LEAST_ACCELERATION = 1e-3, 1e-3, 1e-3
"""Minimum of gaps [m], desired speeds [m/s] and accelerations of vehicles [m/s²], by which the model divides."""

Leader = tuple[float, int, float, float]
"""Leader at a time: place of the reference point of the vehicle in contact with its rear [m], index of the hypothesis,
place of the reference point beside its center [m], and its speed [m/s]. So leaders sort by their rears."""


class Rollout(msgspec.Struct, frozen=True):
    """Motion of P proposals at K times: distance along the line s (P, K) [m], speed (P, K) [m/s], cause (P, ROLLED)."""

    s: Array
    speed: Array
    cause: Integers


class _Motion(NamedTuple):
    """Motion of one proposal: distances along the line [m], speeds [m/s], and causes."""

    s: list[float]
    speed: list[float]
    cause: list[int]


class Roller:
    """Rollout of proposals by the improved Intelligent Driver Model (Treiber and Kesting 2013, section 11.3.7).

    Below the wanted speed its gap in equilibrium is that of the settings, and it does not brake for larger ones.
    It computes with single numbers: for few proposals with few leaders each, arrays take four times as long.

    max_acceleration  of the vehicle [m/s²]
    """

    def __init__(self, settings: BehaviorSettings, times: Array, max_acceleration: float) -> None:
        self._times: list[float] = times.tolist()
        self._steps: list[float] = np.diff(times).tolist()
        self._braking = settings.comfortable_deceleration
        self._lateral_acceleration = HASTY * settings.lateral_acceleration
        able = max(max_acceleration, LEAST_ACCELERATION)
        self._driver = IntelligentDriver(
            time_gap=settings.time_gap,
            standstill_gap=settings.standstill_gap,
            acceleration=min(settings.acceleration, able),
            deceleration=settings.comfortable_deceleration,
            emergency=settings.hard_deceleration,
        )
        self.brisk_acceleration = min(max(settings.acceleration, BRISK), able)
        """Acceleration past standing objects in a lane of the opposite direction [m/s²]."""
        self._brisk_driver = replace(self._driver, acceleration=self.brisk_acceleration)

    def roll(
        self,
        options: Sequence[Option],
        limits: SpeedLimits,
        start: tuple[float, float],
        body: Body,
        scene: Surroundings,
    ) -> Rollout:
        """Return the motion of the options; `start` are the distance along the line [m] and the speed [m/s]."""
        reach = (max(limits.wanted, start[1]) + 1.0) * (self._times[-1] + 1.0)
        ahead = LimitsAhead.of(limits, start[0], reach)
        leaders = _Leaders(scene, (body.front, body.center))
        motion_of: dict[object, _Motion] = {}
        stops: dict[object, WallsOverTime] = {}
        motions = []
        for option in options:
            proposal = option.proposal
            number, leading = leaders.of(option.leads)
            ends = tuple([(wall.s, wall.until) for wall in option.walls])
            # The front axle follows the profile.
            bends = tuple(
                Bend(begin - body.wheelbase, end - body.wheelbase, top)
                for begin, end, top in option.profile.bends(self._lateral_acceleration, limits.wanted)
            )
            passes = ahead is None and not option.profile.overtakes and option.profile.uses_oncoming
            driver = self._brisk_driver if passes else self._driver
            key = (
                driver.acceleration,
                proposal.share,
                proposal.deceleration,
                proposal.is_emergency,
                number,
                ends,
                bends,
                option.time_gap,
            )
            if key not in motion_of:
                if ends not in stops:
                    stops[ends] = walls_over_time(option.walls, self._times)
                bounds = Bounds(proposal.share * limits.wanted, ahead, stops[ends], 2.0 * self._braking, bends)
                motion_of[key] = self._motion(proposal, driver, bounds, start, leading, option.time_gap)
            motions.append(motion_of[key])
        s, speed, cause = zip(*motions, strict=True)
        return Rollout(np.array(s), np.array(speed), np.array(cause))

    def _motion(
        self,
        proposal: Proposal,
        driver: IntelligentDriver,
        bounds: Bounds,
        start: tuple[float, float],
        leaders: list[list[Leader]],
        time_gap: float,
    ) -> _Motion:
        s, speed = start
        motion = _Motion([s], [speed], [])
        add_place, add_speed, add_cause = motion.s.append, motion.speed.append, motion.cause.append
        standstill_gap, exponent = driver.standstill_gap, driver.exponent
        greatest, least = driver.acceleration, -proposal.deceleration
        # Before a standing object the improved model tends to b²/b' - a: here the comfortable deceleration.
        twice_root = 2.0 * math.sqrt(greatest * driver.deceleration**2 / (greatest + driver.deceleration))
        is_emergency, is_free, desired = proposal.is_emergency, bounds.are_free, bounds.wanted
        for step, dt in enumerate(self._steps):
            cause = FREE
            if not is_free:
                desired, cause = bounds.allow(s, speed, step, dt)
            acceleration = least if is_emergency else (desired - speed) / dt
            if acceleration > greatest:
                acceleration = greatest
            # A leader has no effect on a vehicle that brakes with its limit or stands.
            if leaders[step] and (step < ROLLED or (acceleration > least and (speed > 0.0 or acceleration > 0.0))):
                hardest, slowest, leader = NEGLIGIBLE, math.inf, FREE
                # In the order of their rears, one that is not slower than a nearer one has no effect.
                for rear, hypothesis, center, other in leaders[step]:
                    if other < slowest and center > s:
                        slowest = other
                        wish = speed * time_gap + speed * (speed - other) / twice_root
                        gap = standstill_gap + wish if wish > 0.0 else standstill_gap
                        room = rear - s
                        share = gap / (room if room > LEAST_GAP else LEAST_GAP)
                        slowing = greatest * (share * share)
                        if slowing > hardest:
                            hardest, leader = slowing, hypothesis
                if leader != FREE:
                    bound = desired if desired > speed else speed
                    share = speed / (bound if bound > LEAST_SPEED else LEAST_SPEED)
                    free, square = greatest * (1.0 - share**exponent), hardest / greatest
                    if square >= 1.0:
                        follow = greatest - hardest
                    else:
                        follow = free * (1.0 - square ** (greatest / free)) if free > NEGLIGIBLE else 0.0
                    if follow < acceleration - NEGLIGIBLE:
                        cause = leader
                    if follow < acceleration:
                        acceleration = follow
            after = speed + (acceleration if acceleration > least else least) * dt
            if after < 0.0:
                after = 0.0
            s += 0.5 * (speed + after) * dt
            speed = after
            add_place(s)
            add_speed(speed)
            if step < ROLLED:
                add_cause(cause)
        return motion


class _Leaders:
    """Leaders of options over time; options with the same ones share them."""

    def __init__(self, scene: Surroundings, body: tuple[float, float]) -> None:
        front, center = body
        self._leaders: dict[int, list[list[Leader]]] = {}
        self._rears: list[list[float]] = (scene.rear - scene.passing_gap[:, None] - front).tolist()
        self._centers: list[list[float]] = (scene.s - center).tolist()
        self._speeds: list[list[float]] = scene.speed.tolist()

    def of(self, leads: Bools) -> tuple[int, list[list[Leader]]]:
        """Return a number of these leaders (N, K), the same for shared ones, and the leaders at each time."""
        number = id(leads)
        leaders = self._leaders.get(number)
        if leaders is None:
            leaders = self._leaders[number] = [[] for _ in range(leads.shape[1])]
            for hypothesis in np.logical_or.reduce(leads, axis=1).nonzero()[0].tolist():
                columns = (
                    leaders,
                    leads[hypothesis].tolist(),
                    self._rears[hypothesis],
                    self._centers[hypothesis],
                    self._speeds[hypothesis],
                )
                for ahead, leads_now, rear, center, speed in zip(*columns, strict=True):
                    if leads_now:
                        ahead.append((rear, hypothesis, center, speed))
            for ahead in leaders:
                if len(ahead) > 1:
                    ahead.sort()
        return number, leaders

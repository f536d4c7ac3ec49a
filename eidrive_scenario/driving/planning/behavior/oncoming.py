"""Use of a lane of the opposite direction: the view into it, the traffic on it, and the way back.

A maneuver that needs such a lane is verified in every tick. As long as the vehicle can give it up, it is enough that
the lane is free from the point on at which it cannot any more; from there to its return, neither traffic in view nor
traffic that may come out of view meets it.
"""

from __future__ import annotations

import math
from enum import Enum, auto
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.driving.planning.behavior.prediction import ASIDE, LANE_WIDTH
from eidrive_scenario.driving.planning.behavior.proposals import (
    AT_OFFSET,
    ONCOMING_SPEED,
    Body,
    LateralProfile,
    lateral_duration,
    least_length,
)
from eidrive_scenario.driving.planning.behavior.reference import LanesBeside, ReferenceLine
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings

LANES = 6.0
"""Offset from the line within which oncoming traffic counts at least [m]: two lanes."""
PAUSE = 6.0
"""Time of waiting without oncoming traffic after which traffic out of view is expected to drive as fast as that in view
did, or as the vehicle wants to, instead of at the speed limit [s]; of the order of the critical gaps of the Highway
Capacity Manual (4.1 to 7.5 s)."""
LONG, LONGEST = 2, 4
"""Number of pauses without oncoming traffic after which the vehicle relies on others to respond; and after which it
begins behind a standing object from where it does not see far enough: it would wait forever. A choice."""
RARE, MOST_HEADWAYS = 0.025, 2.0
"""Probability up to which a further vehicle is not expected, and maximum for each pause of the headway from which on it
is that small over the longest one until then: few say little about the next one."""
LEAST_HEADWAY = 1.0
"""Difference between expected arrivals that belong to different vehicles [s]."""
SLOWEST = 0.5
"""Share of the wanted speed that traffic out of view is expected to drive at least, and of the greatest speed in view
with which a vehicle in view is expected to arrive at least."""
FREE_TIME = 1.0
"""Time without an obstruction after which the vehicle does not wait any more [s]."""
FARTHEST = 150.0
"""Distance of the view into the oncoming lane for which the vehicle waits farther behind an object [m]: traffic at
50 km/h needs 11 s for it, about the duration of a maneuver from standstill."""
LONGEST_VIEW = 500.0
"""Distance up to which a view is of use [m]: traffic at 130 km/h needs 14 s for it, longer than a maneuver takes."""
SAMPLE = 2.0
"""Spacing of the places on the oncoming lane that are checked for a view [m]."""
RESPONSE, RESPONSE_DECELERATION = 1.0, 3.0
"""Response time [s] and deceleration [m/s²] of traffic that comes into view while the vehicle is in its lane; those of
RSS for a vehicle that keeps to its lane (Shalev-Shwartz et al. 2017)."""
HARD_RESPONSE = 6.0
"""Deceleration that the vehicle expects of such traffic after the longest pause [m/s²]; a choice."""
RESERVE = 1.5
"""Time that has to remain before traffic is met for a maneuver to begin [s]; one that has begun needs none, so that it
is not given up for the noise of a motion."""
NARROW = 1.0
"""Distance between an object and the center of the oncoming lane below which traffic has to slow down for it [m]: half
the width of a car."""
VIEWPOINT, TARGET = 1.5, 1.0
"""Heights of sensor and traffic above the road for the view over a crest [m]."""
BRAKING = 3.0
"""Deceleration with which a maneuver is given up [m/s²]; Autoware limits its stops for obstacles to about that."""
STOPPING_ERROR = 0.5
"""Distance by which the vehicle may stop too late [m]."""
SLOW, OVERRUN = 1.0, 0.3
"""Speed below which the vehicle stops at the border [m/s], and distance by which it may be beyond it then, and on its
way along the border to a place of waiting [m]."""
SLOPE_LENGTH = 0.1
"""Length of the way over which the slope of a profile is determined [m]."""
DELAY = 0.3
"""Time until the vehicle brakes [s]."""
BEHIND = 1.0
"""Gap behind an obstacle at which a maneuver that is given up ends [m]."""


class Verdict(Enum):
    """Result of the verification: go on; wait before the border of the lane, or follow at it; give the maneuver up."""

    GO = auto()
    WAIT = auto()
    FOLLOW = auto()
    GIVE_UP = auto()


class Motion(NamedTuple):
    """Motion along the line that is verified: distances [m] and speeds [m/s] (K,) of the reference point."""

    s: Array
    speed: Array


class Outlook(NamedTuple):
    """View of a vehicle at a time `now` [s]: its line, the objects, and the lanes beside the line."""

    line: ReferenceLine
    scene: Surroundings
    beside: LanesBeside
    now: float


class OncomingTraffic:
    """Oncoming traffic that one vehicle observes over time, and what may come from where it has no view.

    view  range of the perception of the vehicle [m]
    """

    def __init__(self, view: float, times: Array, body: Body, settings: BehaviorSettings) -> None:
        self._ahead: Array = np.arange(SAMPLE, min(view, LONGEST_VIEW) + SAMPLE, SAMPLE)
        """Distances of the places that are checked for a view [m]."""
        self._times = times
        self._body = body
        self._lateral_acceleration = settings.lateral_acceleration
        self._wanted = 0.0
        self._usual, self._fastest = 0.0, 0.0
        """Speed of traffic that is expected out of view, and greatest speed of traffic in view until now [m/s]."""
        self._others_yield = False
        """Whether the current maneuver began without a sufficient view."""
        self._last = -math.inf
        self._arrival = -math.inf
        """Time at which the next oncoming vehicle in view is beside the vehicle, if this stands [s]."""
        self._headways, self._longest_headway = 0, 0.0
        """Number of times between the arrivals of oncoming vehicles that were observed, and the longest one [s]."""
        self._held_up_since: float | None = None
        self._held_up_until = -math.inf
        self._free_to, self._free_at = -math.inf, 0.0
        """Place up to which the oncoming lane was free at a time [m, s]."""

    def observe(
        self,
        scene: Surroundings,
        center: float,
        wanted: float,
        now: float,
        *,
        held_up: bool,
        oncoming: float = math.nan,
        on_foot: Bools | bool = False,
    ) -> None:
        """Update by the objects at `now` [s].

        center   distance of the center of the vehicle along the line [m]
        wanted   wanted speed of the vehicle [m/s]
        held_up  whether the vehicle would pass something
        oncoming center of the lane of the opposite direction [m]; nan without one
        on_foot  whether objects (N,) are pedestrians, who are no traffic
        """
        reach = np.fmax(LANES, abs(oncoming) + LANE_WIDTH / 2.0)
        is_oncoming = (scene.speed[:, 0] < -ONCOMING_SPEED) & (np.abs(scene.d[:, 0]) < reach)
        is_oncoming &= ~(np.sign(oncoming) * scene.d[:, 0] < -LANE_WIDTH / 2.0)  # beside the lane of the vehicle
        is_oncoming &= (scene.front[:, 0] > center) & np.logical_not(on_foot)
        if is_oncoming.any():
            self._last = now
            if self._free_to == math.inf:
                self._free_to = -math.inf
            self._fastest = max(self._fastest, -float(scene.speed[is_oncoming, 0].min()))
            # A vehicle that stops comes ever later, and is not another one.
            speed = np.maximum(-scene.speed[is_oncoming, 0], SLOWEST * self._fastest)
            arrival = now + float(((scene.front[is_oncoming, 0] - center) / speed).min())
            headway = arrival - self._arrival
            if LEAST_HEADWAY < headway < math.inf:
                self._headways += 1
                self._longest_headway = max(self._longest_headway, headway)
            self._arrival = arrival
        self._wanted = wanted
        self._usual = max(self._fastest, SLOWEST * wanted) if self._fastest else wanted
        if held_up:
            self._held_up_until = now
            self._held_up_since = now if self._held_up_since is None else self._held_up_since
        elif now - self._held_up_until > FREE_TIME:
            self._held_up_since = None

    def hidden_speed(self, beside: LanesBeside, now: float) -> float:
        """Return the speed of traffic that may come from out of view [m/s]."""
        if self._is_patient(now) or math.isnan(beside.oncoming_limit):
            return self._usual
        return max(beside.oncoming_limit, self._usual)

    def _is_patient(self, now: float, pauses: int = 1) -> bool:
        """Return whether the vehicle has waited for a number of pauses, and no oncoming traffic came into view.

        A pause is longer after sparse traffic, whose next vehicle may still be beyond the range of the sensors: after n
        uniformly distributed headways up to an unknown limit, the next one is longer than x times the longest one with
        the probability x**-n / (n + 1).
        """
        pause = pauses * PAUSE
        if self._headways:
            longer = max(((self._headways + 1) * RARE) ** (-1.0 / self._headways), 1.0)
            in_view = float(self._ahead[-1]) / max(self._usual, ONCOMING_SPEED)
            pause = max(pause, min(longer, pauses * MOST_HEADWAYS) * self._longest_headway - in_view)
        return self._quiet(now) >= pause

    def _quiet(self, now: float) -> float:
        """Return the time for which the vehicle has waited without oncoming traffic in view [s]."""
        return now - max(self._last, now if self._held_up_since is None else self._held_up_since)

    def line_changed(self, shift: float | None) -> None:
        """Move what is known to be free to another line of the road, or forget it; traffic is that of the road.

        shift  increase of the distances along the line [m]; None if the vehicle has changed to a neighboring lane
        """
        self._free_to = -math.inf if shift is None else self._free_to + shift
        self._others_yield &= shift is not None

    def first_hidden(self, outlook: Outlook, viewpoint: tuple[float, float], step: int = 0) -> float:
        """Return the place on the oncoming lane nearest to the vehicle from which traffic may come unseen [m].

        viewpoint  distance along the line and offset of the vehicle [m];  step  index of the time
        """
        line, scene, oncoming = outlook.line, outlook.scene, outlook.beside.oncoming
        s, d = viewpoint
        places = s + self._ahead
        # Traffic behind an oncoming vehicle is not faster than that, and an object in the lane slows traffic down: they
        # hide none that counts.
        beside_lane = np.abs(scene.d[:, step] - oncoming) - scene.half_width[:, step] >= NARROW
        rows = (scene.speed[:, step] >= -ONCOMING_SPEED) & beside_lane
        center, half = scene.d[rows, step, None], scene.half_width[rows, step, None]
        edges = np.concatenate([scene.rear[rows, step], scene.front[rows, step]])
        # A line to a place on the oncoming lane passes an edge of an object at this share of its length; it is hidden
        # where it crosses the body between both edges.
        share = ((edges - s)[:, None] / (places - s)).reshape(2, -1, len(places))
        at_edge = d + share * (oncoming - d)
        crosses = (share > 0.0) & (share < 1.0) & (at_edge > center - half) & (at_edge < center + half)
        hidden: Bools = np.logical_or.reduce(crosses, axis=(0, 1))
        if line.heights is not None:
            hidden |= _beyond_crest(line.along, line.heights, s, self._ahead)
        first = int(hidden.argmax()) if hidden.any() else len(places)
        return float(s + first * SAMPLE)

    def verify(
        self,
        profile: LateralProfile,
        motion: Motion,
        outlook: Outlook,
        *,
        is_current: bool,
        has_begun: bool = False,
    ) -> Verdict:
        """Return whether the vehicle may follow a profile that uses the oncoming lane.

        is_current  whether it follows the profile already; then it needs no reserve
        has_begun   whether it does so to pass, instead of waiting on it
        """
        scene = outlook.scene
        if math.isnan(outlook.beside.oncoming):
            return Verdict.GO
        body, side, times, border = self._body, profile.side, self._times, profile.border
        offsets = side * np.maximum(side * profile.offset(motion.s + body.wheelbase), side * profile.offset(motion.s))
        outside: Bools = side * offsets > border
        if not outside.any():
            return Verdict.GO
        first = int(outside.argmax())
        back, return_s = self._return(profile, motion, outside)
        passed = self._passed(profile, float(motion.s[0]), scene)
        # Behind what moves there is no place to wait.
        moves = bool((scene.speed[passed, 0] > ONCOMING_SPEED).any())
        beyond = side * offsets - border
        stop = motion.speed**2 / (2.0 * BRAKING) + motion.speed * DELAY
        if not moves:
            # A vehicle on its way out comes farther out while it brakes.
            fronts = motion.s + body.wheelbase
            slopes = side * (profile.offset(fronts + SLOPE_LENGTH) - profile.offset(fronts)) / SLOPE_LENGTH
            beyond = beyond + 0.5 * stop * np.maximum(slopes, 0.0)
        # Where it may stand beyond the border it need not return.
        possible, duration = self._can_give_up(motion, scene, passed, np.maximum(beyond - OVERRUN, 0.0))
        if first and not moves:
            # Behind a standing object there is seldom space to return: the vehicle stops before the border.
            possible &= motion.s + stop <= float(motion.s[first])
        last = int(possible.argmin()) - 1 if not possible.all() else len(times) - 1
        if last < 0 and first == 0:
            return Verdict.GO
        is_at_border = side * float(offsets[0]) < border + OVERRUN
        waits = float(motion.speed[0]) < SLOW or float(motion.s[0]) + body.wheelbase < profile.waits_at < math.inf
        held = Verdict.FOLLOW if moves else Verdict.WAIT
        refused = held if first or (is_at_border and waits and not moves) else Verdict.GIVE_UP
        end, until = return_s + body.front, back if is_current else back + RESERVE
        traffic = self._traffic(profile, motion, scene, first)
        if math.isinf(back):
            return refused
        if self._meets(scene, traffic, until, end):
            self._others_yield = False  # Traffic has come into view: the pauses restart.
            return refused
        if last < 0 and has_begun:
            return Verdict.GO  # The point of no return has passed, and nothing is in view.
        self._others_yield &= is_current
        if self._others_yield:
            return Verdict.GO
        viewpoints = motion.s + body.center
        beside_line = profile.offset(viewpoints)
        here = (float(viewpoints[0]), float(beside_line[0]))
        # Traffic out of view behind that in view does not come before it, nor before what has stopped beyond the end.
        centered = np.abs(scene.d[:, 0] - outlook.beside.oncoming) < ASIDE
        has_stopped = centered & (np.abs(scene.speed[:, 0]) <= ONCOMING_SPEED) & (scene.rear[:, 0] > end)
        nearest: Array = scene.front[traffic | has_stopped].min(axis=0, initial=math.inf)
        free = self._free(outlook, here, until, end, float(nearest[0]))
        if free >= nearest[0] or self._suffices(free, here[0], until, end, outlook):
            return Verdict.GO
        step = max(last, 0)
        there = (float(viewpoints[step]), float(beside_line[step]))
        hidden = self.first_hidden(outlook, there, step)
        if hidden < nearest[step] and not self._suffices(hidden, there[0], until - float(times[step]), end, outlook):
            return refused
        # Until then the vehicle may have to return to its lane for traffic that comes into view on its way out.
        free_to, before, observer = free, 0, here[0]
        for number in range(first, step + 1 if step > first else first):
            time, s = float(times[number]), float(viewpoints[number])
            elapsed = time - float(times[before])
            returned = elapsed + float(duration[number])
            is_free = free_to >= nearest[before]
            if not is_free and not self._suffices(free_to, observer, returned, s + body.half_length, outlook):
                return refused
            hidden = self.first_hidden(outlook, (s, float(beside_line[number])), number)
            free_to = max(hidden, free_to - self.hidden_speed(outlook.beside, outlook.now) * elapsed)
            before, observer = number, s
        return Verdict.GO

    def until_border(self, profile: LateralProfile, motion: Motion) -> float:
        """Return the time for which a vehicle that goes out along a profile can still stop in its lane [s]."""
        places = motion.s + motion.speed**2 / (2.0 * BRAKING) + motion.speed * DELAY
        outside: Bools = profile.side * profile.offset(places + self._body.wheelbase) > profile.border
        return float(self._times[max(int(outside.argmax()) - 1, 0)])

    def yields(
        self,
        outlook: Outlook,
        viewpoint: tuple[float, float],
        *,
        is_last_place: bool,
        has_view: bool,
        until_border: float = 0.0,
    ) -> bool:
        """Return whether a vehicle that has waited in vain for a view may begin, since traffic that comes into view can
        stop before it.

        is_last_place  whether there is no other place to wait at
        has_view       whether the vehicle waits at a place with a view, where it waits longer
        until_border   time for which it can still stop in its lane after it began [s]: after the first pause, it begins
                       that much earlier
        """
        hidden = self.first_hidden(outlook, viewpoint)
        front = viewpoint[0] + self._body.half_length
        at_border = outlook.now + until_border
        has_waited_long = self._is_patient(at_border, LONG)
        way = approach(self._usual, math.inf)
        if has_waited_long:
            way = approach(min(self._usual, self._wanted), math.inf, HARD_RESPONSE)
        is_patient = has_waited_long or (is_last_place and not has_view)
        waits_in_vain = is_last_place and self._is_patient(at_border, LONGEST)
        begins = waits_in_vain or (is_patient and hidden - way >= front)
        self._others_yield = begins and self._is_patient(outlook.now)
        return self._others_yield

    def _suffices(self, hidden: float, viewpoint: float, duration: float, end: float, outlook: Outlook) -> bool:
        """Return whether traffic from a hidden place does not come to `end` in a time [s]."""
        if self._is_over(hidden, viewpoint, duration, end, outlook.now):
            return hidden >= end
        speed = self.hidden_speed(outlook.beside, outlook.now)
        way = speed * duration if self._is_patient(outlook.now) else approach(speed, duration)
        return hidden - way >= end

    def _is_over(self, hidden: float, viewpoint: float, duration: float, end: float, now: float) -> bool:
        """Return whether no more traffic is expected from beyond the range of the sensors at `viewpoint`, where nothing
        else hides it: after the pause, and after traffic not before a time without any that is long against that in
        which some could come to `end` unseen.

        If vehicles come at random with an unknown rate, a time t without one after the last is followed by a time u
        with one with the probability u / (t + u).
        """
        if not self._is_patient(now) or not self._is_in_view(hidden, viewpoint):
            return False
        unseen = duration - (hidden - end) / max(self._usual, ONCOMING_SPEED)
        return math.isinf(self._last) or unseen <= RARE * (self._quiet(now) + unseen)

    def _is_in_view(self, hidden: float, viewpoint: float) -> bool:
        """Return whether nothing but the range of the sensors limits the view from `viewpoint`."""
        return hidden >= viewpoint + float(self._ahead[-1]) - SAMPLE

    def _free(
        self, outlook: Outlook, viewpoint: tuple[float, float], duration: float, end: float, nearest: float
    ) -> float:
        """Return the place up to which the oncoming lane is free, at most that of the `nearest` traffic in view [m].

        What was in view stays free until traffic can have come there: the traffic in view, too, which an obstacle may
        hide soon. Where none is expected from beyond the range of the sensors, none is expected until some comes into
        view.
        """
        now = outlook.now
        still_free = self._free_to - self.hidden_speed(outlook.beside, now) * (now - self._free_at)
        hidden = self.first_hidden(outlook, viewpoint)
        if self._is_over(hidden, viewpoint[0], duration, end, now) and hidden >= end:
            hidden = math.inf
        self._free_to, self._free_at = min(max(still_free, hidden), nearest), now
        return self._free_to

    def place_with_view(self, profile: LateralProfile, scene: Surroundings, oncoming: float, s: float) -> float:
        """Return the place of the front axle nearest to the passed objects from which the vehicle, at the edge of its
        lane, sees the oncoming lane up to the range of its sensors, at most `FARTHEST` [m].

        oncoming  center of the oncoming lane [m];  s  place of the reference point [m]
        """
        rows = self._passed(profile, s, scene)
        edge = profile.border - 2.0 * AT_OFFSET  # with the error of the lateral control
        covered = float((profile.side * scene.d[rows, 0] + scene.half_width[rows, 0]).max(initial=edge)) - edge
        # The line of sight past the nearer corner of an object reaches the center of the lane at the range.
        gap = min(float(self._ahead[-1]), FARTHEST) * covered / max(profile.side * oncoming - edge, AT_OFFSET)
        return float(scene.rear[rows, 0].min(initial=math.inf)) - gap + self._body.wheelbase - self._body.center

    def waiting_place(self, profile: LateralProfile, s: float) -> float:
        """Return the place of the reference point at which the vehicle reaches the border of its lane [m]; `s` if it
        is beyond it already."""
        if math.isfinite(profile.waits_at):
            return max(profile.waits_at - self._body.wheelbase - STOPPING_ERROR, s)
        places = np.arange(s, profile.places[-1], 0.1)
        outside: Bools = profile.side * profile.offset(places + self._body.wheelbase) > profile.border
        return max(float(places[outside.argmax()]) - STOPPING_ERROR, s) if outside.any() else math.inf

    def place_behind(
        self, profile: LateralProfile, motion: tuple[float, float], scene: Surroundings, deceleration: float
    ) -> float | None:
        """Return the place of the reference point at which a vehicle that brakes falls behind what it passes [m]; None
        if that stands, or if the vehicle does not come beside it.

        motion  distance along the line [m] and speed [m/s]
        """
        s, speed = motion
        passed = self._passed(profile, s, scene).nonzero()[0]
        if not passed.size:
            return None
        nearest = passed[scene.rear[passed, 0].argmin()]
        gap, other = float(scene.rear[nearest, 0]) - s - self._body.front - BEHIND, float(scene.speed[nearest, 0])
        closing = speed - other
        square = closing**2 - 2.0 * deceleration * gap
        if other <= ONCOMING_SPEED or square <= 0.0 or (gap >= 0.0 and closing <= 0.0):
            return None
        duration = min(closing + math.sqrt(square), speed) / deceleration
        return s + (speed - 0.5 * deceleration * duration) * duration

    def _return(self, profile: LateralProfile, motion: Motion, outside: Bools) -> tuple[float, float]:
        """Return time and place of the reference point at which the vehicle is back in its lane; inf if never."""
        if not outside[-1]:
            last = len(outside) - int(outside[::-1].argmax())
            return float(self._times[last]), float(motion.s[last])
        places = np.linspace(profile.places[-2], profile.places[-1], 20)
        inside: Bools = profile.side * profile.offset(places) <= profile.border
        return_s = max(float(places[inside.argmax()]) if inside.any() else math.inf, float(motion.s[-1]))
        speed = float(motion.speed[-1])
        if speed <= ONCOMING_SPEED:
            return math.inf, return_s
        return float(self._times[-1]) + (return_s - float(motion.s[-1])) / speed, return_s

    def _passed(self, profile: LateralProfile, s: float, scene: Surroundings) -> Bools:
        """Return which hypotheses (N,) the profile passes: in the lane ahead of the rear of the vehicle at `s`."""
        in_lane = np.abs(scene.d[:, 0]) - scene.half_width[:, 0] < self._body.half_width + scene.margin
        ahead = scene.front[:, 0] > s - self._body.rear
        near = scene.rear[:, 0] < profile.places[-2]
        return np.asarray(in_lane & ahead & near & (scene.speed[:, 0] > -ONCOMING_SPEED) & ~scene.crosses[:, 0])

    def _can_give_up(self, motion: Motion, scene: Surroundings, passed: Bools, excess: Array) -> tuple[Bools, Array]:
        """Return when (K,) the vehicle can still return behind what it passes, and how long the return takes (K,) [s].

        passed  which hypotheses it passes (N,)
        excess  distance by which the vehicle is beyond the border of its lane (K,) [m]
        """
        duration = lateral_duration(excess, self._lateral_acceleration)
        if not passed.any():
            return np.zeros(len(excess), dtype=bool), duration
        rear = scene.rear[passed]
        nearest = rear.argmin(axis=0)
        columns = np.arange(rear.shape[1])
        gap = rear[nearest, columns] - motion.s - self._body.front
        closing = np.maximum(motion.speed - np.maximum(scene.speed[passed][nearest, columns], 0.0), 0.0)
        # The return needs a length on the road, of which the object ahead covers its share meanwhile.
        length = np.maximum(motion.speed * duration, least_length(excess))
        returning = length * closing / np.maximum(motion.speed, ONCOMING_SPEED)
        braking = closing**2 / (2.0 * BRAKING)
        return np.asarray(gap >= np.maximum(returning, braking) + BEHIND), duration

    def _traffic(self, profile: LateralProfile, motion: Motion, scene: Surroundings, first: int) -> Bools:
        """Return which hypotheses (N,) are oncoming traffic in view, ahead of the vehicle at the step `first`."""
        aside = np.abs(profile.side * max(abs(value) for value in profile.values) - scene.d)
        beside = aside - scene.half_width < self._body.half_width + scene.margin[:, None] * 0.5
        comes = np.logical_or.reduce(beside & (scene.speed < -ONCOMING_SPEED), axis=1)
        return np.asarray(comes & (scene.front[:, first] > float(motion.s[first]) - self._body.rear))

    def _meets(self, scene: Surroundings, traffic: Bools, until: float, end: float) -> bool:
        """Return whether traffic (N,) is before `end` [m] at the time `until` [s]: then the vehicle meets it."""
        # Beyond the horizon all keep their last speeds.
        step = min(int(np.searchsorted(self._times, until)), len(self._times) - 1)
        rear = scene.rear[:, step] + scene.speed[:, step] * max(until - float(self._times[-1]), 0.0)
        return bool((traffic & (rear < end)).any())


def approach(speed: float, duration: float, deceleration: float = RESPONSE_DECELERATION) -> float:
    """Return the way of traffic that comes into view, responds to the vehicle in its lane, and brakes [m]."""
    braking = min(max(duration - RESPONSE, 0.0), speed / deceleration)
    return speed * min(duration, RESPONSE) + speed * braking - 0.5 * deceleration * braking**2


def _beyond_crest(along: Array, heights: Array, s: float, ahead: Array) -> Bools:
    """Return which distances `ahead` of a place on the line (P,) the road between hides; its heights are those `along`
    the line."""
    here = float(np.interp(s, along, heights)) + VIEWPOINT
    road = np.interp(s + ahead, along, heights) - here
    # The steepest line of sight over the road up to each place; traffic below it is hidden.
    steepest = np.maximum.accumulate(road / ahead)
    return np.asarray((road + TARGET) / ahead < steepest)

"""Proposals: trajectories along lanes, with lateral motion, and the speed that each aims at."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.driving.planning.behavior.prediction import LANE_WIDTH
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings
from eidrive_scenario.driving.planning.path import approached
from eidrive_scenario.world.actor import ActorSpec

ROUTE = "route"
"""Name of the maneuver without a lateral deviation."""
PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)
"""Peak of the second derivative of the quintic blend from 0 to 1 in unit time: 5.774."""
PEAK_LEAVING = 3.94
"""Peak of the second derivative of the quintic that leaves 0 with derivative 1 and returns to it, in unit time."""
HASTY = 2.0
"""Share of the lateral acceleration with which the vehicle leaves a lane of the opposite direction, and ends a motion
away from its aim: 4 m/s² by default, below nuPlan's limit of comfort, 4.89 m/s²."""
SHORTEST = 11.0
"""Minimum length of a lateral motion by a lane [m]; a car steers about that tightly at walking speed."""
TIGHTER = 1.5
"""Share of the lateral acceleration up to which an obstacle is passed that was recognized late."""
TIGHTEST = 0.6
"""Share of the length of a lateral motion in which most of it must be possible."""
WALKING_PACE = 2.0
"""Least speed for which lateral motions are made [m/s]; in a traffic-calmed area German courts accept 4 to 7 km/h."""
AT_OFFSET = 0.1
"""Difference to an offset up to which the vehicle is there [m]; its control has errors of this size."""
SHORTEST_WAY = 0.1
"""Minimum distance to a place with a view for a vehicle at the edge of its lane [m]."""


class Body(NamedTuple):
    """Distance of the center ahead of the rear axle, half length, half width, and wheelbase of the vehicle [m]."""

    center: float
    half_length: float
    half_width: float
    wheelbase: float

    @classmethod
    def of(cls, spec: ActorSpec) -> Body:
        """Return the body of an actor."""
        return cls(spec.offset[0], spec.size[0] / 2.0, spec.size[1] / 2.0, spec.wheelbase)

    @property
    def front(self) -> float:
        """Distance of the front end ahead of the rear axle [m]."""
        return self.center + self.half_length

    @property
    def rear(self) -> float:
        """Distance of the rear end behind the rear axle [m]."""
        return self.half_length - self.center


class Bend(NamedTuple):
    """Lateral motion from `begin` to `end` [m], and the speed that it allows [m/s]."""

    begin: float
    end: float
    speed: float


class LateralProfile(msgspec.Struct, frozen=True):
    """Offset to the left of the reference line as a function of the distance along it.

    name   what the vehicle does, the same for all profiles of one maneuver
    places (M,) distances along the line at which the values hold [m], increasing
    values (M,) offsets [m]; constant before the first and after the last place
    slope  derivative at the first place
    side   +1 for a maneuver to the left of the route, -1 to the right, 0 for the route itself
    """

    name: str
    places: tuple[float, ...]
    values: tuple[float, ...]
    slope: float = 0.0
    side: int = 0
    overtakes: float = 0.0
    """Speed of the fastest object that it overtakes [m/s]; 0 if it passes standing ones only."""
    waits_at: float = math.inf
    """Place of the front axle at which it may wait at the edge of its lane for a view [m]; inf without one."""
    border: float = math.inf
    """Distance from the line to `side` beyond which the vehicle is in a lane of the opposite direction [m]."""
    gives_up: bool = False
    """Whether it leaves a lane of the opposite direction behind what should have been passed: the vehicle may brake for
    it as in an emergency."""

    def offset(self, s: Array) -> Array:
        """Return the offsets (…) at distances (…) along the line."""
        if len(self.places) == 1:
            return np.full(s.shape, self.values[0])
        places, values = np.array(self.places), np.array(self.values)
        index = places[1:-1].searchsorted(s, side="right")
        begin, length = places[index], (places[1:] - places[:-1])[index]
        share = np.minimum(np.maximum((s - begin) / length, 0.0), 1.0)
        offsets = values[index] + (values[1:] - values[:-1])[index] * blend(share)
        if self.slope:
            first = np.where(index == 0, share, 1.0)
            offsets = offsets + self.slope * float(places[1] - places[0]) * _leaving(first)
        return np.asarray(offsets)

    def offset_at(self, s: float) -> float:
        """Return the offset at one distance along the line [m]."""
        return float(self.offset(np.array([s]))[0])

    def slope_at(self, s: float) -> float:
        """Return the derivative of the offset."""
        before, after = self.offset(np.array([s - 0.05, s + 0.05])).tolist()
        return float(after - before) / 0.1

    @property
    def edge(self) -> float:
        """Offset at which the vehicle is at the edge of its lane, from where it sees past what it overtakes [m]."""
        return self.side * (self.border - AT_OFFSET)

    def bends(self, lateral_acceleration: float, wanted: float) -> list[Bend]:
        """Return the lateral motions that allow less than the wanted speed [m/s] with this peak acceleration [m/s²]."""
        bends = []
        for begin, end, before, after in zip(self.places, self.places[1:], self.values, self.values[1:], strict=False):
            speed = (end - begin) / max(math.sqrt(PEAK_ACCELERATION * abs(after - before) / lateral_acceleration), 1e-9)
            if speed < wanted:
                bends.append(Bend(begin, end, speed))
        return bends

    @property
    def last(self) -> float:
        """Offset at the end of the maneuver [m]."""
        return self.values[-1]

    @property
    def uses_oncoming(self) -> bool:
        """Whether the vehicle enters a lane of the opposite direction."""
        return self.side * max(self.values, key=abs) > self.border


def blend(share: Array) -> Array:
    """Return the quintic blend from 0 to 1, with derivatives of 0 at both ends."""
    return np.asarray(share**3 * (10.0 + share * (6.0 * share - 15.0)))


def _leaving(share: Array) -> Array:
    """Return the quintic with value 0 at both ends and derivative 1 at the start."""
    return np.asarray(share * (1.0 - share * share * (6.0 - share * (8.0 - 3.0 * share))))


def change_length(change: float, speed: float, lateral_acceleration: float) -> float:
    """Return the length of a lateral motion by `change` [m] at a speed [m/s] with this peak acceleration [m/s²]."""
    if not change:
        return 1.0
    by = np.array(abs(change))
    return max(float(lateral_duration(by, lateral_acceleration)) * speed, float(least_length(by)), 1.0)


def lateral_duration(change: Array, lateral_acceleration: float) -> Array:
    """Return the durations of lateral motions by distances `change` [m] with this peak acceleration [m/s²]."""
    return np.asarray(np.sqrt(PEAK_ACCELERATION * change / lateral_acceleration))


def least_length(change: Array) -> Array:
    """Return the minimum lengths of lateral motions by distances `change` [m]."""
    return np.asarray(SHORTEST * np.sqrt(np.minimum(change / LANE_WIDTH, 1.0)))


class Start(NamedTuple):
    """Start of a lateral motion: distance along the line and offset [m], slope of the offset, and speed [m/s]."""

    s: float
    offset: float
    slope: float
    speed: float


def towards(name: str, value: float, start: Start, lateral_acceleration: float, side: int = 0) -> LateralProfile:
    """Return the motion to a constant offset."""
    s, offset, slope, speed = start
    length = change_length(value - offset, speed, lateral_acceleration)
    length = max(length, PEAK_LEAVING * abs(slope) * speed**2 / (HASTY * lateral_acceleration))
    return LateralProfile(name, (s, s + length), (offset, value), slope, side)


def to_lane(offset: float, start: Start, lateral_acceleration: float) -> LateralProfile:
    """Return the change to the lane with its center at an offset."""
    return towards(lane_change_name(offset), offset, start, lateral_acceleration, 1 if offset > 0.0 else -1)


def lane_change_name(offset: float) -> str:
    """Return the name of the change to a lane with its center at an offset."""
    return f"change lane to the {'left' if offset > 0.0 else 'right'}"


def passing(
    name: str,
    value: float,
    obstacle: tuple[float, float],
    start: Start,
    lateral_acceleration: float,
    side: int,
    *,
    lengths: tuple[float, float],
    stands: bool = False,
) -> LateralProfile | None:
    """Return the motion to an offset before `obstacle` (start and end along the line) and back to 0 behind it.

    The result is None if the obstacle is too near for it. A vehicle at the offset, or farther aside, may be beside an
    obstacle that `stands`: it needs no motion before it.

    lengths  of the motions to the offset, if there is space for it, and back [m]
    """
    begin, end = obstacle
    s, offset, slope, speed = start
    length, back = lengths
    if stands and side * (value - offset) <= AT_OFFSET:
        begin = max(begin, s + length)
    first = max(begin - length, s)
    if begin - first < TIGHTEST * change_length(value - offset, speed, TIGHTER * lateral_acceleration):
        return None
    places, values = [s], [offset]
    if first > s + 0.5 and abs(offset) < 0.3:
        places.append(first)
        values.append(offset)
    places += [max(begin, places[-1] + 1.0)]
    places += [max(end, places[-1] + 0.5)]
    places += [places[-1] + back]
    return LateralProfile(name, tuple(places), (*values, value, value, 0.0), slope, side)


def with_view(
    profile: LateralProfile, start: Start, settings: BehaviorSettings, body: Body, viewpoint: float, onward_speed: float
) -> LateralProfile | None:
    """Return a profile past an obstacle in two lateral motions, with a way at the edge of the lane between them, where
    the vehicle has a view into the oncoming lane.

    The result is None if there is not enough space, or if the profile has such a way already.

    viewpoint  place of the front axle at which the view from the center of the vehicle is sufficient [m]
    onward_speed  speed beside the obstacle if the vehicle does not wait [m/s]
    """
    s, offset, slope, speed = start
    edge = profile.edge
    begin, end, back = profile.places[-3:]
    value = profile.values[-2]
    acceleration = settings.lateral_acceleration
    length = change_length(edge - offset, max(speed, WALKING_PACE), acceleration)
    lengths = (
        change_length(value - edge, onward_speed, HASTY * acceleration),
        change_length(value - edge, WALKING_PACE, acceleration),
    )
    starts = [begin - onward for onward in lengths]
    if abs(edge - offset) <= AT_OFFSET:
        # It is at the edge, and keeps its offset up to the place, instead of a place that is farther.
        edge, length = offset, SHORTEST_WAY
    onward = next((start for start in starts if s + length <= start), None)
    if math.isfinite(profile.waits_at) or onward is None:
        return None
    waits_at = min(viewpoint, onward)
    # The vehicle looks from its center, which comes to the edge after the front axle.
    at_edge = waits_at - (body.wheelbase - body.center)
    first = max(at_edge - length, s)
    before = ((s, offset), (first, offset)) if first - s >= 1.0 else ((s, offset),)
    after = ((first + length, edge), (onward, edge), (begin, value), (end, value), (back, 0.0))
    places, values = zip(*before, *after, strict=True)
    return msgspec.structs.replace(profile, places=places, values=values, slope=slope, waits_at=waits_at)


Precedence = Literal["all", "earlier", "none"]
"""Crossing and merging traffic to which a proposal gives way: all of it, what arrives earlier, or none."""

LEAST_EMERGENCY = 5.0
"""Least deceleration of emergency braking [m/s²] (UN Regulation 152: 5 m/s² at least)."""
SPEED_SHARES = (1.0, 0.7, 0.4)
"""Target speeds of proposals, as shares of the wanted speed."""
TOWARDS_GAP = (0.95, 0.85, 0.7, 0.5, 0.3)
"""Target speeds of proposals by which a vehicle comes beside a gap, as shares of the wanted speed."""
SIMILAR_SPEED = 1.0
"""Difference of speeds up to which objects are overtaken together [m/s]."""
ONCOMING_SPEED = 0.5
"""Speed against the direction of the vehicle above which an object is oncoming [m/s]."""
BEFORE_ZONE = 1.5
"""Distance between the front of a waiting vehicle and the zone that others cross [m]."""
LEAST_TOP = 0.5
"""Least top speed by which the time to cover a gap is computed, so that it is finite [m/s]; a choice."""
RELEASE = 0.3
"""Time after which a zone counts as free when the crossing object has left it [s]."""


class Proposal(msgspec.Struct, frozen=True):
    """Proposal: index of its lateral profile, share of the wanted speed, and precedence of others.

    deceleration  maximum deceleration [m/s²];  is_emergency  whether the vehicle brakes with it constantly
    """

    profile: int
    share: float
    precedence: Precedence
    deceleration: float
    is_emergency: bool = False
    is_gentle: bool = False
    """Whether it stops with comfortable braking, whatever is ahead."""


class Wall(msgspec.Struct, frozen=True):
    """Place that the reference point of the vehicle does not pass before a time [s]."""

    s: float
    until: float
    reason: str
    owner: int | None = None
    """Index of the hypothesis for which the vehicle waits."""


class Option(msgspec.Struct, frozen=True):
    """Proposal with the profile that it follows and what it reacts to.

    walls  places before which it waits
    leads  where the hypotheses lead it (N, K); options may share an array
    time_gap  behind leaders [s]
    """

    proposal: Proposal
    profile: LateralProfile
    walls: Sequence[Wall]
    leads: Bools
    time_gap: float


class Conflict(msgspec.Struct, frozen=True):
    """Object that enters the way of one profile later.

    first, last  indices of the times of its occupation;  s  first place that it occupies [m]
    crosses      False for an object that then drives in the direction of the vehicle
    """

    hypothesis: int
    first: int
    last: int
    s: float
    crosses: bool


def inside_way(scene: Surroundings, profile: LateralProfile, half_width: float) -> Bools:
    """Return where hypotheses are in the way (N, K) of a vehicle that follows a profile.

    The vehicle is beside an object that it overtakes as soon as it reaches it, wherever the object is now.
    """
    s = scene.s
    if profile.overtakes:
        slow = (scene.speed[:, 0] > ONCOMING_SPEED) & (scene.speed[:, 0] <= profile.overtakes + SIMILAR_SPEED)
        s = np.where((slow & (scene.rear[:, 0] < profile.places[-2]))[:, None], profile.places[-2], s)
    gap = np.abs(profile.offset(s) - scene.d) - scene.half_width
    return np.asarray(gap < half_width + scene.margin[:, None] * 0.5)


def conflicts(scene: Surroundings, way: Bools, here: float) -> list[Conflict]:
    """Return the objects that cross the way (N, K) or enter it later, ahead of the vehicle `here` [m]."""
    entering = []
    meets: Bools = np.logical_or.reduce(way & scene.crosses, axis=1) | (np.logical_or.reduce(way, axis=1) & ~way[:, 0])
    for hypothesis in (meets & ~scene.behind).nonzero()[0].tolist():
        steps = np.flatnonzero(way[hypothesis])
        first = int(steps[0])
        crosses = bool(scene.crosses[hypothesis, steps].any())
        run = int(np.argmin(np.append(way[hypothesis, first:], False))) + first - 1
        occupied = slice(first, run + 1)
        if float(scene.front[hypothesis, occupied].max()) < here:
            continue
        s = float(scene.rear[hypothesis, occupied].min())
        entering.append(Conflict(hypothesis, first, run, s, crosses))
    return entering


def crossing_walls(
    conflicts: list[Conflict],
    times: Array,
    ego: tuple[float, float, float],
    precedence: Precedence,
    reasons: Mapping[int, str],
) -> list[Wall]:
    """Return the walls before the zones of crossing objects to which a proposal gives way.

    ego      distance of the front from the reference point [m], current distance along the line [m], speed [m/s]
    reasons  of the walls, by hypothesis
    """
    front, s, speed = ego
    walls = []
    for conflict in conflicts:
        if not conflict.crosses or precedence == "none":
            continue
        arrival = (conflict.s - front - s) / max(speed, 1.0)
        if precedence == "earlier" and arrival < times[conflict.first]:
            continue
        until = math.inf if conflict.last == len(times) - 1 else float(times[conflict.last]) + RELEASE
        walls.append(Wall(conflict.s - front - BEFORE_ZONE, until, reasons[conflict.hypothesis], conflict.hypothesis))
    return walls


def proposals_for(
    profile: int,
    conflicts: list[Conflict],
    settings: BehaviorSettings,
    *,
    emergency: float,
    is_current: bool,
    gives_up: bool,
    comfortable: Sequence[float],
) -> list[Proposal]:
    """Return the proposals along one profile.

    emergency  deceleration of the emergency brake [m/s²];  is_current  whether they include stopping
    comfortable  shares of the wanted speed of those that brake comfortably only
    """
    hard = settings.hard_deceleration
    kinds: tuple[Precedence, ...] = ("all", "earlier", "none") if any(c.crosses for c in conflicts) else ("all",)
    most = emergency if gives_up else hard
    made = [Proposal(profile, share, kind, most) for kind in kinds for share in SPEED_SHARES]
    made += [Proposal(profile, share, "all", settings.comfortable_deceleration) for share in comfortable]
    if is_current:
        made.append(Proposal(profile, 0.0, "all", hard))
        made.append(Proposal(profile, 0.0, "all", settings.comfortable_deceleration, is_gentle=True))
        brakes = sorted({min(max(hard, LEAST_EMERGENCY), emergency), emergency})
        made += [Proposal(profile, 0.0, "all", deceleration, is_emergency=True) for deceleration in brakes]
    return made


def speed_limits(curvature: Array, path_limits: Array, spacing: float, settings: BehaviorSettings) -> Array:
    """Return the speed limits (M,) by curves and the end of the path, approached with a comfortable deceleration."""
    kernel = np.ones(5) / 5.0
    smooth = np.convolve(np.abs(np.pad(curvature, 2, mode="edge")), kernel, mode="valid")
    limits = np.minimum(np.sqrt(settings.lateral_acceleration / np.maximum(smooth, 1e-4)), path_limits)
    return approached(limits, np.full(len(limits) - 1, spacing), settings.comfortable_deceleration)


def time_to_gain(gap: float, speed: float, top: float, acceleration: float) -> float:
    """Return the time in which a vehicle that accelerates from a speed to `top` [m/s] covers a gap [m]; for a gap to an
    object that moves, with speeds relative to it."""
    if gap <= 0.0:
        return 0.0
    top = max(top, speed, LEAST_TOP)
    time = (top - speed) / acceleration
    gained = 0.5 * (speed + top) * time
    if gained >= gap:
        return (math.sqrt(speed**2 + 2.0 * acceleration * gap) - speed) / acceleration
    return time + (gap - gained) / top


def leading(scene: Surroundings, way: Bools, conflicts: list[Conflict], center: float, precedence: Precedence) -> Bools:
    """Return where hypotheses lead the vehicle (N, K): in its way and not crossing.

    An object that enters the way in the direction of the vehicle leads it from now on, if the vehicle gives way.
    """
    leads = way & scene.may_lead
    if precedence == "all":
        for conflict in conflicts:
            hypothesis = conflict.hypothesis
            is_oncoming = float(scene.speed[hypothesis, conflict.first]) < -ONCOMING_SPEED
            if not conflict.crosses and not is_oncoming and float(scene.s[hypothesis, 0]) > center:
                leads[hypothesis, : conflict.first] = True
    return np.asarray(leads)

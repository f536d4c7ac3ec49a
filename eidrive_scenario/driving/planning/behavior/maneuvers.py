"""Lateral maneuvers: change to the lane for overtaking, pass an obstacle on either side."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from operator import attrgetter
from typing import NamedTuple

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.detections import VULNERABLE
from eidrive_scenario.driving.planning.behavior.lane_changes import LaneChange
from eidrive_scenario.driving.planning.behavior.memory import ON_FOOT, STILL, KnownObject
from eidrive_scenario.driving.planning.behavior.merging import TrafficBehind, has_gap_now
from eidrive_scenario.driving.planning.behavior.prediction import ASIDE, NOTICEABLE, Prediction
from eidrive_scenario.driving.planning.behavior.proposals import (
    AT_OFFSET,
    BEFORE_ZONE,
    HASTY,
    ONCOMING_SPEED,
    SIMILAR_SPEED,
    WALKING_PACE,
    Body,
    LateralProfile,
    Start,
    Wall,
    change_length,
    least_length,
    passing,
    time_to_gain,
    to_lane,
)
from eidrive_scenario.driving.planning.behavior.reference import LanesBeside, ReferenceLine
from eidrive_scenario.driving.planning.behavior.right_of_way import Passage
from eidrive_scenario.driving.planning.behavior.rollout import SpeedLimits
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Present, Surroundings


class Situation(msgspec.Struct, frozen=True):
    """Vehicle with its settings and body, its position and speed on its line, wanted speed, and the known objects.

    limits  speed limits (M,) at the points of the line [m/s];  curve_limits  those by curves and the end of the route
    s, d    of the reference point [m]
    steered  s and d of the front axle, which the controller keeps on the trajectory [m], and the slope of its motion
    window  range of the points that matter
    stop    place at which a signal requires a stop, or None
    gives_way  returns whether the vehicle gives way to traffic on a passage of a junction; None: there are no junctions
    """

    settings: BehaviorSettings
    body: Body
    line: ReferenceLine
    limits: Array
    curve_limits: Array
    s: float
    d: float
    steered: tuple[float, float, float]
    speed: float
    wanted: float
    objects: list[KnownObject]
    prediction: Prediction
    window: tuple[int, int]
    stop: Wall | None
    now: float
    gives_way: Callable[[Passage], bool] | None = None
    hidden: str = ""
    """Kind of the nearest way ahead that no sensor shows and that limits the speed; empty without one."""
    change: LaneChange | None = None
    """Next lane change that the route requires."""
    passages: tuple[Passage, ...] = ()
    """Current and next passages of junctions."""
    released: float = -math.inf
    """Time at which the last stop that a signal required ended [s]."""

    @property
    def junction(self) -> float:
        """Distance along the line at which the current or next junction begins [m]; inf without one."""
        return self.passages[0].start if self.passages else math.inf

    @property
    def speed_limits(self) -> SpeedLimits:
        """Speed limits along the line, and the wanted speed."""
        return SpeedLimits(self.line.along, self.limits, self.wanted)

    @property
    def motion(self) -> tuple[float, float]:
        """Distance along the line [m] and speed [m/s]."""
        return self.s, self.speed

    @property
    def center(self) -> float:
        """Distance of the center of the vehicle along the line [m]."""
        return self.s + self.body.center

    @property
    def front(self) -> float:
        """Distance of its front along the line [m]."""
        return self.s + self.body.front

    @property
    def rear(self) -> float:
        """Distance of its rear along the line [m]."""
        return self.s - self.body.rear

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Distance of its center along the line and offset, half length and half width [m]."""
        return self.center, self.d, self.body.half_length, self.body.half_width

    @property
    def lanes_ahead(self) -> LanesBeside:
        """Lanes beside the line shortly ahead of the vehicle."""
        return self.line.lanes_beside(self.s + VIEWED)

    @property
    def limit(self) -> float:
        """Speed limit of the lane shortly ahead of the vehicle, else the wanted speed [m/s]."""
        limit = self.lanes_ahead.limit
        return self.wanted if math.isnan(limit) else limit

    def lanes_along(self, profile: LateralProfile) -> LanesBeside:
        """Return the lanes beside the line shortly ahead, or, if none of these is of the opposite direction, as in a
        junction, beside what a profile passes."""
        ahead = self.lanes_ahead
        beside = (ahead, *map(self.line.lanes_beside, profile.places[-3:-1]))
        return next((lanes for lanes in beside if not math.isnan(lanes.oncoming)), ahead)

    def outside_junctions(self, stop: float) -> float:
        """Return the place at which the vehicle stops instead of at `stop`, where it would obstruct the cross traffic
        of junctions [m]; those that it cannot stop before any more count as passed."""
        nearest = self.s + self.speed**2 / (2.0 * self.settings.comfortable_deceleration) - LATE_STOP
        for passage in reversed(self.passages):
            before = passage.entry - BEFORE_ZONE - self.body.front
            if passage.is_crossed and stop - self.body.rear < passage.end and stop > before >= nearest:
                stop = before
        return stop

    def clear_of_junctions(self, scene: Surroundings, way: Bools) -> list[Wall]:
        """Return the wall before the junctions that the vehicle would not leave before it stops behind a queue.

        The vehicles that still move in its way (N, K) will stand there, too (section 11 of the German road traffic
        rules: traffic does not enter a junction in which it would have to wait).
        """
        if not self.passages:
            return []
        ahead = way[:, 0] & scene.may_lead[:, 0] & (scene.rear[:, 0] > self.front) & scene.certain
        stands = ahead & (np.abs(scene.speed[:, 0]) < STILL)
        if not stands.any():
            return []
        end = float((scene.rear[stands, 0] - scene.passing_gap[stands]).min())
        between = np.flatnonzero(ahead & ~stands & (scene.rear[:, 0] < end))
        # By object, which may have several hypotheses.
        length = {scene.owner[row]: 2.0 * scene.half_length[row, 0] + self.settings.standstill_gap for row in between}
        behind_queue = end - sum(length.values()) - self.settings.standstill_gap - self.body.front
        before_junction = self.outside_junctions(behind_queue)
        return [Wall(before_junction, math.inf, KEEP_CLEAR)] if before_junction < behind_queue else []

    @property
    def stops(self) -> list[Wall]:
        """Place at which a signal requires a stop, if there is one."""
        return [] if self.stop is None else [self.stop]

    @property
    def start(self) -> Start:
        """Start of a lateral motion of the front axle."""
        return Start(*self.steered, self.speed)

    @property
    def end(self) -> float:
        """Distance along the line at which the route ends [m]; inf if it goes on."""
        return self.line.length if self.line.path.ends else math.inf

    def kind_of(self, owner: int) -> str:
        """Return the class of an object."""
        return self.objects[owner].kind

    def describe(self, owner: int) -> str:
        """Return class, distance and speed of an object as text."""
        known_object = self.objects[owner]
        x, y = self.line.points[self.line.index_at(self.s)].tolist()
        distance = math.hypot(known_object.x - x, known_object.y - y)
        motion = "that approaches at" if self.approaches(owner) else "at"
        return f"{known_object.kind} {distance:.0f} m ahead {motion} {known_object.speed:.1f} m/s"

    def approaches(self, owner: int) -> bool:
        """Return whether an object moves against the direction of the line."""
        known_object = self.objects[owner]
        _, _, heading = self.line.project(np.array([known_object.x]), np.array([known_object.y]), *self.window)
        along = known_object.vx * math.cos(heading[0]) + known_object.vy * math.sin(heading[0])
        return bool(along < -ONCOMING_SPEED)

    def is_lowered_at(self, s: float) -> bool:
        """Return whether hidden ways or speed limits of the road limit the speed at a distance along the line more than
        curves and the end of the route."""
        limit, by_curves = (np.interp(s, self.line.along, limits) for limits in (self.limits, self.curve_limits))
        return bool(limit < by_curves)

    def rows_of(self, owner: int) -> tuple[int, ...]:
        """Return the row of an object among the fused objects; none if it is lost."""
        fused = self.objects[owner].row
        return () if fused is None else (fused,)

    def free_progress(self, horizon: float) -> float:
        """Return the distance that the vehicle covers without objects [m], by limits, walls and acceleration."""
        speed, s, step = self.speed, self.s, 0.5
        limits, last, spacing, wanted = self.limits, len(self.limits) - 1, self.line.spacing, self.wanted
        end = math.inf if self.stop is None else self.stop.s
        for _ in range(round(horizon / step)):
            limit = float(limits[min(max(int(s / spacing), 0), last)])
            speed = min(speed + self.settings.acceleration * step, wanted, limit)
            s = min(s + speed * step, end)
        return s - self.s

    def speed_at(self, place: float, acceleration: float) -> float:
        """Return the speed that the vehicle has at a distance along the line without objects [m/s]."""
        gain = 2.0 * MEAN_SHARE * acceleration * max(place - self.s, 0.0)
        limit = float(np.interp(place, self.line.along, self.limits))
        return max(min(math.sqrt(self.speed**2 + gain), self.wanted, limit), self.speed)


KEEP_CLEAR = "keep a junction clear"
"""Reason to wait before a junction behind which traffic stands."""
LATE_STOP = 1.0
"""Distance by which a stop before a junction that has begun may come too late [m]."""
VIEWED = 10.0
"""Distance ahead of the vehicle at which the lanes beside the line are determined [m]."""
SLOWER = 2.0
"""Difference to the wanted speed from which on a slower vehicle is passed [m/s]."""
PATIENCE = 3.0
"""Time for which a vehicle has stood before it is passed [s]; as in Autoware's lane change."""
LONG = 15.0
"""Time after which a vehicle in the middle of the lane counts as parked [s]; before, the vehicle waits behind it."""
WAITING = 1.0
"""Speed below which the vehicle waits [m/s]."""
SETTING_OFF = 5.0
"""Time for which a vehicle may still accelerate after it starts [s]; it is not passed meanwhile."""
SWUNG = 0.3
"""Offset from the route from which on the vehicle is beside it [m]."""
SPARE = 0.2
"""Clearance beside a passed obstacle in addition to the lateral margin [m], so that rounding does not block it."""
EARLY = 0.5
"""Share of the way to a meeting with an oncoming cyclist after which the vehicle is aside; a choice, so that it may
slow down meanwhile."""
BESIDE_BUS = 1.0
"""Clearance beside a standing bus, from behind which passengers may come [m]; a choice."""
LEAST_CLEARANCE = 0.25
"""Minimum clearance in a narrow place [m]."""
BEFORE_OBSTACLE = 2.0
"""Distance between the rear of the vehicle and a passed obstacle at which it starts to return [m]."""
SWUNG_OUT = 1.0
"""Distance by which the front is beside an obstacle when the lateral motion ends [m]; it is 99 % complete before."""
BEFORE_MOVING = 1.1
"""Time by which the lateral motion to overtake a moving vehicle ends earlier than beside a standing one [s]: with a gap
as in following."""
MEAN_SHARE = 0.75
"""Share of the maximum acceleration that the car-following model has on average up to 0.9 of the wanted speed."""
QUEUE_GAP, QUEUE_PATIENCE = 15.0, 20.0
"""Gap between standing vehicles that queue [m], and time for which a queue has stood before it is passed [s]."""
INSIDE = 0.1
"""Clearance to a lane of the opposite direction within which the vehicle is not in it [m]."""
TOGETHER = 25.0
"""Gap below which two obstacles are passed in one maneuver [m]."""
BEFORE_JUNCTION = 30.0
"""Distance before a junction at which overtaking ends [m]: 100 ft, section 11-306 of the Uniform Vehicle Code."""
NEAR_STOP = 40.0
"""Distance of a place where traffic stops, ahead of a standing vehicle, within which it queues [m]."""


class _Obstacle(NamedTuple):
    """Objects that hold the vehicle up, the nearest first, and the places between which it is beside them [m].

    beside  lanes at places between both
    """

    objects: list[Present]
    begin: float
    end: float
    beside: list[LanesBeside]

    @classmethod
    def between(cls, begin: float, end: float, objects: list[Present], situation: Situation) -> _Obstacle:
        """Return objects with the lanes at four places from `begin` to `end` [m]."""
        step = (end - begin) / 3.0
        places = (begin, begin + step, begin + 2.0 * step, end)
        return cls(objects, begin, end, [situation.line.lanes_beside(s) for s in places])

    @property
    def fastest(self) -> float:
        """Speed of the fastest object [m/s]."""
        return max(hypothesis.speed for hypothesis in self.objects)


def passing_profiles(
    situation: Situation, scene: Surroundings, behind: Mapping[int, TrafficBehind], *, has_begun: bool
) -> list[LateralProfile]:
    """Return maneuvers past what holds the vehicle up, or out of the way of an oncoming vehicle in its lane.

    The result is empty if the vehicle queues or nothing is free beside it.

    behind     traffic in the lanes to the left (1) and to the right (-1)
    has_begun  whether the vehicle passes something already; what then appears behind that is no queue
    """
    head_on = _head_on(situation, scene)
    if head_on is not None:
        return _evasions(situation, scene, head_on)
    profiles = []
    held_out = _behind_neighbor(situation, scene)
    if held_out is not None:
        profiles.append(held_out)
    blocker = _blocker(situation, scene)
    if blocker is None or (not has_begun and _queues(situation, scene, blocker)):
        return profiles
    obstacle = _obstacle(situation, scene, blocker)
    beside = situation.lanes_ahead
    faster, overtaking = beside.faster, beside.overtaking
    # The vehicle does not stop at the end of its route in the lane of the opposite direction.
    may_cross = obstacle is not None and obstacle.end < situation.end and not _jams(situation, scene, blocker)
    if not _is_parked(situation, blocker):
        profile = None if obstacle is None or not may_cross else _around(situation, scene, obstacle, overtaking)
        return profiles if profile is None or not profile.uses_oncoming else [*profiles, profile]
    moves = obstacle is not None and obstacle.fastest > ONCOMING_SPEED
    # The vehicle has to return to its lane before the end of its route, and before the next change of the route.
    change = situation.change
    last = situation.end if change is None else change.begin
    returns = situation.s < last if obstacle is None else obstacle.end < last or (change is None and not moves)
    may_change = not math.isnan(faster) and returns and not _is_shut(situation, scene, faster, blocker)
    may_change = may_change and behind[overtaking].leaves_gap(situation.limit, situation.speed, situation.now)
    if may_change and has_gap_now(scene, faster, situation.motion, situation.body):
        profiles.append(to_lane(faster, situation.start, situation.settings.lateral_acceleration))
    if obstacle is not None:
        # A moving vehicle is overtaken on one side only. With several lanes of its direction that is a change of lane:
        # those of the opposite direction are not for overtaking then (section 7 of the German road traffic rules).
        sides: tuple[int, ...] = (overtaking, -overtaking)
        if moves:
            one_lane = math.isnan(beside.left) and math.isnan(beside.right)
            solid = any(lanes.has_solid_line for lanes in (beside, *obstacle.beside))
            # The vehicle brakes for the end of the route ahead of what it has overtaken, which it expects to drive on.
            braking = situation.wanted**2 / (2.0 * situation.settings.comfortable_deceleration)
            ends = situation.end - max(obstacle.fastest * situation.settings.horizon, braking)
            may_cross = not solid and returns and obstacle.end < min(situation.junction - BEFORE_JUNCTION, ends)
            sides = (overtaking,) if one_lane else ()
        around = [_around(situation, scene, obstacle, side) for side in sides]
        profiles += [profile for profile in around if profile and (may_cross or not profile.uses_oncoming)]
    return profiles


def extended(situation: Situation, scene: Surroundings, profile: LateralProfile) -> LateralProfile:
    """Return a profile past standing objects with its end behind those that have come into view behind them, on the
    route or in the way of the return to it.

    It is the same if there are none, if they need more clearance to its side, or if the vehicle returns already.
    """
    side, end = profile.side, profile.places[-2] if len(profile.places) > 2 else -math.inf
    if profile.last != 0.0 or situation.steered[0] >= end:
        return profile
    blocker = _in_return(situation, scene, profile) or _blocker(situation, scene)
    if blocker is None or blocker.rear > end + TOGETHER:
        return profile
    obstacle = _obstacle(situation, scene, blocker)
    if obstacle is None or obstacle.end <= end or obstacle.fastest > ONCOMING_SPEED:
        return profile
    value = side * profile.values[-2]
    outer, every = _sides(obstacle, side)
    half_width = situation.body.half_width
    if outer + _clearance(situation, obstacle) > value - half_width or value + half_width > every:
        return profile
    back = _length_at(situation, obstacle.end, value, is_hasty=value > profile.border)
    places = (*profile.places[:-2], obstacle.end, obstacle.end + back)
    return msgspec.structs.replace(profile, places=places)


def _in_return(situation: Situation, scene: Surroundings, profile: LateralProfile) -> Present | None:
    """Return the first standing object beside the route that is in the way of the return of a profile to it; None if
    there is none."""
    *_, end, back = profile.places
    beside = [
        hypothesis
        for hypothesis in scene.present
        if hypothesis.front > end
        and hypothesis.rear < back
        and abs(hypothesis.speed) < WAITING
        and not hypothesis.crosses
        and not _is_in_way(situation, hypothesis)
        and _is_passable(situation, hypothesis)
        and _is_in_way(situation, hypothesis, profile.offset_at(hypothesis.s))
    ]
    return min(beside, key=attrgetter("s"), default=None)


def shortened(situation: Situation, scene: Surroundings, profile: LateralProfile) -> LateralProfile | None:
    """Return a profile past an obstacle with its way back before what stands behind that, on the route or in the lane
    that the vehicle uses; None if nothing does, without space for it, or if the vehicle returns already."""
    if len(profile.places) < 3 or profile.last != 0.0:
        return None
    *_, before, end, back = profile.places
    s, value = situation.steered[0], profile.values[-2]
    if s > end and abs(profile.offset_at(s) - value) > AT_OFFSET:
        return None
    overhang = situation.body.front - situation.body.wheelbase
    rears = [
        hypothesis.rear - overhang
        for hypothesis in scene.present
        if end < hypothesis.rear - overhang < back
        and abs(hypothesis.speed) < WAITING
        and not hypothesis.crosses
        and (_is_in_way(situation, hypothesis) or _is_in_way(situation, hypothesis, value))
    ]
    if not rears:
        return None
    nearest, end = min(rears), max(before + 0.5, end - BEFORE_OBSTACLE, s)
    if nearest - end < float(least_length(np.array(abs(value)))):
        return None
    return msgspec.structs.replace(profile, places=(*profile.places[:-2], end, nearest))


def _head_on(situation: Situation, scene: Surroundings) -> Present | None:
    """Return the nearest hypothesis that comes towards the vehicle in the lane of its route, or a cyclist or pedestrian
    whose distance the vehicle should keep there."""
    center = situation.center

    def comes(hypothesis: Present) -> bool:
        if hypothesis.speed >= -ONCOMING_SPEED:
            return False
        if situation.kind_of(hypothesis.owner) in VULNERABLE:
            return _is_in_way(situation, hypothesis)
        return abs(hypothesis.d) - hypothesis.half_width < situation.body.half_width

    oncoming = [
        hypothesis
        for hypothesis in scene.present
        if hypothesis.s > center and not hypothesis.crosses and comes(hypothesis) and scene.certain[hypothesis.row]
    ]
    return min(oncoming, key=attrgetter("s"), default=None)


def _evasions(situation: Situation, scene: Surroundings, head_on: Present) -> list[LateralProfile]:
    """Return changes to the neighboring lanes that reach as far as an oncoming vehicle, and are free behind, and
    motions past an oncoming cyclist or pedestrian.

    The first lane is away from those of the opposite direction; to each the hasty change comes after the comfortable
    one, which is then the choice between equals.
    """
    here, there = situation.lanes_ahead, situation.line.lanes_beside(head_on.s)
    evasions = []
    if situation.kind_of(head_on.owner) in VULNERABLE:
        obstacle = _meeting(situation, head_on)
        around = [_around(situation, scene, obstacle, side) for side in (here.overtaking, -here.overtaking)]
        evasions += [profile for profile in around if profile is not None]
    for side in (-here.overtaking, here.overtaking):
        offset, beyond = (lanes.left if side > 0 else lanes.right for lanes in (here, there))
        if math.isnan(offset) or math.isnan(beyond):
            continue
        if has_gap_now(scene, offset, situation.motion, situation.body):
            lateral = situation.settings.lateral_acceleration
            evasions += [to_lane(offset, situation.start, share * lateral) for share in (1.0, HASTY)]
    return evasions


def _meeting(situation: Situation, head_on: Present) -> _Obstacle:
    """Return an oncoming object between the places at which the vehicle should be aside [m]."""
    gap = max(head_on.rear - situation.front, 0.0)
    speed = max(situation.speed, WALKING_PACE)
    way = gap * speed / (speed - head_on.speed)
    begin, end = situation.s + EARLY * way, situation.s + way + 2.0 * head_on.half_length
    end += situation.body.wheelbase + situation.body.rear + BEFORE_OBSTACLE
    return _Obstacle.between(begin, end, [head_on], situation)


def _behind_neighbor(situation: Situation, scene: Surroundings) -> LateralProfile | None:
    """Return the motion back to the route behind what stands between it and the vehicle; None if nothing does.

    The maneuver past an obstacle ends where its end was when the maneuver began, and the estimate may have changed.
    """
    s, d, slope = situation.steered
    if abs(d) < SWUNG:
        return None
    side = 1 if d > 0.0 else -1
    rear, front = situation.rear, situation.front
    beside = [
        hypothesis
        for hypothesis in scene.present
        if hypothesis.front > rear
        and hypothesis.rear < front
        and side * hypothesis.d - hypothesis.half_width < side * d
        and _is_in_way(situation, hypothesis)
        and not hypothesis.crosses
        and abs(hypothesis.speed) < WAITING
    ]
    if not beside:
        return None
    last = max(beside, key=attrgetter("front"))
    end = max(last.front + situation.body.rear + situation.body.wheelbase + BEFORE_OBSTACLE, s + 1.0)
    border = _border(situation.line.lanes_beside(end), side, situation.body.half_width)
    back = _length_at(situation, end, abs(d), is_hasty=abs(d) > border)
    return LateralProfile(_name(situation, last, side), (s, end, end + back), (d, d, 0.0), slope, side, border)


def _is_shut(situation: Situation, scene: Surroundings, lane: float, blocker: Present) -> bool:
    """Return whether something stands in the lane at an offset [m], not farther ahead than the blocker."""
    return any(
        situation.front < hypothesis.rear < blocker.front
        and abs(hypothesis.d - lane) < hypothesis.half_width + situation.body.half_width
        and abs(hypothesis.speed) < WAITING
        for hypothesis in scene.present
    )


def _name(situation: Situation, passed: Present, side: int) -> str:
    """Return the name of the maneuver past an object."""
    return f"pass {situation.kind_of(passed.owner)} on the {'left' if side > 0 else 'right'}"


def _length_at(situation: Situation, place: float, change: float, *, is_hasty: bool = False) -> float:
    """Return the length of a lateral motion by `change` [m] at the speed that the vehicle has at a place.

    is_hasty  whether it leaves a lane of the opposite direction
    """
    speed = max(situation.speed_at(place, situation.settings.acceleration), WALKING_PACE)
    return change_length(change, speed, situation.settings.lateral_acceleration * (HASTY if is_hasty else 1.0))


def _border(lanes: LanesBeside, side: int, half_width: float) -> float:
    """Return the offset to a side beyond which the vehicle is in a lane of the opposite direction [m]."""
    own, every = lanes.room(side)
    return own - half_width - INSIDE if every > own else math.inf


def _is_in_way(situation: Situation, hypothesis: Present, offset: float = 0.0) -> bool:
    """Return whether a hypothesis is closer to an offset from the route [m] than the vehicle there should pass."""
    return abs(hypothesis.d - offset) - hypothesis.half_width < situation.body.half_width + hypothesis.margin


def _blocker(situation: Situation, scene: Surroundings) -> Present | None:
    """Return the nearest hypothesis on the route ahead that is slower than the vehicle wants to drive."""
    center, slower = situation.center, max(situation.wanted - SLOWER, STILL)
    slower_ahead = [
        hypothesis
        for hypothesis in scene.present
        if hypothesis.s > center
        and -ONCOMING_SPEED < hypothesis.speed < slower
        and not hypothesis.crosses
        and _is_in_way(situation, hypothesis)
        and _is_passable(situation, hypothesis)
    ]
    return min(slower_ahead, key=attrgetter("s"), default=None)


def _is_beside(situation: Situation, hypothesis: Present) -> bool:
    """Return whether the vehicle is beside an object, which it is then passing, and behind which it cannot wait."""
    return hypothesis.rear < situation.front and abs(situation.d - hypothesis.d) > hypothesis.half_width


def _is_passable(situation: Situation, hypothesis: Present) -> bool:
    """Return whether an object may be passed: standing for some time or moving, a pedestrian steadily."""
    known_object = situation.objects[hypothesis.owner]
    if known_object.still_since is None:
        return known_object.kind not in ON_FOOT or _is_steady(situation, hypothesis)
    if known_object.kind in ON_FOOT and not _is_parked(situation, hypothesis):
        return False
    return known_object.kind == "misc" or situation.now - known_object.still_since >= PATIENCE


def may_pass(situation: Situation, scene: Surroundings) -> bool:
    """Return whether the vehicle may pass what holds it up now; behind a vehicle that has just stopped it waits."""
    blocker = _blocker(situation, scene)
    return blocker is None or _is_parked(situation, blocker)


def sets_off(situation: Situation, scene: Surroundings) -> bool:
    """Return whether what holds the vehicle up, and what stands close ahead of that, sets off while the vehicle can
    still stop behind it comfortably."""
    blocker = _blocker(situation, scene)
    stop = situation.front + situation.speed**2 / (2.0 * situation.settings.comfortable_deceleration)
    return blocker is not None and blocker.rear > stop and _obstacle(situation, scene, blocker) is None


def _is_parked(situation: Situation, hypothesis: Present) -> bool:
    """Return whether an object does not seem to have stopped just now, behind which the vehicle would wait."""
    known_object = situation.objects[hypothesis.owner]
    if known_object.still_since is None or known_object.kind == "misc" or abs(hypothesis.d) > ASIDE:
        return True
    stands = situation.now - known_object.still_since
    return situation.speed < WAITING or stands >= LONG or _is_beside(situation, hypothesis)


def _is_steady(situation: Situation, hypothesis: Present) -> bool:
    """Return whether an object has moved for some time, and neither sets off nor brakes."""
    known_object = situation.objects[hypothesis.owner]
    has_moved = known_object.moving_since is not None and situation.now - known_object.moving_since >= SETTING_OFF
    return has_moved and known_object.acceleration > -NOTICEABLE


def _queues(situation: Situation, scene: Surroundings, blocker: Present) -> bool:
    """Return whether the blocker waits at a place where the vehicle stops as well, or behind another vehicle."""
    if situation.stop is not None and situation.stop.s < blocker.s + NEAR_STOP:
        return True
    if not _stands_in_traffic(situation, blocker, QUEUE_PATIENCE):
        return False
    if _is_beside(situation, blocker):
        return False
    along, end = situation.line.along, situation.window[1]
    if end < len(along) and blocker.front + QUEUE_GAP > along[end - 1]:
        return True  # What it may wait behind is not in the window yet.
    return any(
        _continues_queue(hypothesis, blocker) and abs(hypothesis.d - blocker.d) < 1.0 for hypothesis in scene.present
    )


def _jams(situation: Situation, scene: Surroundings, blocker: Present) -> bool:
    """Return whether the traffic of a neighboring lane of the direction queues as well, beside the blocker and farther.

    The lanes of the opposite direction are not for passing it as long as a queue is not passed, over a solid line not
    at all.
    """
    lanes = situation.line.lanes_beside(blocker.s)
    patience = math.inf if lanes.has_solid_line else QUEUE_PATIENCE
    if not _stands_in_traffic(situation, blocker, patience) or _is_beside(situation, blocker):
        return False
    return any(
        _continues_queue(hypothesis, blocker)
        and (abs(hypothesis.d - lanes.left) < 1.0 or abs(hypothesis.d - lanes.right) < 1.0)
        and _stands_in_traffic(situation, hypothesis, math.inf)
        for hypothesis in scene.present
    )


def _continues_queue(hypothesis: Present, blocker: Present) -> bool:
    """Return whether an object is as far ahead of the blocker as the next vehicle of a queue."""
    return -0.5 < hypothesis.rear - blocker.front < QUEUE_GAP


def _stands_in_traffic(situation: Situation, hypothesis: Present, patience: float) -> bool:
    """Return whether an object is a vehicle that has stood for less than a time [s], not counted before green."""
    known_object = situation.objects[hypothesis.owner]
    since, is_vehicle = known_object.still_since, known_object.kind != "misc" and known_object.kind not in ON_FOOT
    return is_vehicle and since is not None and situation.now - max(since, situation.released) < patience


def _obstacle(situation: Situation, scene: Surroundings, blocker: Present) -> _Obstacle | None:
    """Return the blocker with what stands close behind it; None if it is too fast or not steady enough to pass it."""
    return _block(situation, _together(situation, scene, blocker))


def _block(situation: Situation, objects: list[Present]) -> _Obstacle | None:
    """Return objects as an obstacle; None if they are too fast or not steady enough to pass them."""
    body = situation.body
    wanted = max(situation.wanted, 1.0)
    begin = min([hypothesis.rear for hypothesis in objects]) - (body.front - body.wheelbase) + SWUNG_OUT
    ends = [hypothesis.front for hypothesis in objects]
    speed = [max(hypothesis.speed, 0.0) for hypothesis in objects]
    fastest, slowest = max(speed), min(speed)
    if fastest > ONCOMING_SPEED:
        if wanted - fastest < SLOWER or not all(_is_steady(situation, hypothesis) for hypothesis in objects):
            return None
        gain = situation.settings.acceleration * MEAN_SHARE
        rear = situation.rear - BEFORE_OBSTACLE
        ends = [
            end + own * time_to_gain(end - rear, situation.speed - own, wanted - own, gain)
            for end, own in zip(ends, speed, strict=True)
        ]
        begin -= BEFORE_MOVING * slowest
        begin += slowest * time_to_gain(begin - situation.s, situation.speed - slowest, wanted - slowest, gain)
    end = max(ends) + body.rear + body.wheelbase + BEFORE_OBSTACLE
    return _Obstacle.between(begin, end, objects, situation)


def _with_neighbors(situation: Situation, scene: Surroundings, obstacle: _Obstacle, side: int) -> _Obstacle:
    """Return an obstacle with what stands beside it to one side without space for the vehicle between them, if it
    stands itself."""
    if not all(-ONCOMING_SPEED <= hypothesis.speed < WAITING for hypothesis in obstacle.objects):
        return obstacle
    objects, needed = list(obstacle.objects), 2.0 * (situation.body.half_width + LEAST_CLEARANCE)
    beside = [
        hypothesis
        for hypothesis in scene.present
        if hypothesis.front > obstacle.begin
        and hypothesis.rear < obstacle.end
        and not hypothesis.crosses
        and abs(hypothesis.speed) < WAITING
        and not _is_in_way(situation, hypothesis)
    ]
    for hypothesis in sorted(beside, key=lambda hypothesis: side * hypothesis.d):
        outer = max(side * other.d + other.half_width for other in objects)
        near = side * hypothesis.d - hypothesis.half_width
        if near < outer + needed and side * hypothesis.d + hypothesis.half_width > outer:
            objects.append(hypothesis)
    return obstacle if len(objects) == len(obstacle.objects) else _block(situation, objects) or obstacle


def _around(situation: Situation, scene: Surroundings, obstacle: _Obstacle, side: int) -> LateralProfile | None:
    """Return the motion past an obstacle, and what stands beside it, on one side; None if that is too narrow."""
    obstacle = _with_neighbors(situation, scene, obstacle, side)
    clearance, half_width = _clearance(situation, obstacle), situation.body.half_width
    outer, every = _sides(obstacle, side)
    room = every - outer - 2.0 * half_width
    if room < (clearance + SPARE if _is_vulnerable(situation, obstacle) else min(LEAST_CLEARANCE, clearance + SPARE)):
        return None
    # As far beside the obstacle as it should be, else in the middle of the gap, else at the least clearance.
    beside = (clearance + room) / 2.0 if room > clearance else LEAST_CLEARANCE
    beside = clearance + SPARE if room >= clearance + SPARE else beside
    value = max(outer + beside + half_width, 0.0)
    border = min(_border(lanes, side, half_width) for lanes in obstacle.beside)
    stands = all(situation.objects[hypothesis.owner].still_since is not None for hypothesis in obstacle.objects)
    profile = passing(
        _name(situation, obstacle.objects[0], side),
        side * value,
        (obstacle.begin, obstacle.end),
        Start(*situation.steered, max(situation.speed, WALKING_PACE)),
        situation.settings.lateral_acceleration,
        side,
        lengths=(
            _length_at(situation, obstacle.begin, side * value - situation.steered[1]),
            _length_at(situation, obstacle.end, value, is_hasty=value > border),
        ),
        stands=stands,
    )
    if profile is None:
        return None
    return msgspec.structs.replace(profile, border=border, overtakes=0.0 if stands else max(obstacle.fastest, 0.0))


def _is_vulnerable(situation: Situation, obstacle: _Obstacle) -> bool:
    """Return whether a pedestrian or cyclist is among the objects."""
    return any(situation.kind_of(hypothesis.owner) in VULNERABLE for hypothesis in obstacle.objects)


def _clearance(situation: Situation, obstacle: _Obstacle) -> float:
    """Return the clearance that an obstacle should have [m]."""
    settings = situation.settings
    clearance = settings.pedestrian_margin if _is_vulnerable(situation, obstacle) else settings.lateral_margin
    stops = any(
        situation.kind_of(hypothesis.owner) == "bus" and hypothesis.speed < WAITING for hypothesis in obstacle.objects
    )
    return max(clearance, BESIDE_BUS) if stops else clearance


def _sides(obstacle: _Obstacle, side: int) -> tuple[float, float]:
    """Return the offsets of the side of an obstacle, and of the border of the road beside it, to one side [m]."""
    outer = max(side * hypothesis.d + hypothesis.half_width for hypothesis in obstacle.objects)
    return outer, min(lanes.room(side)[1] for lanes in obstacle.beside)


def _together(situation: Situation, scene: Surroundings, blocker: Present) -> list[Present]:
    """Return the blocker and the objects of similar speed in the way that follow it closely."""
    alike = [
        hypothesis
        for hypothesis in scene.present
        if hypothesis.s >= blocker.s
        and not hypothesis.crosses
        and abs(hypothesis.speed - blocker.speed) < SIMILAR_SPEED
        and _is_in_way(situation, hypothesis)
    ]
    group = [blocker]
    for hypothesis in sorted(alike, key=attrgetter("s")):
        if hypothesis.rear - group[-1].s - group[-1].half_length > TOGETHER:
            break
        if hypothesis.row != blocker.row:
            group.append(hypothesis)
    return group

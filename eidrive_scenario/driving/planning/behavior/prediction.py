"""Prediction of objects: along lanes for vehicles that follow them, else with constant velocity."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.driving.planning.behavior.memory import ON_FOOT, KnownObject
from eidrive_scenario.driving.planning.behavior.right_of_way import (
    FASTEST_TURN,
    Course,
    JunctionRules,
    LaneCourses,
    Passage,
    in_turn,
)
from eidrive_scenario.driving.planning.signal_stops import COMFORTABLE, PERCEPTION
from eidrive_scenario.roads import ALIGNED, RoadNetwork

STANDING = 0.3
"""Speed below which an object is predicted to stand [m/s]; the direction of a slower one is noise."""
LEAVING_RATE = 0.3
"""Minimum lateral speed of a vehicle that leaves its lane [m/s]; slower motion is its lateral wandering."""
LEAVING_ERROR = 3.5
"""Lateral speed of a vehicle that leaves its lane per standard deviation of its position [1/s], if that is larger: with
a velocity from noisy positions."""
CUTTING, STILL_CUTTING = 0.15, 0.3
"""Angle between the motion of a vehicle and its lane in a junction up to which it cuts the curve, and that up to which
one that has been predicted to follow the lane still does [rad]; choices."""
ASIDE = 0.8
"""Offset from the center of a lane from which on a standing vehicle is parked at its edge [m]."""
LANE_WIDTH = 3.5
"""Width of a lane [m], after which a lane change is predicted to end."""
NOTICEABLE, GREATEST = 0.8, 4.0
"""Accelerations below which an object keeps its speed, and maximum acceleration that is considered [m/s²]."""
PERSISTENCE = 1.5
"""Time constant with which the predicted acceleration decreases [s]."""
STOPPING = 2.0
"""Deceleration with which a vehicle is predicted to stop at a sign [m/s²]; one that needs COMFORTABLE for it passes."""
AT_SIGN = 1.0
"""Distance of the front from a sign within which the vehicle has stopped there or passes it [m]."""
SIMILAR_TURN = 0.6
"""Maximum difference to the smallest turn of a vehicle of other turns that are likely [rad]. It is expected to take no
others if it gives way, and they are no reason for emergency braking before it enters the junction, or while it sets off
there."""
HARSH = math.sqrt(7.0 / FASTEST_TURN)
"""Ratio of the speeds in a curve at the limit of the tires (0.7 g) and at that of comfort. A vehicle that has been
predicted to follow a lane may be that fast."""
MOST_HYPOTHESES = 4
"""Maximum number of hypotheses of one object."""


class Prediction(msgspec.Struct, frozen=True):
    """Predicted motion of N hypotheses at K times; an object may have several hypotheses.

    objects  (N,) index of the object;  x, y, yaw, speed  (N, K) [m, rad, m/s]
    room     (N,) distance of the center from the nearer edge of the lane that it follows, inf for other objects [m]
    passages  of junctions ahead, for each hypothesis
    likely    (N,) whether it is no much larger turn in a junction ahead, or in which the object sets off, than another
              hypothesis of the object, or shows
    z         (N, K) height of the lower side of the object [m]; None if all roads are level
    """

    objects: tuple[int, ...]
    x: Array
    y: Array
    yaw: Array
    speed: Array
    room: Array
    passages: tuple[tuple[Passage, ...], ...] = ()
    likely: tuple[bool, ...] = ()
    z: Array | None = None


class Hypothesis(NamedTuple):
    """Predicted motion of one object: poses and speeds (K,), room in its lane [m], and passages of junctions ahead."""

    poses: tuple[Array, Array, Array]
    speed: Array
    room: float = math.inf
    passages: tuple[Passage, ...] = ()
    z: Array | None = None
    """Height of the road that it follows (K,) [m]; None: it follows none, or all roads are level."""
    likely: bool = True
    """Whether it is no much larger turn than another hypothesis, as in `Prediction`."""


class _Branch(NamedTuple):
    """Hypothesis along a lane, with its course and the lateral speed from it [m/s].

    deferring  largest turn with which the object gives way to the ego, -inf if it does not [rad]
    coming     largest turn in junctions that it has not entered, or in which it sets off [rad]
    """

    hypothesis: Hypothesis
    course: Course
    aside: float
    deferring: float
    coming: float


class Predictor:
    """Prediction of objects over a road network, or without one."""

    def __init__(self, roads: RoadNetwork | None, times: Array, rules: JunctionRules | None = None) -> None:
        self._roads = roads
        self._courses = LaneCourses(roads, rules or JunctionRules(roads)) if roads is not None else None
        self._times = times
        self._level = roads is None or roads.is_level

    def follow_lanes(self, objects: list[KnownObject], lanes: list[list[Course]]) -> None:
        """Let lost vehicles move along their lanes."""
        for known_object, courses in zip(objects, lanes, strict=True):
            for course in courses if known_object.row is None else ():
                _, left, heading = course.project(known_object.x, known_object.y)
                turn = float(wrap_angle(math.atan2(known_object.vy, known_object.vx) - heading))
                if abs(turn) <= ALIGNED and abs(left) <= course.half_width:
                    speed = known_object.speed
                    known_object.vx, known_object.vy = speed * math.cos(heading), speed * math.sin(heading)
                    break

    def predict(
        self,
        objects: list[KnownObject],
        lanes: list[list[Course]] | None = None,
        defers: Callable[[Passage], bool] | None = None,
    ) -> Prediction:
        """Return the hypotheses of all objects.

        lanes   courses of the lanes on which each of them is, if they are known already
        defers  returns whether traffic on a passage of a junction gives way to the ego; None: there are no junctions
        """
        lanes = self.lanes(objects) if lanes is None else lanes
        owners: list[int] = []
        hypotheses: list[Hypothesis] = []
        for index, (known_object, courses) in enumerate(zip(objects, lanes, strict=True)):
            new = self._hypotheses(known_object, courses, defers)
            owners += [index] * len(new)
            hypotheses += new
        if not hypotheses:
            nothing = np.empty((0, len(self._times)))
            return Prediction((), nothing, nothing, nothing, nothing, np.empty(0))
        columns = [
            *zip(*[hypothesis.poses for hypothesis in hypotheses], strict=True),
            [hypothesis.speed for hypothesis in hypotheses],
        ]
        x, y, yaw, speed = (np.concatenate(column).reshape(len(hypotheses), -1) for column in columns)
        return Prediction(
            tuple(owners),
            x,
            y,
            yaw,
            speed,
            np.array([hypothesis.room for hypothesis in hypotheses]),
            tuple([hypothesis.passages for hypothesis in hypotheses]),
            tuple([hypothesis.likely for hypothesis in hypotheses]),
            None if self._level else self._heights(objects, owners, hypotheses),
        )

    def _heights(self, objects: list[KnownObject], owners: list[int], hypotheses: list[Hypothesis]) -> Array:
        """Return the heights (N, K) of hypotheses [m]: those of the roads below them, else of the object."""
        now = np.array([objects[owner].z for owner in owners])
        z = np.repeat(now[:, None], len(self._times), axis=1)
        for row, hypothesis in enumerate(hypotheses):
            if hypothesis.z is not None:
                z[row] = hypothesis.z
        free = [row for row, hypothesis in enumerate(hypotheses) if hypothesis.z is None and hypothesis.speed[0] > 0.0]
        if free and self._roads is not None:
            x, y = (np.concatenate([hypotheses[row].poses[axis] for row in free]) for axis in (0, 1))
            heights = z[free].ravel()
            lanes, s, points = self._roads.overlapped_lanes(x, y, heights)
            heights[points] = self._roads.tables.lane_poses(lanes, s, np.zeros(len(s))).z
            z[free] = heights.reshape(len(free), -1)
        return z

    def _hypotheses(
        self, known_object: KnownObject, courses: list[Course], defers: Callable[[Passage], bool] | None
    ) -> list[Hypothesis]:
        times, now = self._times, known_object.speed
        if now < STANDING or known_object.seems_to_stand:
            motion = np.array([known_object.x, known_object.y, known_object.yaw, 0.0])
            x, y, yaw, speed = motion[:, None].repeat(len(times), axis=1)
            return [Hypothesis((x, y, yaw), speed)]
        travelled, speed = longitudinal_motion(now, known_object.acceleration, times)
        following: list[_Branch] = []
        too_fast: list[_Branch] = []
        """Along curves for which the vehicle is too fast: only if it follows no other lane, or leaves the others."""
        leaving: list[Hypothesis] = []
        """Along lanes that the vehicle leaves, crosses or is beside of: only if it follows no lane."""
        direction = math.atan2(known_object.vy, known_object.vx)
        noise = known_object.speed_error
        # A vehicle that accelerates does so until its driver reacts to a curve.
        soon = now + max(known_object.acceleration, 0.0) * PERCEPTION - noise
        steady = max(LEAVING_RATE, LEAVING_ERROR * known_object.error)
        sets_off = known_object.moved < known_object.length
        for course in courses:
            along, left, heading = course.project(known_object.x, known_object.y)
            turn = float(wrap_angle(direction - heading))
            along_lane, lane_speed = travelled, speed
            if not known_object.has_course:
                if now >= noise and math.cos(turn) < 0.0:
                    continue  # It reverses slowly.
                share, turn = max(math.cos(turn), 0.0), 0.0
                along_lane, lane_speed = travelled * share, speed * share
            if abs(turn) > ALIGNED or abs(left) > LANE_WIDTH:
                continue
            aside = now * math.sin(turn)
            offset: float | Array = left
            in_junction = any(passage.start <= along <= passage.end for passage in course.passages)
            wandering = max(steady, CUTTING * now) if in_junction else steady
            is_inside = abs(left) <= course.half_width + known_object.error
            # Else the prediction alternates where a turn is near a limit.
            keeps = (
                in_junction
                and is_inside
                and course in known_object.followed
                and abs(aside) <= max(wandering, STILL_CUTTING * now)
                and course.can_follow(along, (now - noise) / HARSH)
            )
            leaves = abs(aside) > wandering and not keeps
            fits = keeps or now <= noise or course.can_follow(along, soon)
            if leaves:
                offset = left + np.minimum(np.maximum(aside * times, -LANE_WIDTH), LANE_WIDTH)
            way, speeds = _held_by_sign(known_object, course, along, times) or (along_lane, lane_speed)
            room = max(course.half_width - abs(left), 0.0)
            ahead = tuple([passage for passage in course.passages if passage.end > along])
            z = None if self._level else np.interp(along + way, course.along, course.heights)
            hypothesis = Hypothesis(course.poses(along + way, offset), speeds, room, ahead, z)
            if leaves or not is_inside:
                leaving.append(hypothesis)
                continue
            turns = [abs(passage.turn) for passage in ahead if defers is not None and defers(passage)]
            coming = [abs(passage.turn) for passage in ahead if passage.start > along or sets_off]
            deferring = max(turns, default=-math.inf)
            branch = _Branch(hypothesis, course, abs(aside), deferring, max(coming, default=0.0))
            (following if fits else too_fast).append(branch)
            if len(following) == MOST_HYPOTHESES:
                break
        least = min((branch.aside for branch in following), default=-math.inf)
        following += [branch for branch in too_fast if least > max(steady, branch.aside)]
        known_object.followed = [branch.course for branch in following]
        # It is expected to turn before the ego only if it leaves its lane, in the direction of the turn.
        # It may do so if it slows down.
        slows = known_object.acceleration <= -NOTICEABLE
        expected = _expected([(branch.aside, branch.deferring) for branch in following], steady)
        likely = _expected([(branch.aside, branch.coming) for branch in following], steady)
        hypotheses = [
            branch.hypothesis._replace(likely=is_expected and is_likely)
            for branch, is_expected, is_likely in zip(following, expected, likely, strict=True)
            if is_expected or slows
        ]
        hypotheses = hypotheses or [branch.hypothesis for branch in too_fast] or leaving[:MOST_HYPOTHESES]
        return hypotheses or [_straight_on(known_object, travelled, speed)]

    def lanes(self, objects: list[KnownObject]) -> list[list[Course]]:
        """Return the courses of the lanes on which each moving vehicle is."""
        lanes: list[list[Course]] = [[] for _ in objects]
        moving = [
            index
            for index, known_object in enumerate(objects)
            if known_object.speed >= STANDING and known_object.kind not in ON_FOOT
        ]
        if not moving or self._roads is None or self._courses is None:
            return lanes
        x, y, z = np.array([(objects[index].x, objects[index].y, objects[index].z) for index in moving]).T.copy()
        rows, _, owners = self._roads.overlapped_lanes(x, y, None if self._level else z)
        drivable = self._roads.tables.lane_drivable
        alternatives: list[list[tuple[Course, ...]]] = [[] for _ in moving]
        for row, owner in zip(rows.tolist(), owners.tolist(), strict=True):
            if drivable[row]:
                alternatives[owner].append(self._courses.ahead(row))
        for index, groups in zip(moving, alternatives, strict=True):
            lanes[index] = in_turn(groups)
        return lanes


def _expected(turns: list[tuple[float, float]], steady: float) -> list[bool]:
    """Return which turns are about as small as the smallest one, or show, as the vehicle leaves the lanes of those.

    turns   lateral speeds from the lanes [m/s], and turns along them [rad]
    steady  lateral speed up to which a vehicle keeps its lane [m/s]
    """
    usual = min((turn for _, turn in turns), default=0.0) + SIMILAR_TURN
    least = min((deviation for deviation, turn in turns if turn <= usual), default=math.inf)
    return [turn <= usual or least > max(steady, deviation) for deviation, turn in turns]


def _straight_on(known_object: KnownObject, travelled: Array, speed: Array) -> Hypothesis:
    """Return the motion of an object that follows no lane.

    A vehicle whose direction of motion is unknown moves along its axis.
    """
    direction = math.atan2(known_object.vy, known_object.vx)
    if not known_object.has_course and known_object.kind not in ON_FOOT:
        ahead = math.cos(direction - known_object.yaw)
        direction = known_object.yaw if ahead >= 0.0 else known_object.yaw + math.pi
        travelled, speed = travelled * abs(ahead), speed * abs(ahead)
    x, y = known_object.x + math.cos(direction) * travelled, known_object.y + math.sin(direction) * travelled
    return Hypothesis((x, y, np.full(len(travelled), direction)), speed)


def longitudinal_motion(speed: float, acceleration: float, times: Array) -> tuple[Array, Array]:
    """Return the distances [m] and speeds [m/s] (K,) of an object; it never moves backward.

    A positive acceleration decreases exponentially; a braking object continues to brake until it stands.
    """
    if speed < STANDING:
        return np.zeros(len(times)), np.zeros(len(times))
    if abs(acceleration) < NOTICEABLE:
        return np.asarray(speed * times), np.full(len(times), speed)
    acceleration = min(max(acceleration, -GREATEST), GREATEST)
    if acceleration > 0.0:
        gained = acceleration * PERSISTENCE * (1.0 - np.exp(-times / PERSISTENCE))
        return np.asarray((speed + acceleration * PERSISTENCE) * times - PERSISTENCE * gained), speed + gained
    braking = np.minimum(times, -speed / acceleration)
    return np.asarray(speed * braking + 0.5 * acceleration * braking**2), np.asarray(speed + acceleration * braking)


def stopping_motion(speed: float, left: float, times: Array) -> tuple[Array, Array]:
    """Return the distances [m] and speeds [m/s] (K,) of a vehicle that stops `left` meters ahead.

    It brakes as late as STOPPING permits, or at once.
    """
    deceleration = max(STOPPING, speed * speed / (2.0 * left))
    begin = (left - speed * speed / (2.0 * deceleration)) / speed
    braking = np.clip(times - begin, 0.0, speed / deceleration)
    way = speed * np.minimum(times, begin) + speed * braking - 0.5 * deceleration * braking**2
    return np.asarray(way), np.asarray(speed - deceleration * braking)


def _held_by_sign(known_object: KnownObject, course: Course, along: float, times: Array) -> tuple[Array, Array] | None:
    """Return the motion of a vehicle to the next stop sign; None without one, or if it does not stop there any more."""
    front = along + known_object.length / 2.0
    left = next((stop - front for stop in course.stops if stop > front - AT_SIGN), math.inf)
    if left < AT_SIGN or known_object.acceleration > NOTICEABLE or known_object.speed**2 > 2.0 * COMFORTABLE * left:
        return None
    return stopping_motion(known_object.speed, left, times) if math.isfinite(left) else None

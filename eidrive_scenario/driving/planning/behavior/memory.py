"""Memory of fused objects over time: motion of objects without a velocity, confirmation, and loss."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.detections import VULNERABLE, Detections
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.driving.planning.behavior.right_of_way import Course
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.roads import OTHER_LEVEL

ON_FOOT = frozenset({"pedestrian"})
STILL = 0.5
"""Speed below which an object stands [m/s]."""
GATE = 2.5
"""Maximum distance of an object from its prediction [m]: half the length of a car."""
USUAL_ERROR = 0.3
"""Assumed standard deviation of a position without a covariance [m]."""
SPEED_ERROR = 0.5
"""Standard deviation of the speed of a lost object [m/s], by which its covariance grows."""
LARGEST_ERROR = 3.0
"""Maximum standard deviation that is considered [m]; above it the position says nothing."""
SMOOTHING = 0.4
"""Weight of the newest difference quotient in the velocity of an object whose detector estimates none."""
REPEATED = 1.0
"""Maximum time for which a position without a velocity that does not change is that of one sensor reading [s]. Sensors
are slower than decisions, and two readings of a real sensor differ by noise."""
VELOCITY_ERROR = 1.5
"""Assumed standard deviation of a velocity per standard deviation of the position [1/s]."""
AXIAL_SPEED = 1.0
"""Minimum speed of a vehicle whose direction of motion is taken from its velocity instead of its axis [m/s]."""
LASTING = 1.0
"""Time constant of the mean speed [s], with which a lost object moves on."""
ALONG = math.cos(math.radians(40.0))
"""Cosine of the angle between axis and motion up to which an object moves along its axis."""
LONGEST_HIDDEN = 10.0
"""Time for which an object is kept whose place is out of view [s], about that of passing it."""
STAYING = 3.0
"""Time constant of the mean place of an object [s]."""
NEARBY = 1.0
"""Maximum distance of an object from its mean place while it stays there [m]; one that sets off with 1 m/s² leaves it
after 1.4 s."""
CLASSIFYING = 1.0
"""Time constant of the shares of observed classes [s]; detectors confuse those of distant objects for single frames."""
CHANGING = 0.7
"""Time constant of the estimate of accelerations [s], which damps the noise of velocities."""


class KnownObject(msgspec.Struct):
    """One object over time."""

    row: int | None
    """Row of the fused objects; None while the object is lost."""
    kind: str
    x: float
    y: float
    yaw: float
    length: float
    width: float
    vx: float
    vy: float
    has_velocity: bool
    """Whether the velocity is measured or estimated; it is 0 otherwise."""
    error: float
    """Standard deviation of the position in the direction in which it is greatest [m]."""
    existence: float
    seen: float
    """Time of the last observation [s]."""
    still_since: float | None = None
    """Time since which the object stands [s]; None while it moves."""
    stands_at: tuple[float, float] = (math.inf, math.inf)
    """Place at which the object has last come to stand [m]; inf if it has not."""
    moving_since: float | None = None
    """Time since which the object moves [s]; None while it stands."""
    hidden_since: float | None = None
    """Time since which the place of a lost object is out of view [s]."""
    ellipse: tuple[float, float, float] = (1.0, 0.0, 0.0)
    """Covariance of the position in units of the squared error: half of the sum and of the difference of the variances
    of x and y, and their covariance."""
    first_seen: float = math.inf
    """Time of the first observation [s]."""
    mean_place: tuple[float, float] = (0.0, 0.0)
    """Mean place over about the last seconds [m]."""
    acceleration: float = 0.0
    """Estimated rate of change of the speed [m/s²]."""
    mean_speed: float = 0.0
    """Speed over about the last second [m/s]."""
    z: float = 0.0
    """Height of the lower side of its box [m]."""
    followed: list[Course] = []
    """Courses that it was last predicted to follow."""
    kinds: dict[str, float] = {}
    """Shares of the classes that were observed over about the last second; empty while there is only one."""
    measured: tuple[float, float] | None = None
    """Last measured position [m], if the detector estimates no velocity."""
    measured_at: float = math.inf
    """Time since which this position is given [s]."""

    @property
    def speed(self) -> float:
        """Speed [m/s]."""
        return math.hypot(self.vx, self.vy)

    @property
    def moved(self) -> float:
        """Distance from the place at which it last stood [m]; inf if it never did."""
        return math.hypot(self.x - self.stands_at[0], self.y - self.stands_at[1])

    @property
    def speed_error(self) -> float:
        """Assumed standard deviation of the velocity [m/s]."""
        return VELOCITY_ERROR * self.error

    @property
    def has_course(self) -> bool:
        """Whether the direction of its velocity is that of its motion; otherwise a vehicle moves along its axis.

        A slow vehicle has no lateral motion, so that a velocity across its axis is noise.
        """
        return self.speed >= self.speed_error and (self.speed >= AXIAL_SPEED or self.kind in ON_FOOT)

    @property
    def seems_to_stand(self) -> bool:
        """Whether it stood and its speed is within the error; a road user on foot or on two wheels may set off."""
        return self.still_since is not None and self.speed < self.speed_error and self.kind not in VULNERABLE

    def stays(self, now: float, duration: float) -> bool:
        """Return whether it has been near one place for a time [s], whatever velocities were measured."""
        x, y = self.mean_place
        return now - self.first_seen >= duration and math.hypot(self.x - x, self.y - y) <= NEARBY

    def is_at(self, other: KnownObject) -> bool:
        """Return whether it is at the place of another object."""
        return math.hypot(other.x - self.x, other.y - self.y) < GATE and abs(other.z - self.z) < OTHER_LEVEL

    def keep_course(self) -> None:
        """Let an object that has just been lost move along its axis with its mean speed, if it moves about that way.

        Velocities at the edge of the view are noisy.
        """
        ahead = self.vx * math.cos(self.yaw) + self.vy * math.sin(self.yaw)
        if self.kind in ON_FOOT or abs(ahead) < ALONG * self.speed or self.speed < STILL:
            return
        speed = math.copysign(self.mean_speed, ahead)
        self.vx, self.vy = speed * math.cos(self.yaw), speed * math.sin(self.yaw)
        self.acceleration = min(self.acceleration, 0.0)

    def observe(self, fresh: KnownObject, step: float, shares: _Shares) -> None:
        """Update the object by its new observation; one that repeats the measured position is none.

        step    time since the last decision [s]
        shares  weights of a new observation after this time
        """
        if not fresh.has_velocity:
            elapsed = fresh.seen - self.measured_at
            if fresh.measured == self.measured and elapsed < REPEATED - TIME_TOLERANCE:
                self.row, self.seen, self.hidden_since = fresh.row, fresh.seen, None
                return
            if elapsed > step > 0.0:
                step, shares = elapsed, _Shares.of(elapsed)
        before = self.speed if self.has_velocity else None
        if fresh.has_velocity:
            self.vx, self.vy = fresh.vx, fresh.vy
        elif step > 0.0:
            share = SMOOTHING if self.has_velocity else 1.0
            self.vx += share * (fresh.x - self.x) / step
            self.vy += share * (fresh.y - self.y) / step
        speed = self.speed
        if before is not None and step > 0.0:
            change = (speed - before) / step
            self.acceleration += (change - self.acceleration) * shares.acceleration
        self.mean_speed += (speed - self.mean_speed) * (1.0 if before is None else shares.speed)
        self.has_velocity |= fresh.has_velocity or step > 0.0
        self.hidden_since = None
        self._classify(fresh.kind, shares.kind)
        self.row, self.seen = fresh.row, fresh.seen
        self.measured, self.measured_at = fresh.measured, fresh.seen
        self.x, self.y, self.yaw = fresh.x, fresh.y, fresh.yaw
        self.length, self.width = fresh.length, fresh.width
        self.z = fresh.z
        self.error, self.ellipse, self.existence = fresh.error, fresh.ellipse, fresh.existence
        x, y = self.mean_place
        self.mean_place = x + shares.position * (fresh.x - x), y + shares.position * (fresh.y - y)

    def note_motion(self, now: float, uncertainty: float) -> None:
        """Update since when the object stands or moves.

        It stands on while it has moved no farther and no faster than the errors of place and velocity explain.
        """
        if self.speed < STILL or (self.seems_to_stand and self.moved <= uncertainty * self.error):
            if self.still_since is None:
                self.stands_at, self.still_since = (self.x, self.y), now
            self.moving_since = None
        else:
            self.still_since = None
            self.moving_since = now if self.moving_since is None else self.moving_since

    def _classify(self, kind: str, share: float) -> None:
        """Set the class of an object to the one that was observed most, after a new observation with this weight."""
        if kind == self.kind and not self.kinds:
            return
        shares = self.kinds or {self.kind: 1.0}
        self.kinds = {name: value * (1.0 - share) for name, value in shares.items()}
        self.kinds[kind] = self.kinds.get(kind, 0.0) + share
        most = max(self.kinds.values())
        if self.kinds.get(self.kind, 0.0) < most:
            self.kind = max(self.kinds, key=lambda name: self.kinds[name])


class ObjectMemory:
    """Fused objects of one vehicle, associated over time by their predicted positions."""

    def __init__(self, settings: BehaviorSettings) -> None:
        self._settings = settings
        self._objects: list[KnownObject] = []
        self._time = -math.inf

    def update(
        self, detections: Detections, now: float, in_view: Callable[[Sequence[KnownObject]], Bools] | None = None
    ) -> list[KnownObject]:
        """Return all objects at `now` [s], lost ones at their predicted positions.

        Objects with an existence probability below `possible_existence` are ignored. A lost object is kept while its
        place is out of view.

        in_view  returns whether the sensors of the vehicle show the places of objects; None: all of them
        """
        step = now - self._time if self._objects else 0.0
        for known_object in self._objects:
            known_object.x += known_object.vx * step
            known_object.y += known_object.vy * step
            known_object.row = None
        self._time = now
        observed = _objects_of(detections, now, self._settings.possible_existence)
        shares = _Shares.of(step)
        for index, known_object in self._pairs(observed):
            known_object.observe(observed[index], step, shares)
            observed[index] = known_object
        lost = [known_object for known_object in self._objects if known_object.row is None]
        for lost_object in lost:
            if now - step - lost_object.seen < TIME_TOLERANCE:
                lost_object.keep_course()
        self._note_hidden(lost, now, in_view)
        lost = [lost_object for lost_object in lost if self._is_kept(lost_object, observed, now)]
        for lost_object in lost:
            if lost_object.still_since is None:
                lost_object.error = min(lost_object.error + SPEED_ERROR * step, LARGEST_ERROR)
        self._objects = observed + lost
        for known_object in self._objects:
            known_object.note_motion(now, self._settings.uncertainty)
        return self._objects

    def _pairs(self, observed: list[KnownObject]) -> list[tuple[int, KnownObject]]:
        """Return pairs of the index of a new object and a known one, the nearest first, each in at most one pair."""
        if not observed or not self._objects:
            return []
        ahead: Array = np.array([(known_object.x, known_object.y) for known_object in self._objects])
        positions: Array = np.array([(known_object.x, known_object.y) for known_object in observed])
        gap = np.hypot(positions[:, None, 0] - ahead[None, :, 0], positions[:, None, 1] - ahead[None, :, 1])
        for index, fresh_object in enumerate(observed):
            if fresh_object.measured is not None:
                gap[index, [fresh_object.measured == known_object.measured for known_object in self._objects]] = 0.0
        bottom, former = (np.array([known_object.z for known_object in group]) for group in (observed, self._objects))
        fresh, earlier = ((gap < GATE) & (np.abs(bottom[:, None] - former) < OTHER_LEVEL)).nonzero()
        order = gap[fresh, earlier].argsort(kind="stable")
        pairs: list[tuple[int, KnownObject]] = []
        new: set[int] = set()
        old: set[int] = set()
        for first, second in zip(fresh[order].tolist(), earlier[order].tolist(), strict=True):
            if first not in new and second not in old:
                new.add(first)
                old.add(second)
                pairs.append((first, self._objects[second]))
        return pairs

    def _note_hidden(
        self, lost: list[KnownObject], now: float, in_view: Callable[[Sequence[KnownObject]], Bools] | None
    ) -> None:
        """Update since when the places of lost objects are out of view; an object that should be in view is forgotten
        in `memory`."""
        if not lost:
            return
        shown = np.ones(len(lost), dtype=bool) if in_view is None else in_view(lost)
        for lost_object, is_shown in zip(lost, shown.tolist(), strict=True):
            if not is_shown and lost_object.hidden_since is None:
                lost_object.hidden_since = now
            elif is_shown and lost_object.hidden_since is not None:
                lost_object.seen += now - lost_object.hidden_since
                lost_object.hidden_since = None

    def _is_kept(self, lost: KnownObject, observed: list[KnownObject], now: float) -> bool:
        # A lost object at the place of one in view was another track of it.
        if lost.existence < self._settings.min_existence or any(lost.is_at(other) for other in observed):
            return False
        if lost.hidden_since is not None:
            return self._settings.memory > 0.0 and now - lost.hidden_since <= LONGEST_HIDDEN
        return now - lost.seen <= self._settings.memory


def _objects_of(detections: Detections, now: float, least: float) -> list[KnownObject]:
    existence = detections.confidence.tolist()
    of_x, of_y, of_both = (detections.covariance[:, row, column] for row, column in ((0, 0), (1, 1), (0, 1)))
    mean, half = 0.5 * (of_x + of_y), 0.5 * (of_x - of_y)
    greatest = mean + np.hypot(half, of_both)
    scale = np.where(greatest > 0.0, greatest, 1.0)
    ellipses = zip((mean / scale).tolist(), (half / scale).tolist(), (of_both / scale).tolist(), strict=True)
    errors = zip(greatest.tolist(), ellipses, strict=True)
    age = max(now - detections.time, 0.0)
    objects = []
    columns = (detections.boxes.tolist(), detections.velocity.tolist(), errors)
    for row, (box, (vx, vy), (variance, ellipse)) in enumerate(zip(*columns, strict=True)):
        if existence[row] < least:
            continue
        x, y, z, length, width, height, yaw = box
        moving = not (math.isnan(vx) or math.isnan(vy))
        vx, vy = (vx, vy) if moving else (0.0, 0.0)
        error = math.sqrt(variance) if variance >= 0.0 else USUAL_ERROR
        kind = detections.classes[row]
        x, y, error = x + vx * age, y + vy * age, min(error + SPEED_ERROR * age, LARGEST_ERROR)
        observation = KnownObject(row, kind, x, y, yaw, length, width, vx, vy, moving, error, existence[row], now)
        observation.first_seen, observation.mean_place, observation.mean_speed = now, (x, y), observation.speed
        observation.measured, observation.measured_at = None if moving else (x, y), now
        observation.z = z - height / 2.0
        if variance > 0.0:
            observation.ellipse = ellipse
        objects.append(observation)
    return objects


def nearest_rows(detections: Detections, places: Array) -> tuple[int, ...]:
    """Return the rows of the objects that were at places (N, 2) shortly before; none for an object that is lost."""
    if not len(places) or not len(detections):
        return ()
    boxes = detections.boxes
    gap = np.hypot(boxes[:, 0] - places[:, :1], boxes[:, 1] - places[:, 1:])
    nearest = gap.argmin(axis=1)
    near = gap[np.arange(len(places)), nearest] < GATE
    return tuple(dict.fromkeys(nearest[near].tolist()))


class _Shares(NamedTuple):
    """Weights of a new observation in the estimates of acceleration, mean speed, mean place and class."""

    acceleration: float
    speed: float
    position: float
    kind: float

    @classmethod
    def of(cls, step: float) -> _Shares:
        """Return the weights after a time step [s]."""
        return cls(*[1.0 - math.exp(-step / time) for time in (CHANGING, LASTING, STAYING, CLASSIFYING)])

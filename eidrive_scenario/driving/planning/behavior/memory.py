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
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.perception.traffic_lights import OTHER_LEVEL

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
    stands_at: tuple[float, float] = (0.0, 0.0)
    """Place at which the object has come to stand [m]."""
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
    kinds: dict[str, float] = {}
    """Shares of the classes that were observed over about the last second; empty while there is only one."""

    @property
    def speed(self) -> float:
        """Speed [m/s]."""
        return math.hypot(self.vx, self.vy)

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
        for known in self._objects:
            known.x += known.vx * step
            known.y += known.vy * step
            known.row = None
        self._time = now
        found = _objects_of(detections, now, self._settings.possible_existence)
        shares = _Shares.of(step)
        for index, known in self._pairs(found):
            _take_over(known, found[index], step, shares)
            found[index] = known
        lost = [known for known in self._objects if known.row is None]
        for known in lost:
            if now - step - known.seen < TIME_TOLERANCE:
                _keep_course(known)
        self._note_hidden(lost, now, in_view)
        lost = [known for known in lost if self._is_kept(known, now) and not _is_among(known, found)]
        for known in lost:
            if known.still_since is None:
                known.error = min(known.error + SPEED_ERROR * step, LARGEST_ERROR)
        self._objects = found + lost
        uncertainty = self._settings.uncertainty
        for known in self._objects:
            # It stands on while it has moved no farther and no faster than the errors of place and velocity explain.
            moved = math.hypot(known.x - known.stands_at[0], known.y - known.stands_at[1])
            is_still = known.speed < STILL or (known.seems_to_stand and moved <= uncertainty * known.error)
            if is_still and known.still_since is None:
                known.stands_at = known.x, known.y
            known.still_since = (now if known.still_since is None else known.still_since) if is_still else None
            known.moving_since = None if is_still else now if known.moving_since is None else known.moving_since
        return self._objects

    def _pairs(self, found: list[KnownObject]) -> list[tuple[int, KnownObject]]:
        """Return pairs of the index of a new object and a known one, the nearest first, each in at most one pair."""
        if not found or not self._objects:
            return []
        ahead: Array = np.array([(known.x, known.y) for known in self._objects])
        places: Array = np.array([(known.x, known.y) for known in found])
        gap = np.hypot(places[:, None, 0] - ahead[None, :, 0], places[:, None, 1] - ahead[None, :, 1])
        bottom, former = (np.array([known.z for known in some]) for some in (found, self._objects))
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
        for known, is_shown in zip(lost, shown.tolist(), strict=True):
            if is_shown and known.hidden_since is not None:
                known.seen += now - known.hidden_since
            known.hidden_since = None if is_shown else now if known.hidden_since is None else known.hidden_since

    def _is_kept(self, known: KnownObject, now: float) -> bool:
        if known.existence < self._settings.min_existence:
            return False
        if known.hidden_since is not None:
            return self._settings.memory > 0.0 and now - known.hidden_since <= LONGEST_HIDDEN
        return now - known.seen <= self._settings.memory


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
        known = KnownObject(row, kind, x, y, yaw, length, width, vx, vy, moving, error, existence[row], now)
        known.mean_speed, known.ellipse = known.speed, ellipse if variance > 0.0 else (1.0, 0.0, 0.0)
        known.first_seen, known.mean_place = now, (x, y)
        known.z = z - height / 2.0
        objects.append(known)
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


def _is_among(lost: KnownObject, found: list[KnownObject]) -> bool:
    """Return whether a lost object is at the place of one in view, of which it was another track."""
    return any(
        math.hypot(other.x - lost.x, other.y - lost.y) < GATE and abs(other.z - lost.z) < OTHER_LEVEL for other in found
    )


def _keep_course(known: KnownObject) -> None:
    """Let an object that has just been lost move along its axis with its mean speed, if it moves about that way.

    Velocities at the edge of the view are noisy.
    """
    ahead = known.vx * math.cos(known.yaw) + known.vy * math.sin(known.yaw)
    if known.kind in ON_FOOT or abs(ahead) < ALONG * known.speed or known.speed < STILL:
        return
    speed = math.copysign(known.mean_speed, ahead)
    known.vx, known.vy = speed * math.cos(known.yaw), speed * math.sin(known.yaw)
    known.acceleration = min(known.acceleration, 0.0)


class _Shares(NamedTuple):
    """Weights of a new observation in the estimates of acceleration, mean speed, mean place and class."""

    acceleration: float
    speed: float
    place: float
    kind: float

    @classmethod
    def of(cls, step: float) -> _Shares:
        """Return the weights after a time step [s]."""
        return cls(*[1.0 - math.exp(-step / time) for time in (CHANGING, LASTING, STAYING, CLASSIFYING)])


def _take_over(known: KnownObject, fresh: KnownObject, step: float, shares: _Shares) -> None:
    """Update a known object by its new observation.

    step    time since the last observations [s]
    shares  weights of the new observation after this time
    """
    before = known.speed if known.has_velocity else None
    if fresh.has_velocity:
        known.vx, known.vy = fresh.vx, fresh.vy
    elif step > 0.0:
        share = SMOOTHING if known.has_velocity else 1.0
        known.vx += share * (fresh.x - known.x) / step
        known.vy += share * (fresh.y - known.y) / step
    speed = known.speed
    if before is not None and step > 0.0:
        change = (speed - before) / step
        known.acceleration += (change - known.acceleration) * shares.acceleration
    known.mean_speed += (speed - known.mean_speed) * (1.0 if before is None else shares.speed)
    known.has_velocity |= fresh.has_velocity or step > 0.0
    known.hidden_since = None
    _classify(known, fresh.kind, shares.kind)
    known.row, known.seen = fresh.row, fresh.seen
    known.x, known.y, known.yaw = fresh.x, fresh.y, fresh.yaw
    known.length, known.width = fresh.length, fresh.width
    known.z = fresh.z
    known.error, known.ellipse, known.existence = fresh.error, fresh.ellipse, fresh.existence
    x, y = known.mean_place
    known.mean_place = x + shares.place * (fresh.x - x), y + shares.place * (fresh.y - y)


def _classify(known: KnownObject, kind: str, share: float) -> None:
    """Set the class of an object to the one that was observed most, after a new observation with this weight."""
    if kind == known.kind and not known.kinds:
        return
    shares = known.kinds or {known.kind: 1.0}
    known.kinds = {name: value * (1.0 - share) for name, value in shares.items()}
    known.kinds[kind] = known.kinds.get(kind, 0.0) + share
    most = max(known.kinds.values())
    if known.kinds.get(known.kind, 0.0) < most:
        known.kind = max(known.kinds, key=lambda name: known.kinds[name])

"""Predicted objects in the coordinates of the reference line."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.base.detections import VULNERABLE
from eidrive_scenario.driving.planning.behavior.memory import KnownObject
from eidrive_scenario.driving.planning.behavior.prediction import Prediction
from eidrive_scenario.driving.planning.behavior.reference import ReferenceLine
from eidrive_scenario.driving.planning.behavior.right_of_way import Passage
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.roads import OTHER_LEVEL

LARGEST_LATERAL_ERROR = 0.75
"""Maximum enlargement of an object to the side [m]: half of what a lane leaves beside a car, else neighbors block."""
LARGEST_ERROR_ALONG = 3.0
"""Maximum enlargement of an object along the line [m]."""
FAR_ASIDE, AWAY = 12.0, 1e3
"""Distance from the line beyond which an object has no effect at that time, and one for objects without effect [m]."""
ACROSS = np.cos(np.radians(40.0))
"""Cosine of the angle between the motion of an object and the line from which on it crosses."""


class Present(msgspec.Struct, frozen=True):
    """One hypothesis at the first time in coordinates of the reference line; fields as those of `Surroundings`."""

    row: int
    owner: int
    s: float
    d: float
    rear: float
    front: float
    half_length: float
    half_width: float
    speed: float
    margin: float
    crosses: bool


class Surroundings(msgspec.Struct, frozen=True, dict=True):
    """N hypotheses at K times in coordinates of the reference line.

    s, d, half_length, half_width  (N, K) [m];  speed  (N, K) along the line [m/s];  margin  (N,) to the side [m]
    owner  (N,) index of the object;  certain  (N,) whether its existence is certain enough for hard braking
    likely  (N,) whether it is likely enough for emergency braking: no large turn in a junction ahead of it
    passing_gap  (N,) additional gap behind what stands [m]
    crosses  (N, K) whether it moves across the line;  behind  (N,) whether it follows the ego in its lane
    yields   (N,) whether the ego gives way to it at a junction
    """

    s: Array
    d: Array
    half_length: Array
    half_width: Array
    speed: Array
    margin: Array
    owner: tuple[int, ...]
    certain: Bools
    likely: Bools
    passing_gap: Array
    crosses: Bools
    behind: Bools
    yields: Bools

    def __len__(self) -> int:
        return len(self.owner)

    @cached_property
    def rear(self) -> Array:
        """Least distances along the line that the hypotheses occupy (N, K) [m]."""
        return self.s - self.half_length

    @cached_property
    def front(self) -> Array:
        """Greatest distances along the line that the hypotheses occupy (N, K) [m]."""
        return self.s + self.half_length

    @cached_property
    def may_lead(self) -> Bools:
        """Whether the hypotheses lead the ego where they are in its way (N, K)."""
        return np.asarray(~(self.crosses | self.behind[:, None]))

    @cached_property
    def present(self) -> list[Present]:
        """Hypotheses at the first time as scalars, for the choice of single ones, where arrays are slow."""
        columns = (self.s, self.d, self.rear, self.front, self.half_length, self.half_width, self.speed)
        values = np.array([column[:, 0] for column in columns]).tolist()
        names = (range(len(self)), self.owner, *values, self.margin.tolist(), self.crosses[:, 0].tolist())
        return list(map(Present, *names))

    def rows(self, rows: Integers) -> Surroundings:
        """Return some of the hypotheses."""
        arrays = {name: getattr(self, name)[rows] for name in self.__struct_fields__ if name != "owner"}
        return Surroundings(owner=tuple([self.owner[row] for row in rows.tolist()]), **arrays)


def later(scene: Surroundings, steps: Integers, beyond: Array) -> Surroundings:
    """Return the hypotheses at some of their times, and at times `beyond` the last one [s], at which they keep their
    speeds and lanes."""
    index = np.append(steps, np.full(len(beyond), scene.s.shape[1] - 1))
    same = ("d", "half_length", "half_width", "speed", "crosses")
    s = np.hstack([scene.s[:, steps], scene.s[:, -1:] + scene.speed[:, -1:] * beyond])
    return msgspec.structs.replace(scene, s=s, **{name: getattr(scene, name)[:, index] for name in same})


def surroundings(
    objects: list[KnownObject],
    prediction: Prediction,
    line: ReferenceLine,
    window: tuple[int, int],
    settings: BehaviorSettings,
    ego: tuple[float, float, float, float],
    gives_way: Callable[[Passage], bool] | None = None,
) -> Surroundings:
    """Return the predicted objects along the points of the line in `window`.

    gives_way  returns whether the ego gives way to traffic on a passage of a junction; None: there are no junctions
    ego  distance along the line of the center of the ego, its offset, half length and half width [m]
    """
    s, d, heading = line.project(prediction.x, prediction.y, *window)
    turn = prediction.yaw - heading
    cos, sin = np.cos(turn), np.sin(turn)
    owners = [objects[index] for index in prediction.objects]
    half = np.array([(owner.length / 2.0, owner.width / 2.0) for owner in owners]).reshape(-1, 2, 1)
    along, aside = position_errors(owners, heading - (prediction.yaw - prediction.yaw[:, :1]))
    ahead, across = np.abs(cos), np.abs(sin)
    half_length = ahead * half[:, 0] + across * half[:, 1]
    half_length += np.minimum(settings.uncertainty * along, LARGEST_ERROR_ALONG)
    half_width = across * half[:, 0] + ahead * half[:, 1]
    widened = half_width + np.minimum(settings.uncertainty * aside, LARGEST_LATERAL_ERROR)
    # A vehicle that follows its lane is within it, whatever the error of its position.
    half_width = np.maximum(half_width, np.minimum(widened, prediction.room[:, None]))
    margin = np.array(
        [settings.pedestrian_margin if owner.kind in VULNERABLE else settings.lateral_margin for owner in owners]
    )
    if prediction.z is not None and line.heights is not None:
        below = np.interp(s, line.along, line.heights, left=np.nan, right=np.nan)
        d = np.where(np.abs(prediction.z - below) > OTHER_LEVEL, AWAY, d)
    moving = prediction.speed[:, :1] > 0.0
    center, offset, length, width = ego
    behind = (s[:, 0] + half_length[:, 0] < center - length) & (np.abs(d[:, 0] - offset) < half_width[:, 0] + width)
    return Surroundings(
        s,
        np.where(np.abs(d) < FAR_ASIDE, d, AWAY),
        half_length,
        half_width,
        prediction.speed * cos,
        margin,
        prediction.objects,
        np.array([owner.existence >= settings.min_existence for owner in owners], dtype=bool),
        np.array(prediction.likely, dtype=bool),
        np.array([settings.passing_gap * (owner.still_since is not None) for owner in owners]),
        moving & (ahead < ACROSS),
        behind,
        _yields(prediction, gives_way),
    )


def position_errors(objects: list[KnownObject], direction: Array) -> tuple[Array, Array]:
    """Return the standard deviations of the positions of objects along directions (N, K) [rad] and across [m].

    They have shape (N, K), or (N, 1) if none depends on the direction. The error of an object that turns keeps its
    direction relative to the object.
    """
    error = np.array([known_object.error for known_object in objects])[:, None]
    mean, half, of_both = (
        np.array([known_object.ellipse for known_object in objects]).reshape(-1, 3, 1).transpose(1, 0, 2)
    )
    if not (half.any() or of_both.any()):
        alike = error * np.sqrt(np.maximum(mean, 0.0))
        return alike, alike
    shift = half * np.cos(2.0 * direction) + of_both * np.sin(2.0 * direction)
    return error * np.sqrt(np.maximum(mean + shift, 0.0)), error * np.sqrt(np.maximum(mean - shift, 0.0))


def _yields(prediction: Prediction, gives_way: Callable[[Passage], bool] | None) -> Bools:
    if gives_way is None or not any(prediction.passages):
        return np.zeros(len(prediction.objects), dtype=bool)
    return np.array([any(map(gives_way, passages)) for passages in prediction.passages], dtype=bool)


def only(scene: Surroundings, kept: Bools) -> Surroundings:
    """Return the scene without the hypotheses that are not kept (N,), which neither lead nor collide."""
    return msgspec.structs.replace(scene, d=np.where(kept[:, None], scene.d, AWAY))

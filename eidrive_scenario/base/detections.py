"""Perceived objects as arrays of boxes: produced by detectors, transmitted in messages, combined by fusion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Self

import msgspec
import numpy as np
from msgspec.structs import replace

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import rotation, wrap_angle

NOT_ESTIMATED: Array = np.empty(0)
"""Existence, and variance of the velocity, of objects for which no tracker and no fusion method has estimated it."""
NOT_ESTIMATED.flags.writeable = False

CLASSES = ("car", "truck", "bus", "van", "motorbike", "bicycle", "pedestrian", "misc")

VULNERABLE = frozenset({"pedestrian", "bicycle", "motorbike"})
"""Classes of vulnerable road users."""


class Detections(msgspec.Struct, frozen=True, gc=False):
    """Perceived objects at one instant.

    boxes       (N, 7) x y z l w h yaw of the box center in the world frame [m, rad]
    scores      (N,) confidence in [0, 1]
    classes     (N,) names out of CLASSES
    velocity    (N, 2) world frame [m/s], NaN where unknown
    covariance  (N, 2, 2) of the position x y [m²], NaN where unknown
    tracks      (N,) track numbers, constant over time for one object; empty without a tracker
    existence   (N,) probability of existence in [0, 1]; empty (0,) if it is not estimated
    velocity_deviation  standard deviation in each axis [m/s] of velocities that are measurements of this instant alone;
                        None for exact ones, and for states of a filter, which contain earlier measurements
    velocity_variance  (N,) in each axis [m²/s²] of velocities that are states of a filter; empty (0,) if not estimated
    """

    time: float
    boxes: Array = msgspec.field(default_factory=lambda: np.empty((0, 7)))
    scores: Array = msgspec.field(default_factory=lambda: np.empty(0))
    classes: tuple[str, ...] = ()
    velocity: Array = msgspec.field(default_factory=lambda: np.empty((0, 2)))
    covariance: Array = msgspec.field(default_factory=lambda: np.empty((0, 2, 2)))
    tracks: tuple[int, ...] = ()
    existence: Array = msgspec.field(default_factory=lambda: NOT_ESTIMATED)
    velocity_deviation: float | None = None
    velocity_variance: Array = msgspec.field(default_factory=lambda: NOT_ESTIMATED)

    def __post_init__(self) -> None:
        count = len(self.boxes)
        if self.boxes.shape != (count, 7):
            raise ValueError(f"boxes have shape {self.boxes.shape}, expected (N, 7)")
        if self.scores.shape != (count,):
            raise ValueError(f"scores has shape {self.scores.shape}, expected {(count,)}")
        if self.velocity.shape != (count, 2):
            raise ValueError(f"velocity has shape {self.velocity.shape}, expected {(count, 2)}")
        if self.covariance.shape != (count, 2, 2):
            raise ValueError(f"covariance has shape {self.covariance.shape}, expected {(count, 2, 2)}")
        if len(self.classes) != count:
            raise ValueError(f"{len(self.classes)} classes for {count} boxes")
        if self.tracks and len(self.tracks) != count:
            raise ValueError(f"{len(self.tracks)} tracks for {count} boxes")
        if self.existence is not NOT_ESTIMATED and self.existence.shape not in ((count,), (0,)):
            raise ValueError(f"existence has shape {self.existence.shape}, expected {(count,)} or (0,)")
        if self.velocity_variance is not NOT_ESTIMATED and self.velocity_variance.shape not in ((count,), (0,)):
            shape = self.velocity_variance.shape
            raise ValueError(f"velocity_variance has shape {shape}, expected {(count,)} or (0,)")
        if self.velocity_deviation is not None and not 0.0 < self.velocity_deviation < math.inf:
            raise ValueError(f"velocity_deviation is {self.velocity_deviation}, expected a positive number or None")

    @property
    def confidence(self) -> Array:
        """Return the probability of existence (N,) if it is estimated, else the scores."""
        return self.existence if len(self.existence) else self.scores

    def __len__(self) -> int:
        return len(self.boxes)

    def freeze(self) -> Self:
        """Make the arrays read-only, as several stations, messages and observers share them; return the detections."""
        if self.boxes.flags.writeable:  # most are passed on with read-only arrays
            arrays = self.boxes, self.scores, self.velocity, self.covariance, self.existence, self.velocity_variance
            for array in arrays:
                array.setflags(write=False)
        return self

    @classmethod
    def concatenate(cls, time: float, parts: Sequence[Detections]) -> Detections:
        """Return the objects of all parts as those of `time` [s]; the parts have the same deviation of velocities.

        Where only some of them state variances of velocities, those of the others are 0, which fusion raises to usual
        ones.
        """
        if not parts:
            return cls(time)
        is_estimated = any(len(part.existence) for part in parts)
        variances = [part.velocity_variance if len(part.velocity_variance) else np.zeros(len(part)) for part in parts]
        has_variances = any(len(part.velocity_variance) for part in parts)
        return cls(
            time,
            np.concatenate([part.boxes for part in parts]),
            np.concatenate([part.scores for part in parts]),
            tuple([name for part in parts for name in part.classes]),
            np.concatenate([part.velocity for part in parts]),
            np.concatenate([part.covariance for part in parts]),
            tuple([number for part in parts for number in part.tracks]),
            np.concatenate([part.confidence for part in parts]) if is_estimated else NOT_ESTIMATED,
            parts[-1].velocity_deviation,
            np.concatenate(variances) if has_variances else NOT_ESTIMATED,
        )

    def move(self, before: Array, after: Array, turn: float) -> Detections:
        """Return the detections of a station as it reports them from another pose.

        before, after  (2,) positions of the station of these detections, and of the returned ones [m]
        turn           change of its heading [rad]
        """
        turned = rotation(turn)
        boxes = self.boxes.copy()
        boxes[:, :2] = (boxes[:, :2] - before) @ turned.T + after
        boxes[:, 6] = wrap_angle(boxes[:, 6] + turn)
        return replace(
            self, boxes=boxes, velocity=self.velocity @ turned.T, covariance=turned @ self.covariance @ turned.T
        )

    def subset(self, rows: Sequence[int]) -> Detections:
        """Return these rows, in the given order."""
        picked = np.array(rows, dtype=np.intp)
        return Detections(
            self.time,
            self.boxes.take(picked, axis=0),
            self.scores.take(picked),
            tuple([self.classes[row] for row in rows]),
            self.velocity.take(picked, axis=0),
            self.covariance.take(picked, axis=0),
            tuple([self.tracks[row] for row in rows]) if self.tracks else (),
            self.existence.take(picked) if len(self.existence) else NOT_ESTIMATED,
            self.velocity_deviation,
            self.velocity_variance.take(picked) if len(self.velocity_variance) else NOT_ESTIMATED,
        )

"""What a station perceives: boxes of objects, as arrays; made by detectors, carried by messages, joined by fusion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.records import fast_frozen

NOT_ESTIMATED: Array = np.empty(0)
"""Existence of objects that no tracker and no fusion has judged."""
NOT_ESTIMATED.flags.writeable = False

CLASSES = ("car", "truck", "bus", "van", "motorbike", "bicycle", "pedestrian", "misc")


@fast_frozen
@dataclass(frozen=True)
class Detections:
    """Perceived objects at one instant.

    boxes       (N, 7) x y z l w h yaw of the box center in the world frame [m, rad]
    scores      (N,) confidence in [0, 1]
    classes     (N,) names out of CLASSES
    velocity    (N, 2) world frame [m/s], NaN where unknown
    covariance  (N, 2, 2) of the position x y [m²], NaN where unknown
    tracks      numbers of the tracks (N,), the same for one object over time; empty where nobody tracks
    existence   (N,) probability that there is such an object, in [0, 1]; empty (0,) if it is not estimated
    """

    time: float
    boxes: Array = field(default_factory=lambda: np.empty((0, 7)))
    scores: Array = field(default_factory=lambda: np.empty(0))
    classes: tuple[str, ...] = ()
    velocity: Array = field(default_factory=lambda: np.empty((0, 2)))
    covariance: Array = field(default_factory=lambda: np.empty((0, 2, 2)))
    tracks: tuple[int, ...] = ()
    existence: Array = field(default_factory=lambda: NOT_ESTIMATED)

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

    @property
    def confidence(self) -> Array:
        """(N,) probability of existence if it is estimated, else the scores."""
        return self.existence if len(self.existence) else self.scores

    def __len__(self) -> int:
        return len(self.boxes)

    def subset(self, rows: Sequence[int]) -> Detections:
        """These rows only, in the order given."""
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
        )

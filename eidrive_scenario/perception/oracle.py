"""The oracle: a detector without error, of what is in sight."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from eidrive_scenario.detections import Detections
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.sensing.readings import Readings


class OracleDetector(Detector):
    """Exact boxes, classes and velocities of the objects that the truth sensor has in its line of sight, score 1."""

    needs: ClassVar[frozenset[str]] = frozenset({"truth"})
    gives_velocity: ClassVar[bool] = True

    def detect(self, readings: Readings) -> Detections:
        truth = readings.truth
        if truth is None:
            return Detections(readings.time)
        count = len(truth.boxes)
        return Detections(
            time=readings.time,
            boxes=truth.boxes,
            scores=np.ones(count),
            classes=truth.categories,
            velocity=truth.velocity,
            covariance=np.zeros((count, 2, 2)),
        )

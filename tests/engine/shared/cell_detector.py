"""Detector of features for tests: each occupied cell is an object, and its features are what they show."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.feature_map import FeatureMap
from eidrive_scenario.fusion.feature_warp import Grid
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.perception.learned.pillars.codec import CellLayer, FeatureCodec
from eidrive_scenario.sensing.readings import Readings

CELL, CELLS = 0.8, 128
LEAST = 0.12
"""Least feature of an object: interpolation between four cells leaves a quarter of it, attention of two one half."""


def codec() -> FeatureCodec:
    """Return a codec whose latent channels are the first eight features; its code book has 0 and steps of channel 0."""
    codebook = np.zeros((256, 8), np.float32)
    codebook[:, 0] = np.arange(256) / 64.0
    expansion = CellLayer(np.eye(96, 8, dtype=np.float32), np.zeros(96, np.float32))
    return FeatureCodec(np.float32(0.03125), codebook, expansion)


class CellDetector(Detector):
    """Detector whose first feature is 1 in cells with points, and which reports cells with more than `LEAST`.

    velocity  of all objects [m/s]
    """

    needs: ClassVar[frozenset[str]] = frozenset({"lidar"})
    provides_features: ClassVar[bool] = True
    provides_velocity: ClassVar[bool] = True

    def __init__(self, velocity: tuple[float, float] = (0.0, 0.0)) -> None:
        self.velocity = velocity
        self._codec = codec()

    @property
    def codec(self) -> FeatureCodec:
        return self._codec

    def detect(self, readings: Readings) -> Detections:
        features = readings.features
        if features is None:
            self.feature_map = features = self._features(readings)
        grid = Grid(features.x, features.y, features.yaw, features.cell, (CELLS, CELLS))
        centers = grid.to_world(np.argwhere(features.features[0] > LEAST))
        count = len(centers)
        boxes = np.column_stack([centers, np.full((count, 5), (0.75, 1.0, 1.0, 1.5, 0.0))])
        covariance = np.tile(0.04 * np.eye(2), (count, 1, 1))
        velocity = np.tile(self.velocity, (count, 1))
        return Detections(readings.time, boxes, np.ones(count), ("car",) * count, velocity, covariance)

    def _features(self, readings: Readings) -> FeatureMap:
        first = next(iter(readings.lidars.values()))
        yaw = math.atan2(first.pose[1, 0], first.pose[0, 0])
        grid = Grid(float(first.pose[0, 3]), float(first.pose[1, 3]), yaw, CELL, (CELLS, CELLS))
        points = np.concatenate([reading.world_points for reading in readings.lidars.values()])
        cells, inside = grid.cells(points[:, :2])
        features = np.zeros((96, CELLS, CELLS), np.float32)
        features[0][tuple(cells[inside].T)] = 1.0
        return FeatureMap(
            readings.time, grid.x, grid.y, yaw, float(first.pose[2, 3]), 0.0, CELL, features, features[:8], features[0]
        )

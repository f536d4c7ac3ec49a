"""Detector `lidar`: boxes from lidar point clouds, without learning."""

from __future__ import annotations

import math
from collections import deque
from typing import ClassVar

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveInt

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.perception.detector import Detector, DetectorContext, without_duplicates
from eidrive_scenario.perception.geometry.lidar_geometry import (
    LevelFrame,
    Pattern,
    pattern_from_points,
    pattern_from_settings,
)
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.geometry.projection import in_lidar
from eidrive_scenario.perception.lidar.objects import UNLIKELY, FittedObject, objects
from eidrive_scenario.perception.lidar.scan import Scan
from eidrive_scenario.sensing.readings import LidarReading, Readings
from eidrive_scenario.sensing.settings import LidarSettings

HALF_SURE = 5.0
"""Number of points at which the score is half of its maximum."""


class LidarDetectorSettings(Settings):
    """Settings of the property `detector_settings`.

    off_road    maximum distance of an object from the roads of the map [m]; None: unrestricted
    min_points  minimum number of points of an object
    min_score   minimum score of a reported object
    """

    off_road: NonNegativeFloat | None = 0.5
    min_points: PositiveInt = 3
    min_score: float = Field(default=0.05, ge=0.0, le=1.0)


class LidarDetector(Detector):
    """Ground removal, clustering, box fit and classification by size, on one revolution of each lidar at a time.

    The front of an object points along its lane if there is a map, else away from the sensor.
    """

    needs: ClassVar[frozenset[str]] = frozenset({"lidar"})
    settings_type: ClassVar[type[Settings] | None] = LidarDetectorSettings

    def __init__(self, settings: LidarDetectorSettings | None = None) -> None:
        self.settings = settings or LidarDetectorSettings()
        self._map_context = MapContext(None)
        self._patterns: dict[str, Pattern] = {}
        self._revolutions: dict[str, _Revolution] = {}
        self._reach: dict[str, tuple[float, float]] = {}
        """Half the field of view [rad] and the range [m] of each sensor."""

    def setup(self, context: DetectorContext) -> None:
        """Store the map and the ray patterns of the sensors."""
        self._map_context = MapContext(context.roads, margin=self.settings.off_road or 0.0)
        for name, sensor in context.sensors.items():
            if isinstance(sensor, LidarSettings):
                self._patterns[name] = pattern_from_settings(sensor)
                self._revolutions[name] = _Revolution(1.0 / sensor.rotation)
                self._reach[name] = math.radians(sensor.field_of_view) / 2.0, sensor.range

    def detect(self, readings: Readings) -> Detections:
        """Return the road users in the point clouds of all lidars of the station."""
        foot = float(readings.ego.position[2])
        restricted = self.settings.off_road is not None and self._map_context.has_map
        found: list[tuple[FittedObject, LevelFrame]] = []
        for name, reading in readings.lidars.items():
            pattern = self._patterns.get(name) or pattern_from_points(reading.points)
            cloud = self._revolutions[name].add(readings.time, reading) if name in self._revolutions else reading
            scan = Scan(cloud, pattern, foot, self._map_context.near_road if restricted else None)
            found += [(one, scan.frame) for one in objects(scan, self._map_context, self.settings.min_points)]
        found = [(one, frame) for one, frame in found if _score(one) >= self.settings.min_score]
        if not found:
            return Detections(readings.time)
        boxes = np.concatenate([frame.boxes_to_world(np.array([one.fit.box])) for one, frame in found])
        boxes[:, 6] = self._map_context.facing(boxes)
        detections = Detections(
            readings.time,
            boxes,
            np.array([_score(one) for one, _ in found]),
            tuple(one.fit.name for one, _ in found),
            np.full((len(found), 2), np.nan),
            np.concatenate([frame.covariance_to_world(one.fit.covariance[None]) for one, frame in found]),
        )
        return detections if len(readings.lidars) < 2 else without_duplicates(detections)

    def in_view(self, boxes: Array, readings: Readings, found: Detections) -> Array:
        """Return the maximum share (N,) of each box (N, 7) that one of the lidars can show."""
        shares = [
            in_lidar(boxes, reading, *self._reach.get(name, (math.pi, math.inf)), found.boxes)
            for name, reading in readings.lidars.items()
        ]
        return np.max(shares, axis=0) if shares else np.zeros(len(boxes))


class _Revolution:
    """Readings of one sensor that cover its last revolution, for readings that each cover only a part of it."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._parts: deque[tuple[float, LidarReading]] = deque()

    def add(self, time: float, reading: LidarReading) -> LidarReading:
        """Return all points of the last revolution in the frame of the newest reading."""
        while self._parts and self._parts[0][0] <= time - self._period + TIME_TOLERANCE:
            self._parts.popleft()
        self._parts.append((time, reading))
        if len(self._parts) == 1:
            return reading
        rotation, origin = reading.pose[:3, :3], reading.pose[:3, 3]
        points = [
            (old.points @ old.pose[:3, :3].T + old.pose[:3, 3] - origin) @ rotation for _, old in list(self._parts)[:-1]
        ]
        intensities = [old.intensity for _, old in self._parts]
        return LidarReading(np.concatenate([*points, reading.points]), np.concatenate(intensities), reading.pose)


def _score(found: FittedObject) -> float:
    """Return the score: one half for five points that fit a class well; less for unusual sizes."""
    return len(found.rows) / (len(found.rows) + HALF_SURE) * math.exp(-found.fit.deviation / UNLIKELY)

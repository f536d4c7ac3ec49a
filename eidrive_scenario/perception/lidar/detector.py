"""Detector `lidar`: boxes from lidar point clouds, without learning."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveInt

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.perception.detector import Detector, DetectorContext, without_duplicates
from eidrive_scenario.perception.geometry.lidar_geometry import LevelFrame, pattern_from_settings
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.lidar.objects import UNLIKELY, FittedObject, objects
from eidrive_scenario.perception.lidar.scan import Scan
from eidrive_scenario.perception.lidar.station import StationLidars
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.sensing.settings import LidarSettings, SensorSettings

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
        self._lidars = StationLidars({})

    def setup(self, context: DetectorContext) -> None:
        """Store the map and the lidars."""
        self._map_context = MapContext(context.roads, margin=self.settings.off_road or 0.0)
        self._lidars = StationLidars(context.sensors)

    def detect(self, readings: Readings) -> Detections:
        """Return the road users in the point clouds of all lidars of the station."""
        foot = float(readings.ego.position[2])
        restricted = self.settings.off_road is not None and self._map_context.has_map
        candidates: list[tuple[FittedObject, LevelFrame]] = []
        for name, cloud in self._lidars.revolutions(readings).items():
            pattern = self._lidars.pattern(name, readings.lidars[name])
            scan = Scan(cloud, pattern, foot, self._map_context.is_of_traffic if restricted else None)
            candidates += [
                (candidate, scan.frame)
                for candidate in objects(scan, self._map_context, self.settings.min_points)
                if _score(candidate) >= self.settings.min_score
            ]
        if not candidates:
            return Detections(readings.time)
        boxes = np.concatenate([frame.boxes_to_world(np.array([candidate.fit.box])) for candidate, frame in candidates])
        boxes[:, 6] = self._map_context.facing(boxes)
        detections = Detections(
            readings.time,
            boxes,
            np.array([_score(candidate) for candidate, _ in candidates]),
            tuple(candidate.fit.name for candidate, _ in candidates),
            np.full((len(candidates), 2), np.nan),
            np.concatenate(
                [frame.covariance_to_world(candidate.fit.covariance[None]) for candidate, frame in candidates]
            ),
        )
        return detections if len(readings.lidars) < 2 else without_duplicates(detections)

    def range_of(self, sensor: SensorSettings) -> float:
        """Return the distance at which the front of a car has `min_points` points on average [m]."""
        nominal = super().range_of(sensor)
        if not isinstance(sensor, LidarSettings):
            return nominal
        return min(nominal, pattern_from_settings(sensor).range_of_car(self.settings.min_points))

    def in_view(self, boxes: Array, readings: Readings, detections: Detections) -> Array:
        """Return the maximum share (N,) of each box (N, 7) that one of the lidars can show."""
        return self._lidars.in_view(boxes, readings, detections)


def _score(candidate: FittedObject) -> float:
    """Return the score: one half for five points that fit a class well; less for unusual sizes."""
    return len(candidate.rows) / (len(candidate.rows) + HALF_SURE) * math.exp(-candidate.fit.deviation / UNLIKELY)

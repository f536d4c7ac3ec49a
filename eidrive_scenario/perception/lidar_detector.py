"""The detector `lidar`: boxes from a LiDAR alone, without learning."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveInt

from eidrive_scenario.detections import Detections
from eidrive_scenario.geometry import iou_bev
from eidrive_scenario.perception.box_fit import Fit
from eidrive_scenario.perception.clustering import Integers, clusters
from eidrive_scenario.perception.detector import Detector, Installation
from eidrive_scenario.perception.lidar_geometry import (
    LevelFrame,
    Pattern,
    pattern_from_points,
    pattern_from_settings,
)
from eidrive_scenario.perception.scan import Scan
from eidrive_scenario.perception.size_priors import PRIORS
from eidrive_scenario.perception.surroundings import Surroundings
from eidrive_scenario.sensing.readings import LidarReading, Readings
from eidrive_scenario.sensing.settings import LidarSettings
from eidrive_scenario.settings import Settings

Array = NDArray[np.float64]

FEW = 12
"""A cluster of so few points may show no heading; then that of its lane is looked up."""
HALF_SURE = 5.0
"""Points at which the score reaches half of what it can be."""
UNLIKELY = 30.0
"""Sum of squared deviations from the sizes of its class beyond which a cluster is no road user."""
DOUBTFUL = 12.0
"""Beyond this a cluster is looked at again, as it may be several objects close to each other."""
SAME = 0.1
"""Boxes of two sensors of one station that overlap this much show one object (intersection over union)."""


class LidarDetectorSettings(Settings):
    """What the property `detector_settings` may say.

    off_road      how far beside the roads of the map an object may be [m]; None looks everywhere
    least_points  of an object
    least_score   below which an object is not reported
    """

    off_road: NonNegativeFloat | None = 0.5
    least_points: PositiveInt = 3
    least_score: float = Field(default=0.05, ge=0.0, le=1.0)


class LidarDetector(Detector):
    """Ground removal, clustering, box fit, class by size; a sweep at a time.

    The front of an object is that end that leads along its lane where a map tells, else the end that looks away.
    """

    needs: ClassVar[frozenset[str]] = frozenset({"lidar"})
    settings_type: ClassVar[type[Settings] | None] = LidarDetectorSettings

    def __init__(self, settings: LidarDetectorSettings | None = None) -> None:
        self.settings = settings or LidarDetectorSettings()
        self._surroundings = Surroundings(None)
        self._patterns: dict[str, Pattern] = {}

    def install(self, installation: Installation) -> None:
        """Learn the map and the patterns of the sensors."""
        self._surroundings = Surroundings(installation.roads, margin=self.settings.off_road or 0.0)
        for name, sensor in installation.sensors.items():
            if isinstance(sensor, LidarSettings):
                self._patterns[name] = pattern_from_settings(sensor)

    def detect(self, readings: Readings) -> Detections:
        """The road users in the sweeps of all LiDARs of the station."""
        foot = float(readings.ego.position[2])
        found = [
            self._in_sweep(reading, self._patterns.get(name) or pattern_from_points(reading.points), foot)
            for name, reading in readings.lidars.items()
        ]
        fits = [(fit, score, frame) for one in found for fit, score, frame in one]
        if not fits:
            return Detections(readings.time)
        boxes = np.concatenate([frame.boxes_to_world(np.array([fit.box])) for fit, _, frame in fits])
        boxes[:, 6] = self._surroundings.facing(boxes)
        detections = Detections(
            readings.time,
            boxes,
            np.array([score for _, score, _ in fits]),
            tuple(fit.name for fit, _, _ in fits),
            np.full((len(fits), 2), np.nan),
            np.concatenate([frame.covariance_to_world(fit.covariance[None]) for fit, _, frame in fits]),
        )
        return detections if len(readings.lidars) < 2 else _without_doubles(detections)

    def _in_sweep(self, reading: LidarReading, pattern: Pattern, foot: float) -> list[tuple[Fit, float, LevelFrame]]:
        restricted = self.settings.off_road is not None and self._surroundings.has_map
        scan = Scan(reading, pattern, foot, self._surroundings.near_road if restricted else None)
        found = []
        for rows in clusters(scan.points, pattern.azimuth):
            for fit, count in self._fits(scan, rows):
                score = count / (count + HALF_SURE) * math.exp(-fit.deviation / UNLIKELY)
                if fit.deviation <= UNLIKELY and score >= self.settings.least_score:
                    found.append((fit, score, scan.frame))
        return found

    def _fits(self, scan: Scan, rows: Integers) -> list[tuple[Fit, int]]:
        """The objects in a cluster with their points: one, or several where that fits better."""
        if len(rows) < self.settings.least_points:
            return []
        whole = self._fit(scan, rows)
        if whole is not None and whole.deviation <= DOUBTFUL:
            return [(whole, len(rows))]
        parts = clusters(scan.points[rows], scan.pattern.azimuth, grazing=False)
        if len(parts) > 1:
            own = [rows[part] for part in parts if len(part) >= self.settings.least_points]
            fits = [(self._fit(scan, part), len(part)) for part in own]
            good = [(fit, count) for fit, count in fits if fit is not None and fit.deviation <= DOUBTFUL]
            if good:
                return good
        return [(whole, len(rows))] if whole is not None else []

    def _fit(self, scan: Scan, rows: Integers) -> Fit | None:
        middle = scan.frame.to_world(scan.points[rows, :2].mean(axis=0)[None])
        lane = float(self._surroundings.lane_heading(middle)[0]) if len(rows) < FEW else math.nan
        return scan.fit(rows, tuple(PRIORS), lane - scan.frame.yaw if math.isfinite(lane) else None)


def _without_doubles(detections: Detections) -> Detections:
    """Of boxes that overlap, the one of the highest score."""
    overlap = iou_bev(detections.boxes, detections.boxes)
    kept: list[int] = []
    for row in np.argsort(-detections.scores, kind="stable").tolist():
        if not kept or overlap[row, kept].max() < SAME:
            kept.append(row)
    return replace(detections.subset(sorted(kept)))

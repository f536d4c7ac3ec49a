"""Early fusion: lidar points of other stations are merged with the own points before detection."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from msgspec.structs import replace
from pydantic import PositiveFloat

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import points_in_box
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.fusion.covariance_intersection import (
    CovarianceIntersectionFusion,
    CovarianceIntersectionSettings,
)
from eidrive_scenario.fusion.feature_warp import Grid
from eidrive_scenario.perception.detector import Detector
from eidrive_scenario.perception.lidar.segmentation import is_of_surface
from eidrive_scenario.sensing.readings import LidarReading, Readings
from eidrive_scenario.v2x.messages.message import Payload
from eidrive_scenario.v2x.messages.point_cloud import PointCloud, compress


class EarlyFusionSettings(CovarianceIntersectionSettings):
    """Settings of early fusion (property `fusion_settings`). Inherited ones apply to stations without merged points.

    cell          cell size of the grid of transmitted points [m]
    max_lateness  maximum age of merged points; older ones show past positions [s]. Also the maximum lead of a clock
    """

    cell: PositiveFloat = 0.1
    max_lateness: PositiveFloat = 0.5


class EarlyFusion(CovarianceIntersectionFusion):
    """Fusion of lidar points: a station sends its points with its boxes and detects objects in all available points.

    Points are merged as measured, because their motion is unknown. A late point cloud therefore shows moving objects
    twice. Boxes of stations without merged points, such as those whose points are too old, and boxes beyond the grid of
    the detector are fused by covariance intersection. The station reports only objects in its own points, because
    receivers merge these points themselves.
    """

    settings_type = EarlyFusionSettings
    settings: EarlyFusionSettings

    shares: ClassVar[Literal["points", "features"] | None] = "points"

    def __init__(self, settings: EarlyFusionSettings | None = None) -> None:
        super().__init__(settings)
        self._received: dict[str, tuple[float, Array]] = {}
        """Time and points (N, 3) of the newest cloud of each station."""
        self._merged: dict[str, float] = {}
        """Time of the newest cloud of each station that is merged with own points and not too old."""
        self._detector: Detector | None = None

    def setup(self, detector: Detector) -> None:
        self._detector = detector

    @property
    def max_payload_age(self) -> float:
        return self.settings.max_lateness

    def payloads(self, readings: Readings, limit: int) -> tuple[Payload, ...]:
        """Return the points of all lidars of a station, whose readings are those of whole revolutions."""
        if not readings.lidars:
            return ()
        points = np.concatenate([_surface_points(reading) for reading in readings.lidars.values()])
        duration = max(reading.duration for reading in readings.lidars.values())
        return (compress(points, readings.time, self.settings.cell, duration),)

    def add_payload(self, sender: str, payload: Payload, body: Array) -> None:
        """Store a received cloud. An out-of-sequence cloud does not replace a newer one."""
        held = self._received.get(sender)
        if isinstance(payload, PointCloud) and (held is None or payload.time >= held[0]):
            points = payload.points()
            self._received[sender] = payload.time, points[~points_in_box(points, body)]

    def merge_readings(self, readings: Readings, alone: Detections | None = None) -> Readings:
        """Return the readings with the received points added to those of the first lidar."""
        oldest = readings.time - self.max_payload_age - TIME_TOLERANCE
        self._received = {sender: held for sender, held in self._received.items() if held[0] >= oldest}
        self._merged = {sender: time for sender, time in self._merged.items() if time >= oldest}
        if not readings.lidars or not self._received:
            return readings
        self._merged = {sender: time for sender, (time, _) in self._received.items()}
        name, first = next(iter(readings.lidars.items()))
        own = [_surface_points(reading) for other, reading in readings.lidars.items() if other != name]
        received = [points for _, (_, points) in sorted(self._received.items())]
        offset = np.concatenate([*own, *received]) - first.pose[:3, 3]
        points = np.concatenate([first.points, offset @ first.pose[:3, :3]])
        intensity = np.concatenate([first.intensity, np.ones(len(offset))])
        return replace(readings, lidars={name: LidarReading(points, intensity, first.pose)})

    def _omitted(self, rows: Integers, ranks: Integers) -> Bools | None:
        """Return which objects are in merged points of their stations and within the grid of the detector, if it has
        one.
        """
        merged: Bools = np.array([station in self._merged for station in self._order[1]], np.bool_)[ranks]
        features = None if self._detector is None else self._detector.feature_map
        if features is not None and merged.any():
            merged &= Grid.of(features).cells(self._history.positions(rows))[1]
        return merged


def _surface_points(reading: LidarReading) -> Array:
    """Return the points (N, 3) in the world without those of fog, rain and snow: a merged cloud has no intensity."""
    return reading.world_points[is_of_surface(reading.points, reading.intensity)]

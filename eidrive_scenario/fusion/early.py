"""Early fusion: the points that others measured join the own ones before detection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
from pydantic import PositiveFloat

from eidrive_scenario.arrays import Array
from eidrive_scenario.fusion.covariance_intersection import (
    CovarianceIntersectionFusion,
    CovarianceIntersectionSettings,
)
from eidrive_scenario.sensing.readings import LidarReading, Readings
from eidrive_scenario.settings import Settings
from eidrive_scenario.v2x.messages.point_cloud import PointCloud, compressed


class EarlyFusionSettings(CovarianceIntersectionSettings):
    """The property `fusion_settings` of early fusion; the first four are for boxes of stations that share no points.

    cell         points are rounded to a grid of this cell before they are sent [m]
    max_lateness points that were measured longer ago are not joined: they show where things were [s]
    """

    cell: PositiveFloat = 0.1
    max_lateness: PositiveFloat = 0.5


class EarlyFusion(CovarianceIntersectionFusion):
    """A station with this method sends its points beside its boxes, and looks for objects in all points that it has.

    Points are joined as they were measured: nothing knows how each of them moves, so that a late cloud shows moving
    objects twice. Boxes of stations that share no points are joined by covariance intersection. What the station itself
    reports are the objects in its own points alone, as others join those points themselves.
    """

    settings_type: ClassVar[type[Settings] | None] = EarlyFusionSettings

    def __init__(self, settings: EarlyFusionSettings | None = None) -> None:
        self.early = settings or EarlyFusionSettings()
        super().__init__(self.early)

    def shared_cloud(self, readings: Readings) -> PointCloud | None:
        """The points of all LiDARs of a station as it sends them; None where none was read."""
        if not readings.lidars:
            return None
        points = np.concatenate([_to_world(reading) for reading in readings.lidars.values()])
        return compressed(points, readings.time, self.early.cell)

    def merge_readings(self, readings: Readings, heard: Sequence[Array]) -> Readings:
        """The readings with points (N, 3) of others among those of the first LiDAR, as if it had measured them."""
        if not readings.lidars or not heard:
            return readings
        name, first = next(iter(readings.lidars.items()))
        own = [_to_world(reading) for other, reading in readings.lidars.items() if other != name]
        offset = np.concatenate([*own, *heard]) - first.pose[:3, 3]
        points = np.concatenate([first.points, offset @ first.pose[:3, :3]])
        intensity = np.concatenate([first.intensity, np.ones(len(offset))])
        return replace(readings, lidars={name: LidarReading(points, intensity, first.pose)})


def _to_world(reading: LidarReading) -> Array:
    """(N, 3)"""
    points: Array = reading.points @ reading.pose[:3, :3].T + reading.pose[:3, 3]
    return points

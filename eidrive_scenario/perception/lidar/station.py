"""Lidars of one station: their ray patterns, fields of view, and point clouds of whole revolutions."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.perception.geometry.lidar_geometry import Pattern, pattern_from_points, pattern_from_settings
from eidrive_scenario.perception.geometry.projection import LidarView, in_lidar
from eidrive_scenario.sensing.readings import LidarReading, Readings
from eidrive_scenario.sensing.settings import LidarSettings, SensorSettings


class StationLidars:
    """Lidars among the sensors of a station, by name. Readings of other lidars are used as they are."""

    def __init__(self, sensors: Mapping[str, SensorSettings]) -> None:
        lidars = {name: sensor for name, sensor in sensors.items() if isinstance(sensor, LidarSettings)}
        self._patterns = {name: pattern_from_settings(lidar) for name, lidar in lidars.items()}
        self._revolutions = {name: _Revolution(1.0 / lidar.rotation) for name, lidar in lidars.items()}
        self._views = {name: _view(lidar) for name, lidar in lidars.items()}
        self._newest: dict[str, tuple[float, LidarReading]] = {}
        """Time [s] and points of the last revolution that `newest_revolutions` returned for each lidar."""

    def pattern(self, name: str, reading: LidarReading) -> Pattern:
        """Return the ray pattern of a lidar."""
        return self._patterns.get(name) or pattern_from_points(reading.points)

    def revolutions(self, readings: Readings) -> dict[str, LidarReading]:
        """Return all points of the last revolution of each lidar with a reading, in the frame of this reading."""
        return {
            name: self._revolutions[name].add(readings.time, reading) if name in self._revolutions else reading
            for name, reading in readings.lidars.items()
        }

    def newest_revolutions(self, readings: Readings, max_age: float) -> dict[str, LidarReading]:
        """Return the last revolution of each lidar, also of those without a reading now; {} if none has a reading.

        max_age  maximum age of the readings of other lidars [s]
        """
        now = readings.time
        self._newest |= {name: (now, reading) for name, reading in self.revolutions(readings).items()}
        if not readings.lidars:
            return {}
        return {
            name: reading if time == now else replace(reading, duration=reading.duration + now - time)
            for name, (time, reading) in self._newest.items()
            if time >= now - max_age - TIME_TOLERANCE
        }

    def in_view(self, boxes: Array, readings: Readings, detections: Detections) -> Array:
        """Return the maximum share (N,) of each box (N, 7) that one of the lidars can show."""
        shares = [
            in_lidar(boxes, reading, self._views.get(name, LidarView()), detections.boxes)
            for name, reading in readings.lidars.items()
        ]
        return np.max(shares, axis=0) if shares else np.zeros(len(boxes))


def _view(lidar: LidarSettings) -> LidarView:
    rings = lidar.elevations or (lidar.lower_fov, lidar.upper_fov)
    lowest, highest = math.radians(min(rings)), math.radians(max(rings))
    return LidarView(math.radians(lidar.field_of_view) / 2.0, lowest, highest, lidar.range)


def turning_each_step(sensors: Mapping[str, SensorSettings], dt: float) -> dict[str, SensorSettings]:
    """Return sensors whose lidars have the same rays, and turn at least once per time step `dt` [s].

    They describe readings of whole revolutions, which a detector must not accumulate again.
    """
    turning = dict(sensors)
    for name, lidar in sensors.items():
        if isinstance(lidar, LidarSettings) and lidar.rotation * dt < 1.0:
            rays = lidar.points_per_second / lidar.rotation
            turning[name] = lidar.model_copy(update={"rotation": 1.0 / dt, "points_per_second": rays / dt})
    return turning


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
        points = [(old.world_points - origin) @ rotation for _, old in list(self._parts)[:-1]]
        intensities = [old.intensity for _, old in self._parts]
        return LidarReading(
            np.concatenate([*points, reading.points]),
            np.concatenate(intensities),
            reading.pose,
            duration=time - self._parts[0][0],
        )

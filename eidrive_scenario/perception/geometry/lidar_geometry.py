"""Lidar points in a level frame, and the angular pattern of lidar rays."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import rotation
from eidrive_scenario.sensing.readings import LidarReading
from eidrive_scenario.sensing.settings import LidarSettings

LEAST_STEP = math.radians(0.02)
"""Rays closer to each other than this count as one column or ring [rad]."""
USUAL_STEP = math.radians(1.0)
"""Angle between rays if there are too few points to estimate it [rad]."""

CAR_FRONT = 1.8 * 0.8
"""Area of the front of a car between its sill and its windows, which return nothing: width and height [m²]."""


@dataclass(frozen=True)
class LevelFrame:
    """Level frame below a sensor: x along the heading of the sensor in the plane, y to the left, z as in the world.

    Its origin in the plane is the position of the sensor; `height` is the height of the sensor in the world [m].
    """

    x: float
    y: float
    height: float
    yaw: float

    @classmethod
    def of(cls, pose: Array) -> LevelFrame:
        """Return the level frame of a sensor pose (4, 4) whose x axis points forward."""
        x, y, z = pose[:3, 3].tolist()
        return cls(x, y, z, math.atan2(pose[1, 0], pose[0, 0]))

    def points(self, reading: LidarReading) -> Array:
        """Return the points (N, 3) of a reading in this frame."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        level = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        points: Array = reading.points @ (level @ reading.pose[:3, :3]).T
        points += level @ (reading.pose[:3, 3] - (self.x, self.y, 0.0))
        return points

    def to_world(self, plan: Array) -> Array:
        """Return points (..., 2) of this frame in the world."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return np.stack(
            [self.x + cos * plan[..., 0] - sin * plan[..., 1], self.y + sin * plan[..., 0] + cos * plan[..., 1]],
            axis=-1,
        )

    def to_local(self, plan: Array) -> Array:
        """Return points (..., 2) of the world in this frame."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        x, y = plan[..., 0] - self.x, plan[..., 1] - self.y
        return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)

    def boxes_to_world(self, boxes: Array) -> Array:
        """Return boxes (N, 7) of this frame in the world."""
        moved = boxes.copy()
        moved[:, :2] = self.to_world(boxes[:, :2])
        moved[:, 6] = np.pi - (np.pi - boxes[:, 6] - self.yaw) % (2.0 * np.pi)
        return moved

    def covariance_to_local(self, covariance: Array) -> Array:
        """Return covariances (N, 2, 2) in the plane, rotated to the axes of this frame."""
        turn = rotation(-self.yaw)
        return np.asarray(turn @ covariance @ turn.T)

    def covariance_to_world(self, covariance: Array) -> Array:
        """Return covariances (N, 2, 2) in the plane, rotated to the axes of the world."""
        turn = rotation(self.yaw)
        return np.asarray(turn @ covariance @ turn.T)


class Pattern(NamedTuple):
    """Horizontal and vertical angles between neighboring rays, and the elevation of the highest ring [rad].

    half_field  half the horizontal field of view, about the heading of the sensor [rad]; pi for a full circle
    """

    azimuth: float
    elevation: float
    highest: float
    half_field: float = math.pi

    def range_of_car(self, points: int) -> float:
        """Return the distance at which this number of rays meets the front of a car on average [m]."""
        return math.sqrt(CAR_FRONT / (self.azimuth * self.elevation * points))


def pattern_from_settings(settings: LidarSettings) -> Pattern:
    """Return the pattern of a lidar with these settings."""
    columns = max(1, round(settings.points_per_second / settings.channels / settings.rotation))
    rings = settings.elevations or (settings.upper_fov, settings.lower_fov)
    spread = math.radians(max(rings) - min(rings)) / max(settings.channels - 1, 1)
    return Pattern(
        2.0 * math.pi / columns,
        spread or USUAL_STEP,
        math.radians(max(rings)),
        math.radians(settings.field_of_view) / 2.0,
    )


def pattern_from_points(points: Array) -> Pattern:
    """Return the pattern of points (N, 3) in the sensor frame: medians of the gaps between columns and rings."""
    if len(points) < 2:
        return Pattern(USUAL_STEP, USUAL_STEP, math.pi / 2.0)
    elevation = np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))
    return Pattern(_step(np.arctan2(points[:, 1], points[:, 0])), _step(elevation), float(elevation.max()))


def _step(angles: Array) -> float:
    gaps = np.diff(np.sort(angles))
    gaps = gaps[gaps > LEAST_STEP]
    return float(np.median(gaps)) if gaps.size else USUAL_STEP

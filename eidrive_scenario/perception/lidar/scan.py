"""Points of objects above the ground in a lidar point cloud."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.perception.geometry.lidar_geometry import LevelFrame, Pattern
from eidrive_scenario.perception.geometry.size_priors import LARGEST
from eidrive_scenario.perception.lidar.box_fit import Fit, fit_box
from eidrive_scenario.perception.lidar.segmentation import CLEARANCE, ground_height, is_of_surface
from eidrive_scenario.sensing.readings import LidarReading

NEARER = 0.5
"""Minimum difference in range of a neighboring object that hides a part of an object [m]."""
BESIDE = 1.6
"""Number of columns of rays beside the outermost point that are searched for it."""
OVERHEAD = 0.5
"""Height above the tallest road user from which points are ignored [m]."""


class Scan:
    """Points of a lidar reading without the ground, in the level frame of the sensor.

    foot   height of the ground below the sensor [m]
    keep   function that selects positions (N, 2) in the world; None selects all
    """

    def __init__(
        self,
        reading: LidarReading,
        pattern: Pattern,
        foot: float,
        keep: Callable[[Array], NDArray[np.bool_]] | None = None,
    ) -> None:
        self.frame = LevelFrame.of(reading.pose)
        self.foot = foot
        self.pattern = pattern
        points = self.frame.points(reading)
        ground = ground_height(points, foot)
        above = points[:, 2] - ground
        standing = (above > CLEARANCE) & (above < LARGEST[2] + OVERHEAD)
        standing[standing] = is_of_surface(reading.points[standing], reading.intensity[standing])
        if keep is not None:
            standing[standing] = keep(self.frame.to_world(points[standing, :2]))
        self.points = points[standing]
        self._ground = ground[standing]
        rays = reading.points[standing]
        # Unlike bearings and heights, both refer to the frame of the sensor, as its field of view does.
        self._azimuth = np.arctan2(rays[:, 1], rays[:, 0])
        self._elevation = np.arctan2(rays[:, 2], np.hypot(rays[:, 0], rays[:, 1]))
        self._bearing = np.arctan2(self.points[:, 1], self.points[:, 0])
        self._distance = np.hypot(self.points[:, 0], self.points[:, 1])

    @property
    def world(self) -> Array:
        """Points (N, 3) in the world."""
        return np.concatenate([self.frame.to_world(self.points[:, :2]), self.points[:, 2:3]], axis=1)

    def fit(
        self,
        rows: Integers,
        classes: Sequence[str],
        heading: float | None = None,
        heading_cost: Callable[[float], float] | None = None,
    ) -> Fit | None:
        """Return the box around these points, or None if no road user is so large; headings as in `fit_box`."""
        points = self.points[rows]
        if math.hypot(*np.ptp(points[:, :2], axis=0).tolist()) > math.hypot(LARGEST[0], LARGEST[1]):
            return None
        border = self.pattern.highest - 0.5 * self.pattern.elevation
        return fit_box(
            points,
            sensor_height=self.frame.height,
            ground=float(np.median(self._ground[rows])),
            pattern=self.pattern,
            classes=classes,
            hidden=self._hidden(rows),
            cut=self._cut(rows),
            cut_above=bool(self._elevation[rows[np.argmax(points[:, 2])]] > border),
            heading=heading,
            heading_cost=heading_cost,
        )

    def _cut(self, rows: Integers) -> tuple[bool, bool]:
        """Return whether the left and the right end of these points are at the border of the field of view."""
        border = self.pattern.half_field - BESIDE * self.pattern.azimuth
        if self.pattern.half_field >= math.pi:
            return False, False
        at_border = np.abs(self._azimuth[rows]) > border
        bearing = self._bearing[rows]
        left, right = np.argmax(bearing), np.argmin(bearing)
        return bool(at_border[left] and bearing[left] > 0.0), bool(at_border[right] and bearing[right] < 0.0)

    def _hidden(self, rows: Integers) -> tuple[bool, bool]:
        """Return whether something nearer is directly beside the left and the right end of these points."""
        turned = wrap_angle(self._bearing - float(self._bearing[rows[len(rows) // 2]]))
        own = turned[rows]
        flags = []
        for end, sign in ((int(rows[np.argmax(own)]), 1.0), (int(rows[np.argmin(own)]), -1.0)):
            past = sign * (turned - turned[end])
            beside = (past > 1e-9) & (past <= BESIDE * self.pattern.azimuth)
            flags.append(bool(np.any(self._distance[beside] < self._distance[end] - NEARER)))
        return flags[0], flags[1]

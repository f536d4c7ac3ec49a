"""Occupancy grid of objects and route in the frame of a vehicle."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import Detections
from eidrive_scenario.geometry import footprint
from eidrive_scenario.gym.object_table import MAX_SPEED, nearest_rows
from eidrive_scenario.gym.observation_settings import GridSettings
from eidrive_scenario.sensing.readings import EgoState

CHANNELS = ("existence", "velocity_x", "velocity_y", "route")
"""Channels of the grid: probability of existence, velocity over ground in the axes of the vehicle [m/s], route."""
ROUTE_WIDTH = 3.5
"""Width of the route in the grid [m]: a lane."""
_FRACTION_BITS = 4
"""Binary places of the coordinates of polygons."""


def grid_bounds(settings: GridSettings) -> tuple[Array, Array]:
    """Return lower and upper bounds of the grid in SI units, each (4, length, width)."""
    high = np.ones((len(CHANNELS), settings.length, settings.width))
    high[1:3] = MAX_SPEED
    low = np.zeros_like(high)
    low[1:3] = -MAX_SPEED
    return low, high


def occupancy_grid(objects: Detections, route: Array, ego: EgoState, settings: GridSettings) -> NDArray[Any]:
    """Return the grid (4, length, width) in SI units.

    Cell (i, j) has its center at x = (i + 0.5) resolution - behind ahead of the reference point, and at
    y = (j + 0.5 - width / 2) resolution to its left. Of overlapping objects the nearest one is drawn.

    route  points (P, 2) in the frame of the vehicle [m]
    """
    grid = np.zeros((len(CHANNELS), settings.length, settings.width), np.float32)
    cos, sin = math.cos(ego.yaw), math.sin(ego.yaw)
    axes = np.array([[cos, -sin], [sin, cos]])
    corners_of_all = footprint(objects.boxes)
    for row in reversed(nearest_rows(objects, ego)):
        corners = (corners_of_all[row] - ego.position[:2]) @ axes
        polygon = _pixels(corners, settings)
        velocity = np.nan_to_num(objects.velocity[row] @ axes)
        values = (float(objects.confidence[row]), *velocity.tolist())
        for channel, value in enumerate(values):
            cv2.fillConvexPoly(grid[channel], polygon, value, shift=_FRACTION_BITS)
    if len(route) > 1:
        thickness = max(1, round(ROUTE_WIDTH / settings.resolution))
        cv2.polylines(grid[3], [_pixels(route, settings)], False, 1.0, thickness, shift=_FRACTION_BITS)
    return grid


def _pixels(points: Array, settings: GridSettings) -> NDArray[Any]:
    """Return points (N, 2) in the frame of the vehicle as fixed-point pixels, column before row."""
    row = (points[:, 0] + settings.behind) / settings.resolution - 0.5
    column = points[:, 1] / settings.resolution + settings.width / 2.0 - 0.5
    scaled = np.stack([column, row], axis=1) * 2.0**_FRACTION_BITS
    return np.rint(np.clip(scaled, -1e6, 1e6)).astype(np.int32)

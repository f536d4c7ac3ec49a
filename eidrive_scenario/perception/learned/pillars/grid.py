"""Grid of lidar points in plan view: statistics of the points of each cell (pillars)."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.base.arrays import Array, Floats
from eidrive_scenario.base.kernels import kernel
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.perception.geometry.lidar_geometry import LevelFrame
from eidrive_scenario.perception.lidar.segmentation import CLEARANCE, ground_height
from eidrive_scenario.sensing.readings import LidarReading

CELLS = 256
"""Cells along each edge of the grid."""
CELL = 0.4
"""Edge of a cell [m]."""
CHANNELS = 12
TALLEST = 4.5
"""Height above the ground from which points are ignored [m]."""
STEP = 0.2
"""Age of the earlier scan [s]."""
TOLERANCE = 0.05
"""Maximum deviation of the age of the earlier scan [s]."""


@dataclass(frozen=True)
class PillarGrid:
    """Statistics of a scan, and the age of the earlier scan in them [s], None without one.

    `channels` (12, 256, 256) has the index [channel, i, j], with i along x and j along y of a level frame, centered on
    its origin. Points of objects are those between CLEARANCE and TALLEST above the ground, points of the ground those
    below. Channels of a cell:

    0       log(1 + number of points of objects) / 3
    1, 2, 3   their maximum, minimum and mean height above the ground, in units of 4 m
    4       their mean intensity
    5, 6    their mean offset from the center in x and y, in cells
    7       log(1 + number of points of the ground) / 3
    8 to 11   of the points of objects of the earlier scan: as 0, 1, 5 and 6

    All but 7 are 0 without points of objects.
    """

    channels: Floats
    age: float | None


@dataclass(frozen=True)
class _Standing:
    """Points of objects of a scan: time [s], plan (N, 2) in the world, height (N,) above the ground [m]."""

    time: float
    plan: Array
    height: Array


class ScanHistory:
    """Scans of a station of the last quarter of a second."""

    def __init__(self) -> None:
        self._scans: deque[_Standing] = deque()

    def add(self, time: float, clouds: list[LidarReading], frame: LevelFrame, foot: float) -> PillarGrid:
        """Return the grid of these point clouds in a level frame.

        The earlier scan is the one whose age is nearest to STEP, within TOLERANCE. Its points are moved by the poses
        that the station assumed.

        foot  height of the ground below the origin of the frame [m]
        """
        points = np.concatenate([cloud.world_points for cloud in clouds])
        points[:, :2] = frame.to_local(points[:, :2])
        intensity = np.concatenate([cloud.intensity for cloud in clouds], dtype=float)
        height = points[:, 2] - ground_height(points, foot)
        while self._scans and time - self._scans[0].time > STEP + TOLERANCE + TIME_TOLERANCE:
            self._scans.popleft()
        earlier = min(reversed(self._scans), key=lambda scan: abs(time - scan.time - STEP), default=None)
        if earlier is None or abs(time - earlier.time - STEP) > TOLERANCE + TIME_TOLERANCE:
            earlier = _NOTHING
        grid = np.empty((CHANNELS, CELLS, CELLS), dtype=np.float32)
        fill(points, height, intensity, frame.to_local(earlier.plan), earlier.height, CLEARANCE, grid)
        standing = (height > CLEARANCE) & (height < TALLEST)
        self._scans.append(_Standing(time, frame.to_world(points[standing, :2]), height[standing]))
        return PillarGrid(grid, None if earlier is _NOTHING else time - earlier.time)


_NOTHING = _Standing(-math.inf, np.empty((0, 2)), np.empty(0))


@kernel("void(f8[:,::1], f8[::1], f8[::1], f8[:,::1], f8[::1], f8, f4[:,:,::1])")
def fill(
    points: Array,
    height: Array,
    intensity: Array,
    earlier: Array,
    earlier_height: Array,
    clearance: float,
    grid: Floats,
) -> None:
    """Write the channels of a PillarGrid (12, n, n): sums and extremes of each cell first, then means.

    points     (N, 3) in the level frame [m]; their height (N,) above the ground [m] and intensity (N,)
    earlier    (M, 2) points of objects of the earlier scan in the same frame [m], their height (M,) above the ground
    clearance  height from which points are not ground [m]
    """
    grid[:] = np.float32(0.0)
    cells = grid.shape[1]
    for row in range(len(points)):
        x, y = points[row, 0] / CELL + 0.5 * cells, points[row, 1] / CELL + 0.5 * cells
        above = np.float32(height[row])
        # NaN is outside.
        if not (0.0 <= x < cells and 0.0 <= y < cells and height[row] < TALLEST):
            continue
        i, j = int(x), int(y)
        if height[row] <= clearance:
            grid[7, i, j] += np.float32(1.0)
            continue
        if grid[0, i, j] == 0.0 or above > grid[1, i, j]:
            grid[1, i, j] = above
        if grid[0, i, j] == 0.0 or above < grid[2, i, j]:
            grid[2, i, j] = above
        grid[0, i, j] += np.float32(1.0)
        grid[3, i, j] += above
        grid[4, i, j] += np.float32(intensity[row])
        grid[5, i, j] += np.float32(x - i - 0.5)
        grid[6, i, j] += np.float32(y - j - 0.5)
    for row in range(len(earlier)):
        x, y = earlier[row, 0] / CELL + 0.5 * cells, earlier[row, 1] / CELL + 0.5 * cells
        if not (0.0 <= x < cells and 0.0 <= y < cells):
            continue
        i, j = int(x), int(y)
        grid[9, i, j] = max(grid[9, i, j], np.float32(earlier_height[row]))
        grid[8, i, j] += np.float32(1.0)
        grid[10, i, j] += np.float32(x - i - 0.5)
        grid[11, i, j] += np.float32(y - j - 0.5)
    for i in range(cells):
        for j in range(cells):
            if grid[7, i, j] > 0.0:
                grid[7, i, j] = np.float32(math.log1p(grid[7, i, j]) / 3.0)
            count = grid[0, i, j]
            if count > 0.0:
                grid[0, i, j] = np.float32(math.log1p(count) / 3.0)
                grid[1, i, j] *= np.float32(0.25)
                grid[2, i, j] *= np.float32(0.25)
                grid[3, i, j] *= np.float32(0.25) / count
                for channel in range(4, 7):
                    grid[channel, i, j] /= count
            count = grid[8, i, j]
            if count > 0.0:
                grid[8, i, j] = np.float32(math.log1p(count) / 3.0)
                grid[9, i, j] *= np.float32(0.25)
                grid[10, i, j] /= count
                grid[11, i, j] /= count

"""Pose of a camera, and the rays through its pixels."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Floats
from eidrive_scenario.world.camera import Pinhole

Pixels = NDArray[np.intp] | slice
"""Indices of pixels, line by line."""


class CameraView:
    """Camera at a pose (4, 4): camera to world, x right, y down, z forward.

    place  (3,) position in the world [m]
    x, y   (P,) of the rays through the pixels in the camera frame at depth 1, and their length
    """

    def __init__(self, pose: Array, pinhole: Pinhole) -> None:
        self.pose = pose
        self.pinhole = pinhole
        self.place: Array = pose[:3, 3]
        self.shape = (pinhole.height, pinhole.width)
        self._turn = pose[:3, :3].astype(np.float32)
        self.x, self.y, self.length = _own_rays(pinhole)

    def rays(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        """Return rays with these x and y of the camera frame in world axes, at depth 1."""
        turn = self._turn
        rx, ry, rz = (turn[axis, 0] * x + turn[axis, 1] * y + turn[axis, 2] for axis in range(3))
        return rx, ry, rz

    def directions(self, pixels: Pixels) -> tuple[Floats, Floats, Floats]:
        """Return unit vectors through pixels in world axes."""
        length = self.length[pixels]
        rx, ry, rz = self.rays(self.x[pixels], self.y[pixels])
        return rx / length, ry / length, rz / length


@lru_cache(maxsize=32)
def _own_rays(pinhole: Pinhole) -> tuple[Floats, Floats, Floats]:
    columns = (np.arange(pinhole.width) + 0.5 - pinhole.center_x) / pinhole.focal
    rows = (np.arange(pinhole.height) + 0.5 - pinhole.center_y) / pinhole.focal
    x, y = (grid.ravel().astype(np.float32) for grid in np.meshgrid(columns, rows))
    return x, y, np.sqrt(x * x + y * y + np.float32(1.0))


def runs(pixels: NDArray[np.intp], most: int) -> list[NDArray[np.intp] | slice]:
    """Return ascending pixel indices in parts of at most `most`. A contiguous part is a slice, which avoids copies."""
    parts: list[NDArray[np.intp] | slice] = []
    for start in range(0, len(pixels), most):
        part = pixels[start : start + most]
        first, last = int(part[0]), int(part[-1])
        parts.append(slice(first, last + 1) if last - first + 1 == len(part) else part)
    return parts

"""From a camera's pose to pybullet's matrices, and from its buffers to metres."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Picture(NamedTuple):
    """rgb (H, W, 3), depth (H, W) along the optical axis [m], inf where nothing is; segmentation (H, W): row or -1."""

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.int32]


def view_matrix(pose: Array) -> list[float]:
    """OpenGL's view matrix, column by column, of a camera pose (4, 4): camera to world, x right, y down, z forward."""
    camera_to_world = pose @ np.diag([1.0, -1.0, -1.0, 1.0])
    matrix: list[float] = np.linalg.inv(camera_to_world).T.ravel().tolist()
    return matrix


def projection_matrix(width: int, height: int, fov: float, near: float, far: float) -> list[float]:
    """OpenGL's projection matrix, column by column, for square pixels and a horizontal field of view [rad]."""
    across = 1.0 / math.tan(fov / 2)
    return [
        across, 0.0, 0.0, 0.0,
        0.0, across * width / height, 0.0, 0.0,
        0.0, 0.0, -(far + near) / (far - near), -1.0,
        0.0, 0.0, -2.0 * far * near / (far - near), 0.0,
    ]  # fmt: skip


def metres(buffer: NDArray[np.float32], near: float, far: float) -> NDArray[np.float32]:
    """Distance along the optical axis [m] for values of the depth buffer in [0, 1]; inf at its far end."""
    value = buffer.astype(np.float64)
    depth = far * near / (far - (far - near) * value)
    depth[value >= 1.0] = np.inf
    return depth.astype(np.float32)

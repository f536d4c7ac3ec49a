"""From a camera's pose to pybullet's matrices, and from its buffers to metres."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Picture(NamedTuple):
    """rgb (H, W, 3), depth (H, W) along the optical axis [m], inf where nothing is; segmentation (H, W): row or -1."""

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.int32]


@dataclass(frozen=True)
class Pinhole:
    """A camera without distortion, square pixels. Pixel (j, i) covers [j, j + 1) x [i, i + 1) of the picture's plane.

    focal, centre_x, centre_y [px]; near, far along the optical axis [m]
    """

    width: int
    height: int
    focal: float
    centre_x: float
    centre_y: float
    near: float = 0.1
    far: float = 500.0

    @classmethod
    def of_fov(cls, width: int, height: int, fov: float, near: float = 0.1, far: float = 500.0) -> Pinhole:
        """With a horizontal field of view [rad] and its axis in the middle."""
        return cls(width, height, width / 2 / math.tan(fov / 2), width / 2, height / 2, near, far)

    def finer(self, times: int) -> Pinhole:
        """The same view on `times` as many pixels along each axis."""
        lens = (self.focal * times, self.centre_x * times, self.centre_y * times)
        return Pinhole(self.width * times, self.height * times, *lens, self.near, self.far)

    @property
    def intrinsics(self) -> Array:
        """(3, 3) from camera coordinates to pixels."""
        return np.array([[self.focal, 0.0, self.centre_x], [0.0, self.focal, self.centre_y], [0.0, 0.0, 1.0]])


class Radiance(NamedTuple):
    """The light that reaches a camera: luminance (H, W, 3) of linear sRGB [cd/m²]; depth and segmentation as in
    Picture."""

    luminance: NDArray[np.float32]
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
    depth = buffer.astype(np.float64)
    np.multiply(depth, near - far, out=depth)
    np.add(depth, far, out=depth)
    beyond = depth <= near
    np.divide(far * near, depth, out=depth)
    np.copyto(depth, np.inf, where=beyond)
    return depth.astype(np.float32)


def sky(pose: Array, width: int, height: int, fov: float) -> NDArray[np.uint8]:
    """(H, W, 3) the colour of a clear sky in each pixel: pale at the horizon, blue above; below it, haze."""
    right, down, forward = pose[2, :3].tolist()
    return _sky(right, down, forward, width, height, fov)


@lru_cache(maxsize=16)
def _sky(right: float, down: float, forward: float, width: int, height: int, fov: float) -> NDArray[np.uint8]:
    """The same by the vertical parts of the camera's axes; level cameras see one sky whichever way they turn."""
    scale = 2.0 * math.tan(fov / 2) / width
    columns = scale * (np.arange(width) + 0.5 - width / 2)[None, :]
    lines = scale * (np.arange(height) + 0.5 - height / 2)[:, None]
    rise = (forward + right * columns + down * lines) / np.sqrt(1.0 + columns**2 + lines**2)
    share = np.clip(rise / 0.5, 0.0, 1.0)[..., None] ** 0.6
    colours: NDArray[np.uint8] = np.rint(_HORIZON + share * (_ZENITH - _HORIZON)).astype(np.uint8)
    colours.flags.writeable = False
    return colours


_HORIZON, _ZENITH = np.array([214.0, 222.0, 228.0]), np.array([104.0, 150.0, 205.0])

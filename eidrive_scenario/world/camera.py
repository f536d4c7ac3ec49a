"""Ideal camera and its images."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array


class CameraImage(NamedTuple):
    """Image: rgb (H, W, 3), depth (H, W) along the optical axis [m] with inf for no hit, segmentation (H, W) of rows or
    -1.

    Heads of traffic signals have labels below -1 (see `World.signal_labels`).
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.int32]


@dataclass(frozen=True)
class Pinhole:
    """Camera without distortion and with square pixels. Pixel (j, i) covers [j, j + 1) x [i, i + 1) of the image plane.

    focal, center_x, center_y  [px]
    near, far                  along the optical axis [m]
    """

    width: int
    height: int
    focal: float
    center_x: float
    center_y: float
    near: float = 0.1
    far: float = 500.0

    @classmethod
    def of_fov(cls, width: int, height: int, fov: float, near: float = 0.1, far: float = 500.0) -> Pinhole:
        """Return a camera with a horizontal field of view [rad] and its axis in the image center."""
        return cls(width, height, width / 2 / math.tan(fov / 2), width / 2, height / 2, near, far)

    def finer(self, times: float) -> Pinhole:
        """Return the same camera with `times` as many pixels along each axis."""
        lens = (self.focal * times, self.center_x * times, self.center_y * times)
        return Pinhole(round(self.width * times), round(self.height * times), *lens, self.near, self.far)

    @property
    def intrinsics(self) -> Array:
        """Matrix (3, 3) from camera coordinates to pixels."""
        return np.array([[self.focal, 0.0, self.center_x], [0.0, self.focal, self.center_y], [0.0, 0.0, 1.0]])


class Radiance(NamedTuple):
    """Light that reaches a camera: luminance (H, W, 3) of linear sRGB [cd/m²]; depth and segmentation as in
    CameraImage.
    """

    luminance: NDArray[np.float32]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.int32]

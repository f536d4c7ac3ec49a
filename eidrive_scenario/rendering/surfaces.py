"""Surfaces of roads: noise tables for their spatial variation, and reflections on wet ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats, Integers
from eidrive_scenario.base.kernels import kernel
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.rendering.daylight import sample
from eidrive_scenario.rendering.projection import CameraView
from eidrive_scenario.rendering.rasterization import Cover
from eidrive_scenario.world.camera import Pinhole

SIZE = 512


def _blurred(draws: Floats, deviation: float) -> Floats:
    """Return a periodic table (SIZE, SIZE) blurred by a Gaussian of this deviation without a seam."""

    import cv2

    margin = int(np.ceil(4.5 * deviation)) + 1
    blurred = np.asarray(cv2.GaussianBlur(np.pad(draws, margin, mode="wrap"), (0, 0), deviation), dtype=np.float32)
    return blurred[margin:-margin, margin:-margin]


def _layered(name: str, layers: Sequence[tuple[float, float]]) -> Floats:
    """Return smooth noise (SIZE, SIZE) of mean 0 and deviation 1: layers of a deviation [px] and a weight."""
    draws = generator(0, name).standard_normal((SIZE, SIZE), dtype=np.float32)
    total = np.zeros((SIZE, SIZE), dtype=np.float32)
    for deviation, weight in layers:
        layer = _blurred(draws, deviation)
        total += weight * layer / layer.std()
    noise: Floats = (total / total.std()).astype(np.float32)
    return noise


@lru_cache(maxsize=1)
def patches() -> Floats:
    """Return smooth periodic noise (SIZE, SIZE) of mean 0 and deviation 1 without a seam."""
    return _layered("surfaces", ((1.5, 0.5), (4.5, 1.0), (13.5, 1.6)))


@lru_cache(maxsize=1)
def grit() -> Floats:
    """Return uncorrelated noise (SIZE, SIZE) of mean 0 and deviation 1."""
    draws = generator(0, "grit").standard_normal((SIZE, SIZE), dtype=np.float32)
    layer = _blurred(draws, 0.7)
    noise: Floats = (layer / layer.std()).astype(np.float32)
    return noise


@lru_cache(maxsize=1)
def hollows() -> Floats:
    """Return noise as `patches` with larger structures."""
    return _layered("hollows", ((8.0, 0.35), (22.0, 1.0)))


WATER = 0.02
"""Share of light that water reflects at normal incidence (Fresnel, index 1.33)."""
DARKENING = 0.45
"""Share of reflected light that a soaked road loses, as its pores contain water (Lekner and Dorf 1988)."""
_HEIGHT = 0.15
"""Minimum height above the road of reflected objects [m]."""


class RoadPlane(NamedTuple):
    """Plane of the road below a camera: its height there [m] and its normal (3,), a unit vector upwards."""

    height: float
    normal: Array

    @property
    def axes(self) -> Array:
        """Axes (3, 3) as columns: two in the plane and the normal."""
        x, _, z = self.normal.tolist()
        along = np.array([z, 0.0, -x]) / math.hypot(x, z)
        return np.column_stack([along, np.cross(self.normal, along), self.normal])


LEVEL = RoadPlane(0.0, np.array([0.0, 0.0, 1.0]))


def add_reflections(
    light: Floats, on_road: Integers, cover: Cover, view: CameraView, *,
    open_sky: Floats, dome: Floats, wetness: float, ground: RoadPlane,
) -> None:  # fmt: skip
    """Add reflections of a wet road to the luminance (P, 3) of pixels, from an image of half the resolution."""

    import cv2

    if not len(on_road):
        return
    numbers = np.arange(len(light)).reshape(view.shape)[::2, ::2]
    small = replace(view.pinhole.finer(0.5), width=numbers.shape[1], height=numbers.shape[0])
    axes, pose = ground.axes, view.pose.copy()
    pose[:3, :3] = axes.T @ pose[:3, :3]
    above_plane = CameraView(pose, view.pinhole)  # directions and places are along the axes of the plane
    x, y, z = above_plane.directions(numbers.ravel())
    sky = sample(dome, *(axes.astype(np.float32) @ np.stack([x, y, np.abs(z)])).reshape(3, *numbers.shape))
    some = numbers[cover.triangle[::2, ::2] >= 0]
    height = (ground.height - float(view.position[2])) * float(ground.normal[2])
    image = mirrored(light[some], above_plane.places(some, cover.nearness), sky, height, pose, small)
    image = np.asarray(cv2.resize(blurred(image), view.shape[::-1], interpolation=cv2.INTER_LINEAR))
    share = reflectance(np.abs(above_plane.directions(on_road)[2]))
    position = (view.position % 4096.0).astype(np.float32)
    x, y, _, _ = view.places(on_road, cover.nearness)
    share *= puddles(x + position[0], y + position[1], wetness, hollows())
    before, dim = light[on_road], open_sky.ravel()[on_road, None]
    light[on_road] = before + share[:, None] * (image.reshape(-1, 3)[on_road] * dim - before)


def mirrored(light: Floats, places: Floats, sky: Floats, ground: float, pose: Array, pinhole: Pinhole) -> Floats:
    """Return the image (H, W, 3) of a mirror in the plane z = ground [m, relative to the camera].

    light (n, 3) of the visible points at places (3 or more, n) relative to the camera. sky (H, W, 3) is used for
    pixels without a reflected point. Only visible points are reflected, and the nearest one of each pixel is seen.
    """
    image, nearness = sky.copy(), np.zeros(sky.shape[:2], dtype=np.float32)
    lens = np.array([pinhole.focal, pinhole.center_x, pinhole.center_y, ground + _HEIGHT, 2.0 * ground])
    turn = np.ascontiguousarray(pose[:3, :3], dtype=np.float32)
    _mirror(light, places, lens.astype(np.float32), turn, nearness, image)
    return image


@kernel("void(f4[:,::1], f4[:,::1], f4[::1], f4[:,::1], f4[:,::1], f4[:,:,::1])")
def _mirror(light: Floats, places: Floats, lens: Floats, turn: Floats, nearness: Floats, image: Floats) -> None:
    """Draw mirrored points; lens: focal length, center, minimum height of points, and twice that of the mirror."""
    height, width = nearness.shape
    for row in range(len(light)):
        x, y, z = places[0, row], places[1, row], places[2, row]
        if not z > lens[3]:
            continue
        z = lens[4] - z
        depth = max(x * turn[0, 2] + y * turn[1, 2] + z * turn[2, 2], np.float32(1e-3))
        scale = lens[0] / depth
        u = (x * turn[0, 0] + y * turn[1, 0] + z * turn[2, 0]) * scale + lens[1]
        v = (x * turn[0, 1] + y * turn[1, 1] + z * turn[2, 1]) * scale + lens[2]
        if depth > np.float32(0.3) and 0.0 <= u < width and 0.0 <= v < height:
            line, column, near = int(v), int(u), np.float32(1.0) / depth
            if near >= nearness[line, column]:
                nearness[line, column] = near
                for color in range(3):
                    image[line, column, color] = light[row, color]


def blurred(image: Floats) -> Floats:
    """Return the image (H, W, 3) as reflected by a rough surface: blurred mainly vertically."""

    import cv2

    height, width = image.shape[:2]
    tall = max(3, round(height / 24)) | 1
    wide = max(1, round(width / 160)) | 1
    return np.asarray(cv2.blur(cv2.blur(image, (wide, tall)), (1, tall)), dtype=np.float32)


def reflectance(cosine: Floats) -> Floats:
    """Return the reflectance of water by the cosine of the angle of incidence (Schlick 1994)."""
    reflected: Floats = np.float32(WATER) + np.float32(1.0 - WATER) * (np.float32(1.0) - cosine) ** 5
    return reflected


def puddles(x: Floats, y: Floats, wetness: float, table: NDArray[np.float32]) -> Floats:
    """Return the smoothness of the water at world positions [m] in [0, 1]: a film on a moist road, puddles on a wet
    one.
    """
    mask = table.shape[0] - 1
    noise = table[np.floor(y * 12.0).astype(np.int64) & mask, np.floor(x * 12.0).astype(np.int64) & mask]
    film = np.float32(0.25 * min(2.0 * wetness, 1.0))
    pool = np.clip((noise + np.float32(2.6 * wetness - 1.6)) * np.float32(1.5), np.float32(0.0), np.float32(1.0))
    smoothness: Floats = film + (np.float32(1.0) - film) * pool
    return smoothness

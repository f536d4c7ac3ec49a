"""Surfaces of roads: noise tables for their spatial variation, and reflections on wet ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats
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
    found: Floats = (total / total.std()).astype(np.float32)
    return found


@lru_cache(maxsize=1)
def patches() -> Floats:
    """Return smooth periodic noise (SIZE, SIZE) of mean 0 and deviation 1 without a seam."""
    return _layered("surfaces", ((1.5, 0.5), (4.5, 1.0), (13.5, 1.6)))


@lru_cache(maxsize=1)
def grit() -> Floats:
    """Return uncorrelated noise (SIZE, SIZE) of mean 0 and deviation 1."""
    draws = generator(0, "grit").standard_normal((SIZE, SIZE), dtype=np.float32)
    layer = _blurred(draws, 0.7)
    found: Floats = (layer / layer.std()).astype(np.float32)
    return found


@lru_cache(maxsize=1)
def hollows() -> Floats:
    """Return noise as `patches` with larger structures."""
    return _layered("hollows", ((8.0, 0.35), (22.0, 1.0)))


def variation(x: Floats, y: Floats, distance: Floats) -> Floats:
    """Return the relative variation of a surface at world positions [m], about ±1: grit near the camera, patches
    everywhere.
    """
    found: Floats = _looked_up(patches(), x, y, 4.0)
    found *= np.float32(0.35)
    fine = _looked_up(grit(), x, y, 24.0)
    fine *= np.float32(4.0) / (np.float32(6.0) + distance)
    found += fine
    return found


def _looked_up(table: Floats, x: Floats, y: Floats, per_meter: float) -> Floats:
    """Return the values of a periodic table at positions [m]."""
    mask = np.int32(SIZE - 1)
    at = (y * np.float32(per_meter)).astype(np.int32)
    at &= mask
    at *= np.int32(SIZE)
    at += (x * np.float32(per_meter)).astype(np.int32) & mask
    return table.ravel().take(at)


WATER = 0.02
"""Share of light that water reflects at normal incidence (Fresnel, index 1.33)."""
DARKENING = 0.45
"""Share of reflected light that a soaked road loses, as its pores contain water (Lekner and Dorf 1988)."""
_HEIGHT = 0.15
"""Minimum height above the road of reflected objects [m]."""


def add_reflections(
    planes: Floats, on_road: NDArray[np.intp], cover: Cover, view: CameraView, *,
    open_sky: Floats, dome: Floats, wetness: float, ground: float,
) -> None:  # fmt: skip
    """Add reflections of a wet road to the luminance (3, P) of pixels, from an image of half the resolution.

    `ground` is the height of the road below the camera [m].
    """

    import cv2

    if not len(on_road):
        return
    numbers = np.arange(planes.shape[1]).reshape(view.shape)[::2, ::2]
    small = replace(view.pinhole.finer(0.5), width=numbers.shape[1], height=numbers.shape[0])
    x, y, z = (part.reshape(numbers.shape) for part in view.directions(numbers.ravel()))
    sky = sample(dome, x, y, np.abs(z))
    some = numbers[cover.triangle[::2, ::2] >= 0]
    far = np.float32(1.0) / cover.nearness.ravel()[some]
    rx, ry, rz = view.rays(view.x[some], view.y[some])
    places = (rx * far, ry * far, rz * far)
    image = mirrored(planes[:, some], places, sky, ground - float(view.place[2]), view.pose, small)
    image = np.asarray(cv2.resize(blurred(image), view.shape[::-1], interpolation=cv2.INTER_LINEAR))
    rx, ry, rz = view.rays(view.x[on_road], view.y[on_road])
    far = np.float32(1.0) / cover.nearness.ravel()[on_road]
    share = reflectance(np.abs(rz / view.length[on_road]))
    place = (view.place % 4096.0).astype(np.float32)
    share *= puddles(rx * far + place[0], ry * far + place[1], wetness, hollows())
    dim = open_sky.ravel()[on_road]
    for own, plane in zip(planes, cv2.split(image), strict=True):
        before = own[on_road]
        own[on_road] = before + share * (np.ravel(plane)[on_road] * dim - before)


def mirrored(
    light: Floats, places: tuple[Floats, Floats, Floats], sky: Floats, ground: float, pose: Array, pinhole: Pinhole
) -> Floats:
    """Return the image (H, W, 3) of a mirror in the plane z = ground [m, relative to the camera].

    light (3, n) of the visible points at positions x, y, z (n,) relative to the camera. sky (H, W, 3) is used for
    pixels without a reflected point. Only visible points are reflected.
    """
    standing = np.flatnonzero(places[2] > ground + _HEIGHT)
    if not len(standing):
        return sky
    x, y, z = (part[standing] for part in places)
    z = np.float32(2.0 * ground) - z
    right, down, forward = (pose[:3, k].astype(np.float32) for k in range(3))
    depth = np.maximum(x * forward[0] + y * forward[1] + z * forward[2], np.float32(1e-3))
    scale = np.float32(pinhole.focal) / depth
    u = (x * right[0] + y * right[1] + z * right[2]) * scale + np.float32(pinhole.center_x)
    v = (x * down[0] + y * down[1] + z * down[2]) * scale + np.float32(pinhole.center_y)
    inside = np.flatnonzero((u >= 0) & (u < pinhole.width) & (v >= 0) & (v < pinhole.height) & (depth > 0.3))
    target = v[inside].astype(np.int64) * pinhole.width + u[inside].astype(np.int64)
    # The nearest point of each pixel wins: nearness above the index in one key, as in `rasterization`.
    key = (np.float32(1.0) / depth[inside]).view(np.uint32).astype(np.uint64) << np.uint64(32)
    key |= (inside + 1).astype(np.uint64)
    held = np.zeros(pinhole.width * pinhole.height, dtype=np.uint64)
    np.maximum.at(held, target, key)
    source = (held & np.uint64(0xFFFFFFFF)).astype(np.int64) - 1
    found = np.flatnonzero(source >= 0)
    image = sky.reshape(-1, 3).copy()
    image[found] = light[:, standing[source[found]]].T
    return image.reshape(sky.shape)


def blurred(image: Floats) -> Floats:
    """Return the image (H, W, 3) as reflected by a rough surface: blurred mainly vertically."""

    import cv2

    height, width = image.shape[:2]
    tall = max(3, round(height / 24)) | 1
    wide = max(1, round(width / 160)) | 1
    return np.asarray(cv2.blur(cv2.blur(image, (wide, tall)), (1, tall)), dtype=np.float32)


def reflectance(cosine: Floats) -> Floats:
    """Return the reflectance of water by the cosine of the angle of incidence (Schlick 1994)."""
    found: Floats = np.float32(WATER) + np.float32(1.0 - WATER) * (np.float32(1.0) - cosine) ** 5
    return found


def puddles(x: Floats, y: Floats, wetness: float, table: NDArray[np.float32]) -> Floats:
    """Return the smoothness of the water at world positions [m] in [0, 1]: a film on a moist road, puddles on a wet
    one.
    """
    mask = table.shape[0] - 1
    noise = table[(y * 12.0).astype(np.int64) & mask, (x * 12.0).astype(np.int64) & mask]
    film = np.float32(0.25 * min(2.0 * wetness, 1.0))
    pool = np.clip((noise + np.float32(2.6 * wetness - 1.6)) * np.float32(1.5), np.float32(0.0), np.float32(1.0))
    found: Floats = film + (np.float32(1.0) - film) * pool
    return found

"""Luminance of surfaces towards the camera; each pixel is independent of others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats, Integers
from eidrive_scenario.base.kernels import kernel
from eidrive_scenario.rendering.daylight import GROUND_ALBEDO, Daylight, horizon, sample
from eidrive_scenario.rendering.lamps import LAMP_COLOR, Lamp, lamplight
from eidrive_scenario.rendering.materials import GRAIN, MIRROR, RETURNS, SOAKS
from eidrive_scenario.rendering.projection import CameraView, Surfaces
from eidrive_scenario.rendering.shadows import ShadowGrid, Shadows
from eidrive_scenario.rendering.surfaces import DARKENING, grit, patches
from eidrive_scenario.world.weather import Weather

STREET_LAMP = np.array([1.08, 1.0, 0.78])
"""Color of street lamps, linear sRGB."""
_GLINT = 350.0
"""Exponent of the reflection of the sun in car paint: a spot of some four degrees."""
_DULL = 0.93
"""Cosine of the angle to the reflected sun beyond which it adds less than 1e-11 of its peak."""


class Circumstances(NamedTuple):
    """Values that all pixels of an image share: camera, weather, its light, image of the sky, and grid of shadows."""

    view: CameraView
    weather: Weather
    light: Daylight
    sky: Floats
    grid: ShadowGrid | None


class Lit(NamedTuple):
    """Illumination of N triangles: luminance (N, 3) by sky and street lamps, and additional luminance by the sun."""

    surfaces: Surfaces
    steady: Floats
    sunny: Floats

    @property
    def upright(self) -> NDArray[np.bool_]:
        """Whether the triangles face upwards (N,)."""
        upwards: NDArray[np.bool_] = self.surfaces.normal[:, 2] > 0.9
        return upwards


def lit_surfaces(surfaces: Surfaces, light: Daylight, weather: Weather) -> Lit:
    """Return the illumination of whole triangles."""
    nx, ny, nz = (part[:, None] for part in surfaces.normal.T)
    reflected = surfaces.albedo * np.float32(1.0 / math.pi)
    up = np.float32(0.5) + np.float32(0.5) * nz
    incoming = up * _single(light.sky) + (np.float32(1.0) - up) * _single(GROUND_ALBEDO * light.ground)
    if weather.street_lighting > 0.0 and weather.lamps_on:
        level = np.float32(0.35) + np.float32(0.65) * np.maximum(nz, np.float32(0.0))
        incoming += level * _single(weather.street_lighting * STREET_LAMP)
    sx, sy, sz = light.towards.astype(np.float32)
    facing = np.maximum(sx * nx + sy * ny + sz * nz, np.float32(0.0))
    return Lit(surfaces, reflected * incoming + surfaces.glow, reflected * facing * _single(light.sun))


def together(first: Lit, second: Lit) -> Lit:
    """Return the triangles of both, those of the second after those of the first."""
    steady, sunny = np.concatenate([first.steady, second.steady]), np.concatenate([first.sunny, second.sunny])
    return Lit(Surfaces.concatenate([first.surfaces, second.surfaces]), steady, sunny)


def shade(
    triangle: NDArray[np.int32],
    places: Floats,
    among: Lit,
    at: Circumstances,
    shadows: Shadows,
    lamps: Sequence[Lamp],
    open_sky: Floats,
) -> Floats:
    """Return the luminance (n, 3) of points at close distance [cd/m²]: sun and sky, lamps, and emission.

    triangle  (n,) index in `among`
    places    (4, n) as by `CameraView.places`
    lamps     headlamps that shine on the points
    open_sky  (n,) share of sky light that nearby bodies leave
    """
    finish = among.surfaces.finish[triangle]
    sun = shadows.sun_share(places)
    luminance = np.empty((len(triangle), 3), dtype=np.float32)
    _illuminate(triangle, among.steady, among.sunny, open_sky, sun, luminance)
    if lamps:
        received, across = lamplight(lamps, triangle, places, among.surfaces.normal)
        shone = received * np.float32(1.0 / math.pi) + across * RETURNS[finish]
        lamp_lit = np.flatnonzero(shone)
        albedo = among.surfaces.albedo[triangle[lamp_lit]]
        luminance[lamp_lit] += albedo * shone[lamp_lit, None] * LAMP_COLOR
    wet = np.float32(1.0 - DARKENING * min(2.0 * at.weather.wetness, 1.0))
    origin = (at.view.position[:2] % 4096.0).astype(np.float32)
    factors = np.where(SOAKS, wet, np.float32(1.0))
    _add_grain(luminance, places, finish, GRAIN, factors, origin, patches(), grit())
    _add_mirrors(luminance, triangle, places, among.surfaces, at, sun)
    return luminance


@kernel("void(i4[::1], f4[:,::1], f4[:,::1], f4[::1], f4[::1], f4[:,::1])")
def _illuminate(
    triangle: NDArray[np.int32], steady: Floats, sunny: Floats, open_sky: Floats, sun: Floats, luminance: Floats
) -> None:
    """Compute the luminance (n, 3) of triangles by the shares (n,) of sky and sun."""
    for row, number in enumerate(triangle):
        for color in range(3):
            luminance[row, color] = steady[number, color] * open_sky[row] + sunny[number, color] * sun[row]


@kernel("void(f4[:,::1], f4[:,::1], u1[::1], f4[::1], f4[::1], f4[::1], f4[:,::1], f4[:,::1])")
def _add_grain(
    luminance: Floats, places: Floats, finish: NDArray[np.uint8], grain: Floats, factors: Floats, camera: Floats,
    patches: Floats, grit: Floats,
) -> None:  # fmt: skip
    """Add spatial variation of road and soil: grit near the camera, patches everywhere; darken wet parts by factors.

    camera (2,) is its position; patches and grit are periodic tables with 4 and 24 values per meter.
    """
    mask = len(patches) - 1
    for row, kind in enumerate(finish):
        if grain[kind] == 0.0:
            continue
        x, y = places[0, row] + camera[0], places[1, row] + camera[1]
        wide = patches[int(np.floor(y * np.float32(4.0))) & mask, int(np.floor(x * np.float32(4.0))) & mask]
        fine = grit[int(np.floor(y * np.float32(24.0))) & mask, int(np.floor(x * np.float32(24.0))) & mask]
        fine *= np.float32(4.0) / (np.float32(6.0) + places[3, row])
        wide *= np.float32(0.35)
        factor = max((np.float32(1.0) + grain[kind] * (wide + fine)) * factors[kind], np.float32(0.2))
        for color in range(3):
            luminance[row, color] *= factor


def _add_mirrors(
    luminance: Floats, triangle: NDArray[np.int32], places: Floats, surfaces: Surfaces, at: Circumstances, sun: Floats
) -> None:
    """Add reflections of sky and sun in paint, glass and metal; `sun` is the share of the sun (n,)."""
    mirror, light = MIRROR[surfaces.finish[triangle]], at.light
    rows = np.flatnonzero(mirror)
    if not len(rows):
        return
    rays, share = np.empty((4, len(rows)), dtype=np.float32), np.empty(len(rows), dtype=np.float32)
    towards = light.towards.astype(np.float32)
    _reflect(rows, places, triangle, surfaces.normal, mirror, towards, rays, share)
    lobe = np.zeros(len(rows), dtype=np.float32)
    if light.sun.any():
        glinting = np.flatnonzero(rays[3] > _DULL)
        lobe[glinting] = rays[3, glinting] ** np.float32(_GLINT) * np.float32((_GLINT + 2.0) / (2.0 * math.pi))
        lobe *= sun[rows]
    below = (GROUND_ALBEDO / math.pi * light.ground).astype(np.float32)
    seen = sampled(at.sky, *rays[:3])
    _mix(rows, luminance, mirror, share, rays[2], below, seen, lobe, light.sun.astype(np.float32))


@kernel("void(i8[::1], f4[:,::1], i4[::1], f4[:,::1], f4[::1], f4[::1], f4[:,::1], f4[::1])")
def _reflect(
    rows: Integers, places: Floats, triangle: NDArray[np.int32], normal: Floats, mirror: Floats, sun: Floats,
    rays: Floats, share: Floats,
) -> None:  # fmt: skip
    """Compute reflected rays with the cosines of their angles to the sun (4, m), and shares of reflected light (m,)."""
    for number, row in enumerate(rows):
        facet = triangle[row]
        nx, ny, nz = normal[facet, 0], normal[facet, 1], normal[facet, 2]
        distance = places[3, row]
        dx, dy, dz = places[0, row] / distance, places[1, row] / distance, places[2, row] / distance
        inwards = min(dx * nx + dy * ny + dz * nz, np.float32(-1e-3))
        twice = np.float32(2.0) * inwards
        rx, ry, rz = dx - twice * nx, dy - twice * ny, dz - twice * nz
        rays[0, number], rays[1, number], rays[2, number] = rx, ry, rz
        rays[3, number] = rx * sun[0] + ry * sun[1] + rz * sun[2]
        # Schlick's approximation of Fresnel's law
        left = np.float32(1.0) + inwards
        square = left * left
        share[number] = mirror[row] + (np.float32(1.0) - mirror[row]) * (square * square * left)


@kernel("void(i8[::1], f4[:,::1], f4[::1], f4[::1], f4[::1], f4[::1], f4[:,::1], f4[::1], f4[::1])")
def _mix(
    rows: Integers, luminance: Floats, mirror: Floats, share: Floats, upwards: Floats, below: Floats, sky: Floats,
    lobe: Floats, sun: Floats,
) -> None:  # fmt: skip
    """Mix the luminance of points with that of the sky (m, 3) or the ground below in their reflected rays, and the sun.

    A specular surface shows less of its color, as reflected light does not enter it.
    """
    for number, row in enumerate(rows):
        rise = min(max(upwards[number] * np.float32(8.0) + np.float32(0.5), np.float32(0.0)), np.float32(1.0))
        hidden = min(mirror[row], np.float32(0.5))
        for color in range(3):
            seen = (sky[number, color] - below[color]) * rise + below[color] + lobe[number] * sun[color]
            own = luminance[row, color]
            luminance[row, color] = (seen - own * hidden) * share[number] + own


def draw_through_air(
    image: Floats, pixels: Integers, luminance: Floats, distance: Floats, weather: Weather | None
) -> None:
    """Draw light (n, 3) in pixels of an image (P, 3): attenuated over distances (n,), plus the light that the air
    scatters; unchanged without weather.
    """
    if weather is None:
        draw_pixels(image, pixels, luminance)
    else:
        through = np.exp(np.float32(-weather.extinction) * distance)
        _attenuate(luminance, through, _single(horizon(weather)), pixels, image)


@kernel("void(f4[:,::1], i8[::1], f4[:,::1])")
def draw_pixels(image: Floats, pixels: Integers, light: Floats) -> None:
    """Write light (n, 3) into pixels (n,) of an image (P, 3)."""
    for row, pixel in enumerate(pixels):
        for color in range(3):
            image[pixel, color] = light[row, color]


@kernel("void(f4[:,::1], f4[::1], f4[::1], i8[::1], f4[:,::1])")
def _attenuate(luminance: Floats, through: Floats, air: Floats, pixels: Integers, image: Floats) -> None:
    for row, pixel in enumerate(pixels):
        for color in range(3):
            image[pixel, color] = (luminance[row, color] - air[color]) * through[row] + air[color]


@kernel("void(i8[::1], i4[::1], f4[::1], i4[::1], f4, f4[::1], i4[::1])")
def label_pixels(
    pixels: Integers, triangle: NDArray[np.int32], nearness: Floats, labels: NDArray[np.int32], far: np.float32,
    depth: Floats, label: NDArray[np.int32],
) -> None:  # fmt: skip
    """Write depth (P,) and label (P,) of pixels with triangles (P,) up to the distance `far`."""
    for pixel in pixels:
        beyond = np.float32(1.0) / nearness[pixel] > far
        depth[pixel] = np.inf if beyond else np.float32(1.0) / nearness[pixel]
        label[pixel] = -1 if beyond else labels[triangle[pixel]]


def _single(color: Array) -> Floats:
    single: Floats = color.astype(np.float32)
    return single


_ROW = 2048
"""Width of the image of directions for OpenCV, which has at most 32,766 lines."""


def sampled(sky: Floats, x: Floats, y: Floats, z: Floats) -> Floats:
    """Return the sky (n, 3) in directions (n,), which OpenCV requires as an image."""
    grids = np.zeros((3, len(x) // _ROW + 1, _ROW), dtype=np.float32)
    grids.reshape(3, -1)[:, : len(x)] = x, y, z
    return sample(sky, *grids).reshape(-1, 3)[: len(x)]

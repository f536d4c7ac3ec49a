"""Luminance of surfaces towards the camera; each pixel is independent of others."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats
from eidrive_scenario.rendering.daylight import GROUND_ALBEDO, Daylight, sample
from eidrive_scenario.rendering.lamps import LAMP_COLOR, Lamplight
from eidrive_scenario.rendering.materials import GRAIN, MIRROR, RETURNS, SOAKS
from eidrive_scenario.rendering.projection import CameraView, Pixels, Surfaces
from eidrive_scenario.rendering.rasterization import Cover
from eidrive_scenario.rendering.shadows import ShadowGrid, ShadowMap
from eidrive_scenario.rendering.surfaces import DARKENING, variation
from eidrive_scenario.world.weather import Weather

_STREET_LAMP = np.array([1.08, 1.0, 0.78])
"""Color of street lamps, linear sRGB."""
_GLINT = 350.0
"""Exponent of the reflection of the sun in car paint: a spot of some four degrees."""


class Circumstances(NamedTuple):
    """Values that all pixels of an image share: camera, weather, its light, image of the sky, and grid of shadows."""

    view: CameraView
    weather: Weather
    light: Daylight
    sky: Floats
    grid: ShadowGrid | None


class Points(NamedTuple):
    """Points in pixels (n,): triangles, depth [m], positions relative to the camera [m] and distance from it [m]."""

    triangle: NDArray[np.int32]
    depth: Floats
    x: Floats
    y: Floats
    z: Floats
    distance: Floats


def points_at(pixels: Pixels, cover: Cover, view: CameraView) -> Points:
    """Return the points of pixels with a triangle."""
    far = np.float32(1.0) / cover.nearness.reshape(-1)[pixels]
    rx, ry, rz = view.rays(view.x[pixels], view.y[pixels])
    triangle = cover.triangle.reshape(-1)[pixels]
    return Points(triangle, far, rx * far, ry * far, rz * far, view.length[pixels] * far)


class Lit(NamedTuple):
    """Illumination of N triangles: luminance (3, N) by sky and street lamps, additional luminance by the sun (None: no
    sun), and sum of both.
    """

    surfaces: Surfaces
    steady: Floats
    sunny: Floats | None
    whole: Floats

    @property
    def upright(self) -> NDArray[np.bool_]:
        """Whether the triangles face upwards (N,)."""
        upwards: NDArray[np.bool_] = self.surfaces.normal[2] > 0.9
        return upwards


def lit_surfaces(surfaces: Surfaces, light: Daylight, weather: Weather) -> Lit:
    """Return the illumination of whole triangles."""
    nx, ny, nz = surfaces.normal
    reflected = surfaces.albedo * np.float32(1.0 / math.pi)
    up = np.float32(0.5) + np.float32(0.5) * nz
    incoming = up * _column(light.sky) + (np.float32(1.0) - up) * _column(GROUND_ALBEDO * light.ground)
    if weather.street_lighting > 0.0 and weather.lamps_on:
        level = np.float32(0.35) + np.float32(0.65) * np.maximum(nz, np.float32(0.0))
        incoming += level * _column(weather.street_lighting * _STREET_LAMP)
    steady: Floats = reflected * incoming + surfaces.glow
    sunny = None
    if light.sun.any():
        sx, sy, sz = light.towards.astype(np.float32)
        facing = np.maximum(sx * nx + sy * ny + sz * nz, np.float32(0.0))
        sunny = reflected * facing * _column(light.sun)
    return Lit(surfaces, steady, sunny, steady if sunny is None else steady + sunny)


def together(first: Lit, second: Lit) -> Lit:
    """Return the triangles of both, those of the second after those of the first."""
    sunny = None
    if first.sunny is not None and second.sunny is not None:
        sunny = np.concatenate([first.sunny, second.sunny], axis=1)
    steady, whole = np.hstack([first.steady, second.steady]), np.hstack([first.whole, second.whole])
    return Lit(Surfaces.concatenate([first.surfaces, second.surfaces]), steady, sunny, whole)


def shade(
    points: Points,
    among: Lit,
    at: Circumstances,
    shadows: ShadowMap | None,
    lamplight: Lamplight | None,
    open_sky: Floats,
) -> Floats:
    """Return the luminance (3, n) of points at close distance [cd/m²]: sun and sky, lamps, and emission.

    lamplight and open_sky (n,) are those of the points; open_sky is the share of sky light that nearby bodies leave.
    """
    triangle = points.triangle
    finish = among.surfaces.finish[triangle]
    lit = None if shadows is None or among.sunny is None else shadows.lit(points.x, points.y, points.z)
    luminance: Floats
    if lit is None and (open_sky == 1.0).all():
        luminance = among.whole.take(triangle, axis=1)
    else:
        luminance = among.steady.take(triangle, axis=1)
        luminance *= open_sky
        if among.sunny is not None:
            sunny: Floats = among.sunny.take(triangle, axis=1)
            if lit is not None:
                sunny *= lit
            luminance += sunny
    if lamplight is not None:
        shone = lamplight.received * np.float32(1.0 / math.pi) + lamplight.across * RETURNS[finish]
        lamp_lit = np.flatnonzero(shone)
        albedo = among.surfaces.albedo.take(triangle[lamp_lit], axis=1)
        luminance[:, lamp_lit] += albedo * shone[lamp_lit] * LAMP_COLOR[:, None]
    _add_grain(luminance, points, finish, at)
    _add_mirrors(luminance, points, among.surfaces, at, lit)
    return luminance


def _add_grain(luminance: Floats, points: Points, finish: NDArray[np.uint8], at: Circumstances) -> None:
    """Add spatial variation of road and soil, and darken wet parts."""
    grain = GRAIN[finish]
    grained = np.flatnonzero(grain)
    if not len(grained):
        return
    x = points.x[grained] + np.float32(at.view.place[0] % 4096.0)
    y = points.y[grained] + np.float32(at.view.place[1] % 4096.0)
    factor = np.float32(1.0) + grain[grained] * variation(x, y, points.distance[grained])
    if at.weather.wetness > 0.0:
        soaked = SOAKS[finish[grained]]
        wet = np.float32(1.0 - DARKENING * min(2.0 * at.weather.wetness, 1.0))
        factor *= np.where(soaked, wet, np.float32(1.0))
    whole = np.ones(len(grain), dtype=np.float32)
    whole[grained] = np.maximum(factor, np.float32(0.2))
    luminance *= whole


def _add_mirrors(luminance: Floats, points: Points, surfaces: Surfaces, at: Circumstances, lit: Floats | None) -> None:
    """Add reflections of sky and sun in paint, glass and metal; `lit` is the share of the sun (n,), None for all."""
    mirror, light = MIRROR[surfaces.finish[points.triangle]], at.light
    rows = np.flatnonzero(mirror)
    if not len(rows):
        return
    nx, ny, nz = surfaces.normal.take(points.triangle[rows], axis=1)
    distance = points.distance[rows]
    dx, dy, dz = (part[rows] / distance for part in (points.x, points.y, points.z))
    inwards = np.minimum(dx * nx + dy * ny + dz * nz, np.float32(-1e-3))
    twice = np.float32(2.0) * inwards
    rx, ry, rz = dx - twice * nx, dy - twice * ny, dz - twice * nz
    base = mirror[rows]
    # Schlick's approximation of Fresnel's law
    left = np.float32(1.0) + inwards
    square = left * left
    share = base + (np.float32(1.0) - base) * (square * square * left)
    below = _column(GROUND_ALBEDO / math.pi * light.ground)
    upwards = np.clip(rz * np.float32(8.0) + np.float32(0.5), np.float32(0.0), np.float32(1.0))
    seen = sampled(at.sky, rx, ry, rz)
    seen -= below
    seen *= upwards
    seen += below
    if light.sun.any():
        sx, sy, sz = light.towards.astype(np.float32)
        towards = rx * sx + ry * sy + rz * sz
        glinting = np.flatnonzero(towards > _DULL)
        if len(glinting):
            lobe = towards[glinting] ** np.float32(_GLINT)
            lobe *= np.float32((_GLINT + 2.0) / (2.0 * math.pi))
            if lit is not None:
                lobe *= lit[rows[glinting]]
            seen[:, glinting] += lobe * _column(light.sun)
    # A specular surface shows less of its color, as reflected light does not enter it.
    own = luminance[:, rows]
    seen -= own * np.minimum(base, np.float32(0.5))
    seen *= share
    seen += own
    luminance[:, rows] = seen


_DULL = 0.93
"""Cosine of the angle to the reflected sun beyond which it adds less than 1e-11 of its peak."""


def _column(color: Array) -> Floats:
    found: Floats = color.astype(np.float32)[:, None]
    return found


_ROW = 256


def sampled(sky: Floats, x: Floats, y: Floats, z: Floats) -> Floats:
    """Return the sky (3, n) in directions (n,), which OpenCV requires as an image."""
    count = len(x)
    shape = (-(-count // _ROW), _ROW)
    grids = []
    for part in (x, y, z):
        grid = np.zeros(shape, dtype=np.float32)
        grid.ravel()[:count] = part
        grids.append(grid)
    return np.ascontiguousarray(sample(sky, *grids).reshape(-1, 3)[:count].T)

"""The light that surfaces send to the camera, pixel by pixel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.world.render import lamps, wet_road
from eidrive_scenario.world.render.daylight import GROUND_ALBEDO, Daylight
from eidrive_scenario.world.render.materials import GRAIN, MIRROR, RETURNS, SOAKS
from eidrive_scenario.world.render.model import Array, Floats
from eidrive_scenario.world.render.shadows import ShadowMap
from eidrive_scenario.world.render.sky import sample
from eidrive_scenario.world.render.staging import Surfaces
from eidrive_scenario.world.render.surfaces import variation
from eidrive_scenario.world.weather import Weather

_BESIDE_THE_CAMERA = 4.0
"""Lamps as near as this send light along the camera's own rays, so that sheeting returns it there [m]."""
_STREET_LAMP = np.array([1.08, 1.0, 0.78])
"""Colour of lamps along streets, linear sRGB."""
_GLINT = 350.0
"""Exponent of the sun's image in a car's paint: a spot of some four degrees."""


class Points(NamedTuple):
    """What pixels (n,) show: their triangles, places relative to the camera [m], directions (unit) from it and distance
    [m]; and where each pixel's point is: the index (H, W) among them, or -1."""

    triangle: NDArray[np.int32]
    x: Floats
    y: Floats
    z: Floats
    ray: tuple[Floats, Floats, Floats]
    distance: Floats
    where: NDArray[np.int32]


def shade(
    points: Points,
    surfaces: Surfaces,
    eye: Array,
    light: Daylight,
    weather: Weather,
    sky: Floats,
    shadows: ShadowMap | None,
    beams: Sequence[lamps.Beam],
    open_sky: Floats,
) -> Floats:
    """(3, n) luminance of the points as seen from near [cd/m²]: sun and sky, lamps, and what shines itself.

    open_sky (n,) is the share of the sky's light that bodies near by leave to them.
    """
    triangle = points.triangle
    finish = surfaces.finish[triangle]
    steady, sunny = _by_triangle(surfaces, light, weather)
    luminance: Floats = steady[:, triangle]
    luminance *= open_sky
    lit = None
    if sunny is not None:
        lit = shadows.lit(points.x, points.y, points.z) if shadows is not None else np.ones(len(triangle), np.float32)
        luminance += sunny[:, triangle] * lit
    if beams:
        _add_beams(luminance, points, surfaces, eye, beams, finish)
    grained = np.flatnonzero(GRAIN[finish] > 0.0)
    if len(grained):
        x, y = points.x[grained] + np.float32(eye[0] % 4096.0), points.y[grained] + np.float32(eye[1] % 4096.0)
        factor = np.float32(1.0) + GRAIN[finish[grained]] * variation(x, y, points.distance[grained])
        if weather.wetness > 0.0:
            soaked = SOAKS[finish[grained]]
            wet = np.float32(1.0 - wet_road.DARKENING * min(2.0 * weather.wetness, 1.0))
            factor *= np.where(soaked, wet, np.float32(1.0))
        every = np.ones(len(triangle), dtype=np.float32)
        every[grained] = np.maximum(factor, np.float32(0.2))
        luminance *= every
    _add_mirrors(luminance, points, surfaces, light, sky, lit, finish)
    return luminance


def _by_triangle(surfaces: Surfaces, light: Daylight, weather: Weather) -> tuple[Floats, Floats | None]:
    """Luminance of each triangle (3, N) under the sky and lamps overhead, and what the sun adds where it shines."""
    reflected = surfaces.albedo * np.float32(1.0 / math.pi)
    up = np.float32(0.5) + np.float32(0.5) * surfaces.normal[2]
    incoming = up * _column(light.sky) + (np.float32(1.0) - up) * _column(GROUND_ALBEDO * light.ground)
    if weather.street_lighting > 0.0 and weather.lamps_on:
        level = np.float32(0.35) + np.float32(0.65) * np.maximum(surfaces.normal[2], np.float32(0.0))
        incoming += level * _column(weather.street_lighting * _STREET_LAMP)
    steady: Floats = reflected * incoming + surfaces.glow
    if not light.sun.any():
        return steady, None
    facing = np.maximum(light.towards.astype(np.float32) @ surfaces.normal, np.float32(0.0))
    return steady, reflected * facing * _column(light.sun)


def _column(colour: Array) -> Floats:
    found: Floats = colour.astype(np.float32)[:, None]
    return found


def _add_beams(
    luminance: Floats,
    points: Points,
    surfaces: Surfaces,
    eye: Array,
    beams: Sequence[lamps.Beam],
    finish: NDArray[np.uint8],
) -> None:
    """Light of headlamps, found for every second pixel both ways and taken over by its neighbours."""
    where = points.where[::2, ::2]
    some = where[where >= 0]
    if not len(some):
        return
    triangle = points.triangle[some]
    canvas = lamps.Canvas(
        points.x[some],
        points.y[some],
        points.z[some],
        (surfaces.normal[0][triangle], surfaces.normal[1][triangle], surfaces.normal[2][triangle]),
        lamps.numbered(where >= 0),
    )
    sampled = lamps.Sample.of(canvas)
    received, across = (np.zeros(len(some), dtype=np.float32) for _ in range(2))
    for beam in beams:
        shone = lamps.shine(beam, eye, canvas, sampled)
        if shone is not None:
            rows, onto, straight = shone
            received[rows] += onto
            if float(np.linalg.norm(beam.position - eye)) < _BESIDE_THE_CAMERA:
                across[rows] += straight
    received, across = (_spread(part, where, points) for part in (received, across))
    light = received * np.float32(1.0 / math.pi) + across * RETURNS[finish]
    lit = np.flatnonzero(light)
    albedo = surfaces.albedo[:, points.triangle[lit]]
    luminance[:, lit] += albedo * light[lit] * lamps.colour()[:, None]


def _spread(values: Floats, where: NDArray[np.int32], points: Points) -> Floats:
    """Values of every second pixel both ways, for all points.

    One whose pixel had none takes the greatest beside it; one that lies nearer or farther than the pixel's point takes
    the least, so that light does not spill over edges.
    """
    grid = np.full(where.shape, np.float32(-1.0))
    grid[where >= 0] = values
    greatest = np.asarray(cv2.dilate(grid, _SQUARE), dtype=np.float32)
    known: Floats = np.where(grid < 0.0, np.float32(np.inf), grid)
    least = np.asarray(cv2.erode(known, _SQUARE), dtype=np.float32)
    grid = np.where(grid < 0.0, np.maximum(greatest, np.float32(0.0)), grid)
    distance = np.zeros(where.shape, dtype=np.float32)
    distance[where >= 0] = points.distance[where[where >= 0]]
    seen = points.where >= 0
    near = np.abs(_doubled(distance, seen) - points.distance) < np.float32(0.06) * points.distance
    found: Floats = np.where(near, _doubled(grid, seen), np.minimum(_doubled(least, seen), _doubled(grid, seen)))
    return found


_SQUARE = np.ones((3, 3), dtype=np.uint8)


def _doubled(grid: Floats, seen: NDArray[np.bool_]) -> Floats:
    """A grid of every second pixel both ways, at the pixels (H, W) that show something."""
    height, width = seen.shape
    found: Floats = np.repeat(np.repeat(grid, 2, axis=0)[:height], 2, axis=1)[:, :width][seen]
    return found


def _add_mirrors(
    luminance: Floats,
    points: Points,
    surfaces: Surfaces,
    light: Daylight,
    sky: Floats,
    lit: Floats | None,
    finish: NDArray[np.uint8],
) -> None:
    """Sky and sun in paint, glass and metal."""
    rows = np.flatnonzero(MIRROR[finish] > 0.0)
    if not len(rows):
        return
    nx, ny, nz = surfaces.normal[:, points.triangle[rows]]
    dx, dy, dz = (part[rows] for part in points.ray)
    inwards = np.minimum(dx * nx + dy * ny + dz * nz, np.float32(-1e-3))
    rx, ry, rz = dx - 2 * inwards * nx, dy - 2 * inwards * ny, dz - 2 * inwards * nz
    base = MIRROR[finish[rows]]
    share = base + (np.float32(1.0) - base) * (np.float32(1.0) + inwards) ** 5
    above = _sampled(sky, rx, ry, rz)
    below = _column(GROUND_ALBEDO / math.pi * light.ground)
    upwards = np.clip(rz * np.float32(8.0) + np.float32(0.5), np.float32(0.0), np.float32(1.0))
    seen = below + (above - below) * upwards
    if lit is not None:
        sx, sy, sz = light.towards.astype(np.float32)
        lobe = np.maximum(rx * sx + ry * sy + rz * sz, np.float32(0.0)) ** np.float32(_GLINT)
        lobe *= lit[rows] * np.float32((_GLINT + 2.0) / (2.0 * math.pi))
        seen += lobe * _column(light.sun)
    # A mirror-like surface shows less of its own colour, as what is thrown back does not get in.
    own = luminance[:, rows]
    luminance[:, rows] = own + share * (seen - own * np.minimum(base, np.float32(0.5)))


_ROW = 256


def _sampled(sky: Floats, x: Floats, y: Floats, z: Floats) -> Floats:
    """The sky (3, n) in directions (n,), which OpenCV wants as a picture."""
    count = len(x)
    shape = (-(-count // _ROW), _ROW)
    grids = []
    for part in (x, y, z):
        grid = np.zeros(shape, dtype=np.float32)
        grid.ravel()[:count] = part
        grids.append(grid)
    return np.ascontiguousarray(sample(sky, *grids).reshape(-1, 3)[:count].T)

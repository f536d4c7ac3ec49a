"""The light that surfaces send to the camera, pixel by pixel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.world.render import lamps, wet_road
from eidrive_scenario.world.render.daylight import GROUND_ALBEDO, Daylight
from eidrive_scenario.world.render.materials import GRAIN, MIRROR, RETURNS, SOAKS
from eidrive_scenario.world.render.model import Array, Floats
from eidrive_scenario.world.render.shadows import ShadowMap
from eidrive_scenario.world.render.sky import sample
from eidrive_scenario.world.render.staging import Stage
from eidrive_scenario.world.render.surfaces import variation
from eidrive_scenario.world.weather import Weather

_BESIDE_THE_CAMERA = 4.0
"""Lamps as near as this send light along the camera's own rays, so that sheeting returns it there [m]."""
_GLINT = 350.0
"""Exponent of the sun's image in a car's paint: a spot of some four degrees."""


class Points(NamedTuple):
    """What pixels (n,), line by line of a picture, show: their triangles, places relative to the camera [m], directions
    (unit) and distance [m] from it; and the width of the picture."""

    triangle: NDArray[np.int32]
    x: Floats
    y: Floats
    z: Floats
    ray: tuple[Floats, Floats, Floats]
    distance: Floats
    width: int


def shade(
    points: Points,
    stage: Stage,
    eye: Array,
    light: Daylight,
    weather: Weather,
    sky: Floats,
    shadows: ShadowMap | None,
    beams: Sequence[lamps.Beam],
    open_sky: Floats,
) -> Floats:
    """(n, 3) luminance of the points as seen from near [cd/m²]: sun and sky, lamps, and what shines itself.

    open_sky (n,) is the share of the sky's light that bodies near by leave to them.
    """
    triangle, normal = points.triangle, stage.normal
    finish = stage.finish[triangle]
    steady, sunny = _by_triangle(stage, light, weather)
    luminance = steady[triangle] * open_sky[:, None]
    lit = None
    if sunny is not None:
        lit = shadows.lit(points.x, points.y, points.z) if shadows is not None else np.ones(len(triangle), np.float32)
        luminance += sunny[triangle] * lit[:, None]
    if beams:
        normals = (normal[:, 0][triangle], normal[:, 1][triangle], normal[:, 2][triangle])
        _add_beams(luminance, points, stage, eye, beams, normals, finish)
    grained = np.flatnonzero(GRAIN[finish] > 0.0)
    if len(grained):
        x, y = points.x[grained] + np.float32(eye[0] % 4096.0), points.y[grained] + np.float32(eye[1] % 4096.0)
        factor = np.float32(1.0) + GRAIN[finish[grained]] * variation(x, y, points.distance[grained])
        if weather.wetness > 0.0:
            soaked = SOAKS[finish[grained]]
            factor *= np.where(soaked, np.float32(1.0 - wet_road.DARKENING * min(2.0 * weather.wetness, 1.0)), 1.0)
        luminance[grained] *= np.maximum(factor, np.float32(0.2))[:, None]
    _add_mirrors(luminance, points, stage, light, sky, lit, finish)
    return luminance


def _by_triangle(stage: Stage, light: Daylight, weather: Weather) -> tuple[Floats, Floats | None]:
    """Luminance of each triangle (N, 3) under the sky and lamps overhead, and what the sun adds where it shines."""
    reflected = stage.albedo / np.float32(math.pi)
    up = stage.normal[:, 2:3]
    overhead = (np.float32(0.5) + np.float32(0.5) * up) * light.sky.astype(np.float32)
    bounced = (np.float32(0.5) - np.float32(0.5) * up) * (GROUND_ALBEDO * light.ground).astype(np.float32)
    incoming = overhead + bounced
    if weather.street_lighting > 0.0 and weather.lamps_on:
        colour = np.array([1.08, 1.0, 0.78], dtype=np.float32) * np.float32(weather.street_lighting)
        incoming += (np.float32(0.35) + np.float32(0.65) * np.maximum(up, 0.0)) * colour
    steady: Floats = reflected * incoming + stage.glow
    if not light.sun.any():
        return steady, None
    facing = np.maximum(stage.normal @ light.towards.astype(np.float32), np.float32(0.0))
    return steady, reflected * facing[:, None] * light.sun.astype(np.float32)


def _add_beams(
    luminance: Floats,
    points: Points,
    stage: Stage,
    eye: Array,
    beams: Sequence[lamps.Beam],
    normals: tuple[Floats, Floats, Floats],
    finish: NDArray[np.uint8],
) -> None:
    received = np.zeros(len(points.triangle), dtype=np.float32)
    returned = np.zeros(len(points.triangle), dtype=np.float32)
    sheeting = RETURNS[finish]
    for beam in beams:
        shone = lamps.shine(beam, eye, points.x, points.y, points.z, normals, 4 * points.width)
        if shone is None:
            continue
        rows, onto, across = shone
        received[rows] += onto
        if float(np.linalg.norm(beam.position - eye)) < _BESIDE_THE_CAMERA:
            returned[rows] += across * sheeting[rows]
    lit = np.flatnonzero(received + returned)
    light = received[lit] * np.float32(1.0 / math.pi) + returned[lit]
    luminance[lit] += stage.albedo[points.triangle[lit]] * (light[:, None] * lamps.colour())


def _add_mirrors(
    luminance: Floats,
    points: Points,
    stage: Stage,
    light: Daylight,
    sky: Floats,
    lit: Floats | None,
    finish: NDArray[np.uint8],
) -> None:
    """Sky and sun in paint, glass and metal."""
    rows = np.flatnonzero(MIRROR[finish] > 0.0)
    if not len(rows):
        return
    nx, ny, nz = (stage.normal[:, axis][points.triangle[rows]] for axis in range(3))
    dx, dy, dz = (part[rows] for part in points.ray)
    inwards = np.minimum(dx * nx + dy * ny + dz * nz, np.float32(-1e-3))
    rx, ry, rz = dx - 2 * inwards * nx, dy - 2 * inwards * ny, dz - 2 * inwards * nz
    base = MIRROR[finish[rows]]
    share = base + (np.float32(1.0) - base) * (np.float32(1.0) + inwards) ** 5
    above = _sampled(sky, rx, ry, rz)
    below = (GROUND_ALBEDO / math.pi * light.ground).astype(np.float32)
    upwards = np.clip(rz * np.float32(8.0) + np.float32(0.5), np.float32(0.0), np.float32(1.0))[:, None]
    seen = below + (above - below) * upwards
    if lit is not None:
        sx, sy, sz = light.towards.astype(np.float32)
        lobe = np.maximum(rx * sx + ry * sy + rz * sz, np.float32(0.0)) ** np.float32(_GLINT)
        lobe *= lit[rows] * np.float32((_GLINT + 2.0) / (2.0 * math.pi))
        seen = seen + lobe[:, None] * light.sun.astype(np.float32)
    # A mirror-like surface shows less of its own colour, as what is thrown back does not get in.
    luminance[rows] += share[:, None] * (seen - luminance[rows] * np.minimum(base, np.float32(0.5))[:, None])


_ROW = 256


def _sampled(sky: Floats, x: Floats, y: Floats, z: Floats) -> Floats:
    """The sky (n, 3) in directions (n,), which OpenCV wants as a picture."""
    count = len(x)
    shape = (-(-count // _ROW), _ROW)
    grids = []
    for part in (x, y, z):
        grid = np.zeros(shape, dtype=np.float32)
        grid.ravel()[:count] = part
        grids.append(grid)
    return sample(sky, *grids).reshape(-1, 3)[:count]

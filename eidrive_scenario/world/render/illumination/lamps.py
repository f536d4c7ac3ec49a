"""Light of vehicle lamps on objects ahead."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Floats

REACH = 70.0
"""Maximum range of the light of a lamp [m]."""
_WIDTH, _HEIGHT = 1.2, 0.6
"""Maximum tangents of the angles to the axis of a lamp."""
_STRIDE = 4
"""Distance between the lines and columns of the sample that locates the lit area."""
_FINE = 200
"""Steps of the intensity table per unit of the lateral tangent; twice as many vertically."""
_COLUMNS = round(2 * _WIDTH * _FINE) + 1
LOW_BEAM = 24_000.0
"""Maximum luminous intensity of one lamp on low beam [cd].

In UN Regulation No. 112, class B, the brightest part is 0.57 to 1.3 degrees below the horizon with at most 50,000 cd.
"""
HIGH_BEAM = 60_000.0
CUT_OFF = -0.0100
"""Tangent of the angle of the cut-off: 1 % below the horizon."""
ABOVE_CUT_OFF = 350.0
"""Luminous intensity above the cut-off [cd]. The regulation permits 625 cd to oncoming drivers (B50L: 350 cd)."""
_WARM = (1.06, 1.0, 0.82)


class Beam(NamedTuple):
    """Pair of headlamps as one beam: position (3,), axes (3, 3) as columns forward, left, up in the world, brightness
    share, and whether it is a high beam.
    """

    position: Array
    axes: Array
    brightness: float = 1.0
    high: bool = False


class Canvas(NamedTuple):
    """Points (n,) relative to the camera [m] with the normals of their surfaces, and the index (H, W) of each pixel or
    -1.
    """

    x: Floats
    y: Floats
    z: Floats
    normals: tuple[Floats, Floats, Floats]
    where: NDArray[np.int32]


def numbered(shown: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return consecutive indices (H, W) of the pixels with a triangle, line by line from 0; -1 for the rest."""
    found = np.full(shown.shape, -1, dtype=np.int32)
    found[shown] = np.arange(int(shown.sum()), dtype=np.int32)
    return found


class Sample(NamedTuple):
    """Sample of the points of a canvas, with the lines and columns of these pixels."""

    x: Floats
    y: Floats
    z: Floats
    line: NDArray[np.intp]
    column: NDArray[np.intp]

    @classmethod
    def of(cls, canvas: Canvas) -> Sample:
        """Return every _STRIDE-th pixel in both directions."""
        some = canvas.where[::_STRIDE, ::_STRIDE]
        line, column = np.nonzero(some >= 0)
        rows = some[line, column]
        return cls(canvas.x[rows], canvas.y[rows], canvas.z[rows], line, column)


def shine(
    beam: Beam, viewpoint: Array, canvas: Canvas, sample: Sample
) -> tuple[NDArray[np.intp], Floats, Floats] | None:
    """Return the illuminance of points by a pair of lamps: rows of the lit points, illuminance, illuminance across the
    beam [lx].

    The camera is at `viewpoint` (3,). The extent of the light is searched in the sample first.
    """
    place = (beam.position - viewpoint).astype(np.float32)
    axes = beam.axes.astype(np.float32)
    some = _within(place, axes, sample.x, sample.y, sample.z)[0]
    if not len(some):
        return None
    line, column = sample.line[some], sample.column[some]
    top, bottom = max(int(line.min()) - 1, 0) * _STRIDE, (int(line.max()) + 1) * _STRIDE
    left, right = max(int(column.min()) - 1, 0) * _STRIDE, (int(column.max()) + 1) * _STRIDE
    window = canvas.where[top:bottom, left:right].ravel()
    window = window[window >= 0]
    rows, dx, dy, dz, _, aside, above = _within(place, axes, canvas.x[window], canvas.y[window], canvas.z[window])
    rows = window[rows].astype(np.intp)
    column = (aside * np.float32(_FINE) + np.float32(_WIDTH * _FINE)).astype(np.int32)
    line = (above * np.float32(2 * _FINE) + np.float32(_HEIGHT * 2 * _FINE)).astype(np.int32)
    intensity = _table(beam.high)[line * np.int32(_COLUMNS) + column] * np.float32(2.0 * beam.brightness)
    square = dx * dx + dy * dy + dz * dz
    across = intensity / square
    nx, ny, nz = canvas.normals
    cosine = -(dx * nx[rows] + dy * ny[rows] + dz * nz[rows]) / np.sqrt(square)
    return rows, across * np.maximum(cosine, np.float32(0.0)), across


def _within(
    place: Floats, axes: Floats, x: Floats, y: Floats, z: Floats
) -> tuple[NDArray[np.intp], Floats, Floats, Floats, Floats, Floats, Floats]:
    """Return the rows of the points in range of the lamps, their positions relative to the lamps in world axes, their
    distances ahead, and the tangents of the lateral and vertical angles to the axis.
    """
    (fx, lx, ux), (fy, ly, uy), (fz, lz, uz) = axes
    dx, dy, dz = x - place[0], y - place[1], z - place[2]
    ahead = dx * fx + dy * fy + dz * fz
    rows = np.flatnonzero((ahead > 0.3) & (ahead < REACH))
    dx, dy, dz, ahead = dx[rows], dy[rows], dz[rows], ahead[rows]
    aside = (dx * lx + dy * ly + dz * lz) / ahead
    above = (dx * ux + dy * uy + dz * uz) / ahead
    inside = np.flatnonzero((np.abs(aside) < _WIDTH) & (np.abs(above) < _HEIGHT))
    dx, dy, dz, ahead = dx[inside], dy[inside], dz[inside], ahead[inside]
    return rows[inside], dx, dy, dz, ahead, aside[inside], above[inside]


@lru_cache(maxsize=2)
def _table(high: bool) -> Floats:
    """Return `intensity` on a grid of the tangents, line by line."""
    aside = (np.arange(_COLUMNS) + 0.5) / _FINE - _WIDTH
    above = (np.arange(round(4 * _HEIGHT * _FINE) + 1) + 0.5) / (2 * _FINE) - _HEIGHT
    return intensity(aside[None], above[:, None], high).astype(np.float32).ravel()


def intensity(aside: Array, above: Array, high: bool) -> Array:
    """Return the intensity of one lamp [cd] by the tangents of the angles: a hot spot below the cut-off and a wide
    base.
    """
    below = CUT_OFF - above
    spot = np.exp(-((aside / 0.20) ** 2) - ((below - 0.012) / 0.045) ** 2)
    carpet = np.exp(-((aside / 0.55) ** 2) - (below / 0.16) ** 2)
    edge = np.clip(below / 0.006 + 0.5, 0.0, 1.0)
    stray = ABOVE_CUT_OFF * np.exp(-((aside / 0.5) ** 2) - (above / 0.35) ** 2)
    found: Array = LOW_BEAM * (0.85 * spot + 0.15 * carpet) * edge + stray * (1.0 - edge)
    if high:
        found = found + HIGH_BEAM * np.exp(-((aside / 0.12) ** 2) - (above / 0.06) ** 2)
    return found


def color() -> Floats:
    """Return the color of the light, linear sRGB."""
    return np.array(_WARM, dtype=np.float32)

"""Light of vehicles' lamps on what stands before them."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.world.render.model import Array, Floats

REACH = 70.0
"""Where the light of a lamp is forgotten [m]."""
_WIDTH, _HEIGHT = 1.2, 0.6
"""Tangents of the angles to the axis beyond which it is forgotten."""
_STRIDE = 5
"""Of so many points one is looked at first, to find where the light goes."""
_FINE = 200
"""Steps of the table of intensities per unit of the tangent sideways; twice as many upwards."""
_COLUMNS = round(2 * _WIDTH * _FINE) + 1
LOW_BEAM = 24_000.0
"""Greatest luminous intensity of one lamp on low beam [cd]; in UN Regulation No. 112, class B, the brightest part lies
0.57 to 1.3 degrees below the horizon, with at most 50,000 cd."""
HIGH_BEAM = 60_000.0
CUT_OFF = -0.0100
"""Tangent of the angle of the cut-off: 1 % below the horizon."""
ABOVE_CUT_OFF = 350.0
"""What goes above it [cd]: the regulation allows 625 cd to oncoming eyes (B50L: 350 cd)."""
_WARM = (1.06, 1.0, 0.82)


class Beam(NamedTuple):
    """Two headlamps as one: position (3,), axes (3, 3) as columns forward, left, up in the world, share of brightness.

    own   whether the camera is on this vehicle, so that reflective sheeting returns the light to it
    """

    position: Array
    axes: Array
    brightness: float = 1.0
    high: bool = False


def shine(
    beam: Beam, eye: Array, x: Floats, y: Floats, z: Floats, normals: tuple[Floats, Floats, Floats], margin: int
) -> tuple[NDArray[np.intp], Floats, Floats] | None:
    """Illuminance of points before a pair of lamps.

    x, y, z   points relative to the camera at `eye` (3,) [m], line by line of a picture;  normals  of their surfaces
    margin    points in a few of these lines: where the light ends is looked for only so closely
    Returns the rows of the points that get any, their illuminance, and that across the beam [lx].
    """
    place = (beam.position - eye).astype(np.float32)
    axes = beam.axes.astype(np.float32)
    some = _within(place, axes, x[::_STRIDE], y[::_STRIDE], z[::_STRIDE])[0]
    if not len(some):
        return None
    first = max(int(some[0]) * _STRIDE - margin, 0)
    part = slice(first, int(some[-1]) * _STRIDE + margin)
    rows, dx, dy, dz, _, aside, above = _within(place, axes, x[part], y[part], z[part])
    rows = rows + first
    column = (aside * np.float32(_FINE) + np.float32(_WIDTH * _FINE)).astype(np.int32)
    line = (above * np.float32(2 * _FINE) + np.float32(_HEIGHT * 2 * _FINE)).astype(np.int32)
    intensity = _table(beam.high)[line * np.int32(_COLUMNS) + column] * np.float32(2.0 * beam.brightness)
    square = dx * dx + dy * dy + dz * dz
    across = intensity / square
    nx, ny, nz = normals
    cosine = -(dx * nx[rows] + dy * ny[rows] + dz * nz[rows]) / np.sqrt(square)
    return rows, across * np.maximum(cosine, np.float32(0.0)), across


def _within(
    place: Floats, axes: Floats, x: Floats, y: Floats, z: Floats
) -> tuple[NDArray[np.intp], Floats, Floats, Floats, Floats, Floats, Floats]:
    """The rows of the points that the lamps may reach, where these lie from the lamps in the world's axes, how far
    ahead they lie, and the tangents of the angles to the axis, sideways and upwards."""
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
    """`intensity` on a grid of the tangents, line by line."""
    aside = (np.arange(_COLUMNS) + 0.5) / _FINE - _WIDTH
    above = (np.arange(round(4 * _HEIGHT * _FINE) + 1) + 0.5) / (2 * _FINE) - _HEIGHT
    return intensity(aside[None], above[:, None], high).astype(np.float32).ravel()


def intensity(aside: Array, above: Array, high: bool) -> Array:
    """Of one lamp [cd], by the tangents of the angles to its axis: a hot spot under the cut-off, and a wide carpet."""
    below = CUT_OFF - above
    spot = np.exp(-((aside / 0.20) ** 2) - ((below - 0.012) / 0.045) ** 2)
    carpet = np.exp(-((aside / 0.55) ** 2) - (below / 0.16) ** 2)
    edge = np.clip(below / 0.006 + 0.5, 0.0, 1.0)
    stray = ABOVE_CUT_OFF * np.exp(-((aside / 0.5) ** 2) - (above / 0.35) ** 2)
    found: Array = LOW_BEAM * (0.85 * spot + 0.15 * carpet) * edge + stray * (1.0 - edge)
    if high:
        found = found + HIGH_BEAM * np.exp(-((aside / 0.12) ** 2) - (above / 0.06) ** 2)
    return found


def colour() -> Floats:
    """Of the light, linear sRGB."""
    return np.array(_WARM, dtype=np.float32)

"""Light of vehicles' lamps on what stands before them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.world.render.model import Array, Floats

REACH = 90.0
"""Where the light of a lamp is forgotten [m]."""
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
    beam: Beam, eye: Array, x: Floats, y: Floats, z: Floats, normals: tuple[Floats, Floats, Floats]
) -> tuple[NDArray[np.intp], Floats, Floats] | None:
    """Illuminance of points before a pair of lamps.

    x, y, z   points relative to the camera at `eye` (3,) [m];  normals  of their surfaces
    Returns the rows of the points that get any, their illuminance, and that across the beam [lx].
    """
    px, py, pz = (np.float32(value) for value in (beam.position - eye).tolist())
    dx, dy, dz = x - px, y - py, z - pz
    (fx, lx, ux), (fy, ly, uy), (fz, lz, uz) = beam.axes.astype(np.float32)
    ahead = dx * fx + dy * fy + dz * fz
    rows = np.flatnonzero((ahead > 0.3) & (ahead < REACH))
    if not len(rows):
        return None
    dx, dy, dz, ahead = dx[rows], dy[rows], dz[rows], ahead[rows]
    aside = (dx * lx + dy * ly + dz * lz) / ahead
    above = (dx * ux + dy * uy + dz * uz) / ahead
    intensity = _intensity(aside, above, beam.high) * np.float32(2.0 * beam.brightness)
    square = dx * dx + dy * dy + dz * dz
    across = intensity / square
    nx, ny, nz = normals
    cosine = -(dx * nx[rows] + dy * ny[rows] + dz * nz[rows]) / np.sqrt(square)
    return rows, across * np.maximum(cosine, np.float32(0.0)), across


def _intensity(aside: Floats, above: Floats, high: bool) -> Floats:
    """Of one lamp [cd], by the tangents of the angles to its axis: a hot spot under the cut-off, and a wide carpet."""
    below = np.float32(CUT_OFF) - above
    spot = np.exp(-((aside / np.float32(0.20)) ** 2) - ((below - np.float32(0.012)) / np.float32(0.045)) ** 2)
    carpet = np.exp(-((aside / np.float32(0.55)) ** 2) - (below / np.float32(0.16)) ** 2)
    shape = np.float32(LOW_BEAM) * (np.float32(0.85) * spot + np.float32(0.15) * carpet)
    edge = np.clip(below / np.float32(0.006) + np.float32(0.5), np.float32(0.0), np.float32(1.0))
    stray = np.float32(ABOVE_CUT_OFF) * np.exp(-((aside / np.float32(0.5)) ** 2) - (above / np.float32(0.35)) ** 2)
    found: Any = shape * edge + stray * (np.float32(1.0) - edge)
    if high:
        found = found + np.float32(HIGH_BEAM) * np.exp(
            -((aside / np.float32(0.12)) ** 2) - (above / np.float32(0.06)) ** 2
        )
    return np.asarray(found, dtype=np.float32)


def colour() -> Floats:
    """Of the light, linear sRGB."""
    return np.array(_WARM, dtype=np.float32)

"""Lamps of vehicles: state and brightness, beams, and their light in an image."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats
from eidrive_scenario.rendering.model import Light, linear
from eidrive_scenario.rendering.projection import CameraView, Surfaces
from eidrive_scenario.rendering.rasterization import Cover
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.appearance import Appearance, LightState
from eidrive_scenario.world.weather import Weather

HEADLIGHT: Light = (6_500.0, 6_000.0, 4_900.0)
TAILLIGHT: Light = (300.0, 0.8, 0.5)
"""Luminance of lamps at night [cd/m²]."""

_HIGH: Light = (26_000.0, 24_000.0, 20_000.0)
_DAY: Light = (9_000.0, 9_200.0, 9_600.0)
_BRAKE: Light = (7_500.0, 12.0, 8.0)
_REAR_FOG: Light = (9_000.0, 14.0, 9.0)
_INDICATOR: Light = (11_000.0, 3_600.0, 30.0)
_WHITE: Light = (7_000.0, 6_800.0, 6_200.0)
_PLATE: Light = (28.0, 26.0, 22.0)
_BEACON: Light = (150.0, 700.0, 11_000.0)
"""Luminous intensities within the bounds of UN Regulations 7, 6, 38, 23, 87 and 65, divided by the areas of the lamps.
"""

_SHINES: Mapping[str, tuple[tuple[str, Light], ...]] = {
    "daytimeRunningLights": (("headlight", _DAY),),
    "lowBeam": (("headlight", HEADLIGHT), ("taillight", TAILLIGHT)),
    "highBeam": (("headlight", _HIGH), ("taillight", TAILLIGHT)),
    "fogLights": (("headlight", HEADLIGHT), ("taillight", _REAR_FOG)),
    "fogLightsFront": (("headlight", HEADLIGHT),),
    "fogLightsRear": (("taillight", _REAR_FOG),),
    "brakeLights": (("taillight", _BRAKE),),
    "warningLights": (("indicator_left", _INDICATOR), ("indicator_right", _INDICATOR)),
    "indicatorLeft": (("indicator_left", _INDICATOR),),
    "indicatorRight": (("indicator_right", _INDICATOR),),
    "reversingLights": (("reversing_light", _WHITE),),
    "licensePlateIllumination": (("plate", _PLATE),),
    "specialPurposeLights": (("blue_light", _BEACON),),
}
"""Light types of the standard, and the materials of the meshes that emit light."""
_BEAMS = ("lowBeam", "highBeam", "fogLights", "fogLightsFront")


def glow(spec: ActorSpec, appearance: Appearance, weather: Weather, time: float) -> Mapping[str, Light]:
    """Return the luminance of the materials of an actor at `time` [s], linear red, green, blue [cd/m²].

    Lamps without a LightStateAction follow the weather: low beam and tail lamps are on in the dark and in thick air.
    """
    found: dict[str, Light] = {}
    for name, light in _lights(spec, appearance, weather).items():
        brightness = light.brightness(time)
        for material, luminance in _SHINES.get(name, ()) if brightness > 0.0 else ():
            shown = _colored(luminance, light, brightness)
            found[material] = max(shown, found.get(material, shown), key=max)
    return found


def headlights(spec: ActorSpec, appearance: Appearance, weather: Weather, time: float) -> tuple[float, bool] | None:
    """Return the brightness of the headlamps in [0, 1], and whether they are on high beam; None if they are off."""
    lights = _lights(spec, appearance, weather)
    found = {name: lights[name].brightness(time) for name in _BEAMS if name in lights}
    brightest = max(found.values(), default=0.0)
    return (brightest, found.get("highBeam", 0.0) > 0.0) if brightest > 0.0 else None


def _lights(spec: ActorSpec, appearance: Appearance, weather: Weather) -> Mapping[str, LightState]:
    """Return the switched lights, and an automatic low beam if it was not switched."""
    lights = appearance.lights
    if weather.lamps_on and "lowBeam" not in lights and spec.wheelbase > 0.0 and spec.shape != "bicycle":
        return {"lowBeam": LightState("lowBeam", "on"), **lights}
    return lights


def _colored(luminance: Light, light: LightState, brightness: float) -> Light:
    """Return the luminance in the color of the light, if it has one, at the same brightness."""
    if light.color is not None:
        red, green, blue = linear(light.color)
        most = max(red, green, blue)
        scale = max(luminance) / most if most > 0.0 else 0.0
        luminance = (red * scale, green * scale, blue * scale)
    return luminance[0] * brightness, luminance[1] * brightness, luminance[2] * brightness


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
LAMP_COLOR: Floats = np.array([1.06, 1.0, 0.82], dtype=np.float32)
"""Color of the light of headlamps, linear sRGB."""


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

    line, column, sample  every _STRIDE-th pixel in both directions that has a point, and the index of this point
    """

    x: Floats
    y: Floats
    z: Floats
    normals: tuple[Floats, Floats, Floats]
    where: NDArray[np.int32]
    line: NDArray[np.intp]
    column: NDArray[np.intp]
    sample: NDArray[np.int32]

    def at(self, rows: NDArray[np.int32]) -> tuple[Floats, Floats, Floats]:
        """Return the coordinates of some points."""
        return self.x[rows], self.y[rows], self.z[rows]


def shine(beam: Beam, viewpoint: Array, canvas: Canvas) -> tuple[NDArray[np.intp], Floats, Floats] | None:
    """Return the illuminance of points by a pair of lamps: rows of the lit points, illuminance, illuminance across the
    beam [lx].

    The camera is at `viewpoint` (3,). The extent of the light is searched in the sample first.
    """
    place = (beam.position - viewpoint).astype(np.float32)
    axes = beam.axes.astype(np.float32)
    some = _within(place, axes, *canvas.at(canvas.sample))[0]
    if not len(some):
        return None
    line, column = canvas.line[some], canvas.column[some]
    top, bottom = max(int(line.min()) - 1, 0) * _STRIDE, (int(line.max()) + 1) * _STRIDE
    left, right = max(int(column.min()) - 1, 0) * _STRIDE, (int(column.max()) + 1) * _STRIDE
    window = canvas.where[top:bottom, left:right].ravel()
    window = window[window >= 0]
    rows, dx, dy, dz, aside, above = _within(place, axes, *canvas.at(window))
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
) -> tuple[NDArray[np.intp], Floats, Floats, Floats, Floats, Floats]:
    """Return the rows of the points in range of the lamps, their positions relative to the lamps in world axes, and the
    tangents of the lateral and vertical angles to the axis.
    """
    (fx, lx, ux), (fy, ly, uy), (fz, lz, uz) = axes
    dx, dy, dz = x - place[0], y - place[1], z - place[2]
    ahead = dx * fx + dy * fy + dz * fz
    rows = np.flatnonzero((ahead > 0.3) & (ahead < REACH))
    dx, dy, dz, ahead = dx[rows], dy[rows], dz[rows], ahead[rows]
    aside = (dx * lx + dy * ly + dz * lz) / ahead
    above = (dx * ux + dy * uy + dz * uz) / ahead
    inside = np.flatnonzero((np.abs(aside) < _WIDTH) & (np.abs(above) < _HEIGHT))
    return rows[inside], dx[inside], dy[inside], dz[inside], aside[inside], above[inside]


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


_BESIDE_THE_CAMERA = 4.0
"""Maximum distance of lamps that illuminate along the rays of the camera, so that sheeting returns the light [m]."""
_SQUARE = np.ones((3, 3), dtype=np.uint8)


class Lamplight(NamedTuple):
    """Light on the surfaces in pixels (P,), and light across the rays of lamps beside the camera [lx]."""

    received: Floats
    across: Floats


def lamplight(beams: Sequence[Beam], cover: Cover, surfaces: Surfaces, view: CameraView) -> Lamplight | None:
    """Return the light of all beams; None if the image is empty."""
    triangle = cover.triangle[::2, ::2]
    seen = triangle >= 0
    if not seen.any():
        return None
    numbers = np.arange(cover.triangle.size).reshape(view.shape)[::2, ::2][seen]
    x, y, z, _ = view.places(numbers, cover.nearness)
    normals = surfaces.normal[triangle[seen]].T
    where = np.full(seen.shape, -1, dtype=np.int32)
    where[seen] = np.arange(len(numbers), dtype=np.int32)
    coarse = where[::_STRIDE, ::_STRIDE]
    line, column = np.nonzero(coarse >= 0)
    canvas = Canvas(x, y, z, (normals[0], normals[1], normals[2]), where, line, column, coarse[line, column])
    received, across = (np.zeros(len(numbers), dtype=np.float32) for _ in range(2))
    for beam in beams:
        shone = shine(beam, view.place, canvas)
        if shone is not None:
            rows, onto, straight = shone
            received[rows] += onto
            if float(np.linalg.norm(beam.position - view.place)) < _BESIDE_THE_CAMERA:
                across[rows] += straight
    with np.errstate(divide="ignore"):
        distance = view.own[2].reshape(view.shape) / cover.nearness
    received, across = (_spread(part, seen, distance).ravel() for part in (received, across))
    return Lamplight(received, across)


def _spread(values: Floats, seen: NDArray[np.bool_], distance: Floats) -> Floats:
    """Return values of every second pixel in both directions for all pixels (H, W).

    A pixel whose sample is empty uses the maximum of its neighbors. A pixel at another depth than the sample uses the
    minimum, so that light does not leak over edges.
    """

    import cv2

    grid = np.full(seen.shape, np.float32(-1.0))
    grid[seen] = values
    greatest = np.asarray(cv2.dilate(grid, _SQUARE), dtype=np.float32)
    known: Floats = np.where(grid < 0.0, np.float32(np.inf), grid)
    least = np.asarray(cv2.erode(known, _SQUARE), dtype=np.float32)
    grid = np.where(grid < 0.0, np.maximum(greatest, np.float32(0.0)), grid)
    sampled = np.where(seen, distance[::2, ::2], np.float32(0.0))
    with np.errstate(invalid="ignore"):
        near = np.abs(_doubled(sampled, distance.shape) - distance) < np.float32(0.06) * distance
    whole = _doubled(grid, distance.shape)
    found: Floats = np.where(near, whole, np.minimum(_doubled(least, distance.shape), whole))
    return found


def _doubled(grid: Floats, shape: tuple[int, ...]) -> Floats:
    """Return a grid of every second pixel in both directions at all pixels."""
    found: Floats = np.repeat(np.repeat(grid, 2, axis=0)[: shape[0]], 2, axis=1)[:, : shape[1]]
    return found

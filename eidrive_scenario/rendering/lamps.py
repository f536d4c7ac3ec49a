"""Lamps of vehicles: state and brightness, beams, and their light in an image."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats
from eidrive_scenario.base.kernels import kernel
from eidrive_scenario.rendering.model import Light, linear
from eidrive_scenario.rendering.projection import CameraView
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
"""Light types of the standard, and the materials of the meshes that emit light; `fogLights` is in recordings of older
versions."""
_BEAMS = ("lowBeam", "highBeam", "fogLights", "fogLightsFront")


def glow(spec: ActorSpec, appearance: Appearance, weather: Weather, time: float) -> Mapping[str, Light]:
    """Return the luminance of the materials of an actor at `time` [s], linear red, green, blue [cd/m²].

    Lamps without a LightStateAction follow the weather: low beam and tail lamps are on in the dark and in thick air.
    """
    by_material: dict[str, Light] = {}
    for name, light in _lights(spec, appearance, weather).items():
        brightness = light.brightness(time)
        for material, luminance in _SHINES.get(name, ()) if brightness > 0.0 else ():
            shown = _colored(luminance, light, brightness)
            by_material[material] = max(shown, by_material.get(material, shown), key=max)
    return by_material


def headlights(spec: ActorSpec, appearance: Appearance, weather: Weather, time: float) -> tuple[float, bool] | None:
    """Return the brightness of the headlamps in [0, 1], and whether they are on high beam; None if they are off."""
    lights = _lights(spec, appearance, weather)
    beams = {name: lights[name].brightness(time) for name in _BEAMS if name in lights}
    brightest = max(beams.values(), default=0.0)
    return (brightest, beams.get("highBeam", 0.0) > 0.0) if brightest > 0.0 else None


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
    total: Array = LOW_BEAM * (0.85 * spot + 0.15 * carpet) * edge + stray * (1.0 - edge)
    if high:
        total = total + HIGH_BEAM * np.exp(-((aside / 0.12) ** 2) - (above / 0.06) ** 2)
    return total


_BESIDE_THE_CAMERA = 4.0
"""Maximum distance of lamps that illuminate along the rays of the camera, so that sheeting returns the light [m]."""


class Lamp(NamedTuple):
    """Beam as seen by a camera: position relative to it and axes forward, left, up (4, 3), table of the intensity, its
    scale, and whether it is beside the camera."""

    frame: Floats
    table: Floats
    scale: np.float32
    is_beside: bool

    @classmethod
    def of(cls, beam: Beam, view: CameraView) -> Lamp:
        """Return the beam as seen by a camera."""
        offset = beam.position - view.position
        frame = np.ascontiguousarray(np.vstack([offset, beam.axes.T]), dtype=np.float32)
        is_beside = float(np.linalg.norm(offset)) < _BESIDE_THE_CAMERA
        return cls(frame, _table(beam.high), np.float32(2.0 * beam.brightness), is_beside)


def lamplight(lamps: Sequence[Lamp], triangle: NDArray[np.int32], places: Floats, normals: Floats) -> Floats:
    """Return the light (2, n) on the surfaces at points (4, n) of triangles (n,), and across the rays of lamps beside
    the camera [lx]."""
    light = np.zeros((2, len(triangle)), dtype=np.float32)
    for lamp in lamps:
        _shine(triangle, places, normals, lamp.frame, lamp.table, lamp.scale, lamp.is_beside, light)
    return light


@kernel("void(i4[::1], f4[:,::1], f4[:,::1], f4[:,::1], f4[::1], f4, b1, f4[:,::1])")
def _shine(
    triangle: NDArray[np.int32], places: Floats, normals: Floats, frame: Floats, table: Floats, scale: np.float32,
    is_beside: bool, light: Floats,
) -> None:  # fmt: skip
    """Add the illuminance of points (4, n) by a pair of lamps to the light (2, n) on surfaces and across the beam [lx].

    frame   (4, 3) position relative to the camera, and axes forward, left, up
    table   intensity of a lamp as by `_table`, to be scaled
    """
    x, y, z = frame[0, 0], frame[0, 1], frame[0, 2]
    fx, fy, fz = frame[1, 0], frame[1, 1], frame[1, 2]
    lx, ly, lz = frame[2, 0], frame[2, 1], frame[2, 2]
    ux, uy, uz = frame[3, 0], frame[3, 1], frame[3, 2]
    px, py, pz = places[0], places[1], places[2]
    is_lit = np.empty(len(triangle), dtype=np.bool_)
    # Few points are lit. Without branches and divisions, the processor compares several points at once.
    for point in range(len(triangle)):
        dx, dy, dz = px[point] - x, py[point] - y, pz[point] - z
        ahead = dx * fx + dy * fy + dz * fz
        aside = abs(dx * lx + dy * ly + dz * lz)
        above = abs(dx * ux + dy * uy + dz * uz)
        is_lit[point] = (
            (ahead > np.float32(0.3))
            & (ahead < np.float32(REACH))
            & (aside < np.float32(_WIDTH) * ahead)
            & (above < np.float32(_HEIGHT) * ahead)
        )
    for point, facet in enumerate(triangle):
        if is_lit[point]:
            dx, dy, dz = px[point] - x, py[point] - y, pz[point] - z
            ahead = dx * fx + dy * fy + dz * fz
            aside, above = (dx * lx + dy * ly + dz * lz) / ahead, (dx * ux + dy * uy + dz * uz) / ahead
            cell = int(above * np.float32(2 * _FINE) + np.float32(_HEIGHT * 2 * _FINE)) * _COLUMNS
            cell += int(aside * np.float32(_FINE) + np.float32(_WIDTH * _FINE))
            square = dx * dx + dy * dy + dz * dz
            across = table[cell] * scale / square
            facing = dx * normals[facet, 0] + dy * normals[facet, 1] + dz * normals[facet, 2]
            light[0, point] += across * max(-facing / np.sqrt(square), np.float32(0.0))
            if is_beside:
                light[1, point] += across

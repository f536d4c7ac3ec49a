"""Light of sun and sky by the weather."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.world.render.tone_mapping import LUMA
from eidrive_scenario.world.weather import EXTINCTION_AT_RANGE, Weather

RAYLEIGH = 0.008735 * np.array([0.610, 0.550, 0.465]) ** -4.08
"""Optical depth of pure air for red, green, blue (Leckner 1978, with wavelengths in µm)."""
HAZE = 0.05 * np.array([0.610, 0.550, 0.465]) ** -1.3
"""Optical depth of the aerosol of a clear day (Ångström, turbidity 0.05)."""
TWILIGHT = ((0.0, 800.0), (-6.0, 3.4), (-12.0, 0.0083), (-18.0, 0.00065))
"""Illuminance of the ground [lx] by the elevation of the sun [degrees] (RCA Electro-Optics Handbook, 1974)."""
NIGHT_GLOW = 0.02
"""Illuminance of a town sky at night [lx]: 18 mag/arcsec², a bright suburb."""
GROUND_ALBEDO = 0.12
THICKENING = 50.0
"""Rain intensity at which clouds transmit half as much light as without rain [mm/h]."""
CLEAR_AIR = EXTINCTION_AT_RANGE / 20_000.0
"""Extinction that the formulas of clear and cloudy days include [1/m]."""
WHITENING = 300.0
"""Path length over which light in thick air is scattered many times [m]."""
FOG_HEIGHT = 120.0
"""Height of the layer of thick air for light from above [m]."""


class Daylight(NamedTuple):
    """Light of sun and sky.

    sun       light across the rays of the sun (3,) [lx] at the ground
    towards   unit vector to the sun
    sky       light of the whole sky on level ground (3,) [lx]
    clear, clouds  parts of `sky` by the clear and the covered sky (3,) [lx]
    ground    total light on level ground (3,) [lx]
    air       luminance of thick air (3,) [cd/m²]
    """

    sun: Array
    towards: Array
    sky: Array
    clear: Array
    clouds: Array
    ground: Array
    air: Array


@lru_cache(maxsize=64)
def daylight(weather: Weather) -> Daylight:
    """Return the light of sun and sky.

    Clear days by IES, Calculation of daylight availability (1984): sun 127.5 klx exp(-0.21 / sin h), sky 0.8 + 15.5
    sin½ h klx. Under clouds the light of both decreases to 1 - 0.75 c^3.4 (Kasten and Czeplak 1980), and the share of
    the sun with the clear part of the sky. In fog the rest of the sun beam is scattered, half of it downwards.
    """
    towards = np.array(weather.sun_direction)
    height = float(towards[2])
    cover = weather.cloud_cover
    warm = _sunlight_color(weather.sun_elevation)
    if height > 0.0:
        beam = 127_500.0 * math.exp(-0.21 / max(height, 1e-3)) * weather.sun_share
        if weather.sun_illuminance is not None:
            beam = weather.sun_illuminance
        clear_sky = 800.0 + 15_500.0 * math.sqrt(height)
    else:
        beam = 0.0
        clear_sky = _twilight(weather.sun_elevation)
    total = (beam * height + clear_sky) * (1.0 - 0.75 * cover**3.4)
    if weather.precipitation != "none":
        total /= 1.0 + weather.precipitation_intensity / THICKENING
    direct = beam * (1.0 - cover)
    clear = min(clear_sky * (1.0 - cover), total)
    clouds = max(total - direct * height - clear, 0.0) if height > 0.0 else max(total - clear, 0.0)
    if height > 0.0:
        thick = max(weather.extinction - CLEAR_AIR, 0.0)
        left = math.exp(-thick * FOG_HEIGHT / max(height, 0.05))
        clouds += 0.5 * direct * height * (1.0 - left)
        direct *= left
        if direct * height < 0.01 * total:
            direct = 0.0
    clear_light = clear * _unit(np.array([0.70, 0.88, 1.25]) if height > 0.0 else np.array([0.62, 0.78, 1.30]))
    gray = (
        np.array([0.96, 1.0, 1.03]) * (1.0 - 0.35 * _low(weather.sun_elevation))
        + 0.35 * _low(weather.sun_elevation) * warm
    )
    cloud_light = clouds * _unit(gray) + NIGHT_GLOW * _unit(np.array([1.0, 0.85, 0.7]))
    sun = direct * warm
    sky = clear_light + cloud_light
    ground = sky + sun * max(height, 0.0)
    lamps = weather.street_lighting * np.array([1.0, 0.86, 0.62])
    air = (sky + 0.5 * sun * max(height, 0.0) + 0.25 * lamps) / math.pi
    # Light that drops have scattered many times has lost the blue of the sky.
    white = math.exp(-WHITENING * max(weather.extinction - CLEAR_AIR, 0.0))
    air = white * air + (1.0 - white) * float(air @ LUMA) * np.array([0.985, 1.0, 1.03])
    return Daylight(sun, towards, sky, clear_light, cloud_light, ground, air)


def _twilight(elevation: float) -> float:
    """Return the illuminance [lx], log-linear between the elevations of the table."""
    angles, values = zip(*reversed(TWILIGHT), strict=True)
    return math.exp(float(np.interp(elevation, angles, np.log(values))))


def _sunlight_color(elevation: float) -> Array:
    """Return linear sRGB of luminance 1 after air and haze (air mass by Kasten and Young 1989)."""
    height = max(elevation, 0.0)
    mass = 1.0 / (math.sin(math.radians(height)) + 0.50572 * (height + 6.07995) ** -1.6364)
    return _unit(np.exp(-np.minimum(mass, 12.0) * (RAYLEIGH + HAZE)))


def _low(elevation: float) -> float:
    """Return the weight in [0, 1] of the color of a low sun on clouds."""
    return float(np.clip(1.0 - abs(elevation - 2.0) / 10.0, 0.0, 1.0))


def _unit(color: Array) -> Array:
    found: Array = color / float(color @ LUMA)
    return found

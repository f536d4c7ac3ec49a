"""Light of sun and sky by the weather, and the sky as an image of its dome."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Floats
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.rendering.tone_mapping import LUMA
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
    clouds = max(total - direct * height - clear, 0.0)
    if height > 0.0:
        thick = max(weather.extinction - CLEAR_AIR, 0.0)
        left = math.exp(-thick * FOG_HEIGHT / max(height, 0.05))
        clouds += 0.5 * direct * height * (1.0 - left)
        direct *= left
        if direct * height < 0.01 * total:
            direct = 0.0
    clear_light = clear * _unit(np.array([0.70, 0.88, 1.25]) if height > 0.0 else np.array([0.62, 0.78, 1.30]))
    redness = 0.35 * float(np.clip(1.0 - abs(weather.sun_elevation - 2.0) / 10.0, 0.0, 1.0))  # of a low sun on clouds
    gray = np.array([0.96, 1.0, 1.03]) * (1.0 - redness) + redness * warm
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


def _unit(color: Array) -> Array:
    unit: Array = color / float(color @ LUMA)
    return unit


SIZE = 512
"""Pixels of the dome image along each side."""
_CLEAR = (-1.0, -0.32, 10.0, -3.0, 0.45)
_OVERCAST = (4.0, -0.7, 0.0, -1.0, 0.0)
"""Coefficients a to e of the CIE standard general sky (CIE S 011 / ISO 15469), types 12 and 1."""
_CLOUD_HEIGHT = 1.0
_NIGHT_CLOUDS = 0.3
"""Visibility of clouds at night, when a town illuminates sky and clouds alike."""


def sample(dome: Floats, x: Floats, y: Floats, z: Floats) -> Floats:
    """Return the light (…, 3) of the dome in directions of unit vector components (H, W), at least at the horizon."""

    import cv2

    level = np.maximum(z, np.float32(0.0))
    scale = np.float32((SIZE - 2) / 2) / (np.float32(1.0) + level)
    middle = np.float32((SIZE - 1) / 2)
    light: Floats = np.asarray(cv2.remap(dome, x * scale + middle, y * scale + middle, cv2.INTER_LINEAR))
    return light


@lru_cache(maxsize=16)
def dome(weather: Weather) -> Floats:
    """Return the luminance (SIZE, SIZE, 3) [cd/m²]; column and row are x / (1 + z) and y / (1 + z) of the direction.

    The clear and the covered part illuminate the ground as `daylight` states. Towards the horizon the dome fades into
    the air in front of it.
    """
    light = daylight(weather)
    x, y, z, _ = _directions()
    clear = _scaled(_cie(_CLEAR, x, y, z, light.towards), z, float(light.clear @ LUMA))
    covered = _scaled(_cie(_OVERCAST, x, y, z, light.towards), z, float(light.clouds @ LUMA))
    color_clear = light.clear / max(float(light.clear @ LUMA), 1e-12)
    pale = np.array([0.93, 0.99, 1.07])
    blue = np.array([0.42, 0.74, 1.75]) / float(np.array([0.42, 0.74, 1.75]) @ LUMA)
    height = np.clip(z, 0.0, 1.0)[..., None] ** 0.55
    tint = pale + (blue - pale) * height
    sun = light.sun / max(float(light.sun @ LUMA), 1e-12) if light.sun.any() else color_clear
    near = np.clip(x * light.towards[0] + y * light.towards[1] + z * light.towards[2], 0.0, 1.0)[..., None] ** 6
    low = float(np.clip(1.0 - weather.sun_elevation / 25.0, 0.0, 1.0)) * float(weather.sun_elevation > -8.0)
    tint = tint + (sun - tint) * low * (0.25 + 0.55 * near) * (1.0 - 0.8 * height)
    tint /= (tint @ LUMA)[..., None]
    color_clouds = light.clouds / max(float(light.clouds @ LUMA), 1e-12)
    share, relief = _clouds(weather.cloud_cover)
    if weather.sun_elevation < -6.0:
        share = share * _NIGHT_CLOUDS
    whole = clear[..., None] * tint * (1.0 / max(1.0 - weather.cloud_cover, 0.15))
    above = covered[..., None] / max(weather.cloud_cover, 0.35)
    lit_from_above = (
        0.45 * float(light.sun @ LUMA) * max(float(light.towards[2]), 0.3) + float(light.sky @ LUMA)
    ) / math.pi
    above = above + (1.0 - weather.cloud_cover) * np.maximum(lit_from_above - above, 0.0)
    mixed = whole + (above * color_clouds * relief[..., None] - whole) * share[..., None]
    # Thick air in front of the sky extends to the height of the layer in this direction.
    fog = max(weather.extinction - CLEAR_AIR, 0.0)
    through = np.exp(-fog * FOG_HEIGHT / np.maximum(z, 0.004))[..., None]
    image: Floats = (mixed * through + light.air * (1.0 - through)).astype(np.float32)
    image.flags.writeable = False
    return image


@lru_cache(maxsize=64)
def horizon(weather: Weather) -> Array:
    """Return the mean luminance (3,) just above the horizon [cd/m²], the color of large distances."""
    turns = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False, dtype=np.float32)[None]
    rise = np.full_like(turns, 0.03)
    ring = sample(dome(weather), np.cos(turns), np.sin(turns), rise)
    mean: Array = ring.reshape(-1, 3).mean(axis=0).astype(np.float64)
    mean.flags.writeable = False
    return mean


@lru_cache(maxsize=1)
def _directions() -> tuple[Array, Array, Array, Bools]:
    """Return the unit vectors of the pixels of the dome, those of the horizon outside its circle, and a mask of it."""
    axis = (np.arange(SIZE) - (SIZE - 1) / 2) / ((SIZE - 2) / 2)
    u, v = np.meshgrid(axis, axis)
    reach = np.hypot(u, v)
    shrink = np.where(reach > 1.0, 1.0 / np.maximum(reach, 1e-9), 1.0)
    u, v = u * shrink, v * shrink
    square = np.minimum(u * u + v * v, 1.0)
    z = (1.0 - square) / (1.0 + square)
    return u * (1.0 + z), v * (1.0 + z), z, reach <= 1.0


def _cie(coefficients: tuple[float, ...], x: Array, y: Array, z: Array, sun: Array) -> Array:
    """Return the relative luminance of the CIE standard general sky. A sun below the horizon is moved to it."""
    a, b, c, d, e = coefficients
    towards = sun.copy()
    towards[2] = max(towards[2], 0.0)
    towards /= max(float(np.linalg.norm(towards)), 1e-9)
    chi = np.arccos(np.clip(x * towards[0] + y * towards[1] + z * towards[2], -1.0, 1.0))
    gradation = 1.0 + a * np.exp(b / np.maximum(z, 0.01))
    indicatrix = 1.0 + c * (np.exp(d * chi) - np.exp(d * np.pi / 2)) + e * np.cos(chi) ** 2
    luminance: Array = gradation * indicatrix
    return luminance


def _scaled(relative: Array, z: Array, illuminance: float) -> Array:
    """Return the luminance [cd/m²] that gives this illuminance on level ground [lx]."""
    solid_angle = (1.0 + z) ** 2 / ((SIZE - 2) / 2) ** 2
    given = float((relative * z * solid_angle)[_directions()[3]].sum())
    luminance: Array = relative * (illuminance / max(given, 1e-12))
    return luminance


@lru_cache(maxsize=8)
def _clouds(cover: float) -> tuple[Array, Array]:
    """Return the cloud cover in [0, 1] and the brightness of clouds relative to their mean."""
    if cover <= 0.0:
        return np.zeros((SIZE, SIZE)), np.ones((SIZE, SIZE))
    x, y, z, _ = _directions()
    away = _CLOUD_HEIGHT / (z + 0.10)
    noise = _noise(x * away, y * away)
    shape = np.hypot(x, y) < 1.0
    edge = float(np.quantile(noise[shape], 1.0 - cover)) if cover < 1.0 else float(noise.min()) - 1.0
    spread = float(noise.std())
    share = np.clip((noise - edge) / (0.9 * spread) + 0.5, 0.0, 1.0)
    share = share * share * (3.0 - 2.0 * share)
    near = np.clip(z / 0.16, 0.0, 1.0)
    share = cover + (share - cover) * near * near * (3.0 - 2.0 * near)
    relief = np.clip(1.0 + (0.10 + 0.14 * cover) * _noise(x * away + 3.1, y * away - 1.7) / spread, 0.45, 1.6)
    return share, relief


def _noise(u: Array, v: Array) -> Array:
    """Return smooth noise of zero mean: octaves of a table, periodic without a seam."""

    import cv2

    total = np.zeros_like(u)
    for octave in range(5):
        scale = 3.2 * 2.1**octave
        fine = np.asarray(
            cv2.remap(
                _table(),
                np.mod(u * scale, _TABLE).astype(np.float32),
                np.mod(v * scale, _TABLE).astype(np.float32),
                cv2.INTER_CUBIC,
                borderMode=cv2.BORDER_WRAP,
            )
        )
        total += fine * 0.55**octave
    return total


_TABLE = 256


@lru_cache(maxsize=1)
def _table() -> Floats:
    return generator(0, "clouds").standard_normal((_TABLE, _TABLE), dtype=np.float32)

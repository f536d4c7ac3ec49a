"""Sky as an image of its dome: luminance by the CIE standard sky, clouds by noise."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from eidrive_scenario.arrays import Array, Floats
from eidrive_scenario.randomness import generator
from eidrive_scenario.world.render.illumination.daylight import CLEAR_AIR, FOG_HEIGHT, daylight
from eidrive_scenario.world.render.tone_mapping import LUMA
from eidrive_scenario.world.weather import Weather

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
    found: Floats = np.asarray(cv2.remap(dome, x * scale + middle, y * scale + middle, cv2.INTER_LINEAR))
    return found


@lru_cache(maxsize=16)
def dome(weather: Weather) -> Floats:
    """Return the luminance (SIZE, SIZE, 3) [cd/m²]; column and row are x / (1 + z) and y / (1 + z) of the direction.

    The clear and the covered part illuminate the ground as `daylight` states. Towards the horizon the dome fades into
    the air in front of it.
    """
    light = daylight(weather)
    x, y, z = _directions()
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


def horizon(weather: Weather) -> Array:
    """Return the mean luminance (3,) just above the horizon [cd/m²], the color of large distances."""
    return _horizon(weather).copy()


@lru_cache(maxsize=64)
def _horizon(weather: Weather) -> Array:
    turns = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False, dtype=np.float32)[None]
    rise = np.full_like(turns, 0.03)
    ring = sample(dome(weather), np.cos(turns), np.sin(turns), rise)
    found: Array = ring.reshape(-1, 3).mean(axis=0).astype(np.float64)
    return found


@lru_cache(maxsize=1)
def _directions() -> tuple[Array, Array, Array]:
    """Return the unit vectors of the pixels of the dome; those of the horizon outside its circle."""
    axis = (np.arange(SIZE) - (SIZE - 1) / 2) / ((SIZE - 2) / 2)
    u, v = np.meshgrid(axis, axis)
    reach = np.hypot(u, v)
    shrink = np.where(reach > 1.0, 1.0 / np.maximum(reach, 1e-9), 1.0)
    u, v = u * shrink, v * shrink
    square = np.minimum(u * u + v * v, 1.0)
    z = (1.0 - square) / (1.0 + square)
    return u * (1.0 + z), v * (1.0 + z), z


def _cie(coefficients: tuple[float, ...], x: Array, y: Array, z: Array, sun: Array) -> Array:
    """Return the relative luminance of the CIE standard general sky. A sun below the horizon is moved to it."""
    a, b, c, d, e = coefficients
    towards = sun.copy()
    towards[2] = max(towards[2], 0.0)
    towards /= max(float(np.linalg.norm(towards)), 1e-9)
    chi = np.arccos(np.clip(x * towards[0] + y * towards[1] + z * towards[2], -1.0, 1.0))
    gradation = 1.0 + a * np.exp(b / np.maximum(z, 0.01))
    indicatrix = 1.0 + c * (np.exp(d * chi) - np.exp(d * np.pi / 2)) + e * np.cos(chi) ** 2
    found: Array = gradation * indicatrix
    return found


def _scaled(relative: Array, z: Array, illuminance: float) -> Array:
    """Return the luminance [cd/m²] that gives this illuminance on level ground [lx]."""
    axis = (np.arange(SIZE) - (SIZE - 1) / 2) / ((SIZE - 2) / 2)
    inside = np.hypot(*np.meshgrid(axis, axis)) <= 1.0
    solid_angle = (1.0 + z) ** 2 / ((SIZE - 2) / 2) ** 2
    given = float((relative * z * solid_angle)[inside].sum())
    found: Array = relative * (illuminance / max(given, 1e-12))
    return found


@lru_cache(maxsize=8)
def _clouds(cover: float) -> tuple[Array, Array]:
    """Return the cloud cover in [0, 1] and the brightness of clouds relative to their mean."""
    if cover <= 0.0:
        return np.zeros((SIZE, SIZE)), np.ones((SIZE, SIZE))
    x, y, z = _directions()
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

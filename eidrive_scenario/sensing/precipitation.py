"""Rain and snow in front of a lens, and drops on it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array, Floats
from eidrive_scenario.world.camera import Pinhole
from eidrive_scenario.world.weather import Weather

STREAK_TIME = 1.0 / 90.0
"""Duration of the streak of a drop [s]: automotive cameras expose a part of each pixel for at least this time to
prevent flicker of lamps with a pulse-width modulation of 90 Hz."""
STRENGTH = 6.0
"""Factor of streak intensity over the share of time in which a drop covers a pixel. A drop refracts the light of a wide
field and is out of focus at short distance (Garg and Nayar, Vision and rain, 2007); neither is computed."""
MAX_DROPS = 1400
"""Maximum number of drops or flakes in one image; of more, a random share is drawn."""
NEAREST, FAINTEST = 0.4, 0.22
"""Minimum distance of drops [m], and minimum width of a streak [px]; smaller ones are part of the attenuation of the
air."""
_SHADES = 4


class Drops(NamedTuple):
    """Positions (N, 3) in the camera frame [m], diameters [mm] and velocities (N, 3) in the world [m/s]."""

    places: Array
    diameters: Array
    velocities: Array


def drops_before(weather: Weather, pinhole: Pinhole, draws: np.random.Generator) -> Drops:
    """Return drops or flakes in the field of view that are near enough to be visible.

    Diameters of rain by Marshall and Palmer, The distribution of raindrops with size (1948): N = 8000 exp(-L D) per m³
    and mm, L = 4.1 R^-0.21 per mm, from 0.6 mm on. Speeds by Atlas, Srivastava and Sekhon, Doppler radar
    characteristics of precipitation (1973): 9.65 - 10.3 exp(-0.6 D) m/s. Flakes by Gunn and Marshall (1958) for their
    melted diameters, eight times as wide as snow, falling at 1.2 m/s.
    """
    rate = weather.precipitation_intensity
    if weather.precipitation == "rain":
        number, slope, least, widening = 8000.0, 4.1 * rate**-0.21, 0.6, 1.0
    else:
        number, slope, least, widening = 3800.0 * rate**-0.87, 2.55 * rate**-0.48, 0.3, 8.0
    per_cubic_meter = number / slope * math.exp(-slope * least)
    usual = (least + 1.0 / slope) * widening
    farthest = max(pinhole.focal * usual * 1e-3 / FAINTEST, 2.0 * NEAREST)
    half_x, half_y = 0.55 * pinhole.width / pinhole.focal, 0.65 * pinhole.height / pinhole.focal
    volume = 4.0 * half_x * half_y * farthest**3 / 3.0
    # The generator refuses the numbers of a field of view of almost 180 degrees.
    count = min(int(draws.poisson(min(per_cubic_meter * volume, 1e9))), MAX_DROPS)
    depth = farthest * np.maximum(draws.random(count), (NEAREST / farthest) ** 3) ** (1.0 / 3.0)
    places = np.stack(
        [draws.uniform(-half_x, half_x, count) * depth, draws.uniform(-half_y, half_y, count) * depth, depth]
    )
    melted = least + draws.exponential(1.0 / slope, count)
    fall = 9.65 - 10.3 * np.exp(-0.6 * melted) if weather.precipitation == "rain" else np.full(count, 1.2)
    direction = math.radians(weather.wind_direction)
    velocities = np.empty((count, 3))
    velocities[:, 0] = weather.wind_speed * math.cos(direction)
    velocities[:, 1] = weather.wind_speed * math.sin(direction)
    velocities[:, 2] = -fall
    if weather.precipitation == "snow":
        velocities[:, :2] += draws.normal(0.0, 0.4, (count, 2))
    return Drops(places.T, melted * widening, velocities)


def draw_precipitation(
    luminance: Floats,
    weather: Weather,
    pose: Array,
    pinhole: Pinhole,
    draws: np.random.Generator,
    velocity: Array | tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> None:
    """Draw precipitation in front of a camera that moves at `velocity` (3,) [m/s] into its image (H, W, 3) [cd/m²]."""

    import cv2

    if weather.precipitation == "none" or weather.precipitation_intensity <= 0.0:
        return
    drops = drops_before(weather, pinhole, draws)
    travel = (drops.velocities - np.asarray(velocity)) @ pose[:3, :3] * STREAK_TIME
    ends = drops.places + travel
    ahead = ends[:, 2] > 0.5 * NEAREST
    starts, ends, diameters = drops.places[ahead], ends[ahead], drops.diameters[ahead] * 1e-3
    first, last = _pixels(starts, pinhole), _pixels(ends, pinhole)
    length = np.linalg.norm(last - first, axis=1)
    width = diameters * pinhole.focal / starts[:, 2]
    share = np.minimum(STRENGTH * np.minimum(width, 3.0) * width / np.maximum(length, width), 0.3)
    if weather.precipitation == "snow":
        share = np.minimum(3.0 * share, 0.85)
    veil = np.zeros(luminance.shape[:2], dtype=np.uint8)
    fixed = 16
    order = np.argsort(share)
    for part in np.array_split(order, _SHADES):
        if not len(part):
            continue
        lines = np.rint(np.stack([first[part], last[part]], axis=1) * fixed).astype(np.int32)
        shade = max(round(255 * float(share[part].mean())), 1)
        thickness = max(1, min(round(float(width[part].mean())), 5))
        cv2.polylines(veil, list(lines), False, shade, thickness=thickness, lineType=cv2.LINE_AA, shift=4)
    covered = np.flatnonzero(veil.ravel())
    pixels = luminance.reshape(-1, 3)
    share_of_pixel = veil.ravel()[covered, None] * np.float32(1.0 / 255.0)
    pixels[covered] += share_of_pixel * (_refracted_light(luminance) - pixels[covered])


def draw_drops_on_lens(luminance: Floats, weather: Weather, draws: np.random.Generator) -> None:
    """Draw drops on the lens: each shows the scene upside down, small and blurred."""

    import cv2

    if weather.precipitation != "rain":
        return
    height, width = luminance.shape[:2]
    count = int(draws.poisson(min(weather.precipitation_intensity / 6.0, 12.0)))
    for x, y, size in draws.random((count, 3)).tolist():
        radius = max(round(width * (0.008 + 0.022 * size * size)), 2)
        column, row = round(x * width), round(y * height)
        left, top = column - radius, row - radius
        if left < 0 or top < 0 or left + 2 * radius >= width or top + 2 * radius >= height:
            continue
        reach = 5 * radius
        surrounding = luminance[max(row - reach, 0) : row + reach, max(column - reach, 0) : column + reach]
        inside = cv2.resize(surrounding[::-1, ::-1], (2 * radius, 2 * radius), interpolation=cv2.INTER_AREA)
        inside = cv2.GaussianBlur(inside, (0, 0), max(radius / 4.0, 0.6))
        axis = (np.arange(2 * radius) + 0.5 - radius) / radius
        distance = np.hypot(axis[None, :], axis[:, None])
        share = np.clip((1.0 - distance) * 2.5, 0.0, 0.85).astype(np.float32)[..., None]
        target = luminance[top : top + 2 * radius, left : left + 2 * radius]
        target += share * (inside - target)


def _pixels(points: Array, pinhole: Pinhole) -> Array:
    center = np.array([pinhole.center_x - 0.5, pinhole.center_y - 0.5])
    pixels: Array = points[:, :2] / points[:, 2:] * pinhole.focal + center
    return pixels


def _refracted_light(luminance: Floats) -> Floats:
    """Return the light (3,) that a drop refracts to the camera: that of a wide field, mainly of the sky."""
    rows = luminance[: max(luminance.shape[0] // 2, 1) : 4, ::4].reshape(-1, 3)
    light: Floats = np.float32(0.4) * rows.mean(axis=0) + np.float32(0.6) * np.percentile(rows, 90, axis=0)
    return light.astype(np.float32)

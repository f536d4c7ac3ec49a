"""Intensity of lidar returns: from surfaces, through weather, and from the weather itself."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.world.weather import Weather

WAVELENGTH = 0.905
"""Wavelength [µm]."""
REFLECTIVITY: Mapping[str, float] = {
    "car": 0.45,
    "truck": 0.50,
    "bus": 0.50,
    "van": 0.50,
    "motorbike": 0.25,
    "bicycle": 0.20,
    "pedestrian": 0.35,
    "misc": 0.40,
}
"""Diffuse reflectivity of bodies by class: values for car paint, metal, clothes and plastic within the measurements of
Muckenhuber et al. (Automotive lidar modeling approach based on material properties and lidar capabilities, Sensors 20,
2020)."""
GROUND, WET_GROUND = 0.17, 0.06
"""Reflectivity of asphalt, buildings and other static objects, and of asphalt under water."""
PULSE_LENGTH = 0.75
"""Half the distance that light travels during a pulse of 5 ns [m]: the depth of air whose light returns simultaneously.
"""
BACKSCATTER = 0.046
"""Backscatter coefficient of fog times the visibility [1/(m sr) m] (Rasshofer, Spies, Spies: Influences of weather
phenomena on automotive laser radar systems, Advances in Radio Science 9, 2011)."""
CONTRAST = math.log(20.0)
"""Optical depth along the meteorological visibility in that source: 5 % contrast."""
OVERLAP = (0.9, 10.0)
"""Distances between which the beam enters the field of view of a receiver beside it [m]. A sensor with immediate
overlap (Hahner et al., Fog simulation on real LiDAR point clouds, ICCV 2021, have 1 m) would measure only fog at 50 m
visibility; tested sensors measure bodies in it (Bijelic, Gruber, Ritter: A benchmark for lidar sensors in fog, IV
2018)."""
UNEVEN = {"rain": 0.15, "snow": 0.15, "none": 4.0}
"""Shape of the gamma distribution by which the return of the air varies between rays: approximately the number of drops
in the volume of a pulse if there are few (0.2 liters with less than a thousand drops per m³)."""


class Returns(NamedTuple):
    """Return of each ray: whether there is one (M,), its distance [m], and its intensity in [0, 1]."""

    found: NDArray[np.bool_]
    distance: Array
    intensity: Array


def extinction(weather: Weather) -> float:
    """Return the extinction coefficient at 905 nm [1/m].

    Fog follows Kruse's law (ITU-R P.1814), drops attenuate as for visible light.
    """
    kilometers = weather.visual_range / 1000.0
    if kilometers > 50.0:
        power = 1.6
    elif kilometers > 6.0:
        power = 1.3
    else:
        power = 0.585 * kilometers ** (1.0 / 3.0)
    return float(weather.fog_extinction * (WAVELENGTH / 0.55) ** -power + weather.precipitation_extinction)


def reflectivity(rows: NDArray[np.int64], categories: Sequence[str], wetness: float) -> Array:
    """Return the reflectivity (M,) of hit objects: rows of actors, negative for others."""
    ground = GROUND + min(2.0 * wetness, 1.0) * (WET_GROUND - GROUND)
    table = np.array([*(REFLECTIVITY.get(category, REFLECTIVITY["misc"]) for category in categories), ground])
    return table[np.where(rows < 0, len(categories), rows)]


def returns(
    distance: Array,
    brightness: Array,
    weather: Weather,
    *,
    attenuation: float,
    ten_percent_range: float,
    draws: np.random.Generator,
) -> Returns:
    """Return the measured returns of rays with hits at `distance` (M,), inf without a hit, of `brightness` (M,).

    The brightness is the reflectivity times the cosine of the angle to the normal. The power from a surface falls with
    exp(-2 extinction · d) / d² (radar equation of an area larger than the beam). The receiver requires the power of a
    reflectivity of 0.1 at `ten_percent_range` in clear air. Air is measured instead of the surface if it scatters more
    than the surface, and enough.
    """
    fade = extinction(weather)
    reach = np.maximum(distance, 1e-3)
    through = np.exp(-2.0 * fade * np.where(np.isfinite(distance), distance, 0.0))
    hard = np.where(np.isfinite(distance), brightness * through / (math.pi * reach * reach), 0.0)
    least = 0.1 / (math.pi * ten_percent_range**2)
    found = hard >= least
    where = np.where(np.isfinite(distance), distance, 0.0)
    intensity = brightness * through * np.exp(-attenuation * where)
    air = weather.extinction - weather.fog_extinction * (weather.visual_range > 10_000.0)
    if air > 0.0:
        ranges, soft = _air(round(fade, 9), round(BACKSCATTER * air / CONTRAST, 12))
        shape = UNEVEN[weather.precipitation]
        strength = draws.gamma(shape, 1.0 / shape, len(distance))
        place = ranges[np.searchsorted(np.cumsum(soft) / soft.sum(), draws.random(len(distance)))]
        peak = float(soft.max()) * strength
        false = (peak > hard) & (peak >= least) & (place < distance)
        found |= false
        where = np.where(false, place, where)
        intensity = np.where(false, np.minimum(peak * math.pi * place * place, 1.0), intensity)
    return Returns(found, where, np.clip(intensity, 0.0, 1.0))


@lru_cache(maxsize=32)
def _air(fade: float, backscatter: float) -> tuple[Array, Array]:
    """Return distances [m] and backscattered power: backscatter · PULSE_LENGTH · exp(-2 fade r) / r²."""
    ranges = np.linspace(OVERLAP[0], 20.0, 800)
    entered = np.clip((ranges - OVERLAP[0]) / (OVERLAP[1] - OVERLAP[0]), 0.0, 1.0)
    soft: Array = backscatter * PULSE_LENGTH * entered * np.exp(-2.0 * fade * ranges) / ranges**2
    return ranges, soft

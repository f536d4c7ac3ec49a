"""Rotating lidar, and the intensity of its returns from surfaces, through weather, and from the weather itself."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.sensing.crossing import crossing, starts_behind_bodies, turned
from eidrive_scenario.sensing.readings import LidarReading
from eidrive_scenario.sensing.sensor import Scene, Sensor, mounting
from eidrive_scenario.sensing.settings import LidarSettings, SensorSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import NOTHING, WorldView
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
        # The distance in the air is drawn by the power from there. The air is measured if it is before the surface,
        # and stronger than the surface and the minimum of the receiver.
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


class Lidar(Sensor):
    """Lidar with rings of rays; a reading covers the rotation since the last one, at most one revolution.

    All rays of a reading start from the pose at its time: motion during a revolution does not distort the point cloud.
    Rays that hit the ego body give no return. A mast is too thin to hide the ground around it from the head on its top.
    Random values are drawn by seed, station, name and tick.
    """

    settings_type: ClassVar[type[SensorSettings]] = LidarSettings
    settings: LidarSettings

    def __init__(self, settings: LidarSettings, spec: ActorSpec, name: str = "lidar", seed: int = 0) -> None:
        super().__init__(settings, spec, name, seed)
        self.mounting = mounting(settings, spec, "roof")
        rings = settings.elevations or np.linspace(settings.upper_fov, settings.lower_fov, settings.channels)
        self._elevations = np.radians(rings)
        self._on_mast = not spec.has_wheels
        self._columns_per_second = settings.points_per_second / settings.channels
        self._columns_per_turn = max(1, round(self._columns_per_second / settings.rotation))
        self._next: int | None = None
        """First column that no reading has covered."""
        self._key = (seed, "lidar", spec.name, name)

    def directions(self, time: float) -> Array:
        """Return unit vectors (M, 3) in the sensor frame of the rays since the last reading, and advance the head."""
        return self._rays(self._columns(time))[0]

    def read(self, scene: Scene, view: WorldView, row: int) -> LidarReading:
        """Return a point cloud from the actor in this row."""
        settings = self.settings
        pose = self.mounting.pose(view, row)
        directions, ring, azimuth = self._rays(self._columns(view.time))
        rays = directions @ pose[:3, :3].T
        origin = np.broadcast_to(pose[:3, 3], directions.shape)
        targets = origin + settings.range * rays
        clear, starts, near = self._beyond_own_body(origin, targets, view, row)
        sensor_name = {"sensor": self.name} if view.unseen_by else {}
        hits = scene.scan(row, pose[:3, 3], starts, targets[clear], near, **sensor_name)
        rows = hits.rows
        hit = rows != NOTHING
        begin = np.linalg.norm(starts - pose[:3, 3], axis=1) if self._on_mast else 0.0
        distance = np.where(hit, begin + hits.fraction * (settings.range - begin), np.inf)
        weather = scene.weather
        facing = np.abs(np.einsum("mi,mi->m", hits.normal, rays[clear]))
        seed, *key = self._key
        draws = generator(seed, *key, view.tick)
        back = returns(
            distance,
            reflectivity(rows, view.categories, weather.wetness) * facing,
            weather if settings.weather else _CLEAR,
            attenuation=settings.attenuation,
            ten_percent_range=settings.ten_percent_range,
            draws=draws,
        )
        kept = np.flatnonzero(back.found & self._not_dropped(back.intensity, draws))
        length = back.distance[kept]
        if settings.range_noise > 0.0:
            length = np.maximum(length + settings.range_noise * draws.standard_normal(len(kept)), 0.0)
        selected = clear[kept]
        return LidarReading(
            directions[selected] * length[:, None], back.intensity[kept], pose, ring[selected], azimuth[selected]
        )

    def _beyond_own_body(
        self, origin: Array, targets: Array, view: WorldView, row: int
    ) -> tuple[Integers, Array, NDArray[np.bool_]]:
        """Return the rows (K,) of rays that do not hit the ego body, their starts, and whether they pass near it."""
        if self._on_mast:
            starts = starts_behind_bodies(origin[None], targets[None], view, np.array([row]))[0]
            return np.arange(len(origin)), starts, np.zeros(len(origin), dtype=bool)
        own, rows = view.boxes[row], np.array([row])
        begin, end = (turned(points[None], view, rows, upright=True)[0] for points in (origin, targets))
        around = own + np.array([0.0, 0.0, 0.0, *(2.0 * _NEAR,) * 3, 0.0])
        near = np.flatnonzero(_meets(begin, end, around))
        hit = near[_meets(begin[near], end[near], own)]
        passes = np.zeros(len(origin), dtype=bool)
        passes[near] = True
        clear = np.delete(np.arange(len(origin)), hit)
        return clear, origin[clear], passes[clear]

    def _columns(self, time: float) -> NDArray[np.int64]:
        """Return the numbers of the columns since the last reading."""
        end = round(time * self._columns_per_second) + 1
        first = end - self._columns_per_turn if self._next is None else max(self._next, end - self._columns_per_turn)
        self._next = end
        return np.arange(first, end)

    def _rays(self, columns: NDArray[np.int64]) -> tuple[Array, NDArray[np.int32], Array]:
        """Return directions (M, 3) in the sensor frame, rings (M,) and azimuths (M,) in (-pi, pi] of the rays of
        columns."""
        azimuths = self._azimuths(columns)
        if self.settings.field_of_view < 360.0:
            inside = np.abs(azimuths) <= math.radians(self.settings.field_of_view) / 2.0 + 1e-9
            columns, azimuths = columns[inside], azimuths[inside]
        directions = self._turn.take(columns % self._columns_per_turn, axis=0).reshape(-1, 3)
        rings = len(self._elevations)
        return directions, np.tile(np.arange(rings, dtype=np.int32), len(azimuths)), np.repeat(azimuths, rings)

    def _azimuths(self, columns: NDArray[np.int64]) -> Array:
        """Return the azimuths (C,) of columns in (-pi, pi]."""
        turn = self._columns_per_turn
        behind = (columns * 2 + turn) % (2 * turn) - turn
        return np.where(behind == -turn, turn, behind) * (math.pi / turn)

    @cached_property
    def _turn(self) -> Array:
        """Directions (C, R, 3) of the rays of all columns of a revolution."""
        azimuth, elevation = self._azimuths(np.arange(self._columns_per_turn))[:, None], self._elevations
        flat, up = np.cos(elevation), np.sin(elevation)
        return np.stack(np.broadcast_arrays(flat * np.cos(azimuth), flat * np.sin(azimuth), up), axis=-1)

    def _not_dropped(self, intensity: Array, draws: np.random.Generator) -> NDArray[np.bool_]:
        settings = self.settings
        lost = np.full(len(intensity), settings.dropoff)
        if settings.dropoff_intensity > 0.0:
            dark = settings.dropoff_dark * np.maximum(1.0 - intensity / settings.dropoff_intensity, 0.0)
            lost = 1.0 - (1.0 - lost) * (1.0 - dark)
        elif settings.dropoff == 0.0:
            return np.ones(len(intensity), dtype=bool)
        return np.asarray(draws.random(len(intensity)) >= lost)


def _meets(origins: Array, targets: Array, box: Array) -> NDArray[np.bool_]:
    """Return whether rays (M, 3) meet a box (7,)."""
    enter, leave = crossing(origins[None], targets[None], box[None])
    return np.asarray(((enter < leave) & (leave > 0.0))[0])


_NEAR = 0.02
"""Distance from the ego body within which only ray casts tell whether a ray hits it [m]."""
_CLEAR = Weather(visual_range=1e12)

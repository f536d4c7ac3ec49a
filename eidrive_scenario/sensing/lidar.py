"""Rotating lidar, and the intensity of its returns from surfaces, through weather, and from the weather itself."""

from __future__ import annotations

import math
from functools import cached_property, lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.geometry import rotation_matrix
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.sensing.bodies import body_surfaces
from eidrive_scenario.sensing.ray_fan import FanHits, RayFan
from eidrive_scenario.sensing.readings import LidarReading
from eidrive_scenario.sensing.sensor import Scene, Sensor, mounting
from eidrive_scenario.sensing.settings import LidarSettings, SensorSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import GROUND, NOTHING, WorldView
from eidrive_scenario.world.weather import Weather

WAVELENGTH = 0.905
"""Wavelength [µm]."""
ASPHALT, WET_ASPHALT = 0.17, 0.06
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
in the volume of a pulse if there are few (0.2 liters with less than a thousand drops per m³). The variances of fog and
drops add up in proportion to their shares of the return, squared."""


class Returns(NamedTuple):
    """Returns of rays (M,): whether there is one, distance [m], intensity in [0, 1], and whether it is of the air."""

    detected: NDArray[np.bool_]
    distance: Array
    intensity: Array
    airborne: NDArray[np.bool_]


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
    detected = hard >= least
    where = np.where(np.isfinite(distance), distance, 0.0)
    intensity = brightness * through * np.exp(-attenuation * where)
    false = np.zeros(len(distance), dtype=bool)
    air = weather.fog_extinction * (weather.visual_range <= 10_000.0) + weather.precipitation_extinction
    if air > 0.0:
        ranges, soft = _air(round(fade, 9), round(BACKSCATTER * air / CONTRAST, 12))
        drops = weather.precipitation_extinction / air
        shape = 1.0 / ((1.0 - drops) ** 2 / UNEVEN["none"] + drops**2 / UNEVEN[weather.precipitation])
        # The distance in the air is drawn by the power from there. The air is measured if it is before the surface,
        # and stronger than the surface and the minimum of the receiver.
        strength = draws.gamma(shape, 1.0 / shape, len(distance))
        below = np.cumsum(soft)
        depth = ranges[np.searchsorted(below, draws.random(len(distance)) * below[-1])]
        peak = float(soft.max()) * strength
        false = (peak > hard) & (peak >= least) & (depth < distance)
        detected |= false
        where = np.where(false, depth, where)
        intensity = np.where(false, np.minimum(peak * math.pi * depth * depth, 1.0), intensity)
    return Returns(detected, where, np.clip(intensity, 0.0, 1.0), false)


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
        return self._directions(self._columns(time))

    def read(self, scene: Scene, view: WorldView, row: int) -> LidarReading:
        """Return a point cloud from the actor in this row."""
        settings = self.settings
        pose = self.mounting.pose(view, row)
        columns = self._columns(view.time)
        hits = self._hits(columns, pose, scene, view, row)
        rays = np.flatnonzero(hits.rows != row)
        rows = hits.rows.ravel()[rays]
        draws = generator(*self._key, view.tick)
        weather = scene.weather
        static = ASPHALT + min(2.0 * weather.wetness, 1.0) * (WET_ASPHALT - ASPHALT)
        back = returns(
            np.where(rows == NOTHING, np.inf, hits.distance.ravel()[rays]),
            np.where(rows == GROUND, static, 1.0) * hits.brightness.ravel()[rays],
            weather if settings.weather else _CLEAR,
            attenuation=settings.attenuation,
            ten_percent_range=settings.ten_percent_range,
            draws=draws,
        )
        measured = back.detected & (back.distance <= settings.range)  # the air is measured up to 20 m
        kept = np.flatnonzero(measured & self._not_dropped(back.intensity, draws))
        length = back.distance[kept]
        if settings.range_noise > 0.0:
            length = np.maximum(length + settings.range_noise * draws.standard_normal(len(kept)), 0.0)
        selected = rays[kept]
        column, ring = np.divmod(selected, len(self._elevations))
        return LidarReading(
            self._directions(columns)[selected] * length[:, None],
            back.intensity[kept],
            pose,
            ring.astype(np.int32),
            self._azimuths(columns)[column],
            np.where(back.airborne[kept], NOTHING, rows[kept]).astype(np.int32),
        )

    def _hits(self, columns: Integers, pose: Array, scene: Scene, view: WorldView, row: int) -> FanHits:
        """Return the first hits of the rays of some columns."""
        hits = FanHits(self._fan, columns % self._columns_per_turn, pose, self.settings.range)
        hits.meet(scene.surfaces(), GROUND, np.eye(3), np.zeros(3))
        extent = np.linalg.norm(view.offset, axis=1) + np.linalg.norm(view.size, axis=1) / 2.0
        near = np.linalg.norm(view.position - pose[:3, 3], axis=1) < self.settings.range + extent
        near[view.hidden_rows(self.name)] = False
        near[row] = not self._on_mast
        others = np.flatnonzero(near)
        turns = rotation_matrix(view.yaw[others], view.pitch[others], view.roll[others])
        for other, turn in zip(others.tolist(), turns, strict=True):
            name = view.names[other]
            hits.meet(body_surfaces(scene.spec(name), scene.motion(name)), other, turn, view.position[other])
        return hits

    def _columns(self, time: float) -> Integers:
        """Return the numbers of the columns in the field of view since the last reading."""
        end = round(time * self._columns_per_second) + 1
        first = end - self._columns_per_turn if self._next is None else max(self._next, end - self._columns_per_turn)
        self._next = end
        columns = np.arange(first, end)
        if self.settings.field_of_view < 360.0:
            half = math.radians(self.settings.field_of_view) / 2.0 + 1e-9
            columns = columns[np.abs(self._azimuths(columns)) <= half]
        return columns

    def _directions(self, columns: Integers) -> Array:
        """Return directions (M, 3) in the sensor frame of the rays of columns."""
        return self._turn.take(columns % self._columns_per_turn, axis=0).reshape(-1, 3)

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

    @cached_property
    def _fan(self) -> RayFan:
        return RayFan(self._azimuths(np.arange(self._columns_per_turn)), self._elevations)

    def _not_dropped(self, intensity: Array, draws: np.random.Generator) -> NDArray[np.bool_]:
        settings = self.settings
        lost = np.full(len(intensity), settings.dropoff)
        if settings.dropoff_intensity > 0.0:
            dark = settings.dropoff_dark * np.maximum(1.0 - intensity / settings.dropoff_intensity, 0.0)
            lost = 1.0 - (1.0 - lost) * (1.0 - dark)
        elif settings.dropoff == 0.0:
            return np.ones(len(intensity), dtype=bool)
        return np.asarray(draws.random(len(intensity)) >= lost)


_CLEAR = Weather(visual_range=1e12)

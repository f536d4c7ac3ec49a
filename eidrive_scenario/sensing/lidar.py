"""Rotating lidar."""

from __future__ import annotations

import math
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.randomness import generator
from eidrive_scenario.sensing.crossing import crossing, set_upright, starts_behind_bodies
from eidrive_scenario.sensing.lidar_physics import reflectivity, returns
from eidrive_scenario.sensing.mounting import mounting
from eidrive_scenario.sensing.readings import LidarReading
from eidrive_scenario.sensing.scene import NOTHING, Scene
from eidrive_scenario.sensing.sensor import Sensor
from eidrive_scenario.sensing.settings import LidarSettings, SensorSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import WorldView
from eidrive_scenario.world.weather import Weather


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
        rows = np.asarray(hits.rows)
        hit = rows != NOTHING
        begin = np.linalg.norm(starts - pose[:3, 3], axis=1) if self._on_mast else 0.0
        distance = np.where(hit, begin + np.asarray(hits.fraction) * (settings.range - begin), np.inf)
        weather = scene.weather
        facing = np.abs(np.einsum("mi,mi->m", np.asarray(hits.normal), rays[clear]))
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
        begin, end = set_upright(origin[None], view, rows)[0], set_upright(targets[None], view, rows)[0]
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

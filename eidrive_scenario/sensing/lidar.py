"""The spinning LiDAR."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.sensing.mounting import mounting
from eidrive_scenario.sensing.readings import LidarReading
from eidrive_scenario.sensing.scene import NOTHING, Scene
from eidrive_scenario.sensing.settings import LidarSettings
from eidrive_scenario.sensing.truth import crossing, past_box
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import WorldView

Array = NDArray[np.float64]


class Lidar:
    """Rings of rays; each reading covers what the head has turned since the last one, at most one revolution.

    All rays of a reading start from the pose at its time: the motion during a revolution does not bend the sweep.
    The intensity of a return is exp(-attenuation · distance). Rays that meet the own body give no return; a mast is too
    thin to take the ground around it from the head on its top.
    """

    def __init__(self, settings: LidarSettings, spec: ActorSpec) -> None:
        self.settings = settings
        self.mounting = mounting(settings, spec, "roof")
        self._elevations = np.radians(np.linspace(settings.upper_fov, settings.lower_fov, settings.channels))
        self._on_mast = spec.wheelbase <= 0.0
        self._columns_per_second = settings.points_per_second / settings.channels
        self._columns_per_turn = max(1, round(self._columns_per_second / settings.rotation))
        self._next: int | None = None
        """The first column that no reading has covered."""

    def directions(self, time: float) -> Array:
        """(M, 3) unit vectors in the sensor frame of the rays since the last reading; moves the head on."""
        end = round(time * self._columns_per_second) + 1
        first = end - self._columns_per_turn if self._next is None else max(self._next, end - self._columns_per_turn)
        self._next = end
        azimuths = np.arange(first, end) * (2.0 * math.pi / self._columns_per_turn)
        azimuth, elevation = (grid.ravel() for grid in np.meshgrid(azimuths, self._elevations, indexing="ij"))
        flat = np.cos(elevation)
        return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=1)

    def read(self, scene: Scene, view: WorldView, row: int) -> LidarReading:
        """A sweep from the actor in this row."""
        pose = self.mounting.pose(view, row)
        directions = self.directions(view.time)
        origin = np.broadcast_to(pose[:3, 3], directions.shape)
        targets = origin + self.settings.range * directions @ pose[:3, :3].T
        own = view.boxes[row][None]
        if self._on_mast:
            starts, clear = past_box(origin[None], targets[None], own)[0], np.ones(len(origin), dtype=bool)
        else:
            enter, leave = crossing(origin[None], targets[None], own)
            starts, clear = origin, ~((enter < leave) & (leave > 0.0))[0]
        hits = scene.cast(np.ascontiguousarray(starts[clear]), targets[clear])
        met = np.asarray(hits.rows) != NOTHING
        begin = np.linalg.norm(starts[clear][met] - pose[:3, 3], axis=1) / self.settings.range
        distance = (begin + np.asarray(hits.fraction)[met] * (1.0 - begin)) * self.settings.range
        points = directions[clear][met] * distance[:, None]
        return LidarReading(points, np.exp(-self.settings.attenuation * distance), pose)

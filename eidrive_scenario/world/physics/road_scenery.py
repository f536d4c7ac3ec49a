"""Static objects of a road network: what worlds on the same roads share."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache

import numpy as np

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.roads import RoadNetwork, surface_meshes
from eidrive_scenario.world.physics.obstacles import MAX_FACES, Box, Obstacles
from eidrive_scenario.world.road_objects import Building, RoadObjectBody, buildings, road_object_bodies

_SPACING = 4.0
"""Distance of the points of the ground along a road [m]."""
_SHORTEST = 4.0
"""Minimum length of a part of a body that has a separate circle [m]."""
_MAX_KEPT = 2
"""Maximum number of road networks whose objects stay in the process."""


class RoadScenery:
    """Static objects of a road network, computed when they are first used.

    entities  ids of objects that are actors instead
    """

    def __init__(self, roads: RoadNetwork, entities: frozenset[str]) -> None:
        self._roads = roads
        self._entities = entities

    @cached_property
    def buildings(self) -> Sequence[Building]:
        """Buildings."""
        return tuple(buildings(self._roads, without=self._entities))

    @cached_property
    def road_objects(self) -> Sequence[RoadObjectBody]:
        """Road objects except buildings."""
        return tuple(road_object_bodies(self._roads, self._entities))

    @cached_property
    def obstacles(self) -> Obstacles:
        """Road objects with a body."""
        return Obstacles(self.road_objects)

    @cached_property
    def circles(self) -> Array:
        """Circles (4, K) in plan view that cover all bodies: center x, y, radius, and top of the body [m]."""
        return covering_circles([*self.obstacles.boxes, *map(standing_box, self.buildings)])

    @cached_property
    def ground(self) -> Sequence[tuple[Array, Integers]]:
        """Meshes of the ground: vertices (N, 3) [m], faces (M, 3) of rows in them."""
        parts = []
        for mesh in surface_meshes(self._roads, _SPACING):
            if mesh.kind.startswith("marking"):
                continue
            for start in range(0, len(mesh.faces), MAX_FACES):
                used, faces = np.unique(mesh.faces[start : start + MAX_FACES], return_inverse=True)
                parts.append((mesh.vertices[used], faces))
        return tuple(parts)


def covering_circles(boxes: Sequence[Box]) -> Array:
    """Return circles (4, K) that cover boxes: center x, y, radius, and top [m]. A row of them covers a long box."""
    x, y, bottom, length, width, height, yaw = np.reshape(boxes, (-1, 7)).T
    long, wide = np.maximum(length, width), np.minimum(length, width)
    yaw = np.where(length >= width, yaw, yaw + np.pi / 2.0)
    count = np.ceil(long / np.maximum(wide, _SHORTEST)).clip(1.0).astype(int)
    of = np.arange(len(count)).repeat(count)
    number = np.arange(len(of)) - (np.cumsum(count) - count)[of]
    part = (long / count)[of]
    along = (number + 0.5) * part - long[of] / 2.0
    center_x, center_y = x[of] + along * np.cos(yaw[of]), y[of] + along * np.sin(yaw[of])
    return np.stack([center_x, center_y, np.hypot(part, wide[of]) / 2.0, (bottom + height)[of]])


def standing_box(building: Building) -> Box:
    """Return the box of a building, with the height of its lower end."""
    x, y, z = building.center
    return x, y, z - building.size[2] / 2.0, *building.size, building.yaw


@lru_cache(maxsize=_MAX_KEPT)
def road_scenery(roads: RoadNetwork, entities: frozenset[str]) -> RoadScenery:
    """Return the static objects of a road network without those that are actors."""
    return RoadScenery(roads, entities)

"""Static bodies: ground, roads, buildings, road objects; what worlds on the same roads share of them."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from functools import cached_property, lru_cache

import numpy as np

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.geometry import footprint_distance
from eidrive_scenario.roads import RoadNetwork, surface_meshes
from eidrive_scenario.world.actor import Vector3
from eidrive_scenario.world.physics.bullet import (
    DRIVEN,
    RAYS,
    STATIC,
    TERRAIN,
    bullet,
    create_static_body,
    create_triangle_shape,
    quaternion,
)
from eidrive_scenario.world.physics.obstacles import MAX_FACES, Box, Obstacles, SpatialGrid, grid_cells
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


_shared_scenery = lru_cache(maxsize=_MAX_KEPT)(RoadScenery)


MAX_BOXES = 16
"""Maximum number of boxes of a shape in pybullet."""


GROUND = "ground"


class Scenery:
    """Bodies in pybullet of ground, buildings and road objects.

    entities  ids of objects that are actors instead

    The bodies of road objects are created when a vehicle may touch them or rays are cast.
    """

    def __init__(self, client: int, roads: RoadNetwork | None, entities: Collection[str] = ()) -> None:
        self.roads = roads
        self._of_roads = _shared_scenery(roads, frozenset(entities)) if roads is not None else None
        self.buildings: list[Building] = []
        self._nearby: SpatialGrid[tuple[float, float, float]] = SpatialGrid()
        """Center and radius of each building in plan view [m]."""
        self._client = client
        self._ground: set[int] = set()
        self.level = roads is None or roads.is_level
        self._raised = False
        self._obstacles: Obstacles | None = None
        self._obstacle_handles: frozenset[int] = frozenset()
        self._built: dict[int, Sequence[Building]] = {}
        """Buildings of each body in pybullet, which takes 0.2 ms to create one, whatever its shape."""
        if self._of_roads is not None:
            self.add_buildings(self._of_roads.buildings)

    def add_buildings(self, buildings: Sequence[Building]) -> None:
        """Add buildings, which block vehicles and rays."""
        for building in buildings:
            self.buildings.append(building)
            x, y, radius = building.center[0], building.center[1], math.hypot(building.size[0], building.size[1]) / 2
            self._nearby.add((x, y, radius), grid_cells(x, y, radius))
        for start in range(0, len(buildings), MAX_BOXES):
            some = buildings[start : start + MAX_BOXES]
            shape = bullet.createCollisionShapeArray(
                [bullet.GEOM_BOX] * len(some),
                halfExtents=[[extent / 2 for extent in building.size] for building in some],
                collisionFramePositions=[building.center for building in some],
                collisionFrameOrientations=[quaternion(building.yaw, 0.0, 0.0) for building in some],
                physicsClientId=self._client,
            )
            self._built[create_static_body(self._client, shape, STATIC, RAYS | DRIVEN)] = some

    def raise_ground(self) -> bool:
        """Create the ground for rays if it does not exist. Return True if it was created.

        Vehicles do not need it, and on hilly roads it takes time, so that it is created for the first ray.
        """
        if self._raised:
            return False
        self._raised = True
        in_client = {"physicsClientId": self._client}
        if self.level or self._of_roads is None:
            plane = bullet.createCollisionShape(bullet.GEOM_PLANE, **in_client)
            # Without a visual shape pybullet loads a textured plane from a file, which takes 7 ms.
            shown = bullet.createVisualShape(bullet.GEOM_BOX, halfExtents=(0.01, 0.01, 0.01), **in_client)
            self._ground.add(create_static_body(self._client, plane, TERRAIN, RAYS, shown))
            return True
        for vertices, faces in self._of_roads.ground:
            shape = create_triangle_shape(self._client, vertices, faces)
            self._ground.add(create_static_body(self._client, shape, TERRAIN, RAYS))
        return True

    @property
    def road_objects(self) -> Sequence[RoadObjectBody]:
        """Road objects except buildings."""
        return self._of_roads.road_objects if self._of_roads is not None else ()

    def raise_obstacles(self) -> bool:
        """Create the bodies of road objects if they do not exist. Return True if they were created."""
        if self._obstacles is not None or self._of_roads is None:
            return False
        self._obstacles = self._of_roads.obstacles
        self._obstacle_handles = frozenset(self._obstacles.raise_bodies(self._client))
        return bool(self._obstacle_handles)

    def circles(self) -> Array:
        """Return circles (4, K) in plan view that cover all static objects: center x, y, radius, and top [m]."""
        if self._of_roads is None:
            return covering_circles([standing_box(building) for building in self.buildings])
        added = [standing_box(building) for building in self.buildings[len(self._of_roads.buildings) :]]
        return np.concatenate([self._of_roads.circles, covering_circles(added)], axis=1)

    def name_of(self, handle: int, position: Vector3) -> str:
        """Return the name of the object with this body in pybullet at a point of contact."""
        if handle in self._obstacle_handles and self._obstacles is not None:
            return self._obstacles.name_at(position[0], position[1])
        if handle in self._ground:
            return GROUND
        point = (*position, 0.0, 0.0, 0.0, 0.0)
        return min(self._built[handle], key=lambda building: footprint_distance(building.box, point)).name

    @property
    def highest_handle(self) -> int:
        """Maximum handle of these bodies in pybullet; -1 without any."""
        return max([*self._ground, *self._built, *self._obstacle_handles], default=-1)

    def clearance(self, x: float, y: float, most: float) -> float:
        """Return the distance of a point from the nearest static object, at most `most` [m]."""
        free = most if self._obstacles is None else self._obstacles.clearance(x, y, most)
        for bx, by, radius in self._nearby.query(x, y, most):
            free = min(free, math.hypot(bx - x, by - y) - radius)
        return free

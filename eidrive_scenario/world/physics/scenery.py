"""Static bodies: ground, roads, buildings, road objects."""

from __future__ import annotations

import math
from collections.abc import Collection
from functools import cached_property

import numpy as np

from eidrive_scenario.roads import RoadNetwork, surface_meshes
from eidrive_scenario.world.actor import Vector3
from eidrive_scenario.world.physics.bodies import BODY_FRICTION, DRIVEN, RAYS, RESTITUTION, STATIC, TERRAIN, quaternion
from eidrive_scenario.world.physics.bullet import bullet
from eidrive_scenario.world.physics.ground import is_level
from eidrive_scenario.world.physics.obstacles import MAX_FACES, Obstacles
from eidrive_scenario.world.physics.spatial_grid import SpatialGrid, grid_cells
from eidrive_scenario.world.physics.triangle_shape import create_triangle_shape
from eidrive_scenario.world.road_objects import Building, RoadObjectBody, buildings, road_object_bodies

GROUND = "ground"


class Scenery:
    """Bodies in pybullet of ground, buildings and road objects.

    entities  ids of objects that are actors instead

    The bodies of road objects are created when a vehicle may touch them or rays are cast.
    """

    def __init__(self, client: int, roads: RoadNetwork | None, entities: Collection[str] = ()) -> None:
        self.roads = roads
        self.buildings: list[Building] = []
        self._nearby: SpatialGrid[tuple[float, float, float]] = SpatialGrid()
        """Center and radius of each building in plan view [m]."""
        self._client = client
        self._entities = frozenset(entities)
        self._names: dict[int, str] = {}
        self.level = is_level(roads)
        self._raised = False
        self._obstacles: Obstacles | None = None
        self._obstacle_handles: frozenset[int] = frozenset()
        if roads is not None:
            for building in buildings(roads, without=entities):
                self.add_building(building.name, building.center, building.size, building.yaw)

    def add_building(self, name: str, center: Vector3, size: Vector3, yaw: float, color: Vector3 | None = None) -> None:
        """Add a building that blocks vehicles and rays."""
        self.buildings.append(Building(name, center, size, yaw, color))
        radius = math.hypot(size[0], size[1]) / 2
        self._nearby.add((center[0], center[1], radius), grid_cells(center[0], center[1], radius))
        half = (size[0] / 2, size[1] / 2, size[2] / 2)
        shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half, physicsClientId=self._client)
        self._add_static(shape, center, yaw, STATIC, RAYS | DRIVEN, name)

    def raise_ground(self) -> bool:
        """Create the ground for rays if it does not exist. Return True if it was created.

        Vehicles do not need it, and on hilly roads it takes time, so that it is created for the first ray.
        """
        if self._raised:
            return False
        self._raised = True
        in_client = {"physicsClientId": self._client}
        if self.level or self.roads is None:
            plane = bullet.createCollisionShape(bullet.GEOM_PLANE, **in_client)
            # Without a visual shape pybullet loads a textured plane from a file, which takes 7 ms.
            shown = bullet.createVisualShape(bullet.GEOM_BOX, halfExtents=(0.01, 0.01, 0.01), **in_client)
            self._add_static(plane, (0.0, 0.0, 0.0), 0.0, TERRAIN, RAYS, GROUND, shown)
            return True
        for mesh in surface_meshes(self.roads, 4.0):
            if mesh.kind.startswith("marking"):
                continue
            for start in range(0, len(mesh.faces), MAX_FACES):
                used, faces = np.unique(mesh.faces[start : start + MAX_FACES], return_inverse=True)
                shape = create_triangle_shape(self._client, mesh.vertices[used], faces)
                self._add_static(shape, (0.0, 0.0, 0.0), 0.0, TERRAIN, RAYS, GROUND)
        return True

    @cached_property
    def road_objects(self) -> tuple[RoadObjectBody, ...]:
        """Road objects except buildings."""
        return tuple(road_object_bodies(self.roads, self._entities)) if self.roads is not None else ()

    def raise_obstacles(self) -> bool:
        """Create the bodies of road objects if they do not exist. Return True if they were created."""
        if self._obstacles is not None:
            return False
        self._obstacles = Obstacles(self.road_objects)
        handles = self._obstacles.raise_bodies(self._client)
        self._obstacle_handles = frozenset(handles)
        return bool(handles)

    def name_of(self, handle: int, position: Vector3) -> str:
        """Return the name of the object with this body in pybullet at a point of contact."""
        if handle in self._obstacle_handles and self._obstacles is not None:
            return self._obstacles.name_at(position[0], position[1])
        return self._names[handle]

    @property
    def highest_handle(self) -> int:
        """Maximum handle of these bodies in pybullet; -1 without any."""
        return max([*self._names, *self._obstacle_handles], default=-1)

    def clearance(self, x: float, y: float, most: float) -> float:
        """Return the distance of a point from the nearest static object, at most `most` [m]."""
        free = most if self._obstacles is None else self._obstacles.clearance(x, y, most)
        for bx, by, radius in self._nearby.query(x, y, most):
            free = min(free, math.hypot(bx - x, by - y) - radius)
        return free

    def _add_static(
        self, shape: int, at: Vector3, yaw: float, group: int, meets: int, name: str, shown: int = -1
    ) -> None:
        in_client = {"physicsClientId": self._client}
        turn = quaternion(yaw, 0.0, 0.0)
        handle = bullet.createMultiBody(
            0.0, shape, shown, basePosition=at, baseOrientation=turn, useMaximalCoordinates=1, **in_client
        )
        bullet.changeDynamics(handle, -1, lateralFriction=BODY_FRICTION, restitution=RESTITUTION, **in_client)
        bullet.setCollisionFilterGroupMask(handle, -1, group, meets, **in_client)
        self._names[handle] = name

"""Static bodies: ground, roads, buildings, road objects."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.world.actor import Vector3
from eidrive_scenario.world.physics.bodies import RAYS, TERRAIN
from eidrive_scenario.world.physics.building_bodies import BuildingBodies
from eidrive_scenario.world.physics.bullet import bullet
from eidrive_scenario.world.physics.ground import is_level
from eidrive_scenario.world.physics.obstacles import Obstacles
from eidrive_scenario.world.physics.road_scenery import covering_circles, road_scenery, standing_box
from eidrive_scenario.world.physics.spatial_grid import SpatialGrid, grid_cells
from eidrive_scenario.world.physics.static_body import create_static_body
from eidrive_scenario.world.physics.triangle_shape import create_triangle_shape
from eidrive_scenario.world.road_objects import Building, RoadObjectBody

GROUND = "ground"


class Scenery:
    """Bodies in pybullet of ground, buildings and road objects.

    entities  ids of objects that are actors instead

    The bodies of road objects are created when a vehicle may touch them or rays are cast.
    """

    def __init__(self, client: int, roads: RoadNetwork | None, entities: Collection[str] = ()) -> None:
        self.roads = roads
        self._of_roads = road_scenery(roads, frozenset(entities)) if roads is not None else None
        self.buildings: list[Building] = []
        self._nearby: SpatialGrid[tuple[float, float, float]] = SpatialGrid()
        """Center and radius of each building in plan view [m]."""
        self._client = client
        self._ground: set[int] = set()
        self.level = is_level(roads)
        self._raised = False
        self._obstacles: Obstacles | None = None
        self._obstacle_handles: frozenset[int] = frozenset()
        self._building_bodies = BuildingBodies(client)
        if self._of_roads is not None:
            self.add_buildings(self._of_roads.buildings)

    def add_buildings(self, buildings: Sequence[Building]) -> None:
        """Add buildings, which block vehicles and rays."""
        for building in buildings:
            self.buildings.append(building)
            x, y, radius = building.center[0], building.center[1], math.hypot(building.size[0], building.size[1]) / 2
            self._nearby.add((x, y, radius), grid_cells(x, y, radius))
        self._building_bodies.add(buildings)

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
        return GROUND if handle in self._ground else self._building_bodies.name_at(handle, position)

    @property
    def highest_handle(self) -> int:
        """Maximum handle of these bodies in pybullet; -1 without any."""
        return max([*self._ground, *self._building_bodies.handles, *self._obstacle_handles], default=-1)

    def clearance(self, x: float, y: float, most: float) -> float:
        """Return the distance of a point from the nearest static object, at most `most` [m]."""
        free = most if self._obstacles is None else self._obstacles.clearance(x, y, most)
        for bx, by, radius in self._nearby.query(x, y, most):
            free = min(free, math.hypot(bx - x, by - y) - radius)
        return free

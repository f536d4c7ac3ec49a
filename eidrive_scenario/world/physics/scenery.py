"""Static bodies: ground, roads, buildings, road objects; what worlds on the same roads share of them.

Road objects are merged into a few triangle meshes: each body slows down the steps of pybullet, and a road may have ten
thousand posts.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from functools import cached_property, lru_cache
from typing import Generic, TypeVar

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers, number_in_groups
from eidrive_scenario.base.geometry import footprint_distance, quaternion
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
)
from eidrive_scenario.world.road_objects import Building, RoadObjectBody, buildings, road_object_bodies
from eidrive_scenario.world.surfaces import BOX_FACES, LEVEL_GROUND, Surfaces, box_corners

StaticObject = TypeVar("StaticObject")
Cell = tuple[int, int]

SQUARE = 10.0
"""Side of a cell [m]."""
_FAR = 300.0
"""Reach from which on the occupied cells are searched instead of all cells in reach [m]: steps of many seconds."""


class SpatialGrid(Generic[StaticObject]):
    """Static objects, each in the cells that it may overlap."""

    def __init__(self) -> None:
        self._in_cell: dict[Cell, list[StaticObject]] = {}

    def add(self, static_object: StaticObject, cells: Iterable[Cell]) -> None:
        """Add an object to these cells."""
        for cell in dict.fromkeys(cells):
            self._in_cell.setdefault(cell, []).append(static_object)

    def query(self, x: float, y: float, reach: float) -> list[StaticObject]:
        """Return the objects in the cells within reach of a point [m], possibly with duplicates."""
        near: list[StaticObject] = []
        if reach > _FAR:
            side = reach + SQUARE
            for (column, line), objects in self._in_cell.items():
                if abs((column + 0.5) * SQUARE - x) <= side and abs((line + 0.5) * SQUARE - y) <= side:
                    near += objects
        elif self._in_cell:
            for cell in grid_cells(x, y, reach):
                if cell in self._in_cell:
                    near += self._in_cell[cell]
        return near


def grid_cells(x: float, y: float, reach: float) -> list[Cell]:
    """Return the cells that overlap the square around a point with half the side `reach` [m]."""
    left, right = math.floor((x - reach) / SQUARE), math.floor((x + reach) / SQUARE)
    low, high = math.floor((y - reach) / SQUARE), math.floor((y + reach) / SQUARE)
    if left == right and low == high:
        return [(left, low)]
    return [(column, line) for column in range(left, right + 1) for line in range(low, high + 1)]


MAX_FACES = 20_000
"""Maximum number of faces of a collision shape; pybullet rejects much larger ones."""
FOLIAGE = 0.8
"""Share of the extents of a crown or bush that is opaque."""
CROWN = 0.3
"""Height of the lower end of a crown as a share of the height of the tree."""


class Obstacles:
    """Road objects with a body."""

    def __init__(self, road_objects: Sequence[RoadObjectBody]) -> None:
        solid = [piece for piece in road_objects if piece.solid]
        self._solid = _merged_rails(solid)
        self.solid_boxes = [box for piece in self._solid for box in _solid_boxes(piece)]
        self.soft_boxes = [_foliage(piece) for piece in road_objects if piece.kind in ("tree", "vegetation")]
        self._nearby: SpatialGrid[int] = SpatialGrid()
        for row, piece in enumerate(self._solid):
            self._nearby.add(row, _cells(piece))

    def raise_bodies(self, client: int) -> list[int]:
        """Create the bodies in pybullet and return their handles."""
        solid = _meshes(client, self.solid_boxes, STATIC, RAYS | DRIVEN)
        return [*solid, *_meshes(client, self.soft_boxes, TERRAIN, RAYS)]

    def clearance(self, x: float, y: float, most: float) -> float:
        """Return the distance of a point from the nearest solid object, at most `most` [m]."""
        return min([most, *(_gap(self._solid[row], x, y) for row in self._nearby.query(x, y, most))])

    def name_at(self, x: float, y: float) -> str:
        """Return the name of the object at a point of contact."""
        gaps = [(_gap(self._solid[row], x, y), row) for row in self._nearby.query(x, y, SQUARE)]
        return self._solid[min(gaps)[1]].name if gaps else "obstacle"


def _merged_rails(solid: Sequence[RoadObjectBody]) -> list[RoadObjectBody]:
    """Return the bodies with collinear consecutive parts of a rail or barrier merged."""
    whole: list[RoadObjectBody] = []
    for piece in solid:
        before = whole[-1] if whole else None
        if (
            before is not None
            and not piece.radius
            and piece[:2] == before[:2]
            and (piece.width, piece.height, piece.pose.z) == (before.width, before.height, before.pose.z)
            and abs(piece.pose.h - before.pose.h) < 1e-3
            and _follows(before, piece)
        ):
            length = before.length + piece.length
            share = before.length / length
            x, y = (share * a + (1 - share) * b for a, b in zip(before.pose[:2], piece.pose[:2], strict=True))
            whole[-1] = before._replace(pose=before.pose._replace(x=x, y=y), length=length)
        else:
            whole.append(piece)
    return whole


def _follows(before: RoadObjectBody, piece: RoadObjectBody) -> bool:
    """Return whether a part starts at the end of its predecessor."""
    step = (before.length + piece.length) / 2
    cos, sin = math.cos(before.pose.h), math.sin(before.pose.h)
    dx, dy = piece.pose.x - before.pose.x - step * cos, piece.pose.y - before.pose.y - step * sin
    return math.hypot(dx, dy) < 0.05 and before.length < 200.0


Box = tuple[float, float, float, float, float, float, float]
"""Center of the bottom x, y, z, length, width, height [m], heading [rad]."""


def _solid_boxes(piece: RoadObjectBody) -> Iterator[Box]:
    x, y, z, h = piece.pose[:4]
    if piece.kind == "gantry":
        cos, sin = math.cos(h), math.sin(h)
        for side in (-piece.width / 2, piece.width / 2):
            yield x - sin * side, y + cos * side, z, 0.3, 0.3, piece.height, h
        yield x, y, z + piece.height - 0.6, 0.3, piece.width, 0.6, h
    elif piece.radius:
        # A square as large as the circle.
        side = math.sqrt(math.pi) * piece.radius
        yield x, y, z, side, side, piece.height, h
    else:
        yield x, y, z, piece.length, piece.width, piece.height, h


def _foliage(piece: RoadObjectBody) -> Box:
    x, y, z, h = piece.pose[:4]
    low = CROWN * piece.height if piece.kind == "tree" else 0.0
    return x, y, z + low, FOLIAGE * piece.length, FOLIAGE * piece.width, piece.height - low, h


def _meshes(client: int, boxes: Sequence[Box], group: int, meets: int) -> Iterator[int]:
    for start in range(0, len(boxes), MAX_FACES // len(BOX_FACES)):
        vertices = box_corners(np.array(boxes[start : start + MAX_FACES // len(BOX_FACES)]))
        faces = (BOX_FACES[None] + 8 * np.arange(len(vertices))[:, None, None]).reshape(-1, 3)
        shape = create_triangle_shape(client, vertices.reshape(-1, 3), faces)
        yield create_static_body(client, shape, group, meets)


def _cells(piece: RoadObjectBody) -> Iterator[Cell]:
    """Yield the grid cells that a body may overlap: those of a row of squares along it, which cover it."""
    extent, side = max(piece.length, piece.width, 2 * piece.radius), min(piece.length, piece.width)
    parts = max(math.ceil(extent / SQUARE), 1)
    cos, sin = math.cos(piece.pose.h), math.sin(piece.pose.h)
    dx, dy = (cos, sin) if piece.length >= piece.width else (-sin, cos)
    for part in range(parts):
        at = ((part + 0.5) / parts - 0.5) * extent
        reach = max(math.hypot(extent / parts, side) / 2, piece.radius)
        yield from grid_cells(piece.pose.x + at * dx, piece.pose.y + at * dy, reach)


def _gap(piece: RoadObjectBody, x: float, y: float) -> float:
    """Return the distance of a point outside of a body [m]."""
    dx, dy = x - piece.pose.x, y - piece.pose.y
    if piece.radius:
        return max(math.hypot(dx, dy) - piece.radius, 0.0)
    cos, sin = math.cos(piece.pose.h), math.sin(piece.pose.h)
    along, lateral = abs(cos * dx + sin * dy), abs(cos * dy - sin * dx)
    return math.hypot(max(along - piece.length / 2, 0.0), max(lateral - piece.width / 2, 0.0))


_SPACING = 4.0
"""Distance of the points of the ground along a road [m]."""
_SHORTEST = 4.0
"""Minimum length of a part of a body that has a separate circle [m]."""
_NEIGHBORS = 32
"""Number of triangles of the ground in a group of surfaces."""
_MAX_KEPT = 2
"""Maximum number of road networks whose objects stay in the process."""


class RoadScenery:
    """Static objects of a road network, computed when they are first used; only level ground without one.

    entities  ids of objects that are actors instead
    """

    def __init__(self, roads: RoadNetwork | None, entities: frozenset[str]) -> None:
        self._roads = roads
        self._entities = entities
        self.level = roads is None or roads.is_level

    @cached_property
    def buildings(self) -> Sequence[Building]:
        """Buildings."""
        return () if self._roads is None else tuple(buildings(self._roads, self._entities))

    @cached_property
    def road_objects(self) -> Sequence[RoadObjectBody]:
        """Road objects except buildings."""
        return () if self._roads is None else tuple(road_object_bodies(self._roads, self._entities))

    @cached_property
    def obstacles(self) -> Obstacles:
        """Road objects with a body."""
        return Obstacles(self.road_objects)

    @cached_property
    def circles(self) -> Array:
        """Circles (4, K) in plan view that cover all bodies: center x, y, radius, and top of the body [m]."""
        return covering_circles(self._boxes)

    @property
    def _boxes(self) -> list[Box]:
        return [*self.obstacles.solid_boxes, *self.obstacles.soft_boxes, *(each.box for each in self.buildings)]

    @cached_property
    def surfaces(self) -> Surfaces:
        """Surfaces of the ground and of all bodies."""
        ground = LEVEL_GROUND
        if not self.level:
            triangles = [vertices[faces] for vertices, faces in self.ground]
            ground = Surfaces.group(np.concatenate(triangles), _NEIGHBORS)
        return Surfaces.join(ground, Surfaces.of_boxes(np.array(self._boxes)))

    @cached_property
    def ground(self) -> Sequence[tuple[Array, Integers]]:
        """Meshes of the ground on hilly roads: vertices (N, 3) [m], faces (M, 3) of rows in them."""
        parts = []
        for mesh in [] if self._roads is None else surface_meshes(self._roads, _SPACING):
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
    # A box is cut along its longer side into parts that are about as long as wide, each with its circle.
    count = np.ceil(long / np.maximum(wide, _SHORTEST)).clip(1.0).astype(int)
    of, number = number_in_groups(count)
    part = (long / count)[of]
    along = (number + 0.5) * part - long[of] / 2.0
    center_x, center_y = x[of] + along * np.cos(yaw[of]), y[of] + along * np.sin(yaw[of])
    return np.stack([center_x, center_y, np.hypot(part, wide[of]) / 2.0, (bottom + height)[of]])


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
        self._of_roads = _shared_scenery(roads, frozenset(entities))
        self.buildings: list[Building] = []
        self._nearby: SpatialGrid[tuple[float, float, float]] = SpatialGrid()
        """Center and radius of each building in plan view [m]."""
        self._client = client
        self._ground: set[int] = set()
        self.level = self._of_roads.level
        self._raised = False
        self._obstacles: Obstacles | None = None
        self._obstacle_handles: frozenset[int] = frozenset()
        self._built: dict[int, Sequence[Building]] = {}
        """Buildings of each body in pybullet, which takes 0.2 ms to create one, whatever its shape."""
        self.add_buildings(self._of_roads.buildings)

    def add_buildings(self, buildings: Sequence[Building]) -> None:
        """Add buildings, which block vehicles and rays."""
        for cached in ("circles", "surfaces"):  # of the buildings so far
            vars(self).pop(cached, None)
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
                collisionFrameOrientations=[quaternion(building.yaw) for building in some],
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
        if self.level:
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
        return self._of_roads.road_objects

    def raise_obstacles(self) -> bool:
        """Create the bodies of road objects if they do not exist. Return True if they were created."""
        if self._obstacles is not None:
            return False
        self._obstacles = self._of_roads.obstacles
        self._obstacle_handles = frozenset(self._obstacles.raise_bodies(self._client))
        return bool(self._obstacle_handles)

    @cached_property
    def circles(self) -> Array:
        """Circles (4, K) in plan view that cover all static objects: center x, y, radius, and top [m]."""
        return np.concatenate([self._of_roads.circles, covering_circles(self._added_boxes)], axis=1)

    @cached_property
    def surfaces(self) -> Surfaces:
        """Surfaces of the ground and of all static objects."""
        of_roads, added = self._of_roads.surfaces, self._added_boxes
        return Surfaces.join(of_roads, Surfaces.of_boxes(np.array(added))) if added else of_roads

    @property
    def _added_boxes(self) -> list[Box]:
        """Buildings that the road network does not have."""
        return [building.box for building in self.buildings[len(self._of_roads.buildings) :]]

    def name_of(self, handle: int, position: Vector3) -> str:
        """Return the name of the object with this body in pybullet at a point of contact."""
        if handle in self._obstacle_handles and self._obstacles is not None:
            return self._obstacles.name_at(position[0], position[1])
        if handle in self._ground:
            return GROUND
        point = (*position, 0.0, 0.0, 0.0, 0.0)
        return min(self._built[handle], key=lambda building: footprint_distance(building.box, point)).name

    @property
    def handles(self) -> set[int]:
        """Handles of these bodies in pybullet."""
        return {*self._ground, *self._built, *self._obstacle_handles}

    @property
    def highest_handle(self) -> int:
        """Maximum handle of these bodies in pybullet; -1 without any."""
        return max(self.handles, default=-1)

    def clearance(self, x: float, y: float, most: float) -> float:
        """Return the distance of a point from the nearest static object, at most `most` [m]."""
        free = most if self._obstacles is None else self._obstacles.clearance(x, y, most)
        for bx, by, radius in self._nearby.query(x, y, most):
            free = min(free, math.hypot(bx - x, by - y) - radius)
        return free

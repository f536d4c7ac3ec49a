"""What does not move: the ground, the roads on it, buildings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from eidrive_scenario.world.actor import Vector3
from eidrive_scenario.world.bodies import BODY_FRICTION, DRIVEN, RAYS, RESTITUTION, STATIC, quaternion
from eidrive_scenario.world.bullet import bullet
from eidrive_scenario.world.ground import is_level

if TYPE_CHECKING:
    from eidrive_scenario.roads import RoadNetwork
    from eidrive_scenario.roads.model import RoadObject


@dataclass(frozen=True)
class Building:
    """A box that stands on the ground: centre [m], length, width, height [m], heading [rad]."""

    name: str
    centre: Vector3
    size: Vector3
    yaw: float
    colour: Vector3 | None = None


class Scenery:
    """The bodies in pybullet of ground and buildings, those of the road network's objects included."""

    def __init__(self, client: int, roads: RoadNetwork | None) -> None:
        self.roads = roads
        self.buildings: list[Building] = []
        self._client = client
        self._names: dict[int, str] = {}
        self.level = is_level(roads)
        if self.level:
            plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=client)
            self._add_static(plane, (0.0, 0.0, 0.0), 0.0, RAYS, "ground")
        if roads is not None:
            for entry in roads.objects:
                if entry.type == "building":
                    building = _building(roads, entry)
                    self.add_building(building.name, building.centre, building.size, building.yaw)

    def add_building(
        self, name: str, centre: Vector3, size: Vector3, yaw: float, colour: Vector3 | None = None
    ) -> None:
        """Put up a building that stops vehicles and rays."""
        self.buildings.append(Building(name, centre, size, yaw, colour))
        half = (size[0] / 2, size[1] / 2, size[2] / 2)
        shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=half, physicsClientId=self._client)
        self._add_static(shape, centre, yaw, RAYS | DRIVEN, name)

    def name_of(self, handle: int) -> str:
        """The name of the building with this body in pybullet."""
        return self._names[handle]

    @property
    def highest_handle(self) -> int:
        """The greatest number that pybullet gave to any of these bodies; -1 without any."""
        return max(self._names, default=-1)

    def near(self, x: float, y: float, reach: float) -> bool:
        """Whether any building may be within reach of a point [m]."""
        for building in self.buildings:
            bound = reach + math.hypot(building.size[0], building.size[1]) / 2
            if math.hypot(building.centre[0] - x, building.centre[1] - y) <= bound:
                return True
        return False

    def _add_static(self, shape: int, at: Vector3, yaw: float, meets: int, name: str) -> None:
        here = {"physicsClientId": self._client}
        handle = bullet.createMultiBody(
            0.0, shape, basePosition=at, baseOrientation=quaternion(yaw, 0.0, 0.0), useMaximalCoordinates=1, **here
        )
        bullet.changeDynamics(handle, -1, lateralFriction=BODY_FRICTION, restitution=RESTITUTION, **here)
        bullet.setCollisionFilterGroupMask(handle, -1, STATIC, meets, **here)
        self._names[handle] = name


def _building(roads: RoadNetwork, entry: RoadObject) -> Building:
    """The box around an object of the road network."""
    pose = roads.road_pose_at(entry.road, entry.s, entry.t)
    yaw = pose.h + entry.heading
    name = entry.name or f"building {entry.id}"
    cos, sin = math.cos(yaw), math.sin(yaw)
    corners = []
    height, bottom = entry.height, 0.0
    for corner in entry.outlines[0] if entry.outlines else ():
        height = max(height, corner.height)
        if corner.on_road:
            at = roads.road_pose_at(entry.road, corner.x, corner.y)
            dx, dy = at.x - pose.x, at.y - pose.y
            corners.append((cos * dx + sin * dy, cos * dy - sin * dx))
        else:
            corners.append((corner.x, corner.y))
        bottom = min(bottom, corner.z)
    if corners:
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    else:
        length, width = (entry.length, entry.width) if entry.length else (2 * entry.radius, 2 * entry.radius)
        low, high = np.array([-length / 2, -width / 2]), np.array([length / 2, width / 2])
    mx, my = ((low + high) / 2).tolist()
    length, width = (high - low).tolist()
    centre = (
        pose.x + cos * mx - sin * my,
        pose.y + sin * mx + cos * my,
        pose.z + entry.z_offset + bottom + height / 2,
    )
    return Building(name, centre, (length, width, height), yaw)

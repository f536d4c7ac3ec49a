"""Bodies of buildings in pybullet, which block vehicles and rays.

Several buildings have one body, since pybullet takes 0.2 ms to create one, whatever its shape.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from eidrive_scenario.geometry import footprint_distance
from eidrive_scenario.world.actor import Vector3
from eidrive_scenario.world.physics.bodies import DRIVEN, RAYS, STATIC, quaternion
from eidrive_scenario.world.physics.bullet import bullet
from eidrive_scenario.world.physics.static_body import create_static_body
from eidrive_scenario.world.road_objects import Building

MOST = 16
"""Maximum number of boxes of a shape in pybullet."""


class BuildingBodies:
    """Bodies of buildings in pybullet."""

    def __init__(self, client: int) -> None:
        self._client = client
        self._buildings: dict[int, Sequence[Building]] = {}
        """Buildings of each body, by its handle."""

    @property
    def handles(self) -> Sequence[int]:
        """Handles of the bodies in pybullet."""
        return tuple(self._buildings)

    def add(self, buildings: Sequence[Building]) -> None:
        """Create the bodies of buildings."""
        for some in _groups(buildings):
            self._buildings[self._create(some)] = some

    def name_at(self, handle: int, position: Vector3) -> str:
        """Return the name of the building of a body that is nearest to a point of contact."""
        point = (*position, 0.0, 0.0, 0.0, 0.0)
        return min(self._buildings[handle], key=lambda one: footprint_distance(one.box, point)).name

    def _create(self, buildings: Sequence[Building]) -> int:
        shape = bullet.createCollisionShapeArray(
            [bullet.GEOM_BOX] * len(buildings),
            halfExtents=[[extent / 2 for extent in one.size] for one in buildings],
            collisionFramePositions=[one.center for one in buildings],
            collisionFrameOrientations=[quaternion(one.yaw, 0.0, 0.0) for one in buildings],
            physicsClientId=self._client,
        )
        return create_static_body(self._client, shape, STATIC, RAYS | DRIVEN)


def _groups(buildings: Sequence[Building]) -> Iterator[Sequence[Building]]:
    for start in range(0, len(buildings), MOST):
        yield buildings[start : start + MOST]

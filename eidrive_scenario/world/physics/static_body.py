"""Static rigid bodies in pybullet."""

from __future__ import annotations

from eidrive_scenario.world.physics.bodies import BODY_FRICTION, RESTITUTION
from eidrive_scenario.world.physics.bullet import bullet


def create_static_body(client: int, shape: int, group: int, meets: int, visual: int = -1) -> int:
    """Create a body at the origin, and return its handle.

    group, meets  groups of the collision filter: its own, and those of the bodies and rays that it blocks
    visual        visual shape; -1 for the one of the collision shape
    """
    here = {"physicsClientId": client}
    handle: int = bullet.createMultiBody(0.0, shape, visual, useMaximalCoordinates=1, **here)
    bullet.changeDynamics(handle, -1, lateralFriction=BODY_FRICTION, restitution=RESTITUTION, **here)
    bullet.setCollisionFilterGroupMask(handle, -1, group, meets, **here)
    return handle

"""Image of an ideal camera in a world that has a picture maker."""

from __future__ import annotations

from collections.abc import Iterable

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.rendering.tone_mapping import ideal_image
from eidrive_scenario.world import World
from eidrive_scenario.world.camera import CameraImage, Pinhole


def camera_image(
    world: World, pose: Array, width: int, height: int, fov: float, *, ignore: Iterable[str] = ()
) -> CameraImage:
    """Return the image of a camera at a pose (4, 4) with a horizontal field of view [rad]."""
    return ideal_image(world.radiance(pose, Pinhole.of_fov(width, height, fov, far=300.0), ignore=ignore))

"""What sensors ask of the world: rays and pictures. `eidrive_scenario.world.World` answers."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NOTHING = -2
"""In RayHits.rows: the ray met nothing. -1 is the ground, the road or a building."""


class RayHits(Protocol):
    """Where each of M rays ended first."""

    @property
    def rows(self) -> NDArray[Any]:
        """(M,) row of the actor in the world's view, -1 for what is no actor, NOTHING."""

    @property
    def fraction(self) -> Array:
        """(M,) share of the way from origin to target, 1 where nothing was met."""


class Scene(Protocol):
    """The part of the world that sensors see."""

    def cast(self, origins: Array, targets: Array) -> RayHits:
        """Rays from (M, 3) to (M, 3) [m]."""

    def camera(
        self, pose: Array, width: int, height: int, fov: float, near: float, far: float
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int32]]:
        """Colour, depth and segmentation of a pinhole camera: pose (4, 4) camera to world, fov horizontal [rad]."""

"""Interface between sensors and the world: rays and images. `eidrive_scenario.world.World` implements it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.world.camera import Pinhole, Radiance
from eidrive_scenario.world.weather import Weather

Point = tuple[float, float, float]

NOTHING = -2
"""Value of RayHits.rows for rays without a hit. -1 is the ground, the road or a building."""


class RayHitsView(Protocol):
    """First hit of each of M rays."""

    @property
    def rows(self) -> NDArray[Any]:
        """Row (M,) of the actor in the view of the world, -1 for other objects, or NOTHING."""

    @property
    def fraction(self) -> Array:
        """Share (M,) of the distance from origin to target, 1 without a hit."""

    @property
    def normal(self) -> Array:
        """Normals (M, 3) of the surfaces, zero without a hit."""


class UndrawnImage(Protocol):
    """Image whose content is fixed, but that is not drawn yet."""

    @property
    def digest(self) -> bytes:
        """Digest of everything that determines the image: equal digests mean equal images."""

    def draw(self) -> Radiance:
        """Return the light that reaches the camera."""


class Scene(Protocol):
    """Part of the world that sensors measure."""

    @property
    def weather(self) -> Weather:
        """Current weather."""

    def raycast(self, origins: Array, targets: Array, *, sensor: str = "") -> RayHitsView:
        """Cast rays from (M, 3) to (M, 3) [m] for the sensor of this name, from which some actors may be hidden."""

    def scan(
        self, own: int, apex: Array, origins: Array, targets: Array, near: NDArray[np.bool_], *, sensor: str = ""
    ) -> RayHitsView:
        """Return the same as `raycast` for many rays on lines through one point (3,) of the actor in the row `own`.

        near  (M,) rays that may hit this actor
        """

    def first_hit(self, origins: Sequence[Sequence[float]], targets: Sequence[Sequence[float]]) -> Sequence[int]:
        """Return the same rows as `raycast`, for a few rays in scalar arithmetic."""

    def is_free(self, own: int, origin: Point, target: int) -> bool:
        """Return True if certainly nothing is between a point of an actor and the box of another, by their rows."""

    def radiance(self, pose: Array, pinhole: Pinhole, *, ignore: Iterable[str] = ()) -> Radiance:
        """Return the light that a camera receives; pose (4, 4) camera to world, x right, y down, z forward."""

    def image(self, pose: Array, pinhole: Pinhole, *, ignore: Iterable[str] = ()) -> UndrawnImage:
        """Return the same image before it is drawn. It shows the current time, also if it is drawn later."""

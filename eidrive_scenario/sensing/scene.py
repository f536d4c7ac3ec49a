"""What sensors ask of the world: rays and pictures. `eidrive_scenario.world.World` answers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Protocol

from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.world.camera import Pinhole, Radiance
from eidrive_scenario.world.weather import Weather

Point = tuple[float, float, float]

NOTHING = -2
"""In RayHits.rows: the ray met nothing. -1 is the ground, the road or a building."""


class RayHitsView(Protocol):
    """Where each of M rays ended first."""

    @property
    def rows(self) -> NDArray[Any]:
        """(M,) row of the actor in the world's view, -1 for what is no actor, NOTHING."""

    @property
    def fraction(self) -> Array:
        """(M,) share of the way from origin to target, 1 where nothing was met."""

    @property
    def normal(self) -> Array:
        """(M, 3) of the surfaces met, zero where nothing was."""


class Scene(Protocol):
    """The part of the world that sensors see."""

    @property
    def weather(self) -> Weather:
        """The weather at present."""

    def raycast(self, origins: Array, targets: Array, *, sensor: str = "") -> RayHitsView:
        """Rays from (M, 3) to (M, 3) [m], of the sensor of this name, which may not see some actors."""

    def first_hit(self, origins: Sequence[Point], targets: Sequence[Point]) -> Sequence[int]:
        """The same rows as of `raycast`, for a few rays in plain numbers."""

    def radiance(self, pose: Array, pinhole: Pinhole, *, ignore: Iterable[str] = ()) -> Radiance:
        """The light that a camera receives; pose (4, 4) camera to world, x right, y down, z forward."""

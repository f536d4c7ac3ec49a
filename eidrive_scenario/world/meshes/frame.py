"""What a mesh is built into, and the wheels that many share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eidrive_scenario.world.meshes.solids import Mesh, cylinder


@dataclass(frozen=True)
class Frame:
    """The bounding box of an actor: origin at its centre on the ground, x forward; all in metres.

    front, rear  x of the axles
    """

    length: float
    width: float
    height: float
    front: float
    rear: float
    wheel_radius: float

    def x(self, share: float) -> float:
        """x at a share of the length, 0 at the rear end and 1 at the front."""
        return (share - 0.5) * self.length

    def z(self, share: float) -> float:
        """z at a share of the height."""
        return share * self.height

    @property
    def side(self) -> float:
        """Half the width."""
        return self.width / 2


def add_wheels(mesh: Mesh, frame: Frame, side: float, tyre: float, *, axles: tuple[float, ...] = ()) -> None:
    """Wheels, `tyre` wide, with rims and dark arches, whose outer faces lie at y = ±side."""
    radius = frame.wheel_radius
    for x in axles or (frame.front, frame.rear):
        arch = cylinder((x, side - tyre, radius), (x, side - 0.012, radius), 1.16 * radius, sides=18)
        arch[..., 2] = np.maximum(arch[..., 2], 0.5 * radius)
        mesh.add_mirrored("trim", arch)
        mesh.add_mirrored("tyre", cylinder((x, side - tyre, radius), (x, side, radius), radius, sides=18))
        mesh.add_mirrored("rim", cylinder((x, side - 0.05, radius), (x, side + 0.006, radius), 0.64 * radius, sides=12))
        mesh.add_mirrored("trim", cylinder((x, side, radius), (x, side + 0.01, radius), 0.18 * radius, sides=8))

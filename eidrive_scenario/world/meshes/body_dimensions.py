"""Dimensions of the body of an actor, and wheels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eidrive_scenario.world.actor import ExtraAxle
from eidrive_scenario.world.meshes.solids import Mesh, cylinder


@dataclass(frozen=True)
class BodyDimensions:
    """Bounding box of an actor: origin at its center on the ground, x forward; all in meters.

    front, rear  x of the axles
    """

    length: float
    width: float
    height: float
    front: float
    rear: float
    wheel_radius: float
    extra_axles: tuple[ExtraAxle, ...] = ()
    """Additional axles; their x is in the frame of front and rear."""

    def x(self, share: float) -> float:
        """Return x at a share of the length, 0 at the rear end and 1 at the front."""
        return (share - 0.5) * self.length

    def z(self, share: float) -> float:
        """Return z at a share of the height."""
        return share * self.height

    @property
    def side(self) -> float:
        """Half the width."""
        return self.width / 2


def add_wheels(mesh: Mesh, frame: BodyDimensions, side: float, tire: float, *, axles: tuple[float, ...] = ()) -> None:
    """Add wheels of width `tire` with rims and dark arches, whose outer faces are at y = ±side.

    By default the wheels of all axles are added; the body then hides their inner parts.
    """
    for x in axles or (frame.front, frame.rear):
        _add_pair(mesh, x, frame.wheel_radius, side, tire)
    for axle in () if axles else frame.extra_axles:
        _add_pair(mesh, axle.x, axle.wheel_radius or frame.wheel_radius, side, tire)


def add_extra_wheels(mesh: Mesh, frame: BodyDimensions, side: float, tire: float, steered: float | None = None) -> None:
    """Add the wheels of additional axles below a body with their track widths, within y = ±side.

    tire     width of a wheel, or of twin tires
    steered  width for a steered axle, if it differs
    """
    for axle in frame.extra_axles:
        wide = steered if steered is not None and axle.max_steering > 0.0 else tire
        outer = min((axle.track + wide) / 2, side) if axle.track > 0.0 else side
        _add_pair(mesh, axle.x, axle.wheel_radius or frame.wheel_radius, max(outer, wide), wide)


def _add_pair(mesh: Mesh, x: float, radius: float, side: float, tire: float) -> None:
    arch = cylinder((x, side - tire, radius), (x, side - 0.012, radius), 1.16 * radius, sides=18)
    arch[..., 2] = np.maximum(arch[..., 2], 0.5 * radius)
    mesh.add_mirrored("trim", arch)
    mesh.add_mirrored("tire", cylinder((x, side - tire, radius), (x, side, radius), radius, sides=18))
    mesh.add_mirrored("rim", cylinder((x, side - 0.05, radius), (x, side + 0.006, radius), 0.64 * radius, sides=12))
    mesh.add_mirrored("trim", cylinder((x, side, radius), (x, side + 0.01, radius), 0.18 * radius, sides=8))

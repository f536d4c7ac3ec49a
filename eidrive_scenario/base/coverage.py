"""Coverage of sensors: the sectors in which they detect objects, and the regions that a station perceives."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array, Bools


class ViewSector(msgspec.Struct, frozen=True):
    """Horizontal sector around a sensor, in the frame of the actor or of the world.

    x, y, z  position [m];  yaw  of its axis [rad];  half_angle  half of the opening angle [rad];  range  [m]
    """

    x: float
    y: float
    z: float
    yaw: float
    half_angle: float
    range: float

    def contains(self, x: Array, y: Array, radius: Array | float = 0.0) -> Bools:
        """Return whether discs (N,) with these centers and radii [m] are wholly inside."""
        dx, dy = x - self.x, y - self.y
        distance = np.hypot(dx, dy)
        inside = distance + radius <= self.range
        if self.half_angle < math.pi:
            turn = np.abs((np.arctan2(dy, dx) - self.yaw + math.pi) % (2.0 * math.pi) - math.pi)
            width = np.arcsin(np.minimum(radius / np.maximum(distance, 1e-9), 1.0))
            inside &= turn + width <= self.half_angle
        return np.asarray(inside)

    def placed(self, x: float, y: float, z: float, yaw: float) -> ViewSector:
        """Return the sector in the world, if this one is in the frame of an actor at this pose [m, rad]."""
        cos, sin = math.cos(yaw), math.sin(yaw)
        return ViewSector(
            x + cos * self.x - sin * self.y,
            y + sin * self.x + cos * self.y,
            z + self.z,
            yaw + self.yaw,
            self.half_angle,
            self.range,
        )


class PerceptionRegion(msgspec.Struct, frozen=True):
    """Region that the sensors of a station perceived: sectors in the world, and the time of the measurement [s].

    What is behind an object in these sectors is not perceived: perception regions of ETSI TS 103 324 whose shadows the
    receiver determines from the perceived objects.
    """

    station: str
    time: float
    sectors: tuple[ViewSector, ...]

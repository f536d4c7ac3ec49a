"""Coverage of sensors: the horizontal sectors in which they detect objects."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array, Bools
from eidrive_scenario.sensing.mounting import mounting
from eidrive_scenario.sensing.settings import CameraSettings, SensorSettings
from eidrive_scenario.world.actor import ActorSpec


class ViewSector(NamedTuple):
    """Horizontal sector around a sensor, in the frame of the actor.

    x, y  position [m];  yaw  of its axis [rad];  half_angle  half of the opening angle [rad];  range  [m]
    """

    x: float
    y: float
    yaw: float
    half_angle: float
    range: float

    def contains(self, x: Array, y: Array, radius: Array) -> Bools:
        """Return whether discs (N,) with these centers in the frame of the actor and radii [m] are wholly inside."""
        dx, dy = x - self.x, y - self.y
        distance = np.hypot(dx, dy)
        inside = distance + radius <= self.range
        if self.half_angle < math.pi:
            turn = np.abs((np.arctan2(dy, dx) - self.yaw + math.pi) % (2.0 * math.pi) - math.pi)
            width = np.arcsin(np.minimum(radius / np.maximum(distance, 1e-9), 1.0))
            inside &= turn + width <= self.half_angle
        return np.asarray(inside)


def view_sectors(sensors: Iterable[SensorSettings], spec: ActorSpec) -> tuple[ViewSector, ...]:
    """Return the sectors of sensors on a body. A sensor without a setting for its opening angle covers all directions,
    one without `range` is not limited."""
    found = []
    for settings in sensors:
        mount = mounting(settings, spec, "front" if isinstance(settings, CameraSettings) else "roof")
        angle = math.radians(getattr(settings, "fov", getattr(settings, "field_of_view", 360.0)))
        found.append(ViewSector(mount.x, mount.y, mount.yaw, angle / 2.0, getattr(settings, "range", math.inf)))
    return tuple(found)

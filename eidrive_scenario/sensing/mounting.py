"""Mounting of sensors on a body, and their poses in the world."""

from __future__ import annotations

import math
from collections.abc import Iterable

import msgspec
import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.coverage import ViewSector
from eidrive_scenario.geometry import rotation_matrix
from eidrive_scenario.sensing.settings import CameraSettings, Mount, SensorSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import WorldView

ABOVE_ROOF = 0.41
"""Height of a roof sensor above the body: 1.90 m on a car of 1.49 m [m]."""
AHEAD_OF_BUMPER = 0.054
"""Distance of the front camera ahead of the body: 2.5 m ahead of the center of a car of 4.892 m [m]."""

_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Camera axes (x right, y down, z forward) as columns in a frame of x forward, y left, z up."""


class Mounting(msgspec.Struct, frozen=True):
    """Pose of a sensor in the frame of the actor: position [m], yaw to the left and pitch downwards [rad]."""

    x: float
    y: float
    z: float
    yaw: float = 0.0
    pitch: float = 0.0

    def position(self, view: WorldView, row: int) -> tuple[float, float, float]:
        """Return the position in the world [m]."""
        x, y, z, yaw, pitch, roll, *_ = view.states[row]
        if pitch or roll:
            along, aside, up = (rotation_matrix(yaw, pitch, roll) @ (self.x, self.y, self.z)).tolist()
            return x + along, y + aside, z + up
        cos, sin = math.cos(yaw), math.sin(yaw)
        return x + cos * self.x - sin * self.y, y + sin * self.x + cos * self.y, z + self.z

    def pose(self, view: WorldView, row: int) -> Array:
        """Return the pose (4, 4) sensor to world, sensor frame x forward, y left, z up."""
        body = rotation_matrix(view.yaw[row], view.pitch[row], view.roll[row])
        pose = np.eye(4)
        pose[:3, :3] = body @ rotation_matrix(self.yaw, self.pitch)
        pose[:3, 3] = view.position[row] + body @ (self.x, self.y, self.z)
        return pose

    def camera_pose(self, view: WorldView, row: int) -> Array:
        """Return the pose (4, 4) camera to world, camera frame x right, y down, z forward."""
        pose = self.pose(view, row)
        pose[:3, :3] = pose[:3, :3] @ _OPTICAL
        return pose


def mounting(settings: SensorSettings, spec: ActorSpec, usual: str) -> Mounting:
    """Return the mounting that the settings select on this body; `usual` is the default of the kind of sensor.

    The named mounts are those of EI-Drive on a Lincoln MKZ, transferred to other bodies: they are relative to the
    center of the outline of the body, at ground level. On a body without wheels (a mast) all are at its top.
    """
    mount = settings.mount if settings.mount is not None else usual
    if isinstance(mount, Mount):
        return Mounting(mount.x, mount.y, mount.z, math.radians(mount.yaw), math.radians(mount.pitch))
    center_x, center_y, center_z = spec.offset
    top = center_z + spec.size[2] / 2.0
    yaw = math.radians({"left": 100.0, "right": -100.0, "back": 180.0}.get(mount, 0.0))
    if not spec.has_wheels:
        return Mounting(center_x, center_y, top, yaw)
    x, y, z = {
        "front": (spec.size[0] / 2.0 + AHEAD_OF_BUMPER, 0.0, 1.0),
        "left": (0.0, 0.3, top + ABOVE_ROOF - 0.1),
        "right": (0.0, -0.3, top + ABOVE_ROOF - 0.1),
        "back": (-2.0, 0.0, top + ABOVE_ROOF - 0.1),
        "roof": (-0.5, 0.0, top + ABOVE_ROOF),
    }[mount]
    return Mounting(center_x + x, center_y + y, z, yaw)


def view_sectors(sensors: Iterable[SensorSettings], spec: ActorSpec) -> tuple[ViewSector, ...]:
    """Return the sectors of sensors on a body. A sensor without a setting for its opening angle covers all directions,
    one without `range` is not limited."""
    found = []
    for settings in sensors:
        mount = mounting(settings, spec, "front" if isinstance(settings, CameraSettings) else "roof")
        angle = math.radians(getattr(settings, "fov", getattr(settings, "field_of_view", 360.0)))
        found.append(
            ViewSector(mount.x, mount.y, mount.z, mount.yaw, angle / 2.0, getattr(settings, "range", math.inf))
        )
    return tuple(found)

"""Poses of OPV2V: [x, y, z, roll, yaw, pitch] in meters and degrees, in a left-handed world.

The world of OPV2V is that of CARLA: x forward, y to the right, z up. It is this world mirrored at y = 0, so that y
and yaw have the other sign. OPV2V measures pitch upwards, this project downwards. Roll is the same.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import rigid_transform, rotation_matrix
from eidrive_scenario.export.geometry import angles

MIRROR: Array = np.diag([1.0, -1.0, 1.0, 1.0])
"""Reflection (4, 4) between a frame of this project and that of OPV2V."""


def opv2v_pose(matrix: Array) -> list[float]:
    """Return the pose of OPV2V of a right-handed pose (4, 4)."""
    yaw, pitch, roll = angles(matrix[:3, :3])
    x, y, z = matrix[:3, 3].tolist()
    return [x, -y, z, math.degrees(roll), -math.degrees(yaw), -math.degrees(pitch)]


def pose_matrix(pose: Sequence[float]) -> Array:
    """Return the right-handed pose (4, 4) of a pose of OPV2V."""
    x, y, z, roll, yaw, pitch = pose
    turn = rotation_matrix(-math.radians(yaw), -math.radians(pitch), math.radians(roll))
    return rigid_transform(turn, (x, -y, z))

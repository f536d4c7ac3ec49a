"""Poses of bounding boxes in world and vehicle coordinates."""

from __future__ import annotations

import math

import numpy as np

from eidrive_scenario.arrays import Array


def rotations(yaw: Array, pitch: Array, roll: Array) -> Array:
    """Return the matrices (N, 3, 3) of z-y'-x'' rotations, which turn vectors of the bodies into the world."""
    cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def angles(turn: Array) -> tuple[float, float, float]:
    """Return yaw, pitch and roll of a rotation matrix (3, 3), the inverse of `rotations` [rad]."""
    (xx, _, _), (yx, _, _), (zx, zy, zz) = turn.tolist()
    return math.atan2(yx, xx), math.asin(min(max(-zx, -1.0), 1.0)), math.atan2(zy, zz)


def quaternion(yaw: float, pitch: float = 0.0, roll: float = 0.0) -> tuple[float, float, float, float]:
    """Return x, y, z, w of a z-y'-x'' rotation [rad]."""
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )

"""Projection between the world and the pixels of a camera."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.perception.geometry.lidar_geometry import LevelFrame
from eidrive_scenario.sensing.readings import CameraReading

NEAREST = 0.1
"""Minimum depth along the optical axis of a point in the image [m]."""


def pixels(points: Array, camera: CameraReading) -> tuple[Array, Array]:
    """Return image positions (N, 2) of world points (N, 3) [px], and depths (N,) along the optical axis [m].

    Positions of points that are not in front of the camera are NaN. The distortion is Brown's, as in OpenCV. So far off
    the optical axis that it would return towards the axis, points have no position either: they are outside the image.
    """

    import cv2

    inverse = camera.pose[:3, :3].T
    in_camera = (points - camera.pose[:3, 3]) @ inverse.T
    found = np.full((len(points), 2), np.nan)
    ahead = in_camera[:, 2] > NEAREST
    limit = _largest_radius(*camera.distortion.tolist())
    if limit < math.inf:
        ahead &= np.hypot(in_camera[:, 0], in_camera[:, 1]) < limit * in_camera[:, 2]
    if ahead.any():
        plane: Any
        plane, _ = cv2.projectPoints(
            np.ascontiguousarray(in_camera[ahead]), np.zeros(3), np.zeros(3), camera.intrinsics, camera.distortion
        )
        found[ahead] = plane[:, 0]
    return found, in_camera[:, 2]


@lru_cache(maxsize=64)
def _largest_radius(k1: float, k2: float, p1: float, p2: float, k3: float) -> float:
    """Return the distance from the axis at depth 1 up to which the distorted one increases in every direction.

    At radius r, p1 and p2 move a point by at most 3 |p| r². Infinite without such a limit.
    """
    if not any((k1, k2, p1, p2, k3)):
        return math.inf
    slope = [1.0, -6.0 * math.hypot(p1, p2), 3.0 * k1, 0.0, 5.0 * k2, 0.0, 7.0 * k3]
    roots = np.polynomial.Polynomial(slope).trim().roots()
    return min((root.real for root in roots.tolist() if root.real > 0.0 and abs(root.imag) < 1e-9), default=math.inf)


def straight_boxes(boxes: Array, camera: CameraReading) -> Array:
    """Return boxes (N, 4) [px] in the plane at distance 1 from an undistorted camera: left, top, right, bottom.

    The middle of each edge is transformed.
    """

    import cv2

    x0, y0, x1, y1 = boxes.T
    x, y = (x0 + x1) / 2.0, (y0 + y1) / 2.0
    middles = np.stack([np.stack([x0, y], 1), np.stack([x, y0], 1), np.stack([x1, y], 1), np.stack([x, y1], 1)], 1)
    flat: Any = cv2.undistortPoints(
        np.ascontiguousarray(middles.reshape(-1, 1, 2)), camera.intrinsics, camera.distortion
    )
    rays = np.asarray(flat, dtype=float).reshape(-1, 4, 2)
    return np.stack([rays[:, 0, 0], rays[:, 1, 1], rays[:, 2, 0], rays[:, 3, 1]], axis=1)


def level_frame(camera: CameraReading) -> tuple[LevelFrame, Array]:
    """Return the level frame below a camera, x along its optical axis, and its rotation (3, 3) to the camera axes."""
    pose = camera.pose
    x, y, z = pose[:3, 3].tolist()
    yaw = math.atan2(pose[1, 2], pose[0, 2])
    cos, sin = math.cos(yaw), math.sin(yaw)
    level = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return LevelFrame(x, y, z, yaw), np.asarray(pose[:3, :3].T @ level)

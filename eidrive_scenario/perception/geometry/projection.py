"""Projection of boxes into cameras, and the visibility of objects for cameras and lidars."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.geometry import BOX_SAMPLES, box_corners, points_of_boxes
from eidrive_scenario.perception.geometry.lidar_geometry import LevelFrame
from eidrive_scenario.sensing.crossing import crossing
from eidrive_scenario.sensing.readings import CameraReading, LidarReading
from eidrive_scenario.sensing.sensor import undistorted

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
    positions = np.full((len(points), 2), np.nan)
    ahead = in_camera[:, 2] > NEAREST
    limit = _largest_radius(*camera.distortion.tolist())
    if limit < math.inf:
        ahead &= np.hypot(in_camera[:, 0], in_camera[:, 1]) < limit * in_camera[:, 2]
    if ahead.any():
        plane: Any
        plane, _ = cv2.projectPoints(
            np.ascontiguousarray(in_camera[ahead]), np.zeros(3), np.zeros(3), camera.intrinsics, camera.distortion
        )
        positions[ahead] = plane[:, 0]
    return positions, in_camera[:, 2]


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
    x0, y0, x1, y1 = boxes.T
    x, y = (x0 + x1) / 2.0, (y0 + y1) / 2.0
    middles = np.stack([np.stack([x0, y], 1), np.stack([x, y0], 1), np.stack([x1, y], 1), np.stack([x, y1], 1)], 1)
    rays = undistorted(middles.reshape(-1, 2), camera.intrinsics, camera.distortion).reshape(-1, 4, 2)
    return np.stack([rays[:, 0, 0], rays[:, 1, 1], rays[:, 2, 0], rays[:, 3, 1]], axis=1)


def level_frame(camera: CameraReading) -> tuple[LevelFrame, Array]:
    """Return the level frame below a camera, x along its optical axis, and its rotation (3, 3) to the camera axes."""
    pose = camera.pose
    x, y, z = pose[:3, 3].tolist()
    yaw = math.atan2(pose[1, 2], pose[0, 2])
    cos, sin = math.cos(yaw), math.sin(yaw)
    level = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return LevelFrame(x, y, z, yaw), np.asarray(pose[:3, :3].T @ level)


POINTS: Array = 0.8 * BOX_SAMPLES
"""Sampled points (10, 3) of a box, in half lengths from its center."""
LEAST_HEIGHT, LEGIBLE_HEIGHT = 8.0, 20.0
"""Objects below the first height in the input of a network are not expected to be detected; from the second on they are
[px]. A third of the vehicles that the networks miss is below 15 px (docs/perception.md)."""
SAME = 0.5
"""A detection does not occlude a box whose center is closer than this share of both lengths: it is the same object."""


def in_camera(boxes: Array, camera: CameraReading, others: Array, reduction: float = 1.0) -> Array:
    """Return the share (N,) in [0, 1] of boxes (N, 7) that the camera can show past the boxes `others` (M, 7).

    `reduction` is the height of the image in the input of a network, divided by its own height.
    """
    if not len(boxes):
        return np.empty(0)
    points = points_of_boxes(boxes, POINTS)
    width, height = camera.size
    positions, _ = pixels(points.reshape(-1, 3), camera)
    positions = positions.reshape(len(boxes), -1, 2)
    x, y = positions[..., 0], positions[..., 1]
    visible = (x >= 0.0) & (x < width) & (y >= 0.0) & (y < height)
    corners, _ = pixels(box_corners(boxes).reshape(-1, 3), camera)
    rows = reduction * corners.reshape(len(boxes), -1, 2)[..., 1]
    tall = np.where(np.isnan(rows).any(axis=1), LEGIBLE_HEIGHT, np.ptp(np.nan_to_num(rows), axis=1))
    legible = np.clip((tall - LEAST_HEIGHT) / (LEGIBLE_HEIGHT - LEAST_HEIGHT), 0.0, 1.0)
    visible &= ~_hidden(camera.pose[:3, 3], points, boxes, others)
    return np.asarray(visible.mean(axis=1) * legible)


class LidarView(NamedTuple):
    """View of a lidar: half its horizontal field of view, elevations of its lowest and its highest ring [rad], and its
    range [m]."""

    half_field: float = math.pi
    lowest: float = -math.pi / 2.0
    highest: float = math.pi / 2.0
    range: float = math.inf


def in_lidar(boxes: Array, lidar: LidarReading, view: LidarView, others: Array) -> Array:
    """Return the share (N,) in [0, 1] of boxes (N, 7) that the lidar can show past the boxes `others` (M, 7)."""
    if not len(boxes):
        return np.empty(0)
    points = points_of_boxes(boxes, POINTS)
    x, y, z = np.moveaxis((points - lidar.pose[:3, 3]) @ lidar.pose[:3, :3], -1, 0)
    plan = np.hypot(x, y)
    elevation = np.arctan2(z, plan)
    visible = (np.abs(np.arctan2(y, x)) <= view.half_field) & (np.hypot(plan, z) <= view.range)
    visible &= (view.lowest <= elevation) & (elevation <= view.highest)
    visible &= ~_hidden(lidar.pose[:3, 3], points, boxes, others)
    return np.asarray(visible.mean(axis=1))


def _hidden(origin: Array, points: Array, boxes: Array, others: Array) -> Bools:
    """Return whether one of `others` (M, 7) is between `origin` (3,) and points (N, P, 3) of boxes (N, 7)."""
    hidden = np.zeros(points.shape[:2], dtype=bool)
    origins = np.broadcast_to(origin, points.shape)
    for other in others:
        enter, leave = crossing(origins, points, np.broadcast_to(other, boxes.shape))
        near = np.hypot(boxes[:, 0] - other[0], boxes[:, 1] - other[1])
        is_same = near < SAME * np.minimum(other[3], boxes[:, 3])
        hidden |= (enter < leave) & (enter > 0.0) & (enter < 1.0) & ~is_same[:, None]
    return hidden

"""Share of objects that a camera or a lidar can show: field of view, range, apparent height, and occlusion."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array, Bools
from eidrive_scenario.geometry import BOX_SAMPLES, box_corners, points_of_boxes
from eidrive_scenario.perception.geometry.lidar_geometry import LevelFrame
from eidrive_scenario.perception.geometry.projection import pixels
from eidrive_scenario.sensing.crossing import crossing
from eidrive_scenario.sensing.readings import CameraReading, LidarReading

POINTS: Array = 0.8 * BOX_SAMPLES
"""Sampled points (10, 3) of a box, in half lengths from its center."""
LEAST_HEIGHT, LEGIBLE_HEIGHT = 8.0, 20.0
"""Objects below the first height in the image are not expected to be detected; from the second on they are [px]. A
third of the vehicles that the networks miss is below 15 px (docs/perception.md)."""
SAME = 0.5
"""A detection does not occlude a box whose center is closer than this share of both lengths: it is the same object."""


def in_camera(boxes: Array, camera: CameraReading, others: Array) -> Array:
    """Return the share (N,) in [0, 1] of boxes (N, 7) that the camera can show past the boxes `others` (M, 7)."""
    if not len(boxes):
        return np.empty(0)
    points = points_of_boxes(boxes, POINTS)
    width, height = camera.size
    places, _ = pixels(points.reshape(-1, 3), camera)
    places = places.reshape(len(boxes), -1, 2)
    x, y = places[..., 0], places[..., 1]
    visible = (x >= 0.0) & (x < width) & (y >= 0.0) & (y < height)
    corners, _ = pixels(box_corners(boxes).reshape(-1, 3), camera)
    rows = corners.reshape(len(boxes), -1, 2)[..., 1]
    tall = np.where(np.isnan(rows).any(axis=1), LEGIBLE_HEIGHT, np.ptp(np.nan_to_num(rows), axis=1))
    legible = np.clip((tall - LEAST_HEIGHT) / (LEGIBLE_HEIGHT - LEAST_HEIGHT), 0.0, 1.0)
    visible &= ~_hidden(camera.pose[:3, 3], points, boxes, others)
    return np.asarray(visible.mean(axis=1) * legible)


def in_lidar(boxes: Array, lidar: LidarReading, half_field: float, reach: float, others: Array) -> Array:
    """Return the share (N,) in [0, 1] of boxes (N, 7) that the lidar can show past the boxes `others` (M, 7).

    half_field  half its horizontal field of view [rad];  reach  its range [m]
    """
    if not len(boxes):
        return np.empty(0)
    points = points_of_boxes(boxes, POINTS)
    place = LevelFrame.of(lidar.pose).to_local(points[..., :2])
    bearing = np.abs(np.arctan2(place[..., 1], place[..., 0]))
    visible = (bearing <= half_field) & (np.hypot(place[..., 0], place[..., 1]) <= reach)
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

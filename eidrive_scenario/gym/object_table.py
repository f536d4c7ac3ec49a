"""Table of the nearest objects in the frame of a vehicle."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.detections import CLASSES, Detections
from eidrive_scenario.sensing.readings import EgoState

MAX_SPEED = 70.0
"""Bound of speeds in observations [m/s]."""
MAX_SIZE = 30.0
"""Bound of lengths and widths of objects [m]."""
MAX_DEVIATION = 10.0
"""Bound of standard deviations of positions [m]."""
MAX_AGE = 10.0
"""Bound of ages [s]."""

COLUMNS = (
    "present", "x", "y", "velocity_x", "velocity_y", "velocity_known", "length", "width", "cos", "sin", "existence",
    "deviation_x", "deviation_y", "covariance_known", "age", *CLASSES,
)  # fmt: skip
"""Columns of the table. Positions [m], velocities over ground [m/s] and headings are in the axes of the vehicle."""
FEW = 12
"""Maximum number of objects for which scalar arithmetic is faster than arrays."""
_SIGNED = ("x", "y", "velocity_x", "velocity_y", "cos", "sin")
_CLASS = {name: COLUMNS.index(name) for name in CLASSES}
_CLASS_COLUMNS = {name: [float(name == other) for other in CLASSES] for name in CLASSES}


def column_bounds(reach: float) -> tuple[Array, Array]:
    """Return lower and upper bounds of the columns in SI units for objects within `reach` [m]."""
    high = np.ones(len(COLUMNS))
    for name, bound in (
        ("x", reach),
        ("y", reach),
        ("velocity_x", MAX_SPEED),
        ("velocity_y", MAX_SPEED),
        ("length", MAX_SIZE),
        ("width", MAX_SIZE),
        ("deviation_x", MAX_DEVIATION),
        ("deviation_y", MAX_DEVIATION),
        ("age", MAX_AGE),
    ):
        high[COLUMNS.index(name)] = bound
    low = np.where([name in _SIGNED for name in COLUMNS], -high, 0.0)
    return low, high


def nearest_rows(objects: Detections, ego: EgoState, reach: float = math.inf) -> list[int]:
    """Return the rows of the objects within `reach` [m], nearest first; equal distances in the order of the rows."""
    if not len(objects):
        return []
    x, y, _ = ego.position.tolist()
    if len(objects) <= FEW:
        places = [math.hypot(box[0] - x, box[1] - y) for box in objects.boxes.tolist()]
        return sorted([row for row, away in enumerate(places) if away <= reach], key=places.__getitem__)
    distance = np.hypot(objects.boxes[:, 0] - x, objects.boxes[:, 1] - y)
    order = np.argsort(distance, kind="stable")
    return [row for row in order.tolist() if distance[row] <= reach]


def object_values(
    objects: Detections, ego: EgoState, now: float, *, count: int, reach: float
) -> Sequence[float] | Array:
    """Return the values of the table of the nearest objects in SI units, row by row; at most `count` rows."""
    rows = nearest_rows(objects, ego, reach)[:count]
    age = max(now - objects.time, 0.0)
    if len(rows) > FEW:
        return object_rows(objects, rows, ego, age).ravel()
    return [value for row in few_object_rows(objects, rows, ego, age) for value in row] if rows else ()


def few_object_rows(objects: Detections, rows: Sequence[int], ego: EgoState, age: float) -> list[list[float]]:
    """Return the same as `object_rows` in scalar arithmetic. Adding 0 replaces -0 at rest."""
    cos, sin = math.cos(ego.yaw), math.sin(ego.yaw)
    own_x, own_y, _ = ego.position.tolist()
    boxes, velocities = objects.boxes.tolist(), objects.velocity.tolist()
    covariances, confidence = objects.covariance.tolist(), objects.confidence.tolist()
    filled = []
    for row in rows:
        x, y, _, length, width, _, yaw = boxes[row]
        dx, dy = x - own_x, y - own_y
        vx, vy = velocities[row]
        moves = math.isfinite(vx) and math.isfinite(vy)
        if not moves:
            vx = vy = 0.0
        (xx, xy), (yx, yy) = covariances[row]
        certain = math.isfinite(xx + xy + yx + yy)
        ahead = aside = 0.0
        if certain:
            ahead = cos * cos * xx + cos * sin * (xy + yx) + sin * sin * yy
            aside = sin * sin * xx - sin * cos * (xy + yx) + cos * cos * yy
        heading = yaw - ego.yaw
        filled.append(
            [
                1.0,
                dx * cos + dy * sin,
                dy * cos - dx * sin,
                vx * cos + vy * sin + 0.0,
                vy * cos - vx * sin + 0.0,
                float(moves),
                length,
                width,
                math.cos(heading),
                math.sin(heading),
                confidence[row],
                math.sqrt(max(ahead, 0.0)),
                math.sqrt(max(aside, 0.0)),
                float(certain),
                age,
                *_CLASS_COLUMNS[objects.classes[row]],
            ]
        )
    return filled


def object_rows(objects: Detections, rows: Sequence[int], ego: EgoState, age: float) -> Array:
    """Return the rows (N, C) of these objects in SI units."""
    filled = np.zeros((len(rows), len(COLUMNS)))
    cos, sin = math.cos(ego.yaw), math.sin(ego.yaw)
    axes = np.array([[cos, -sin], [sin, cos]])
    boxes = objects.boxes[rows]
    filled[:, 0] = 1.0
    filled[:, 1:3] = (boxes[:, :2] - ego.position[:2]) @ axes
    velocity = objects.velocity[rows] @ axes
    known = np.isfinite(velocity[:, 0]) & np.isfinite(velocity[:, 1])
    filled[:, 3:5] = np.where(np.reshape(known, (-1, 1)), velocity, 0.0)
    filled[:, 5] = known
    filled[:, 6:8] = boxes[:, 3:5]
    heading = boxes[:, 6] - ego.yaw
    filled[:, 8], filled[:, 9] = np.cos(heading), np.sin(heading)
    filled[:, 10] = objects.confidence[rows]
    covariance = objects.covariance[rows]
    certain = np.isfinite(covariance.sum(axis=(1, 2)))
    variance = np.einsum("ji,njk,ki->ni", axes, np.where(np.reshape(certain, (-1, 1, 1)), covariance, 0.0), axes)
    filled[:, 11:13] = np.sqrt(np.maximum(variance, 0.0))
    filled[:, 13] = certain
    filled[:, 14] = age
    for index, row in enumerate(rows):
        filled[index, _CLASS[objects.classes[row]]] = 1.0
    return filled

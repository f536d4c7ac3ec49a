"""Plane and solid geometry of oriented boxes: corners, overlap, distance, intersection over union.

A box is seven numbers `x y z l w h yaw`: center, length, width, height [m] and heading [rad]; it stands upright.
All results are exact up to rounding. The functions for two single boxes use plain floats, which are faster than numpy
for a few actors; those for arrays broadcast.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array

Box = Sequence[float] | Array

BOX_SAMPLES: Array = np.array(
    [[x, y, z] for x in (1.0, -1.0) for y in (1.0, -1.0) for z in (1.0, -1.0)] + [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
)
"""Points (10, 3) of a box, in half lengths from its center: eight corners, the center, the middle of the top."""

TURN = 2.0 * math.pi
"""Full turn [rad]."""
_CORNERS = np.array([[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]])


@overload
def wrap_angle(angle: float) -> float: ...
@overload
def wrap_angle(angle: Array) -> Array: ...
def wrap_angle(angle: Any) -> Any:
    """Return the equivalent angle in (-pi, pi] [rad]; a float or an array."""
    return math.pi - (math.pi - angle) % TURN


def components(x: float, y: float, heading: float) -> tuple[float, float]:
    """Return the components of a vector along a heading [rad] and to the left of it."""
    cos, sin = math.cos(heading), math.sin(heading)
    return cos * x + sin * y, cos * y - sin * x


def rotation(angle: float) -> Array:
    """Return the rotation (2, 2) in the plane by an angle [rad], from axes with this heading to those of the world."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin], [sin, cos]])


def rotation_matrix(yaw: Any, pitch: Any = 0.0, roll: Any = 0.0) -> Array:
    """Return rotations (..., 3, 3) from the body frame to the world frame: yaw, then pitch, then roll (z-y'-x'')."""
    yaw, pitch, roll = np.broadcast_arrays(yaw, pitch, roll)
    cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion(yaw: float, pitch: float = 0.0, roll: float = 0.0) -> tuple[float, float, float, float]:
    """Return x y z w of the rotation yaw, pitch, roll (z-y'-x'')."""
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    if pitch == 0.0 and roll == 0.0:
        return 0.0, 0.0, sy, cy
    cp, sp, cr, sr = math.cos(pitch / 2), math.sin(pitch / 2), math.cos(roll / 2), math.sin(roll / 2)
    return (
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
        cy * cp * cr + sy * sp * sr,
    )


def rigid_transform(turn: Array, position: Array | Sequence[float]) -> Array:
    """Return the pose (4, 4) of a rotation matrix (3, 3) and a position (3,)."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, position
    return pose


def equidistant(start: float, end: float, spacing: float) -> list[float]:
    """Return numbers from start to end with equal steps of at most `spacing`."""
    numbers: list[float] = np.linspace(start, end, max(2, math.ceil((end - start) / spacing) + 1)).tolist()
    return numbers


def footprint(boxes: Array) -> Array:
    """Return the corners (..., 4, 2) of boxes (..., 7) in the plane, counter-clockwise from the front left."""
    boxes = np.asarray(boxes, dtype=float)
    local = _CORNERS * boxes[..., None, 3:5]
    cos, sin = np.cos(boxes[..., 6:7]), np.sin(boxes[..., 6:7])
    x, y = local[..., 0], local[..., 1]
    return np.stack([cos * x - sin * y + boxes[..., 0:1], sin * x + cos * y + boxes[..., 1:2]], axis=-1)


def box_corners(boxes: Array) -> Array:
    """Return the corners (..., 8, 3) of boxes (..., 7): bottom ones in the order of `footprint`, then top ones."""
    boxes = np.asarray(boxes, dtype=float)
    plan = footprint(boxes)
    bottom, top = boxes[..., 2:3] - boxes[..., 5:6] / 2, boxes[..., 2:3] + boxes[..., 5:6] / 2
    heights = np.concatenate([np.repeat(bottom, 4, axis=-1), np.repeat(top, 4, axis=-1)], axis=-1)
    return np.concatenate([np.concatenate([plan, plan], axis=-2), heights[..., None]], axis=-1)


def points_of_boxes(boxes: Array, samples: Array) -> Array:
    """Return points (N, K, 3) of boxes (N, 7) at `samples` (K, 3), in half lengths from the center."""
    local = samples * (boxes[:, None, 3:6] / 2.0)
    cos, sin = np.cos(boxes[:, 6:7]), np.sin(boxes[:, 6:7])
    points = np.empty_like(local)
    points[..., 0] = boxes[:, 0:1] + cos * local[..., 0] - sin * local[..., 1]
    points[..., 1] = boxes[:, 1:2] + sin * local[..., 0] + cos * local[..., 1]
    points[..., 2] = boxes[:, 2:3] + local[..., 2]
    return points


def box_distance(a: Box, b: Box) -> float:
    """Return the distance between two boxes (7,) [m]; 0 if they touch or overlap."""
    a, b = _plain(a), _plain(b)
    gap = max(abs(a[2] - b[2]) - (a[5] + b[5]) / 2, 0.0)
    plan = footprint_distance(a, b)
    return math.hypot(plan, gap) if gap else plan


def footprint_distance(a: Box, b: Box) -> float:
    """Return the distance between the footprints of two boxes (7,) [m]; 0 if they touch or overlap."""
    a, b = _plain(a), _plain(b)
    dx, dy = b[0] - a[0], b[1] - a[1]
    cos_a, sin_a, cos_b, sin_b = math.cos(a[6]), math.sin(a[6]), math.cos(b[6]), math.sin(b[6])
    if _plan_overlap(a, b, dx, dy, cos_a, sin_a, cos_b, sin_b):
        return 0.0
    return math.sqrt(
        min(
            _nearest_corner(a, b, dx, dy, cos_a, sin_a, cos_b, sin_b),
            _nearest_corner(b, a, -dx, -dy, cos_b, sin_b, cos_a, sin_a),
        )
    )


def overlap(a: Box, b: Box) -> bool:
    """Whether two boxes (7,) share a point in 3D, by separating axes (Gottschalk et al., OBBTree, 1996)."""
    a, b = _plain(a), _plain(b)
    if abs(a[2] - b[2]) > (a[5] + b[5]) / 2:
        return False
    dx, dy = b[0] - a[0], b[1] - a[1]
    return _plan_overlap(a, b, dx, dy, math.cos(a[6]), math.sin(a[6]), math.cos(b[6]), math.sin(b[6]))


def iou_bev(a: Array, b: Array) -> Array:
    """Return the intersection over union (N, M) of the footprints of boxes (N, 7) and (M, 7)."""
    a, b = np.reshape(a, (-1, 7)), np.reshape(b, (-1, 7))
    shared = _intersection_area(footprint(a)[:, None], b[None, :])
    area_a, area_b = a[:, 3] * a[:, 4], b[:, 3] * b[:, 4]
    union = area_a[:, None] + area_b[None, :] - shared
    return np.divide(shared, union, out=np.zeros_like(shared), where=union > 0)


LEVEL_TOLERANCE = 2.0
"""Maximum vertical gap between two boxes of one object [m], since heights of detections have large errors."""


@overload
def on_two_levels(z: float, height: float, other_z: float, other_height: float) -> bool: ...
@overload
def on_two_levels(z: Array, height: Array, other_z: Array, other_height: Array) -> NDArray[np.bool_]: ...
def on_two_levels(z: Any, height: Any, other_z: Any, other_height: Any) -> Any:
    """Return whether boxes with these centers and heights [m] are on two levels, as on and below a bridge.

    Arrays broadcast.
    """
    return abs(z - other_z) > 0.5 * (height + other_height) + LEVEL_TOLERANCE


def points_in_polygon(points: Array, polygon: Array) -> NDArray[np.bool_]:
    """Return whether points (..., 2) are inside a polygon (M, 2) by the even-odd rule; it need not be convex."""
    points, polygon = np.asarray(points, dtype=float), np.asarray(polygon, dtype=float)
    x, y = points[..., 0:1], points[..., 1:2]
    x0, y0 = polygon[:, 0], polygon[:, 1]
    x1, y1 = np.roll(x0, -1), np.roll(y0, -1)
    straddles = (y0 > y) != (y1 > y)
    rise = np.where(y1 == y0, 1.0, y1 - y0)
    inside: NDArray[np.bool_] = np.count_nonzero(straddles & (x < x0 + (y - y0) / rise * (x1 - x0)), axis=-1) % 2 == 1
    return inside


def point_in_polygon(x: float, y: float, polygon: Sequence[tuple[float, float]]) -> bool:
    """Return whether one point is inside a polygon by the even-odd rule."""
    inside = False
    x0, y0 = polygon[-1]
    for x1, y1 in polygon:
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
            inside = not inside
        x0, y0 = x1, y1
    return inside


def points_in_box(points: Array, box: Box) -> NDArray[np.bool_]:
    """Return whether points (..., 3) are inside a box (7,) or on its surface."""
    x, y, z, length, width, height, yaw = _plain(box)
    offset = np.asarray(points, dtype=float) - (x, y, z)
    along = math.cos(yaw) * offset[..., 0] + math.sin(yaw) * offset[..., 1]
    across = math.cos(yaw) * offset[..., 1] - math.sin(yaw) * offset[..., 0]
    inside: NDArray[np.bool_] = (
        (np.abs(along) <= length / 2) & (np.abs(across) <= width / 2) & (np.abs(offset[..., 2]) <= height / 2)
    )
    return inside


def _plain(box: Box) -> Sequence[float]:
    if isinstance(box, np.ndarray):
        plain: list[float] = box.tolist()
        return plain
    return box


def _plan_overlap(
    a: Sequence[float], b: Sequence[float], dx: float, dy: float, ca: float, sa: float, cb: float, sb: float
) -> bool:
    cos, sin = abs(ca * cb + sa * sb), abs(sa * cb - ca * sb)
    la, wa, lb, wb = a[3] / 2, a[4] / 2, b[3] / 2, b[4] / 2
    return (
        abs(dx * ca + dy * sa) <= la + lb * cos + wb * sin
        and abs(dy * ca - dx * sa) <= wa + lb * sin + wb * cos
        and abs(dx * cb + dy * sb) <= lb + la * cos + wa * sin
        and abs(dy * cb - dx * sb) <= wb + la * sin + wa * cos
    )


def _nearest_corner(
    a: Sequence[float], b: Sequence[float], dx: float, dy: float, ca: float, sa: float, cb: float, sb: float
) -> float:
    """Return the squared distance from rectangle a to the nearest corner of b [m²].

    The shortest connection between disjoint rectangles ends at a corner of one of them.
    """
    x, y = dx * ca + dy * sa, dy * ca - dx * sa
    cos, sin = ca * cb + sa * sb, ca * sb - sa * cb
    lx, ly, wx, wy = cos * b[3] / 2, sin * b[3] / 2, -sin * b[4] / 2, cos * b[4] / 2
    half_length, half_width = a[3] / 2, a[4] / 2
    nearest = math.inf
    for px, py in ((x + lx + wx, y + ly + wy), (x - lx + wx, y - ly + wy),
                   (x - lx - wx, y - ly - wy), (x + lx - wx, y + ly - wy)):  # fmt: skip
        ex, ey = abs(px) - half_length, abs(py) - half_width
        square = (ex * ex if ex > 0.0 else 0.0) + (ey * ey if ey > 0.0 else 0.0)
        if square < nearest:
            nearest = square
    return nearest


def _in_frame(points: Array, box: Array) -> Array:
    """Transform points (..., K, 2) to the frames of boxes (..., 7): origin at the center, x forward, y left."""
    offset = points - box[..., None, 0:2]
    cos, sin = np.cos(box[..., 6:7]), np.sin(box[..., 6:7])
    along = cos * offset[..., 0] + sin * offset[..., 1]
    return np.stack([along, cos * offset[..., 1] - sin * offset[..., 0]], axis=-1)


def _intersection_area(polygon: Array, boxes: Array) -> Array:
    """Return the intersection area of polygons (..., 4, 2), counter-clockwise, and boxes (..., 7) [m²].

    Green's theorem: the area is the integral of clamp(x, -l/2, l/2) dy along the part of the outline with |y| <= w/2,
    in the frame of the box. Each edge is divided where the integrand has a kink, so the trapezoidal rule is exact. The
    sum is continuous in its input, unlike a list of crossing points, so coinciding edges cause no error.
    """
    start = _in_frame(polygon, boxes)
    edge = np.roll(start, -1, axis=-2) - start
    x, y, run, rise = start[..., 0], start[..., 1], edge[..., 0], edge[..., 1]
    half_length, half_width = boxes[..., 3:4] / 2, boxes[..., 4:5] / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        enter, leave = (-np.copysign(half_width, rise) - y) / rise, (np.copysign(half_width, rise) - y) / rise
        low, high = (-np.copysign(half_length, run) - x) / run, (np.copysign(half_length, run) - x) / run
    t0 = np.where(rise == 0, 0.0, np.clip(enter, 0.0, 1.0))
    t3 = np.where(rise == 0, 0.0, np.clip(leave, 0.0, 1.0))
    t1 = np.where(run == 0, t0, np.clip(low, t0, t3))
    t2 = np.where(run == 0, t0, np.clip(high, t0, t3))
    cuts = np.stack([t0, t1, t2, t3], axis=-1)
    clamped = np.clip(x[..., None] + cuts * run[..., None], -half_length[..., None], half_length[..., None])
    area: Array = np.sum(rise[..., None] * np.diff(cuts) * (clamped[..., 1:] + clamped[..., :-1]) / 2, axis=(-1, -2))
    return np.maximum(area, 0.0)


def segment_distance(x: float, y: float, x0: float, y0: float, x1: float, y1: float) -> float:
    """Return the distance of a point from a segment [m]."""
    dx, dy = x1 - x0, y1 - y0
    square = dx * dx + dy * dy
    share = ((x - x0) * dx + (y - y0) * dy) / square if square > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    return math.hypot(x - x0 - share * dx, y - y0 - share * dy)


def aligned_distances(points: Array, x: float, y: float, heading: float) -> Array:
    """Return the distances (M - 1,) of a position from the points (M, D) of a line without the last one [m].

    They are inf where the line does not lead along a heading [rad].
    """
    along = np.diff(points[:, :2], axis=0) @ (math.cos(heading), math.sin(heading)) > 0.0
    return np.where(along, np.hypot(*(points[:-1, :2] - (x, y)).T), np.inf)


def distances_along(points: Array) -> Array:
    """Return the distances of the points (M, 2) of a polyline from its first point, along it (M,) [m]."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])


JUMP = 1.0
"""Displacement beyond the one at twice the speed that is a teleport [m]."""


def is_teleport(distance: float, speed: float, duration: float) -> bool:
    """Return whether a displacement [m] in this time [s] is a teleport of an actor with this speed [m/s]."""
    return distance > 2.0 * speed * duration + JUMP

"""Intersection of rays and boxes, and rays that start behind the body of their sensor."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.geometry import rotation_matrix
from eidrive_scenario.world.view import WorldView

Point = tuple[float, float, float]

BEYOND_OWN_BODY = 1e-3
"""Offset of the start of a ray behind the ego body, as a share of its length. A ray through the underside starts before
it, as the road there, such as a bridge, hides what is below."""
ROUNDING = 1e-9
"""Relative tolerance of the height at which a ray leaves through the underside."""
PARALLEL = 1e-12
"""Minimum extent of a ray across a slab [m]; shorter ones are replaced by it."""


def crossing(origins: Array, targets: Array, boxes: Array) -> tuple[Array, Array]:
    """Return where rays (P, K, 3) enter and leave boxes (P, 7), as shares of their length; enter > leave without
    intersection.

    The slab method (Kay and Kajiya, Ray tracing complex scenes, 1986) in the frame of the box.
    """
    cos, sin = np.cos(boxes[:, 6])[:, None], np.sin(boxes[:, 6])[:, None]
    enter = np.full(origins.shape[:2], -np.inf)
    leave = np.full(origins.shape[:2], np.inf)
    start, ray = origins - boxes[:, None, :3], targets - origins
    axes = (
        (cos * start[..., 0] + sin * start[..., 1], cos * ray[..., 0] + sin * ray[..., 1]),
        (cos * start[..., 1] - sin * start[..., 0], cos * ray[..., 1] - sin * ray[..., 0]),
        (start[..., 2], ray[..., 2]),
    )
    for axis, (begin, step) in enumerate(axes):
        half = boxes[:, None, 3 + axis] / 2.0
        step = np.where(np.abs(step) < PARALLEL, PARALLEL, step)
        first, second = (-half - begin) / step, (half - begin) / step
        enter = np.maximum(enter, np.minimum(first, second))
        leave = np.minimum(leave, np.maximum(first, second))
    return enter, leave


def turned(points: Array, view: WorldView, rows: Integers, *, upright: bool) -> Array:
    """Return points (P, K, 3) turned about the reference points of bodies (P,): to an upright body, or back."""
    if view.is_upright:
        return points
    yaw, pitch, roll = view.yaw[rows], view.pitch[rows], view.roll[rows]
    tilt = rotation_matrix(yaw, pitch, roll) @ rotation_matrix(yaw).transpose(0, 2, 1)
    turn = tilt.transpose(0, 2, 1) if upright else tilt
    pivots = view.position[rows][:, None]
    moved: Array = pivots + np.einsum("pij,pkj->pki", turn, points - pivots)
    return moved


def starts_behind_bodies(origins: Array, targets: Array, view: WorldView, rows: Integers) -> Array:
    """Return starts (P, K, 3) of rays (P, K, 3) behind the bodies (P,) of their sensors; unchanged if a ray does not
    intersect its body."""
    begin, end = origins, targets
    if not view.is_upright:
        begin, end = (turned(points, view, rows, upright=True) for points in (origins, targets))
    shares = shares_behind(begin, end, view.boxes[rows])
    return np.asarray(origins + shares[..., None] * (targets - origins))


def shares_behind(origins: Array, targets: Array, boxes: Array) -> Array:
    """Return the shares (P, K) of rays (P, K, 3) at which they leave upright boxes (P, 7); 0 without intersection."""
    enter, leave = crossing(origins, targets, boxes)
    crosses = (enter < leave) & (leave > 0.0) & (enter < 1.0)
    fall = origins[..., 2] - targets[..., 2]
    above_bottom = origins[..., 2] - boxes[:, None, 2] + boxes[:, None, 5] / 2.0
    through_bottom = (fall > 0.0) & (leave * fall >= above_bottom * (1.0 - ROUNDING))
    starts = np.where(through_bottom, np.maximum(leave - BEYOND_OWN_BODY, 0.0), leave + BEYOND_OWN_BODY)
    return np.where(crosses, np.minimum(starts, 1.0), 0.0)


def few_ray_starts(origin: Point, targets: Sequence[Point], box: Sequence[float]) -> list[Point]:
    """Return starts behind an upright box by `shares_behind` in scalar arithmetic, for a few rays from one origin.

    Targets above each other are faster if they are consecutive.
    """
    x, y, z, length, width, height, yaw = box
    cos, sin = math.cos(yaw), math.sin(yaw)
    ox, oy, oz = origin
    px, py, pz = cos * (ox - x) + sin * (oy - y), cos * (oy - y) - sin * (ox - x), oz - z
    back, front = -length / 2.0 - px, length / 2.0 - px
    right, left = -width / 2.0 - py, width / 2.0 - py
    bottom, top = -height / 2.0 - pz, height / 2.0 - pz
    starts = []
    dx = dy = enter_walls = leave_walls = math.nan
    for tx, ty, tz in targets:
        if tx - ox != dx or ty - oy != dy:
            dx, dy = tx - ox, ty - oy
            step = cos * dx + sin * dy or PARALLEL
            enter_walls, leave_walls = (back / step, front / step) if step > 0.0 else (front / step, back / step)
            step = cos * dy - sin * dx or PARALLEL
            first, last = (right / step, left / step) if step > 0.0 else (left / step, right / step)
            if first > enter_walls:
                enter_walls = first
            if last < leave_walls:
                leave_walls = last
        dz = tz - oz
        step = dz or PARALLEL
        enter, leave = (bottom / step, top / step) if step > 0.0 else (top / step, bottom / step)
        if enter_walls > enter:
            enter = enter_walls
        if leave_walls < leave:
            leave = leave_walls
        if enter >= leave or leave <= 0.0 or enter >= 1.0:
            starts.append(origin)
        else:
            through_bottom = dz < 0.0 and leave * dz <= bottom * (1.0 - ROUNDING)
            share = min(max(leave - BEYOND_OWN_BODY, 0.0) if through_bottom else leave + BEYOND_OWN_BODY, 1.0)
            starts.append((ox + share * dx, oy + share * dy, oz + share * dz))
    return starts

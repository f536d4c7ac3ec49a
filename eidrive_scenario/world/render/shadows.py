"""Which points the sun reaches: a picture of the scene as the sun sees it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.world.camera import Pinhole
from eidrive_scenario.world.render.model import Array, Floats, Instance
from eidrive_scenario.world.render.rasterise import rasterise

REACH = 80.0
"""How far from the camera shadows are drawn [m]."""
_COARSEST, _FINEST = 256, 640
"""Pixels of the sun's picture along its longer side; between these, a little more than the camera's has across."""
_SLACK = 0.04
"""A point must lie this far behind what the sun sees before it is in shadow [m]; more for large pixels."""
_LOWEST = 0.035
"""Sine of the lowest sun that throws shadows."""


@dataclass(frozen=True)
class ShadowMap:
    """Heights along the sun's rays of what it meets first, on a grid across them.

    axes (2, 3) of the grid and `towards` (3,) in the world, origin (2,) and scale [px/m] of the grid, base [m] of the
    heights; all relative to `eye` (3,), the camera
    """

    heights: Floats
    width: int
    height: int
    axes: Floats
    towards: Floats
    origin: Floats
    scale: float
    base: float

    def lit(self, x: Floats, y: Floats, z: Floats) -> Floats:
        """Share of the sun that reaches points given relative to the camera [m]; 1 beyond the grid."""
        (ax, ay, az), (bx, by, bz), (sx, sy, sz) = *self.axes, self.towards
        column = (ax * x + ay * y + az * z - self.origin[0]) * np.float32(self.scale) - np.float32(0.5)
        row = (bx * x + by * y + bz * z - self.origin[1]) * np.float32(self.scale) - np.float32(0.5)
        level = sx * x + sy * y + sz * z + np.float32(_SLACK + 0.35 / self.scale - self.base)
        left, top = np.floor(column), np.floor(row)
        right, down = column - left, row - top
        left, top = left.astype(np.int32), top.astype(np.int32)
        outside = (left < 0) | (top < 0) | (left >= self.width - 1) | (top >= self.height - 1)
        at = np.where(outside, 0, top * np.int32(self.width) + left)
        heights = self.heights
        upper = (heights[at] <= level) * (1 - right) + (heights[at + 1] <= level) * right
        lower = (heights[at + self.width] <= level) * (1 - right) + (heights[at + self.width + 1] <= level) * right
        share = upper + (lower - upper) * down
        share[outside] = 1.0
        found: Floats = share.astype(np.float32)
        return found


def shadow_map(casters: Sequence[Instance], towards: Array, pose: Array, pinhole: Pinhole) -> ShadowMap | None:
    """The sun's picture of what may shade the part of the world that a camera sees; None where there is no shade.

    It shows the sides of bodies that turn away from the sun: those facing it lie above, and so do not shade themselves.
    """
    if towards[2] < _LOWEST or not casters:
        return None
    first = np.cross(towards, (0.0, 0.0, 1.0) if abs(towards[2]) < 0.99 else (1.0, 0.0, 0.0))
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(towards, first)])
    seen = _seen_ground(pose, pinhole)
    flat = seen @ axes.T
    low, high = flat.min(axis=0) - 0.5, flat.max(axis=0) + 0.5
    pixels = min(max(1.2 * pinhole.width, _COARSEST), _FINEST)
    scale = min(pixels / float((high - low).max()), 20.0)
    width, height = (max(math.ceil(extent * scale), 2) for extent in (high - low).tolist())
    found = [
        corners for caster in casters if (corners := _away(caster, towards, axes, pose[:3, 3], low, high)) is not None
    ]
    if not found:
        return None
    corners = np.concatenate(found)
    across, up, level = (np.ascontiguousarray((corners @ axis).reshape(-1, 3).T) for axis in (*axes, towards))
    base = float(level.min()) - 1.0
    cover = rasterise((across - low[0]) * scale, (up - low[1]) * scale, level - base, width, height)
    return ShadowMap(
        np.where(cover.triangle >= 0, cover.nearness, np.float32(-np.inf)),
        width,
        height,
        axes.astype(np.float32),
        towards.astype(np.float32),
        low.astype(np.float32),
        scale,
        base,
    )


def _seen_ground(pose: Array, pinhole: Pinhole) -> Array:
    """(M, 3) points, relative to the camera, around the part of the view within reach, near the ground and above."""
    columns = np.array([0.0, 0.5, 1.0]) * pinhole.width
    rows = np.array([0.0, 0.5, 1.0]) * pinhole.height
    rays = np.array([((c - pinhole.centre_x) / pinhole.focal, (r - pinhole.centre_y) / pinhole.focal, 1.0)
                     for c in columns for r in rows])  # fmt: skip
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True) @ pose[:3, :3].T
    lowest, highest = -pose[2, 3] - 0.5, max(-pose[2, 3] + 6.0, 1.0)
    points = [np.zeros((1, 3))]
    for ray in rays:
        reach = REACH
        if ray[2] < -1e-9:
            reach = min(reach, lowest / ray[2])
        elif ray[2] > 1e-9:
            reach = min(reach, highest / ray[2])
        end = ray * reach
        points.append(end[None])
    found: Array = np.concatenate(points)
    return found


def _away(caster: Instance, towards: Array, axes: Array, eye: Array, low: Array, high: Array) -> Array | None:
    """Corners (3 · K, 3), relative to the camera, of a body's triangles that turn away from the sun; None where none of
    them can shade the grid."""
    model = caster.model
    centre = caster.rotation @ model.centre + caster.position - eye
    flat = axes @ centre
    if (flat + model.radius < low).any() or (flat - model.radius > high).any():
        return None
    sun = (caster.rotation.T @ towards).astype(np.float32)
    if model.cells is not None:
        flat = (model.cells.centre @ caster.rotation.T + caster.position - eye) @ axes.T
        radius = model.cells.radius[:, None]
        within = (flat + radius >= low) & (flat - radius <= high)
        rows = model.cells.rows(within[:, 0] & within[:, 1])
        rows = rows[model.is_coarse[rows]]
    else:
        rows = model.coarse
    rows = rows[model.normals[rows] @ sun < 0.0]
    if not len(rows):
        return None
    corners: NDArray[np.float64] = model.triangles[rows].reshape(-1, 3) @ caster.rotation.T + (caster.position - eye)
    return corners

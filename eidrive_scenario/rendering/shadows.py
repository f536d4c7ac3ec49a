"""Shadows: of the sun, and reduced sky light below and beside bodies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats
from eidrive_scenario.rendering.model import MeshInstance
from eidrive_scenario.rendering.projection import CameraView
from eidrive_scenario.rendering.rasterization import Cover, greatest

REACH = 80.0
"""Maximum distance of shadows from the camera [m]."""
_COARSEST, _FINEST = 256, 640
"""Minimum and maximum size of the shadow map in pixels along its longer side, slightly more than that of the camera."""
_SLACK = 0.04
"""Minimum depth of a point behind the lit surface for shadow [m]; more for large pixels."""
_LOWEST = 0.035
"""Minimum sine of the elevation of the sun for shadows."""
_DEPTH = 200.0
"""Range of the shadow map beyond the farthest corner of the view [m]."""


@dataclass(frozen=True)
class ShadowGrid:
    """Grid across the rays of the sun over the view of a camera.

    axes (2, 3) of the grid and `towards` (3,) in the world; low, high (2,) are its bounds [m]; width, height [px];
    scale [px/m]; base [m] of heights along the rays. All are relative to `origin`, the camera position.
    """

    axes: Array
    towards: Array
    low: Array
    high: Array
    width: int
    height: int
    scale: float
    base: float
    origin: Array

    def cells(self, x: Floats, y: Floats, z: Floats) -> tuple[Floats, Floats]:
        """Return column and row of points relative to the camera, counted from the center of the first cell."""
        (ax, ay, az), (bx, by, bz) = self.axes.astype(np.float32)
        start, scale = self.low.astype(np.float32), np.float32(self.scale)
        column = (ax * x + ay * y + az * z - start[0]) * scale - np.float32(0.5)
        row = (bx * x + by * y + bz * z - start[1]) * scale - np.float32(0.5)
        return column, row

    def numbers(self, x: Floats, y: Floats, z: Floats) -> NDArray[np.int32]:
        """Return the cells (n,) of points, counted between cell centers line by line; -1 outside the grid."""
        column, row = (np.floor(part) for part in self.cells(x, y, z))
        within = (column >= 0) & (column < self.width - 1) & (row >= 0) & (row < self.height - 1)
        found: NDArray[np.int32] = np.where(within, row * np.float32(self.width) + column, -1.0).astype(np.int32)
        return found

    def drawn(self, casters: Sequence[MeshInstance]) -> ShadowMap:
        """Return the shadow map of bodies.

        It contains the sides that face away from the sun: the sides that face it are above and do not shade themselves.
        """
        found = [corners for caster in casters if (corners := _away(caster, self)) is not None]
        if not found:
            return ShadowMap(self, np.empty((0, 0), dtype=np.float32), 0, 0)
        corners = np.concatenate(found)
        across, up, level = (
            np.ascontiguousarray((corners @ axis).reshape(-1, 3).T) for axis in (*self.axes, self.towards)
        )
        across, up = (across - self.low[0]) * self.scale, (up - self.low[1]) * self.scale
        found_heights, line, column = greatest(across, up, level - self.base, self.width, self.height)
        # An empty margin of one cell is included, as points are interpolated between four cells.
        rows, columns = found_heights.shape
        top, left = max(line - 1, 0), max(column - 1, 0)
        bottom, right = min(line + rows + 1, self.height), min(column + columns + 1, self.width)
        heights = np.full((bottom - top, right - left), np.float32(-np.inf))
        inner = heights[line - top : line - top + rows, column - left : column - left + columns]
        np.copyto(inner, found_heights, where=found_heights > 0.0)
        return ShadowMap(self, heights, top, left)


@dataclass(frozen=True)
class ShadowMap:
    """Heights (h, w) along the rays of the sun of the first surface in a window of the grid; outside there is none."""

    grid: ShadowGrid
    heights: Floats
    top: int
    left: int

    @property
    def window(self) -> tuple[slice, slice]:
        """Lines and columns in the grid."""
        height, width = self.heights.shape
        return slice(self.top, self.top + height), slice(self.left, self.left + width)

    def lit(self, x: Floats, y: Floats, z: Floats) -> Floats | None:
        """Return the share of the sun (n,) at points relative to the camera [m], 1 outside the grid; None if all are
        fully lit.
        """
        height, width = self.heights.shape
        column, row = self.grid.cells(x, y, z)
        left, top = np.floor(column), np.floor(row)
        within = (
            (left >= self.left) & (left < self.left + width - 1) & (top >= self.top) & (top < self.top + height - 1)
        )
        some = np.flatnonzero(within)
        if not len(some):
            return None
        sx, sy, sz = self.grid.towards.astype(np.float32)
        margin = np.float32(_SLACK + 0.35 / self.grid.scale - self.grid.base)
        at = (top[some].astype(np.int32) - np.int32(self.top)) * np.int32(width)
        at += left[some].astype(np.int32) - np.int32(self.left)
        level = sx * x[some] + sy * y[some] + sz * z[some] + margin
        below = np.flatnonzero(self._highest.take(at) > level)
        if not len(below):
            return None
        some, at, level = some[below], at[below], level[below]
        right, down = column[some] - left[some], row[some] - top[some]
        heights = self.heights.ravel()
        upper = (heights[at] > level) * (1 - right) + (heights[at + 1] > level) * right
        at += np.int32(width)
        lower = (heights[at] > level) * (1 - right) + (heights[at + 1] > level) * right
        found = np.ones(len(x), dtype=np.float32)
        found[some] = np.float32(1.0) - (upper + (lower - upper) * down)
        return found

    @cached_property
    def _highest(self) -> Floats:
        """Maximum of the four cells around a point (h · w,); -inf in the last line and column."""
        heights = self.heights
        found = np.full_like(heights, -np.inf)
        pairs = np.maximum(heights[:-1], heights[1:])
        np.maximum(pairs[:, :-1], pairs[:, 1:], out=found[:-1, :-1])
        return found.ravel()

    def over(self, still: Floats) -> tuple[ShadowMap, NDArray[np.bool_]]:
        """Return this map combined with the heights (height, width) of static objects, and the cells that change
        points.

        The cells (height · width + 1,) extend between cell centers. The last one represents points outside the grid.
        """
        heights = still.copy()
        window = self.window
        np.maximum(heights[window], self.heights, out=heights[window])
        changed = np.zeros((still.shape[0] + 1, still.shape[1] + 1), dtype=bool)
        changed[:-1, :-1][window] = heights[window] > still[window]
        around = changed[:-1, :-1] | changed[:-1, 1:] | changed[1:, :-1] | changed[1:, 1:]
        return ShadowMap(self.grid, heights, 0, 0), np.append(around.ravel(), False)


def shadow_grid(towards: Array, view: CameraView) -> ShadowGrid | None:
    """Return the grid for the view of a camera; None if the sun is too low."""
    if towards[2] < _LOWEST:
        return None
    first = np.cross(towards, (0.0, 0.0, 1.0) if abs(towards[2]) < 0.99 else (1.0, 0.0, 0.0))
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(towards, first)])
    seen = _seen_ground(view)
    flat = seen @ axes.T
    low, high = flat.min(axis=0) - 0.5, flat.max(axis=0) + 0.5
    pixels = min(max(1.2 * view.pinhole.width, _COARSEST), _FINEST)
    scale = min(pixels / float((high - low).max()), 20.0)
    width, height = (max(math.ceil(extent * scale), 2) for extent in (high - low).tolist())
    base = float((seen @ towards).min()) - _DEPTH
    return ShadowGrid(axes, towards, low, high, width, height, scale, base, view.place)


def _seen_ground(view: CameraView) -> Array:
    """Return points (M, 3) relative to the camera around the view within reach, near the ground and above."""
    pinhole, pose = view.pinhole, view.pose
    columns = np.array([0.0, 0.5, 1.0]) * pinhole.width
    rows = np.array([0.0, 0.5, 1.0]) * pinhole.height
    rays = np.array([((c - pinhole.center_x) / pinhole.focal, (r - pinhole.center_y) / pinhole.focal, 1.0)
                     for c in columns for r in rows])  # fmt: skip
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True) @ pose[:3, :3].T
    lowest, highest = -pose[2, 3] - 0.5, max(-pose[2, 3] + 6.0, 1.0)
    points = [np.zeros(3)]
    for ray in rays:
        reach = REACH
        if ray[2] < -1e-9:
            reach = min(reach, lowest / ray[2])
        elif ray[2] > 1e-9:
            reach = min(reach, highest / ray[2])
        points.append(ray * reach)
    return np.array(points)


def _away(caster: MeshInstance, grid: ShadowGrid) -> Array | None:
    """Return the corners (3 · K, 3) relative to the camera of the triangles of a body that face away from the sun.

    The result is None if none of them can cast a shadow on the grid.
    """
    model, axes, origin, low, high = caster.model, grid.axes, grid.origin, grid.low, grid.high
    center = caster.rotation @ model.center + caster.position - origin
    flat = axes @ center
    if (flat + model.radius < low).any() or (flat - model.radius > high).any():
        return None
    sun = (caster.rotation.T @ grid.towards).astype(np.float32)
    if model.cells is not None:
        flat = (model.cells.center @ caster.rotation.T + caster.position - origin) @ axes.T
        radius = model.cells.radius[:, None]
        within = (flat + radius >= low) & (flat - radius <= high)
        rows = model.cells.rows(within[:, 0] & within[:, 1])
        rows = rows[model.is_coarse[rows]]
    else:
        rows = model.coarse
    rows = rows[model.normals[rows] @ sun < 0.0]
    if not len(rows):
        return None
    corners: NDArray[np.float64] = model.triangles[rows].reshape(-1, 3) @ caster.rotation.T + (caster.position - origin)
    return corners


_LEAST = 0.12
"""Share of sky light below the center of a body."""
_REACH = 0.9
"""Distance from a body within which the ground is darkened [m]."""
_INSET = 0.35
"""Distance from the edge to the darkest line below a body [m]."""
_NEAR_GROUND = 0.12
"""Maximum height difference between the base of a body and darkened ground [m]."""
_FEWEST_PIXELS = 10.0


_Window = tuple[slice, slice]
"""Lines and columns of the image."""


def dimmed(bodies: Sequence[MeshInstance], cover: Cover, upright: NDArray[np.bool_], view: CameraView) -> Floats:
    """Return the share (H, W) of sky light on the ground in the pixels; `upright` by triangle."""
    share = np.ones(view.shape, dtype=np.float32)
    for body in bodies:
        half = body.model.half
        middle = body.rotation @ np.array([*body.model.center[:2], 0.0]) + body.position - view.place
        away = math.sqrt(float(middle @ middle))
        if 2.0 * float(half[0]) * view.pinhole.focal < _FEWEST_PIXELS * away:
            continue
        window = _window(middle, body, half, view)
        if window is not None:
            _dim(share[window], window, middle, body, cover, upright, view)
    return share


def _dim(
    share: Floats,
    window: _Window,
    middle: Array,
    body: MeshInstance,
    cover: Cover,
    upright: NDArray[np.bool_],
    view: CameraView,
) -> None:
    """Multiply the share of sky light of one body in its window of the image."""
    triangle = cover.triangle[window]
    rows = np.flatnonzero(upright[triangle] & (triangle >= 0))
    if not len(rows):
        return
    far = np.float32(1.0) / cover.nearness[window].ravel()[rows]
    own_x, own_y = (part.reshape(view.shape)[window].ravel()[rows] for part in (view.x, view.y))
    x, y, z = (ray * far for ray in view.rays(own_x, own_y))
    level = np.flatnonzero(np.abs(z - np.float32(middle[2])) < _NEAR_GROUND)
    rows, dx, dy = rows[level], x[level] - np.float32(middle[0]), y[level] - np.float32(middle[1])
    half = body.model.half
    cos, sin = body.rotation[:2, 0].astype(np.float32) / np.float32(math.hypot(*body.rotation[:2, 0]))
    # Distance from the rectangle below the body, negative inside
    ahead = np.abs(cos * dx + sin * dy) - np.float32(half[0])
    aside = np.abs(cos * dy - sin * dx) - np.float32(half[1])
    inwards = np.minimum(np.maximum(ahead, aside), np.float32(0.0))
    ahead, aside = np.maximum(ahead, np.float32(0.0)), np.maximum(aside, np.float32(0.0))
    outside = np.sqrt(ahead * ahead + aside * aside) + inwards
    rise = np.clip((outside + np.float32(_INSET)) / np.float32(_INSET + _REACH), np.float32(0.0), np.float32(1.0))
    rise *= np.float32(2.0) - rise
    lines, columns = np.divmod(rows, share.shape[1])
    share[lines, columns] = np.minimum(share[lines, columns], np.float32(_LEAST) + np.float32(1.0 - _LEAST) * rise)


def _window(middle: Array, body: MeshInstance, half: Array, view: CameraView) -> _Window | None:
    """Return the window of the image around the darkened ground of a body; None if it is outside."""
    pinhole = view.pinhole
    signs = np.array([(1, 1, 0), (1, -1, 0), (-1, -1, 0), (-1, 1, 0)], dtype=float)
    reach = np.array([half[0] + _REACH, half[1] + _REACH, 0.0])
    corners = (signs * reach) @ body.rotation.T + middle
    corners = _ahead(corners @ view.pose[:3, :3], pinhole.near)
    if not len(corners):
        return None
    x, y, depth = corners.T
    columns, rows = x / depth * pinhole.focal + pinhole.center_x, y / depth * pinhole.focal + pinhole.center_y
    left, right = max(math.floor(columns.min()), 0), min(math.ceil(columns.max()) + 1, pinhole.width)
    top, bottom = max(math.floor(rows.min()), 0), min(math.ceil(rows.max()) + 1, pinhole.height)
    if left >= right or top >= bottom:
        return None
    return slice(top, bottom), slice(left, right)


def _ahead(corners: Array, near: float) -> Array:
    """Return the part (M, 3) of a polygon (N, 3) in the camera frame beyond the near plane."""
    if (corners[:, 2] >= near).all():
        return corners
    found = []
    for first, second in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if first[2] >= near:
            found.append(first)
        if (first[2] >= near) != (second[2] >= near):
            found.append(first + (near - first[2]) / (second[2] - first[2]) * (second - first))
    return np.array(found).reshape(-1, 3)

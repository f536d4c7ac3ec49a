"""Shadows: of the sun, and reduced sky light below and beside bodies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats, Integers
from eidrive_scenario.base.kernels import kernel
from eidrive_scenario.rendering.model import MeshInstance
from eidrive_scenario.rendering.projection import CameraView
from eidrive_scenario.rendering.rasterization import Cover

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

    def drawn(self, casters: Sequence[MeshInstance], onto: Floats | None = None) -> Floats:
        """Return the heights (height, width) along the rays of the sun of the first surface of bodies, -inf without.

        They are drawn onto the heights of other bodies. They are those of the sides that face away from the sun: the
        sides that face it are above and do not shade themselves.
        """
        nothing = np.full((self.height, self.width), np.float32(-np.inf))
        heights = nothing if onto is None else onto.copy()
        away = [corners for caster in casters if (corners := _away(caster, self)) is not None]
        if away:
            corners = np.concatenate(away)
            across, up, level = ((corners @ axis).reshape(-1, 3).T for axis in (*self.axes, self.towards))
            across, up = (across - self.low[0]) * self.scale, (up - self.low[1]) * self.scale
            Cover(np.empty(heights.shape, dtype=np.int32), heights).draw(across, up, level - self.base)
        return heights


class Shadows(NamedTuple):
    """Shadows of the sun.

    heights  (height, width) along the rays of the sun of the first surface in a grid, -inf without
    rows     (4, 4) columns, lines and heights of points relative to the camera: factors of x, y, z, and the constant;
             in the last row the scale of columns and lines
    """

    heights: Floats
    rows: Floats

    @classmethod
    def of(cls, grid: ShadowGrid | None, heights: Floats | None) -> Shadows:
        """Return the shadows of these heights in a grid; none without a grid."""
        if grid is None or heights is None:
            return cls(np.empty((0, 0), dtype=np.float32), np.zeros((4, 4), dtype=np.float32))
        margin = _SLACK + 0.35 / grid.scale - grid.base
        rows = np.column_stack([np.vstack([grid.axes, grid.towards]), [-grid.low[0], -grid.low[1], margin]])
        return cls(heights, np.vstack([rows, np.full(4, grid.scale)]).astype(np.float32))

    def sun_share(self, places: Floats) -> Floats:
        """Return the share of the sun (n,) at points (3 or more, n) relative to the camera [m], 1 outside the grid."""
        share = np.empty(places.shape[1], dtype=np.float32)
        _share_of_sun(places, self.heights, self.rows, share)
        return share

    def mark_new(self, before: Floats, places: Floats, pixels: Integers, changed: NDArray[np.bool_]) -> None:
        """Mark pixels (n,) with points at these places whose shadows may differ from those of lower heights."""
        _mark_new(places, self.heights, before, self.rows, pixels, changed)


@kernel("f4(f4, f4, f4, f4[:,::1], i8)")
def _coordinate(x: np.float32, y: np.float32, z: np.float32, rows: Floats, axis: int) -> np.float32:
    """Return the column (axis 0) or line (axis 1) of a point, counted from the center of the first cell."""
    along = rows[axis, 0] * x + rows[axis, 1] * y + rows[axis, 2] * z + rows[axis, 3]
    return along * rows[3, 0] - np.float32(0.5)  # type: ignore[no-any-return]


@kernel("void(f4[:,::1], f4[:,::1], f4[:,::1], f4[::1])")
def _share_of_sun(places: Floats, heights: Floats, rows: Floats, share: Floats) -> None:
    """Compute the share of the sun of points: interpolated between the four cells around each, lit or not."""
    one = np.float32(1.0)
    height, width = heights.shape
    for point in range(len(share)):
        share[point] = one
        x, y, z = places[0, point], places[1, point], places[2, point]
        column, line = _coordinate(x, y, z, rows, 0), _coordinate(x, y, z, rows, 1)
        if not (0.0 <= column < width - 1 and 0.0 <= line < height - 1):
            continue
        left, top = int(column), int(line)
        level = rows[2, 0] * x + rows[2, 1] * y + rows[2, 2] * z + rows[2, 3]
        right, down = column - np.float32(left), line - np.float32(top)
        upper, lower = np.float32(0.0), np.float32(0.0)
        if heights[top, left] > level:
            upper += one - right
        if heights[top, left + 1] > level:
            upper += right
        if heights[top + 1, left] > level:
            lower += one - right
        if heights[top + 1, left + 1] > level:
            lower += right
        share[point] = one - (upper + (lower - upper) * down)


@kernel("void(f4[:,::1], f4[:,::1], f4[:,::1], f4[:,::1], i8[::1], b1[::1])")
def _mark_new(
    places: Floats, heights: Floats, before: Floats, rows: Floats, pixels: Integers, changed: NDArray[np.bool_]
) -> None:
    height, width = heights.shape
    for point, pixel in enumerate(pixels):
        x, y, z = places[0, point], places[1, point], places[2, point]
        column, line = _coordinate(x, y, z, rows, 0), _coordinate(x, y, z, rows, 1)
        if 0.0 <= column < width - 1 and 0.0 <= line < height - 1:
            left, top = int(column), int(line)
            for row in (top, top + 1):
                changed[pixel] |= heights[row, left] > before[row, left]
                changed[pixel] |= heights[row, left + 1] > before[row, left + 1]


def shadow_grid(towards: Array, view: CameraView, lowest: float, highest: float) -> ShadowGrid | None:
    """Return the grid for the view of a camera; None if the sun is too low.

    lowest, highest  heights of the roads within reach [m]
    """
    if towards[2] < _LOWEST:
        return None
    first = np.cross(towards, (0.0, 0.0, 1.0) if abs(towards[2]) < 0.99 else (1.0, 0.0, 0.0))
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(towards, first)])
    seen = _seen_ground(view, lowest, highest)
    flat = seen @ axes.T
    low, high = flat.min(axis=0) - 0.5, flat.max(axis=0) + 0.5
    pixels = min(max(1.2 * view.pinhole.width, _COARSEST), _FINEST)
    scale = min(pixels / float((high - low).max()), 20.0)
    width, height = (max(math.ceil(extent * scale), 2) for extent in (high - low).tolist())
    base = float((seen @ towards).min()) - _DEPTH
    return ShadowGrid(axes, towards, low, high, width, height, scale, base, view.position)


def _seen_ground(view: CameraView, lowest: float, highest: float) -> Array:
    """Return points (M, 3) relative to the camera around the view within reach, near the ground and above."""
    pinhole, pose = view.pinhole, view.pose
    columns = (np.array([0.0, 0.5, 1.0]) * pinhole.width - pinhole.center_x) / pinhole.focal
    rows = (np.array([0.0, 0.5, 1.0]) * pinhole.height - pinhole.center_y) / pinhole.focal
    right, down, ahead = pose[2, :3].tolist()
    # The farthest ground is at the horizon, if that is in the image.
    horizon = np.clip([-(ahead + right * column) / (down or 1.0) for column in columns], rows[0], rows[-1])
    rays = np.array([(x, y, 1.0) for x, level in zip(columns, horizon, strict=True) for y in (*rows, level)])
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True) @ pose[:3, :3].T
    low, high = lowest - pose[2, 3] - 0.5, max(highest - pose[2, 3] + 6.0, 1.0)
    points = [np.zeros(3)]
    for ray in rays:
        reach = REACH
        if ray[2] < -1e-9:
            reach = min(reach, low / ray[2])
        elif ray[2] > 1e-9:
            reach = min(reach, high / ray[2])
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


def dimmed(bodies: Sequence[MeshInstance], cover: Cover, upright: NDArray[np.bool_], view: CameraView) -> Floats:
    """Return the share (H, W) of sky light on the ground in the pixels; `upright` by triangle."""
    share = np.ones(view.shape, dtype=np.float32)
    for body in bodies:
        half = body.model.half
        middle = body.rotation @ np.array([*body.model.center[:2], 0.0]) + body.position - view.position
        away = math.sqrt(float(middle @ middle))
        if 2.0 * float(half[0]) * view.pinhole.focal < _FEWEST_PIXELS * away:
            continue
        window = _window(middle, body, half, view)
        if window is None:
            continue
        triangle = cover.triangle[window]
        pixels = np.arange(share.size).reshape(share.shape)[window][upright[triangle] & (triangle >= 0)]
        forward = body.rotation[:2, 0].astype(np.float32) / np.float32(math.hypot(*body.rotation[:2, 0]))
        base = np.array([*middle, *half[:2], *forward], dtype=np.float32)
        _darken(pixels, view.places(pixels, cover.nearness), base, share.ravel())
    return share


@kernel("void(i8[::1], f4[:,::1], f4[::1], f4[::1])")
def _darken(pixels: Integers, places: Floats, base: Floats, share: Floats) -> None:
    """Darken the ground around the rectangle below a body: x, y, z of its center, half extents, and its direction."""
    zero, one, two = np.float32(0.0), np.float32(1.0), np.float32(2.0)
    cos, sin = base[5], base[6]
    for point, pixel in enumerate(pixels):
        if abs(places[2, point] - base[2]) < np.float32(_NEAR_GROUND):
            dx, dy = places[0, point] - base[0], places[1, point] - base[1]
            # Distance from the rectangle, negative inside
            ahead, aside = abs(cos * dx + sin * dy) - base[3], abs(cos * dy - sin * dx) - base[4]
            inwards = min(max(ahead, aside), zero)
            ahead, aside = max(ahead, zero), max(aside, zero)
            outside = np.sqrt(ahead * ahead + aside * aside) + inwards
            rise = min(max((outside + np.float32(_INSET)) / np.float32(_INSET + _REACH), zero), one)
            rise *= two - rise
            share[pixel] = min(share[pixel], np.float32(_LEAST) + np.float32(1.0 - _LEAST) * rise)


def _window(middle: Array, body: MeshInstance, half: Array, view: CameraView) -> tuple[slice, slice] | None:
    """Return the lines and columns of the image around the darkened ground of a body; None if it is outside."""
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
    clipped = []
    for first, second in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if first[2] >= near:
            clipped.append(first)
        if (first[2] >= near) != (second[2] >= near):
            clipped.append(first + (near - first[2]) / (second[2] - first[2]) * (second - first))
    return np.array(clipped).reshape(-1, 3)

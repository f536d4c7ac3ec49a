"""Contact shadows: reduced sky light below and beside bodies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Floats
from eidrive_scenario.world.render.camera_view import CameraView
from eidrive_scenario.world.render.model import MeshInstance
from eidrive_scenario.world.render.rasterization import Cover

_LEAST = 0.12
"""Share of sky light below the center of a body."""
_REACH = 0.9
"""Distance from a body within which the ground is darkened [m]."""
_INSET = 0.35
"""Distance from the edge to the darkest line below a body [m]."""
_NEAR_GROUND = 0.12
"""Maximum height difference between the base of a body and darkened ground [m]."""
_FEWEST_PIXELS = 10.0


class _Window(NamedTuple):
    lines: slice
    columns: slice


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
    return _Window(slice(top, bottom), slice(left, right))


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

"""The dimness under and close around bodies, where they keep the sky's light from the ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.world.camera import Pinhole
from eidrive_scenario.world.render.model import Array, Floats, Instance

_LEAST = 0.12
"""Share of the sky's light in the middle below a body."""
_REACH = 0.9
"""How far around a body the ground is dimmed [m]."""
_INSET = 0.35
"""How far under its edge it is darkest [m]."""
_NEAR_GROUND = 0.12
"""How far from the level of a body's foot ground may lie to be dimmed [m]."""
_FEWEST_PIXELS = 10.0


class Ground(NamedTuple):
    """Points (n,) relative to the camera, whether their surfaces look up, and where each pixel's point is: the index
    (H, W) among them, or -1."""

    x: Floats
    y: Floats
    z: Floats
    upright: NDArray[np.bool_]
    where: NDArray[np.int32]


def dimmed(bodies: Sequence[Instance], ground: Ground, pose: Array, pinhole: Pinhole) -> Floats:
    """(n,) share of the sky's light that bodies leave to points of the ground."""
    share = np.ones(len(ground.x), dtype=np.float32)
    for body in bodies:
        half = body.model.half
        middle = body.rotation @ np.array([*body.model.centre[:2], 0.0]) + body.position - pose[:3, 3]
        away = math.sqrt(float(middle @ middle))
        if 2.0 * float(half[0]) * pinhole.focal < _FEWEST_PIXELS * away:
            continue
        window = _window(middle, body, half, pose, pinhole)
        if window is None:
            continue
        rows = ground.where[window].ravel()
        rows = rows[rows >= 0]
        rows = rows[ground.upright[rows] & (np.abs(ground.z[rows] - np.float32(middle[2])) < _NEAR_GROUND)]
        if not len(rows):
            continue
        dx, dy = ground.x[rows] - np.float32(middle[0]), ground.y[rows] - np.float32(middle[1])
        cos, sin = body.rotation[:2, 0].astype(np.float32) / np.float32(math.hypot(*body.rotation[:2, 0]))
        ahead = np.abs(cos * dx + sin * dy) - np.float32(half[0])
        aside = np.abs(cos * dy - sin * dx) - np.float32(half[1])
        outside = np.hypot(np.maximum(ahead, 0.0), np.maximum(aside, 0.0)) + np.minimum(np.maximum(ahead, aside), 0.0)
        rise = np.clip((outside + np.float32(_INSET)) / np.float32(_INSET + _REACH), np.float32(0.0), np.float32(1.0))
        rise *= np.float32(2.0) - rise
        share[rows] = np.minimum(share[rows], np.float32(_LEAST) + np.float32(1.0 - _LEAST) * rise)
    return share


def _window(middle: Array, body: Instance, half: Array, pose: Array, pinhole: Pinhole) -> tuple[slice, slice] | None:
    """The part of the picture that the dimmed ground around a body can fill; None where it is out of the picture."""
    signs = np.array([(1, 1, 0), (1, -1, 0), (-1, 1, 0), (-1, -1, 0)], dtype=float)
    reach = np.array([half[0] + _REACH, half[1] + _REACH, 0.0])
    corners = (signs * reach) @ body.rotation.T + middle
    x, y, depth = (corners @ pose[:3, :3]).T
    if (depth < pinhole.near).all():
        return None
    if (depth < 0.5).any():
        return slice(0, pinhole.height), slice(0, pinhole.width)
    columns, rows = x / depth * pinhole.focal + pinhole.centre_x, y / depth * pinhole.focal + pinhole.centre_y
    left, right = max(math.floor(columns.min()), 0), min(math.ceil(columns.max()) + 1, pinhole.width)
    top, bottom = max(math.floor(rows.min()), 0), min(math.ceil(rows.max()) + 1, pinhole.height)
    if left >= right or top >= bottom:
        return None
    return slice(top, bottom), slice(left, right)

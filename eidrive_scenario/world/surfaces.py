"""Surfaces of bodies as triangles, for sensors that cast many rays."""

from __future__ import annotations

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array, Integers

_SIGNS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], dtype=float)
BOX_FACES = np.array(
    [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4), (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6),
     (3, 0, 4), (3, 4, 7)]
)  # fmt: skip
"""Faces of a box as rows of `box_corners`: four corners of the bottom, then four of the top."""


class Surfaces(msgspec.Struct, frozen=True):
    """Triangles in groups of neighbors, so that those out of reach are skipped together.

    triangles  (K, 3, 3) corners [m]
    first      (G + 1,) first triangle of each group, and K
    spheres    (G, 4) sphere around each group: center and radius [m]
    reflectivity  (K,) share of light that is reflected diffusely, relative to other surfaces of the same kind
    closed     whether the triangles form closed skins, counter-clockwise seen from outside
    """

    triangles: Array
    first: Integers
    spheres: Array
    reflectivity: Array
    closed: bool = False

    @classmethod
    def group(cls, triangles: Array, size: int, reflectivity: Array | None = None, *, closed: bool = False) -> Surfaces:
        """Return triangles (K, 3, 3) in groups of `size` in their order."""
        if reflectivity is None:
            reflectivity = np.ones(len(triangles))
        first = np.append(np.arange(0, len(triangles), size), len(triangles))
        low = np.minimum.reduceat(triangles.min(axis=1), first[:-1])
        high = np.maximum.reduceat(triangles.max(axis=1), first[:-1])
        center = (low + high) / 2.0
        away = np.linalg.norm(triangles - center.repeat(np.diff(first), axis=0)[:, None], axis=2).max(axis=1)
        radius = np.maximum.reduceat(away, first[:-1])
        spheres = np.column_stack([center, radius])
        return cls(np.ascontiguousarray(triangles), first, spheres, reflectivity, closed)

    @classmethod
    def of_boxes(cls, boxes: Array) -> Surfaces:
        """Return the surfaces of boxes (N, 7): center of the bottom x, y, z, length, width, height [m], heading."""
        return cls.group(box_corners(boxes)[:, BOX_FACES].reshape(-1, 3, 3), len(BOX_FACES))

    @classmethod
    def join(cls, *parts: Surfaces) -> Surfaces:
        """Return the surfaces of all parts, none of which counts as closed."""
        start = np.cumsum([0, *(len(part.triangles) for part in parts)])
        first = [part.first[:-1] + begin for part, begin in zip(parts, start[:-1], strict=True)]
        return cls(
            np.concatenate([part.triangles for part in parts]),
            np.concatenate([*first, start[-1:]]),
            np.concatenate([part.spheres for part in parts]),
            np.concatenate([part.reflectivity for part in parts]),
        )


def box_corners(boxes: Array) -> Array:
    """Return the corners (N, 8, 3) of boxes (N, 7): center of the bottom x, y, z, length, width, height, heading."""
    boxes = np.reshape(boxes, (-1, 7))
    along, lateral = boxes[:, 3:4] / 2 * _SIGNS[:, 0], boxes[:, 4:5] / 2 * _SIGNS[:, 1]
    cos, sin = np.cos(boxes[:, 6:7]), np.sin(boxes[:, 6:7])
    x, y = boxes[:, 0:1] + cos * along - sin * lateral, boxes[:, 1:2] + sin * along + cos * lateral
    low = np.stack([x, y, np.broadcast_to(boxes[:, 2:3], x.shape)], axis=2)
    return np.concatenate([low, low + boxes[:, None, 5:6] * (0.0, 0.0, 1.0)], axis=1)


_FAR = 1e7
LEVEL_GROUND = Surfaces.group(
    np.array([(-_FAR, -_FAR, 0.0), (_FAR, -_FAR, 0.0), (_FAR, _FAR, 0.0), (-_FAR, _FAR, 0.0)])[[(0, 1, 2), (0, 2, 3)]],
    2,
)
"""The plane z = 0, as far as coordinates of maps reach."""

"""Concave triangle meshes as collision shapes of pybullet, without its memory leak.

`createCollisionShape` of pybullet 3.2.7 keeps two references to each vertex of `vertices`, and two to `vertices` and
`indices`, forever. All calls therefore share one set of vertex lists, and the two sequences are emptied after each
call: a call leaks two empty lists.
"""

from __future__ import annotations

from threading import Lock

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.world.physics.bullet import bullet

_vertices: list[list[float]] = []
"""Shared vertices, as many as the largest mesh had."""
_lock = Lock()


def create_triangle_shape(client: int, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> int:
    """Return the collision shape of a mesh: vertices (N, 3) [m], faces (M, 3) of rows in them."""
    with _lock:
        for row, vertex in enumerate(vertices.tolist()):
            if row < len(_vertices):
                _vertices[row][:] = vertex
            else:
                _vertices.append(vertex)
        points, corners = _vertices[: len(vertices)], faces.ravel().tolist()
        shape: int = bullet.createCollisionShape(
            bullet.GEOM_MESH,
            vertices=points,
            indices=corners,
            flags=bullet.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=client,
        )
        points.clear()
        corners.clear()
    return shape

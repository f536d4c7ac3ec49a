"""pybullet: its import without the build message, its clients, static bodies and triangle meshes."""

from __future__ import annotations

import os
import sys
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.files.bounded import file_in_memory

RAYS, SCRIPTED, DRIVEN, STATIC, TERRAIN = 1, 2, 4, 8, 16
"""Groups of the collision filter of pybullet; rays belong to the first by default."""

RESTITUTION = 0.3
"""Restitution of one body. Two rebound with its square, about 0.1, as cars above some 5 m/s."""
BODY_FRICTION = 0.7
"""Coefficient of friction of one body, whose product with that of the other counts."""
_NOTICE = b"pybullet build time:"


def _import_silently() -> Any:
    """Import pybullet while file descriptor 2 refers to a file in memory. Other output is passed on.

    The message is printed by C code, which `contextlib.redirect_stderr` does not affect.
    """
    if sys.stderr is not None:
        sys.stderr.flush()
    try:
        kept = os.dup(2)
    except OSError:  # Without a standard error of the process there is no message to suppress.
        import pybullet

        return pybullet
    with file_in_memory() as caught:
        os.dup2(caught.fileno(), 2)
        try:
            import pybullet
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            caught.seek(0)
            other = b"".join(line for line in caught if not line.startswith(_NOTICE))
            if other:
                os.write(2, other)
    return pybullet


bullet: Any = _import_silently()


_idle: list[int] = []
"""Clients of closed worlds that the next world uses. To connect takes several times as long as to empty a client."""
_MOST_IDLE = 1


def connect() -> int:
    """Return a client without a window and without bodies. Raise SimulationError if pybullet has no free client."""
    try:
        return _idle.pop()
    except IndexError:
        client: int = bullet.connect(bullet.DIRECT)
    if client < 0:
        raise SimulationError("pybullet gives no further client: close the worlds that are no longer used")
    return client


def disconnect(client: int) -> None:
    """Free a client with all its bodies. An emptied client is kept for the next world."""
    if len(_idle) < _MOST_IDLE:
        bullet.resetSimulation(physicsClientId=client)
        _idle.append(client)
    else:
        bullet.disconnect(physicsClientId=client)


def create_static_body(client: int, shape: int, group: int, meets: int, visual: int = -1) -> int:
    """Create a body at the origin, and return its handle.

    group, meets  groups of the collision filter: its own, and those of the bodies and rays that it blocks
    visual        visual shape; -1 for the one of the collision shape
    """
    here = {"physicsClientId": client}
    handle: int = bullet.createMultiBody(0.0, shape, visual, useMaximalCoordinates=1, **here)
    bullet.changeDynamics(handle, -1, lateralFriction=BODY_FRICTION, restitution=RESTITUTION, **here)
    bullet.setCollisionFilterGroupMask(handle, -1, group, meets, **here)
    return handle


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

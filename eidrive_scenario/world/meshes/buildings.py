"""Meshes of buildings: walls with rows of windows, and a roof."""

from __future__ import annotations

from eidrive_scenario.arrays import Array
from eidrive_scenario.world.actor import Vector3
from eidrive_scenario.world.meshes.solids import Mesh, box, polygon
from eidrive_scenario.world.road_objects import STOREY

WINDOW = (1.3, 1.5)
"""Width and height of a window [m]."""
PITCH = 3.0
"""Distance between windows [m]."""
_PROUD = 0.03


def building(size: Vector3) -> dict[str, Array]:
    """Return triangles by material of a building of this size; origin at its center on the ground."""
    length, width, height = size
    mesh = Mesh()
    mesh.add("wall", box((0, 0, height / 2 - 0.1), (length - 2 * _PROUD, width - 2 * _PROUD, height - 0.2)))
    mesh.add("roof", box((0, 0, height - 0.15), (length, width, 0.3)))
    mesh.add("plastic", box((0, 0, 0.25), (length, width, 0.5)))
    storeys = max(int((height - 0.8) / STOREY), 1)
    for wall, reach, turned in ((length, width / 2, False), (width, length / 2, True)):
        columns = int((wall - 1.0) / PITCH)
        for storey in range(storeys):
            low = 0.5 + storey * STOREY + 0.9
            high = min(low + WINDOW[1], height - 0.4)
            for column in range(columns):
                center = (column - (columns - 1) / 2) * PITCH
                for sign in (-1.0, 1.0):
                    mesh.add("window", _window(center, sign * (reach - _PROUD / 2), low, high, turned))
    return mesh.materials()


def _window(center: float, at: float, low: float, high: float, turned: bool) -> Array:
    half = WINDOW[0] / 2 * (1.0 if at < 0.0 else -1.0)
    corners = [(center - half, low), (center + half, low), (center + half, high), (center - half, high)]
    if turned:
        return polygon([(at, -along, up) for along, up in corners])
    return polygon([(along, at, up) for along, up in corners])

"""Meshes of masts and boxes."""

from __future__ import annotations

from eidrive_scenario.world.meshes.body_dimensions import BodyDimensions
from eidrive_scenario.world.meshes.solids import Mesh, bevelled_box, box, cylinder


def roadside_unit(frame: BodyDimensions) -> Mesh:
    """Return a mast with a cabinet at its base and a head of camera, lidar and antenna."""
    mesh = Mesh()
    z, side = frame.z, frame.side
    half = frame.length / 2
    pole = min(0.09, 0.35 * side)
    mesh.add("steel", cylinder((0, 0, 0), (0, 0, z(0.94)), pole, 0.7 * pole, sides=12))
    mesh.add("plastic", cylinder((0, 0, 0), (0, 0, 0.06), 2.0 * pole, sides=12))
    mesh.add(
        "white", bevelled_box((-0.35 * half, 0, min(1.3, 0.35 * frame.height)), (0.6 * half, 1.3 * side, 0.6), 0.03)
    )
    mesh.add("white", bevelled_box((0.45 * half, 0, z(0.90)), (1.0 * half, 0.7 * side, 0.16), 0.03))
    mesh.add("glass", box((0.96 * half, 0, z(0.90)), (0.03, 0.45 * side, 0.10)))
    mesh.add("trim", cylinder((0, 0, z(0.94)), (0, 0, z(0.965)), 1.4 * pole, sides=14))
    mesh.add("glass", cylinder((0, 0, z(0.965)), (0, 0, z(0.985)), 1.2 * pole, sides=14))
    mesh.add_mirrored(
        "trim", cylinder((-0.4 * half, 0.5 * side, z(0.90)), (-0.4 * half, 0.5 * side, z(1.0)), 0.02, sides=6)
    )
    mesh.add("trim", box((-0.3 * half, 0, z(0.90)), (0.3 * half, 1.1 * side, 0.03)))
    mesh.add("blue_light", box((-0.35 * half, 0, min(1.3, 0.35 * frame.height) + 0.31), (0.2 * half, 0.4 * side, 0.03)))
    return mesh


def crate(frame: BodyDimensions) -> Mesh:
    """Return a box with battens, for objects without a specific mesh."""
    mesh = Mesh()
    length, width, height = frame.length, frame.width, frame.height
    batten = 0.06 * min(length, width, height)
    inner = (length - 2 * batten, width - 2 * batten, height - 2 * batten)
    mesh.add("paint", box((0, 0, height / 2), inner))
    thick = 2 * batten
    for sy in (-1, 1):
        for sz in (-1, 1):
            y, up = sy * (width - thick) / 2, height / 2 + sz * (height - thick) / 2
            mesh.add("plastic", box((0, y, up), (length, thick, thick)))
        for sx in (-1, 1):
            mesh.add(
                "plastic",
                box((sx * (length - thick) / 2, sy * (width - thick) / 2, height / 2), (thick, thick, height)),
            )
    for sx in (-1, 1):
        for sz in (-1, 1):
            x, up = sx * (length - thick) / 2, height / 2 + sz * (height - thick) / 2
            mesh.add("plastic", box((x, 0, up), (thick, width, thick)))
    return mesh

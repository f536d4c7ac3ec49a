"""People, masts and boxes."""

from __future__ import annotations

from eidrive_scenario.world.meshes.frame import Frame
from eidrive_scenario.world.meshes.solids import Mesh, ball, bevelled_box, box, cylinder, tapered_box


def pedestrian(frame: Frame) -> Mesh:
    """Somebody in mid-stride, arms swinging, inside the box."""
    mesh = Mesh()
    z, side = frame.z, frame.side
    stride = min(0.5 * frame.length - 0.11, 0.16 * frame.height)
    shoulder = min(0.132 * frame.height, side - 0.06)
    hip, neck, head = z(0.50), z(0.835), 0.068 * frame.height
    thigh, calf = 0.047 * frame.height, 0.034 * frame.height
    for sign in (-1, 1):
        y = sign * 0.40 * shoulder
        knee = (0.45 * sign * stride + 0.03, y, z(0.275))
        ankle = (sign * stride, y, z(0.05))
        mesh.add("trousers", cylinder((0, y, hip + 0.02), knee, thigh, 0.85 * thigh, sides=8))
        mesh.add("trousers", cylinder(knee, ankle, 0.85 * thigh, calf, sides=8))
        mesh.add("shoes", bevelled_box((ankle[0] + 0.04, y, z(0.023)), (0.24, 0.10, z(0.046)), 0.015))
        arm = sign * shoulder
        hand = (-0.8 * sign * stride, arm, z(0.47))
        elbow = (-0.35 * sign * stride - 0.02, arm, z(0.645))
        mesh.add("paint", cylinder((0, arm, neck - 0.05), elbow, 0.034 * frame.height, 0.03 * frame.height, sides=8))
        mesh.add("paint", cylinder(elbow, hand, 0.03 * frame.height, 0.024 * frame.height, sides=8))
        mesh.add("skin", ball(hand, (0.045, 0.035, 0.055), 4, 6))
    mesh.add("trousers", bevelled_box((0, 0, hip), (0.2, 1.5 * shoulder, z(0.08)), 0.04))
    mesh.add(
        "paint",
        tapered_box((0, 0, (hip + neck) / 2 + 0.02), (0.19, 1.45 * shoulder, neck - hip), (0.22, 2.0 * shoulder)),
    )
    mesh.add("skin", cylinder((0, 0, neck), (0, 0, neck + 0.03 * frame.height), 0.05, sides=8))
    mesh.add("skin", ball((0.01, 0, frame.height - 1.12 * head), (0.82 * head, 0.72 * head, head)))
    mesh.add("hair", ball((-0.015, 0, frame.height - 0.92 * head), (0.86 * head, 0.78 * head, 0.92 * head)))
    return mesh


def roadside_unit(frame: Frame) -> Mesh:
    """A mast with a cabinet at its foot and a head of camera, LiDAR and antenna."""
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


def crate(frame: Frame) -> Mesh:
    """A box with battens, for whatever has no shape of its own."""
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

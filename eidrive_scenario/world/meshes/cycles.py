"""Meshes of two-wheelers with their riders."""

from __future__ import annotations

from eidrive_scenario.world.meshes.body_dimensions import BodyDimensions, add_extra_wheels
from eidrive_scenario.world.meshes.solids import Mesh, ball, bevelled_box, box, cylinder, tapered_box


def motorbike(frame: BodyDimensions) -> Mesh:
    """Return a motorbike and a rider with helmet, of the height of the frame."""
    mesh = Mesh()
    radius, x0, x1 = min(frame.wheel_radius, 0.34), frame.rear, frame.front
    base = x1 - x0
    for axle, wide in ((x0, 0.17), (x1, 0.12)):
        _wheel(mesh, axle, radius, wide, 0.62)
    add_extra_wheels(mesh, frame, frame.side, 0.12)
    middle, seat = x0 + 0.45 * base, 2 * radius + 0.16
    mesh.add("plastic", bevelled_box((middle, 0, radius + 0.08), (0.44 * base, 0.26, 0.34), 0.05))
    mesh.add("steel", cylinder((middle - 0.2, -0.15, radius), (x0 - 0.15, -0.17, radius + 0.06), 0.055, sides=8))
    mesh.add("paint", bevelled_box((middle + 0.14 * base, 0, seat + 0.02), (0.36 * base, 0.27, 0.22), 0.06))
    mesh.add("leather", bevelled_box((x0 + 0.22 * base, 0, seat), (0.48 * base, 0.25, 0.10), 0.03))
    mesh.add("paint", tapered_box((x0 - 0.04, 0, seat - 0.02), (0.36, 0.18, 0.09), (0.26, 0.14), -0.04))
    steer = (x1 - 0.20 * base, 0.0, seat + 0.24)
    mesh.add_mirrored("steel", cylinder((x1, 0.075, radius), (steer[0], 0.075, steer[2]), 0.03, sides=8))
    mesh.add("trim", cylinder((steer[0], -0.36, steer[2] + 0.05), (steer[0], 0.36, steer[2] + 0.05), 0.025, sides=8))
    mesh.add("headlight", ball((x1 - 0.08 * base, 0, seat + 0.10), (0.07, 0.09, 0.09)))
    mesh.add("paint", box((x1, 0, 2 * radius + 0.03), (0.42, 0.12, 0.03)))
    mesh.add("taillight", box((x0 - 0.22, 0, seat), (0.04, 0.12, 0.06)))
    for along in (x0 - 0.20, x1 - 0.06 * base):
        mesh.add_sided("indicator", ball((along, 0.14, seat), (0.03, 0.03, 0.03), 4, 6))
    mesh.add("plate", box((x0 - 0.25, 0, seat - 0.16), (0.02, 0.20, 0.16)))
    _rider(mesh, frame, x0 + 0.30 * base, seat + 0.05, steer, foot=(middle, 0.17, radius - 0.02), lean=0.20)
    return mesh


def bicycle(frame: BodyDimensions) -> Mesh:
    """Return a bicycle and a rider."""
    mesh = Mesh()
    radius, x0, x1 = min(frame.wheel_radius, 0.36), frame.rear, frame.front
    base = x1 - x0
    for axle in (x0, x1):
        _wheel(mesh, axle, radius, 0.045, 0.88)
    add_extra_wheels(mesh, frame, frame.side, 0.05)
    crank, head, saddle = x0 + 0.42 * base, x1 - 0.16 * base, x0 + 0.26 * base
    high = min(0.56 * frame.height, 0.98)
    for start, end in (
        ((crank, radius), (saddle, high)),
        ((crank, radius), (head, high - 0.10)),
        ((saddle, high - 0.12), (head, high - 0.02)),
        ((x0, radius), (crank, radius)),
        ((x0, radius), (saddle, high - 0.14)),
        ((x1, radius), (head, high + 0.06)),
    ):
        mesh.add("red", cylinder((start[0], 0, start[1]), (end[0], 0, end[1]), 0.022, sides=6))
    mesh.add("leather", tapered_box((saddle, 0, high + 0.03), (0.27, 0.16, 0.06), (0.24, 0.10), 0.02))
    mesh.add("trim", cylinder((head + 0.02, -0.28, high + 0.09), (head + 0.02, 0.28, high + 0.09), 0.02, sides=6))
    mesh.add("headlight", box((head + 0.10, 0, high), (0.05, 0.06, 0.06)))
    mesh.add("taillight", box((x0 - 0.02, 0, high - 0.22), (0.03, 0.05, 0.05)))
    _rider(
        mesh, frame, saddle, high + 0.06, (head + 0.02, 0.0, high + 0.10), foot=(crank, 0.10, radius - 0.10), lean=0.16
    )
    return mesh


def _wheel(mesh: Mesh, x: float, radius: float, wide: float, rim: float) -> None:
    mesh.add("tire", cylinder((x, -wide / 2, radius), (x, wide / 2, radius), radius, sides=18))
    mesh.add("rim", cylinder((x, -wide / 2 - 0.006, radius), (x, wide / 2 + 0.006, radius), rim * radius, sides=18))
    mesh.add("trim", cylinder((x, -wide / 2 - 0.01, radius), (x, wide / 2 + 0.01, radius), 0.2 * radius, sides=8))


def _rider(
    mesh: Mesh,
    frame: BodyDimensions,
    seat_x: float,
    seat_z: float,
    bar: tuple[float, float, float],
    foot: tuple[float, float, float],
    lean: float,
) -> None:
    """Add a rider who sits at seat_x, seat_z, holds the bar and has the feet on the pedals."""
    top = frame.height
    head = 0.115
    shoulder_x, shoulder_z = seat_x + lean, top - 2 * head - 0.04
    reach = min(0.26, frame.side - 0.05)
    chest = tapered_box(
        (seat_x, 0, (seat_z + shoulder_z) / 2),
        (0.24, 0.30, shoulder_z - seat_z),
        (0.24, 2 * reach - 0.06),
        shoulder_x - seat_x,
    )
    mesh.add("paint", chest)
    mesh.add("skin", cylinder((shoulder_x, 0, shoulder_z - 0.01), (shoulder_x + 0.03, 0, top - head), 0.06, sides=8))
    mesh.add("white", ball((shoulder_x + 0.04, 0, top - head), (head + 0.02, head, head)))
    mesh.add("trim", ball((shoulder_x + 0.09, 0, top - head - 0.005), (0.09, 0.09, 0.055)))
    elbow = ((shoulder_x + bar[0]) / 2, reach + 0.02, (shoulder_z + bar[2]) / 2 - 0.06)
    mesh.add_mirrored("paint", cylinder((shoulder_x, reach - 0.05, shoulder_z - 0.05), elbow, 0.06, 0.05, sides=8))
    mesh.add_mirrored("paint", cylinder(elbow, (bar[0], reach, bar[2]), 0.05, 0.04, sides=8))
    knee = (max(foot[0], seat_x) + 0.22, foot[1] + 0.03, (seat_z + foot[2]) / 2 + 0.12)
    mesh.add_mirrored("trousers", cylinder((seat_x, 0.10, seat_z + 0.06), knee, 0.085, 0.07, sides=8))
    mesh.add_mirrored("trousers", cylinder(knee, (foot[0], foot[1], foot[2] + 0.06), 0.07, 0.05, sides=8))
    mesh.add_mirrored("shoes", box((foot[0] + 0.05, foot[1], foot[2] + 0.03), (0.25, 0.09, 0.08)))

"""Meshes of pedestrians in the motions of the standard, and of two-wheelers with their riders."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.rendering.meshes.solids import (
    BodyDimensions,
    Mesh,
    add_extra_wheels,
    ball,
    bevelled_box,
    box,
    cylinder,
    moved,
    tapered_box,
)


class Posture(NamedTuple):
    """Posture of a body.

    pace     distance between the feet, as a share of the stride of walking
    hip      height of the hip as a share of the body height
    knee     distance of the knees ahead of the hip, and their height, as shares of the body height
    bend     forward bend of the upper body [rad]
    lift     lift of the body as a share of the height
    lies     on the back
    """

    pace: float = 0.0
    hip: float = 0.50
    knee: tuple[float, float] | None = None
    bend: float = 0.0
    lift: float = 0.0
    lies: bool = False


POSTURES: Mapping[str, Posture] = {
    "": Posture(pace=1.0),
    "standing": Posture(),
    "walking": Posture(pace=1.0),
    "running": Posture(pace=1.6, bend=0.15),
    "reeling": Posture(pace=0.7, bend=0.12),
    "cycling": Posture(hip=0.40, knee=(0.16, 0.34), bend=0.5),
    "sitting": Posture(hip=0.27, knee=(0.24, 0.27)),
    "squatting": Posture(hip=0.20, knee=(0.20, 0.30), bend=0.35),
    "ducking": Posture(hip=0.30, knee=(0.17, 0.27), bend=0.9),
    "bendingDown": Posture(hip=0.49, bend=1.25),
    "crawling": Posture(hip=0.26, knee=(0.02, 0.05), bend=1.45),
    "jumping": Posture(pace=0.5, lift=0.15),
    "lying": Posture(lies=True),
}
"""Postures by PedestrianMotionType of the standard; the default is walking."""


def pedestrian(frame: BodyDimensions, motion: str = "") -> Mesh:
    """Return a pedestrian in a motion of the standard: walking without one, standing if it is unknown."""
    posture = POSTURES.get(motion, POSTURES["standing"])
    mesh = Mesh()
    _legs(mesh, frame, posture)
    _upper_body(mesh, frame, posture)
    if posture.lies:
        _lay_down(mesh)
    elif posture.lift:
        for solids in mesh.triangles.values():
            solids[:] = [moved(solid, (0.0, 0.0, posture.lift * frame.height)) for solid in solids]
    return mesh


def _stride(frame: BodyDimensions, posture: Posture) -> float:
    return posture.pace * min(0.5 * frame.length - 0.11, 0.16 * frame.height)


def _shoulder(frame: BodyDimensions) -> float:
    return min(0.132 * frame.height, frame.side - 0.06)


def _legs(mesh: Mesh, frame: BodyDimensions, posture: Posture) -> None:
    z, stride, hip = frame.z, _stride(frame, posture), frame.z(posture.hip)
    thigh, calf = 0.047 * frame.height, 0.034 * frame.height
    for sign in (-1, 1):
        y = sign * 0.40 * _shoulder(frame)
        knee = (0.45 * sign * stride + 0.03, y, z(0.275))
        ankle = (sign * stride, y, z(0.05))
        if posture.knee is not None:
            knee = (posture.knee[0] * frame.height, y, z(posture.knee[1]))
            ankle = (knee[0] - (0.22 * frame.height if knee[2] < z(0.1) else 0.0), y, z(0.05))
        mesh.add("trousers", cylinder((0, y, hip + 0.02), knee, thigh, 0.85 * thigh, sides=8))
        mesh.add("trousers", cylinder(knee, ankle, 0.85 * thigh, calf, sides=8))
        mesh.add("shoes", bevelled_box((ankle[0] + 0.04, y, z(0.023)), (0.24, 0.10, z(0.046)), 0.015))
    mesh.add("trousers", bevelled_box((0, 0, hip), (0.2, 1.5 * _shoulder(frame), z(0.08)), 0.04))


def _upper_body(mesh: Mesh, frame: BodyDimensions, posture: Posture) -> None:
    """Add the upper body, bent about the hip, with hanging and swinging arms."""
    z, shoulder, head = frame.z, _shoulder(frame), 0.068 * frame.height
    hip, neck = z(0.50), z(0.835)
    down = z(posture.hip) - hip
    trunk = tapered_box((0, 0, (hip + neck) / 2 + 0.02), (0.19, 1.45 * shoulder, neck - hip), (0.22, 2.0 * shoulder))
    throat = cylinder((0, 0, neck), (0, 0, neck + 0.03 * frame.height), 0.05, sides=8)
    face = ball((0.01, 0, frame.height - 1.12 * head), (0.82 * head, 0.72 * head, head))
    hair = ball((-0.015, 0, frame.height - 0.92 * head), (0.86 * head, 0.78 * head, 0.92 * head))
    for material, solid in (("paint", trunk), ("skin", throat), ("skin", face), ("hair", hair)):
        mesh.add(material, moved(_bent(solid, hip, posture.bend), (0.0, 0.0, down)))
    stride = _stride(frame, posture)
    for sign in (-1, 1):
        arm = sign * shoulder
        top = moved(_bent(np.array([0.0, arm, neck - 0.05]), hip, posture.bend), (0.0, 0.0, down))
        reach = min(1.0, (float(top[2]) - 0.06) / (neck - 0.05 - z(0.47)))
        elbow = moved(top, (-0.35 * sign * stride - 0.02, 0.0, reach * (z(0.645) - neck + 0.05)))
        hand = moved(top, (-0.8 * sign * stride, 0.0, reach * (z(0.47) - neck + 0.05)))
        mesh.add("paint", cylinder(top, elbow, 0.034 * frame.height, 0.03 * frame.height, sides=8))
        mesh.add("paint", cylinder(elbow, hand, 0.03 * frame.height, 0.024 * frame.height, sides=8))
        mesh.add("skin", ball(hand, (0.045, 0.035, 0.055), 4, 6))


def _bent(solid: Array, hip: float, angle: float) -> Array:
    """Return a solid bent forward about the hip."""
    if angle == 0.0:
        return solid
    x, up = solid[..., 0], solid[..., 2] - hip
    cos, sin = math.cos(angle), math.sin(angle)
    return np.stack([cos * x + sin * up, solid[..., 1], hip + cos * up - sin * x], axis=-1)


def _lay_down(mesh: Mesh) -> None:
    """Rotate the body onto its back, with its center above the origin."""
    whole = np.concatenate([solid.reshape(-1, 3) for solids in mesh.triangles.values() for solid in solids])
    middle, back = whole[:, 2].max() / 2, whole[:, 0].min()
    for solids in mesh.triangles.values():
        solids[:] = [np.stack([middle - part[..., 2], part[..., 1], part[..., 0] - back], axis=-1) for part in solids]


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
    bar = (head + 0.02, 0.0, high + 0.10)
    _rider(mesh, frame, saddle, high + 0.06, bar, foot=(crank, 0.10, radius - 0.10), lean=0.16)
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
    top, head = frame.height, 0.115
    shoulder_x, shoulder_z = seat_x + lean, top - 2 * head - 0.04
    reach = min(0.26, frame.side - 0.05)
    chest = (0.24, 0.30, shoulder_z - seat_z)
    middle = (seat_x, 0, (seat_z + shoulder_z) / 2)
    mesh.add("paint", tapered_box(middle, chest, (0.24, 2 * reach - 0.06), shoulder_x - seat_x))
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

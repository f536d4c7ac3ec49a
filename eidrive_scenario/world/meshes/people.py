"""Meshes of pedestrians in the motions of the standard."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.world.meshes.body_dimensions import BodyDimensions
from eidrive_scenario.world.meshes.solids import Mesh, ball, bevelled_box, cylinder, moved, tapered_box


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


WALKING = Posture(pace=1.0)
POSTURES: Mapping[str, Posture] = {
    "": WALKING,
    "standing": Posture(),
    "walking": WALKING,
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


def in_motion(frame: BodyDimensions, motion: str) -> dict[str, Array]:
    """Return triangles by material of a pedestrian in a motion, standing if the motion is unknown."""
    return _held(frame, POSTURES.get(motion, POSTURES["standing"])).materials()


def pedestrian(frame: BodyDimensions) -> Mesh:
    """Return a walking pedestrian with swinging arms inside the box."""
    return _held(frame, WALKING)


def _held(frame: BodyDimensions, posture: Posture) -> Mesh:
    mesh = Mesh()
    _legs(mesh, frame, posture)
    _upper_body(mesh, frame, posture)
    if posture.lies:
        _lay_down(mesh)
    elif posture.lift:
        _move(mesh, (0.0, 0.0, posture.lift * frame.height))
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
        solids[:] = [
            np.stack([middle - solid[..., 2], solid[..., 1], solid[..., 0] - back], axis=-1) for solid in solids
        ]


def _move(mesh: Mesh, by: tuple[float, float, float]) -> None:
    for solids in mesh.triangles.values():
        solids[:] = [moved(solid, by) for solid in solids]

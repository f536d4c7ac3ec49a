"""Generated low-polygon meshes of actors, true to scale and deterministic for the same size."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.rendering.meshes.cars import ambulance, car, van
from eidrive_scenario.rendering.meshes.heavy import bus, firetruck, trailer, truck
from eidrive_scenario.rendering.meshes.people import bicycle, motorbike, pedestrian
from eidrive_scenario.rendering.meshes.road_objects import crate, roadside_unit
from eidrive_scenario.rendering.meshes.solids import BodyDimensions, Mesh
from eidrive_scenario.world.actor import ActorSpec, Vector3

BUILDERS: Mapping[str, Callable[[BodyDimensions], Mesh]] = {
    "car": car,
    "firetruck": firetruck,
    "ambulance": ambulance,
    "bus": bus,
    "van": van,
    "truck": truck,
    "motorbike": motorbike,
    "bicycle": bicycle,
    "pedestrian": pedestrian,
    "rsu": roadside_unit,
    "box": crate,
}


SMALLEST: Mapping[str, Vector3] = {
    "car": (1.5, 0.7, 0.5), "firetruck": (2.5, 0.9, 1.2), "ambulance": (2.0, 0.8, 0.9), "bus": (3.5, 0.9, 1.0),
    "van": (1.8, 0.7, 0.8), "truck": (2.5, 0.8, 1.2), "motorbike": (1.2, 0.3, 0.8), "bicycle": (0.8, 0.2, 0.8),
    "pedestrian": (0.15, 0.15, 0.4), "rsu": (0.1, 0.1, 0.8), "box": (0.0, 0.0, 0.0),
}  # fmt: skip
"""Smallest length, width and height of the bodies that the builders draw [m]: details such as plates and lamps have
fixed sizes. Smaller bodies are drawn like one of this size, and reduced."""


def actor_mesh(spec: ActorSpec, motion: str = "") -> Mapping[str, Array]:
    """Return triangles (K, 3, 3) of an actor by material: origin at the center of its box on the ground, x forward [m].

    A truck without a front axle is a trailer. A pedestrian stands, walks or lies by its motion, a value of the
    standard. Axles beyond the ends of the box are moved so that their wheels, which are at most as high as it, are in
    it; if both would be at one end, they have their usual distance.
    """
    shape, smallest = spec.shape, SMALLEST[spec.shape]
    along, across, up = (max(1.0, least / max(own, 1e-9)) for least, own in zip(smallest, spec.size, strict=True))
    length, width, height = spec.size[0] * along, spec.size[1] * across, spec.size[2] * up
    rear, front, radius = -0.3 * length, 0.3 * length, min(0.35, 0.3 * height)
    if spec.wheelbase > 0.0:
        radius = min(spec.wheel_radius * up, height / 2, length / 4)
        most, x = length / 2 - radius, -spec.offset[0] * along
        axles = tuple(min(max(axle, -most), most) for axle in (x, x + spec.wheelbase * along))
        if axles[1] - axles[0] > 0.1 * length:
            rear, front = axles
    extra = tuple(
        replace(
            axle,
            x=min(max((axle.x - spec.offset[0]) * along, -length / 2), length / 2),
            track=axle.track * across,
            wheel_radius=min(axle.wheel_radius * up, height / 2, length / 4),
        )
        for axle in spec.extra_axles
    )
    if spec.wheelbase <= 0.0 and extra:
        shape, extra = ("trailer", extra) if shape == "truck" else (shape, ())
    return _mesh(shape, BodyDimensions(length, width, height, front, rear, radius, extra), motion, (along, across, up))


@lru_cache(maxsize=256)
def _mesh(shape: str, frame: BodyDimensions, motion: str, reduction: Vector3) -> Mapping[str, Array]:
    if shape == "pedestrian":
        mesh = pedestrian(frame, motion)
    else:
        mesh = trailer(frame) if shape == "trailer" else BUILDERS[shape](frame)
    return {material: triangles / reduction for material, triangles in mesh.materials().items()}

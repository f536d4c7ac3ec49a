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
from eidrive_scenario.world.actor import ActorSpec

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


def actor_mesh(spec: ActorSpec, motion: str = "") -> Mapping[str, Array]:
    """Return triangles (K, 3, 3) of an actor by material: origin at the center of its box on the ground, x forward [m].

    A truck without a front axle is a trailer. A pedestrian stands, walks or lies by its motion, a value of the
    standard. Axles beyond the ends of the box are moved so that their wheels are in it.
    """
    length, width, height = spec.size
    if spec.wheelbase > 0.0:
        radius, most = spec.wheel_radius, length / 2 - spec.wheel_radius
        rear, front = max(-spec.offset[0], -most), min(spec.wheelbase - spec.offset[0], most)
    else:
        rear, front, radius = -0.3 * length, 0.3 * length, min(0.35, 0.3 * height)
    shape, extra = spec.shape, tuple(replace(axle, x=axle.x - spec.offset[0]) for axle in spec.extra_axles)
    if spec.wheelbase <= 0.0 and extra:
        shape, extra = ("trailer", extra) if shape == "truck" else (shape, ())
    return _mesh(shape, BodyDimensions(length, width, height, front, rear, radius, extra), motion)


@lru_cache(maxsize=256)
def _mesh(shape: str, frame: BodyDimensions, motion: str) -> Mapping[str, Array]:
    if shape == "pedestrian":
        return pedestrian(frame, motion).materials()
    return (trailer(frame) if shape == "trailer" else BUILDERS[shape](frame)).materials()

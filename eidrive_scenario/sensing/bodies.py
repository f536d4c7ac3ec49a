"""Bodies of actors as lidars see them: the meshes that cameras draw, with the reflectivity of their materials."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from eidrive_scenario.rendering.meshes import actor_mesh
from eidrive_scenario.world.actor import ActorSpec, ExtraAxle, Vector3
from eidrive_scenario.world.surfaces import Surfaces

REFLECTIVITY: Mapping[str, float] = {
    "paint": 0.45, "white": 0.50, "yellow": 0.50, "red": 0.50, "orange": 0.50, "cargo": 0.50,
    "chrome": 0.40, "rim": 0.40, "steel": 0.40, "gray": 0.40,
    "plastic": 0.10, "trim": 0.10, "tire": 0.05, "leather": 0.20, "shoes": 0.20,
    "trousers": 0.35, "skin": 0.50, "hair": 0.20,
    "glass": 0.0, "window": 0.0, "headlight": 0.10, "plate": 1.0, "taillight": 1.0,
}  # fmt: skip
"""Diffuse reflectivity at 905 nm by material of the meshes: values for car paint, metal, cloth and plastic within the
measurements of Muckenhuber et al. (Automotive lidar modeling approach based on material properties and lidar
capabilities, Sensors 20, 2020). The others are design choices: tires are dark, and plates and rear reflectors have the
maximum of the intensity, as they exceed a white surface by far. Glass transmits light or reflects it like a mirror, so
that it returns nothing."""
USUAL = 0.40
"""Reflectivity of other materials."""


def body_surfaces(spec: ActorSpec, motion: str) -> Surfaces:
    """Return the surfaces of an actor in its frame. A pedestrian has the posture of a motion of the standard."""
    return _surfaces(
        spec.shape, spec.size, spec.offset, spec.wheelbase, spec.wheel_radius, spec.extra_axles, motion
    )  # fmt: skip


@lru_cache(maxsize=256)
def _surfaces(
    shape: str,
    size: Vector3,
    offset: Vector3,
    wheelbase: float,
    wheel_radius: float,
    extra_axles: tuple[ExtraAxle, ...],
    motion: str,
) -> Surfaces:
    spec = ActorSpec(
        "", shape, "", size, offset, wheelbase=wheelbase, wheel_radius=wheel_radius, extra_axles=extra_axles
    )
    mesh = actor_mesh(spec, motion)
    triangles = np.concatenate(list(mesh.values()))
    # A mesh that does not reach the sides of the box is stretched; mirrors extend beyond them, and pedestrians who lie
    # or sit remain lower.
    stretch = np.maximum(np.array(size) / np.ptp(triangles.reshape(-1, 3), axis=0), 1.0)
    if shape == "pedestrian":
        stretch[2] = 1.0
    triangles = triangles * stretch + (offset[0], offset[1], offset[2] - size[2] / 2.0)
    of_materials = [REFLECTIVITY.get(material, USUAL) for material in mesh]
    reflectivity = np.repeat(of_materials, [len(part) for part in mesh.values()])
    return Surfaces.group(triangles, len(triangles), reflectivity, closed=True)

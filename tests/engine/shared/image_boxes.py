"""Image boxes around rendered bodies, for tests of lifting."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from eidrive_scenario.base.geometry import rotation_matrix
from eidrive_scenario.perception.geometry.projection import pixels
from eidrive_scenario.rendering.meshes import actor_mesh
from eidrive_scenario.sensing.readings import CameraReading
from eidrive_scenario.world.actor import ActorSpec

WIDTH, HEIGHT, FOCAL = 800, 600, 400.0
USUAL = {"car": (4.6, 1.85, 1.55), "van": (5.7, 2.1, 2.4), "truck": (8.2, 2.6, 3.5), "pedestrian": (0.55, 0.55, 1.72)}


def camera(
    x: float = 0.0, y: float = 0.0, z: float = 1.5, yaw: float = 0.0, pitch: float = 0.0, **options: Any
) -> CameraReading:
    """Return a camera that points along yaw and downwards by pitch, with an empty image."""
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    pose = np.eye(4)
    pose[:3, 2] = cy * cp, sy * cp, -sp
    pose[:3, 0] = sy, -cy, 0.0
    pose[:3, 1] = np.cross(pose[:3, 2], pose[:3, 0])
    pose[:3, 3] = x, y, z
    intrinsics = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1.0]])
    return CameraReading(
        np.zeros((HEIGHT, WIDTH, 3), np.uint8),
        np.zeros((HEIGHT, WIDTH), np.float32),
        np.zeros((HEIGHT, WIDTH), np.int32),
        intrinsics,
        pose,
        **options,
    )


def box(name: str, x: float, y: float, yaw: float = 0.0, ground: float = 0.0) -> np.ndarray:
    length, width, height = USUAL[name]
    return np.array([x, y, ground + height / 2, length, width, height, yaw])


@cache
def body(name: str, size: tuple[float, float, float]) -> np.ndarray:
    """Return corners (N, 3) of the rendered body, relative to the center of its base."""
    length, _, height = size
    spec = ActorSpec(
        name, name, name, size, (0.3 * length, 0.0, height / 2.0), wheelbase=0.6 * length, wheel_radius=0.33
    )
    return np.concatenate(list(actor_mesh(spec).values())).reshape(-1, 3)


def outline(target: np.ndarray, view: CameraReading, name: str = "car") -> list[float]:
    """Return the image box around an object, clipped at the border."""
    x, y, z, length, width, height, yaw = target.tolist()
    points = body(name, (length, width, height)) @ rotation_matrix(yaw, 0.0, 0.0).T + (x, y, z - height / 2.0)
    places, _ = pixels(points, view)
    low, high = places.min(axis=0), places.max(axis=0)
    return [*np.clip(low, 0, (WIDTH, HEIGHT)).tolist(), *np.clip(high, 0, (WIDTH, HEIGHT)).tolist()]

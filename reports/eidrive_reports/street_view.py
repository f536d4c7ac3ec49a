"""Camera images of a recorded view from a position in the street."""

from __future__ import annotations

import math
from collections.abc import Mapping

import cv2
import numpy as np

from eidrive_scenario.api.common import ActorSpec, Array, Placement, RoadNetwork, SimulationError, WorldView
from eidrive_scenario.api.run import Pinhole, World, ideal_image, picture_maker

Point = tuple[float, float, float]

WIDTH, HEIGHT = 960, 540


def look_at(position: Point, target: Point) -> Array:
    """Return the transform (4, 4) from camera (x right, y down, z forward) to world of an upright camera."""
    forward = np.subtract(target, position)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right = right / np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, np.cross(forward, right), forward, position
    return pose


def driver_view(view: WorldView, name: str) -> Array:
    """Return the camera pose of a driver: above the center of the vehicle, along its heading."""
    row = view.row(name)
    x, y, z = view.centers[row].tolist()
    yaw, height = float(view.yaw[row]), float(view.size[row, 2])
    position = (x, y, z + 0.4 * height)
    return look_at(position, (x + 20.0 * math.cos(yaw), y + 20.0 * math.sin(yaw), position[2] - 0.4))


def helper_view(view: WorldView, name: str, target: str) -> Array:
    """Return the camera pose on top of an actor, towards another actor."""
    row = view.row(name)
    x, y, z = view.centers[row].tolist()
    at = view.centers[view.row(target)].tolist()
    return look_at((x, y, z + 0.5 * float(view.size[row, 2]) + 0.1), (at[0], at[1], at[2]))


def street_image(
    bodies: Mapping[str, ActorSpec],
    roads: RoadNetwork | None,
    view: WorldView,
    pose: Array,
    *,
    without: str,
    fov: float = 80.0,
) -> bytes:
    """Return a PNG image of all actors of `view` from the camera `pose`, except `without`, which carries the camera.

    bodies  specifications of the actors by name
    fov     horizontal field of view [degrees]
    """
    with World(roads, picture_maker=picture_maker) as world:
        for row, name in enumerate(view.names):
            x, y, z = view.position[row].tolist()
            angles = (float(view.yaw[row]), float(view.pitch[row]), float(view.roll[row]))
            world.add(bodies[name], Placement(x, y, z, *angles))
        pinhole = Pinhole.of_fov(WIDTH, HEIGHT, math.radians(fov), far=300.0)
        image = ideal_image(world.radiance(pose, pinhole, ignore=(without,)))
    encoded, png = cv2.imencode(".png", cv2.cvtColor(image.rgb, cv2.COLOR_RGB2BGR))
    if not encoded:
        raise SimulationError("image: PNG encoding failed")
    return bytes(png)

"""Pictures of an instant of a run as a camera in the street would take them."""

from __future__ import annotations

import math
from collections.abc import Mapping

import cv2
import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.errors import SimulationError
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Placement
from eidrive_scenario.world.view import WorldView

Point = tuple[float, float, float]

WIDTH, HEIGHT = 960, 540


def look_at(eye: Point, target: Point) -> Array:
    """(4, 4) camera to world, x right, y down, z forward, of an upright camera at `eye` that looks at `target`."""
    forward = np.subtract(target, eye)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right = right / np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, np.cross(forward, right), forward, eye
    return pose


def driver_view(view: WorldView, name: str) -> Array:
    """The camera pose of somebody who sits in that vehicle: above its center, looking along its heading."""
    row = view.row(name)
    x, y, z = view.centers[row].tolist()
    yaw, height = float(view.yaw[row]), float(view.size[row, 2])
    eye = (x, y, z + 0.4 * height)
    return look_at(eye, (x + 20.0 * math.cos(yaw), y + 20.0 * math.sin(yaw), eye[2] - 0.4))


def helper_view(view: WorldView, name: str, target: str) -> Array:
    """The camera pose on top of one actor, looking at another."""
    row = view.row(name)
    x, y, z = view.centers[row].tolist()
    at = view.centers[view.row(target)].tolist()
    return look_at((x, y, z + 0.5 * float(view.size[row, 2]) + 0.1), (at[0], at[1], at[2]))


def street_picture(
    bodies: Mapping[str, ActorSpec],
    roads: RoadNetwork | None,
    view: WorldView,
    pose: Array,
    *,
    without: str,
    fov: float = 80.0,
) -> bytes:
    """A PNG of all actors of `view` where they were, taken from `pose`; the actor `without`, who holds the camera, is
    left out. `bodies` are by name; `fov` is horizontal [degrees]."""
    with World(roads) as world:
        for row, name in enumerate(view.names):
            x, y, z = view.position[row].tolist()
            angles = (float(view.yaw[row]), float(view.pitch[row]), float(view.roll[row]))
            world.add(bodies[name], Placement(x, y, z, *angles))
        picture = world.camera(pose, WIDTH, HEIGHT, math.radians(fov), ignore=(without,))
    done, png = cv2.imencode(".png", cv2.cvtColor(picture.rgb, cv2.COLOR_RGB2BGR))
    if not done:
        raise SimulationError("the picture could not be written as PNG")
    return bytes(png)

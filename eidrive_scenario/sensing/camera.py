"""The camera."""

from __future__ import annotations

import math

import numpy as np

from eidrive_scenario.sensing.mounting import mounting
from eidrive_scenario.sensing.readings import CameraReading
from eidrive_scenario.sensing.scene import Scene
from eidrive_scenario.sensing.settings import CameraSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import WorldView


class Camera:
    """A pinhole camera with square pixels, its principal point in the middle of the picture."""

    def __init__(self, settings: CameraSettings, spec: ActorSpec) -> None:
        self.settings = settings
        self.mounting = mounting(settings, spec, "front")
        self.fov = math.radians(settings.fov)
        focal = settings.width / 2.0 / math.tan(self.fov / 2.0)
        self.intrinsics = np.array(
            [[focal, 0.0, settings.width / 2.0], [0.0, focal, settings.height / 2.0], [0.0, 0.0, 1.0]]
        )

    def read(self, scene: Scene, view: WorldView, row: int) -> CameraReading:
        """A picture from the actor in this row."""
        settings = self.settings
        pose = self.mounting.camera_pose(view, row)
        rgb, depth, segmentation = scene.camera(
            pose, settings.width, settings.height, self.fov, settings.near, settings.far
        )
        return CameraReading(rgb, depth, segmentation, self.intrinsics, pose)

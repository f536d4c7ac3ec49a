"""The camera."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.randomness import generator
from eidrive_scenario.sensing.exposure import develop, metered
from eidrive_scenario.sensing.mounting import mounting
from eidrive_scenario.sensing.optics import Optics, lens_of
from eidrive_scenario.sensing.precipitation import draw_drops_on_lens, draw_precipitation
from eidrive_scenario.sensing.readings import CameraReading
from eidrive_scenario.sensing.scene import Scene
from eidrive_scenario.sensing.settings import CameraSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import WorldView

DROPS_STAY = 2.0
"""How long drops sit on a lens before others have come [s]."""


class Camera:
    """A camera with square pixels, its principal point in the middle of the picture.

    Its noise and the drops before its lens are drawn by seed, station, name and tick. On a mast it does not see that,
    which throws its shadow all the same.
    """

    def __init__(self, settings: CameraSettings, spec: ActorSpec, name: str = "camera", seed: int = 0) -> None:
        self.settings = settings
        self.name = name
        self.mounting = mounting(settings, spec, "front")
        self._photographer = ImageSensor(settings)
        self._unseen = (spec.name,) if spec.wheelbase <= 0.0 else ()
        self._key = (seed, "camera", spec.name, name)

    def read(self, scene: Scene, view: WorldView, row: int) -> CameraReading:
        """A picture from the actor in this row."""
        seed, *key = self._key
        return self._photographer.capture(
            scene,
            self.mounting.camera_pose(view, row),
            generator(seed, *key, view.tick),
            ignore=(*view.unseen_by.get(self.name, ()), *self._unseen),
            velocity=view.velocity[row],
            lens=generator(seed, *key, "lens", int(view.time / DROPS_STAY)),
        )


class ImageSensor:
    """Takes pictures with a camera of these settings, from anywhere."""

    def __init__(self, settings: CameraSettings) -> None:
        self.settings = settings
        self._lens = lens_of(settings)
        self.intrinsics = self._lens.intrinsics
        self._optics = Optics(settings)

    def capture(
        self,
        scene: Scene,
        pose: Array,
        draws: np.random.Generator,
        *,
        ignore: Iterable[str] = (),
        velocity: Array | tuple[float, float, float] = (0.0, 0.0, 0.0),
        lens: np.random.Generator | None = None,
    ) -> CameraReading:
        """A picture from `pose` (4, 4): camera to world, x right, y down, z forward; actors in `ignore` are not seen.

        `draws` are for noise and falling drops, `lens` for drops that sit on it (None: there are none); velocity (3,)
        of the camera [m/s]. The same scene, pose and state of the generators give the same picture.
        """
        settings = self.settings
        seen = self._optics.bent(scene.radiance(pose, self._optics.pinhole, ignore=ignore))
        draw_precipitation(seen.luminance, scene.weather, pose, self._lens, draws, velocity)
        if lens is not None and settings.lens_drops:
            draw_drops_on_lens(seen.luminance, scene.weather, lens)
        exposure = metered(seen.luminance, settings)
        rgb = develop(seen.luminance, exposure, settings.noise, draws)
        return CameraReading(rgb, seen.depth, seen.segmentation, self.intrinsics, pose, np.array(settings.distortion))

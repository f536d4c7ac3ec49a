"""Camera sensor."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.randomness import generator
from eidrive_scenario.sensing.imaging.exposure import develop, meter_exposure
from eidrive_scenario.sensing.imaging.optics import Optics, lens_of
from eidrive_scenario.sensing.mounting import mounting
from eidrive_scenario.sensing.precipitation import draw_drops_on_lens, draw_precipitation
from eidrive_scenario.sensing.readings import CameraReading
from eidrive_scenario.sensing.scene import Scene
from eidrive_scenario.sensing.sensor import Sensor
from eidrive_scenario.sensing.settings import CameraSettings, SensorSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import WorldView

DROPS_STAY = 2.0
"""Time that drops stay on a lens before others replace them [s]."""


class Camera(Sensor):
    """Camera with square pixels and its principal point in the center of the image.

    Noise and drops in front of the lens are drawn by seed, station, name and tick. The image of a camera on a mast does
    not contain the mast, but its shadow.
    """

    settings_type: ClassVar[type[SensorSettings]] = CameraSettings
    settings: CameraSettings

    def __init__(self, settings: CameraSettings, spec: ActorSpec, name: str = "camera", seed: int = 0) -> None:
        super().__init__(settings, spec, name, seed)
        self.mounting = mounting(settings, spec, "front")
        self._image_sensor = ImageSensor(settings)
        self._ignored = () if spec.has_wheels else (spec.name,)
        self._key = (seed, "camera", spec.name, name)

    @classmethod
    def check_settings(cls, settings: SensorSettings) -> None:
        """Raise SettingError if the distortion of the lens cannot be inverted."""
        if isinstance(settings, CameraSettings):
            Optics(settings)

    def read(self, scene: Scene, view: WorldView, row: int) -> CameraReading:
        """Return an image from the actor in this row."""
        seed, *key = self._key
        return self._image_sensor.capture(
            scene,
            self.mounting.camera_pose(view, row),
            generator(seed, *key, view.tick),
            ignore=(*view.unseen_by.get(self.name, ()), *self._ignored),
            velocity=view.velocity[row],
            lens=generator(seed, *key, "lens", int(view.time / DROPS_STAY)),
        )


class ImageSensor:
    """Image sensor with these camera settings that captures images at any pose."""

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
        """Return an image at `pose` (4, 4): camera to world, x right, y down, z forward, without the actors in
        `ignore`.

        `draws` generates noise and falling drops, `lens` the drops on the lens (None: no drops); velocity (3,) of the
        camera [m/s]. Equal scenes, poses and generator states give equal images.
        """
        settings = self.settings
        radiance = self._optics.distort(scene.radiance(pose, self._optics.pinhole, ignore=ignore))
        draw_precipitation(radiance.luminance, scene.weather, pose, self._lens, draws, velocity)
        if lens is not None and settings.lens_drops:
            draw_drops_on_lens(radiance.luminance, scene.weather, lens)
        exposure = meter_exposure(radiance.luminance, settings)
        rgb = develop(radiance.luminance, exposure, settings.noise, draws)
        return CameraReading(
            rgb, radiance.depth, radiance.segmentation, self.intrinsics, pose, np.array(settings.distortion)
        )

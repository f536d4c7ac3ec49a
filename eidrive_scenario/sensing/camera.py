"""Camera sensor."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.content_digest import content_digest
from eidrive_scenario.randomness import generator
from eidrive_scenario.sensing.imaging import Optics, develop, lens_of, meter_exposure
from eidrive_scenario.sensing.mounting import mounting
from eidrive_scenario.sensing.precipitation import draw_drops_on_lens, draw_precipitation
from eidrive_scenario.sensing.readings import CameraReading, Exposure
from eidrive_scenario.sensing.sensor import Scene, Sensor
from eidrive_scenario.sensing.settings import CameraSettings, SensorSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.camera import CameraImage, Radiance, UndrawnImage
from eidrive_scenario.world.view import WorldView
from eidrive_scenario.world.weather import Weather

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
        sensor, pose = self._image_sensor, self.mounting.camera_pose(view, row)
        ignored = (*view.unseen_by.get(self.name, ()), *self._ignored)
        undrawn = scene.image(pose, sensor.pinhole, ignore=ignored)
        conditions = _Conditions(
            self.settings,
            scene.weather,
            pose,
            view.velocity[row],
            (*self._key, view.tick),
            (*self._key, "lens", int(view.time / DROPS_STAY)),
        )
        exposure = Exposure(
            (self.settings.width, self.settings.height),
            partial(_expose, sensor, undrawn, conditions),
            lambda: content_digest(undrawn.digest, conditions),
        )
        return CameraReading.of(exposure, sensor.intrinsics, pose, np.array(self.settings.distortion))


class _Conditions(NamedTuple):
    """Inputs that determine an image in addition to the light in front of the lens.

    velocity     (3,) of the camera [m/s]
    noise, lens  keys of the random numbers of the noise and falling drops, and of the drops on the lens
    """

    settings: CameraSettings
    weather: Weather
    pose: Array
    velocity: Array
    noise: tuple[int, *tuple[str | int, ...]]
    lens: tuple[int, *tuple[str | int, ...]]


def _expose(sensor: ImageSensor, undrawn: UndrawnImage, conditions: _Conditions) -> CameraImage:
    _, weather, pose, velocity, noise, lens = conditions
    return sensor.develop(undrawn.draw(), weather, pose, generator(*noise), velocity, generator(*lens))


class ImageSensor:
    """Image sensor with these camera settings that captures images at any pose."""

    def __init__(self, settings: CameraSettings) -> None:
        self.settings = settings
        self._lens = lens_of(settings)
        self.intrinsics = self._lens.intrinsics
        self._optics = Optics(settings)
        self.pinhole = self._optics.pinhole
        """Camera of the light that `develop` expects."""

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
        radiance = scene.radiance(pose, self.pinhole, ignore=ignore)
        image = self.develop(radiance, scene.weather, pose, draws, velocity, lens)
        return CameraReading(*image, self.intrinsics, pose, np.array(self.settings.distortion))

    def develop(
        self,
        radiance: Radiance,
        weather: Weather,
        pose: Array,
        draws: np.random.Generator,
        velocity: Array | tuple[float, float, float],
        lens: np.random.Generator | None,
    ) -> CameraImage:
        """Return the image of the light that reaches the camera `pinhole`, with the arguments of `capture`."""
        settings = self.settings
        radiance = self._optics.distort(radiance)
        draw_precipitation(radiance.luminance, weather, pose, self._lens, draws, velocity)
        if lens is not None and settings.lens_drops:
            draw_drops_on_lens(radiance.luminance, weather, lens)
        exposure = meter_exposure(radiance.luminance, settings)
        rgb = develop(radiance.luminance, exposure, settings.noise, draws)
        return CameraImage(rgb, radiance.depth, radiance.segmentation)

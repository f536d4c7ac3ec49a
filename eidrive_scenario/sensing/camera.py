"""Camera sensor: lens (pinhole with the distortion of Brown and Conrady), exposure, noise, tone mapping."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats
from eidrive_scenario.base.content_digest import content_digest
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.rendering.tone_mapping import PixelNoise, tone_map, white_level
from eidrive_scenario.sensing.precipitation import draw_drops_on_lens, draw_precipitation
from eidrive_scenario.sensing.readings import CameraReading, DeferredImage
from eidrive_scenario.sensing.sensor import Scene, Sensor, mounting, undistorted
from eidrive_scenario.sensing.settings import CameraSettings, NoiseSettings, SensorSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.camera import CameraImage, Pinhole, Radiance
from eidrive_scenario.world.view import WorldView
from eidrive_scenario.world.weather import Weather


class _Distortion(NamedTuple):
    """Pinhole camera of the undistorted image, and positions of the distorted pixels in it (centers at integers)."""

    straight: Pinhole
    x: Floats
    y: Floats


def lens_of(settings: CameraSettings) -> Pinhole:
    """Return the camera without its distortion."""
    fov = math.radians(settings.fov)
    return Pinhole.of_fov(settings.width, settings.height, fov, settings.near, settings.far)


def unexposed(settings: CameraSettings) -> CameraReading:
    """Return a reading of a camera without an image and at the origin, for the projection of points."""

    def expose() -> CameraImage:
        raise RuntimeError("a camera without an image has no pixels")

    image = DeferredImage((settings.width, settings.height), expose)
    return CameraReading.of(image, lens_of(settings).intrinsics, np.eye(4), np.array(settings.distortion))


@lru_cache(maxsize=32)
def _distortion(settings: CameraSettings) -> _Distortion:
    """Return the direction of each pixel center.

    Raise SettingError if a direction does not project within a tenth of a pixel of its center: strong coefficients that
    compensate each other do not converge.
    """

    import cv2

    lens = lens_of(settings)
    columns, rows = np.meshgrid(np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5)
    pixels = np.stack([columns.ravel(), rows.ravel()], axis=1)
    rays = undistorted(pixels, lens.intrinsics, settings.distortion)
    none, along = np.zeros(3), np.column_stack([rays, np.ones(len(rays))])
    projected = cv2.projectPoints(along, none, none, lens.intrinsics, np.array(settings.distortion))[0]
    if not np.abs(projected[:, 0] - pixels).max() < 0.1:
        what = f"distortion: the coefficients cannot be inverted (got {list(settings.distortion)})"
        raise SettingError(Diagnostic(what, "use smaller coefficients or a smaller fov"))
    low, high = rays.min(axis=0) * lens.focal - 1.0, rays.max(axis=0) * lens.focal + 1.0
    (left, top), (right, bottom) = np.floor(low), np.ceil(high)
    straight = Pinhole(int(right - left), int(bottom - top), lens.focal, -left, -top, lens.near, lens.far)
    places = (rays * lens.focal - (left, top) - 0.5).astype(np.float32).reshape(lens.height, lens.width, 2)
    return _Distortion(straight, np.ascontiguousarray(places[..., 0]), np.ascontiguousarray(places[..., 1]))


LENS = 0.65
"""H = 0.65 L t / N²: exposure [lx s] behind a lens of f-number N for a luminance L [cd/m²] (ISO 12232)."""
SATURATION = 78.0
"""H_sat = 78 / S: exposure that saturates a sensor of speed S [lx s] (ISO 12232)."""
BASE_SPEED = 100.0
"""Speed of the sensor at a gain of 0 dB."""


@dataclass(frozen=True)
class Exposure:
    """Exposure time [s], gain [dB], and the luminance at saturation [cd/m²]."""

    time: float
    gain: float
    saturation: float


def meter_exposure(luminance: Floats, settings: CameraSettings) -> Exposure:
    """Return the exposure of an image (H, W, 3) [cd/m²]: fixed settings, and an ideal meter for the others.

    The meter increases time first, then gain, up to their limits.
    """
    optics = SATURATION / BASE_SPEED * settings.f_number**2 / LENS
    time, gain = settings.exposure_time, settings.gain
    if time is None or gain is None:
        required = optics / white_level(luminance)
        if time is None:
            time = min(required / (1.0 if gain is None else _linear(gain)), settings.max_exposure_time)
        if gain is None:
            gain = min(max(20.0 * math.log10(required / time), 0.0), settings.max_gain)
    return Exposure(time, gain, optics / (time * _linear(gain)))


def develop(
    luminance: Floats, exposure: Exposure, noise: NoiseSettings | None, draws: np.random.Generator
) -> NDArray[np.uint8]:
    """Return the image (H, W, 3) of luminance (H, W, 3) [cd/m²]; values above saturation are clipped.

    Noise is the linear model of EMVA 1288 (release 4.0): for a mean of n electrons, the variance is n + read noise²;
    gain reduces the electrons of full scale. Electrons are drawn from a normal distribution, one value per channel.
    """
    if noise is None:
        return tone_map(luminance, exposure.saturation)
    well = noise.full_well / _linear(exposure.gain)
    variance = np.array([(noise.read_noise / well) ** 2, 1.0 / well], dtype=np.float32)
    # Each value of the generator contains four numbers of 16 bits.
    numbers: NDArray[np.uint64] = draws.bit_generator.random_raw(-(-luminance.size // 4))
    return tone_map(
        luminance, exposure.saturation, PixelNoise(variance, numbers.view(np.uint16), _normal_values(1 << 16))
    )


@cache
def _normal_values(count: int) -> Floats:
    """Return equally likely values of the standard normal distribution.

    Drawing from them is four times as fast as drawing normal values.
    """
    from scipy.special import ndtri

    numbers = ndtri((np.arange(count) + 0.5) / count)
    values: Floats = (numbers / numbers.std()).astype(np.float32)
    return values


def _linear(gain: float) -> float:
    return float(10.0 ** (gain / 20.0))


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
            ImageSensor(settings)

    def read(self, scene: Scene, view: WorldView, row: int) -> CameraReading:
        """Return an image from the actor in this row."""
        sensor, pose = self._image_sensor, self.mounting.camera_pose(view, row)
        ignored = (*view.unseen_by.get(self.name, ()), *self._ignored)
        undrawn = scene.image(pose, sensor.pinhole, ignore=ignored)
        settings, weather, velocity = self.settings, scene.weather, view.velocity[row]
        # Keys of the random numbers of the noise and falling drops, and of the drops on the lens
        noise, lens = (*self._key, view.tick), (*self._key, "lens", int(view.time / DROPS_STAY))

        def expose() -> CameraImage:
            return sensor.develop(undrawn.draw(), weather, pose, generator(*noise), velocity, generator(*lens))

        image = DeferredImage(
            (settings.width, settings.height),
            expose,
            lambda: content_digest(undrawn.digest, settings, weather, pose, velocity, noise, lens),
        )
        return CameraReading.of(image, sensor.intrinsics, pose, np.array(settings.distortion))


class ImageSensor:
    """Image sensor with these camera settings, behind their lens, that captures images at any pose."""

    def __init__(self, settings: CameraSettings) -> None:
        self.settings = settings
        self._lens = lens_of(settings)
        self.intrinsics = self._lens.intrinsics
        self._distortion = _distortion(settings) if any(settings.distortion) else None
        straight = self._lens if self._distortion is None else self._distortion.straight
        self.pinhole = straight.finer(settings.supersampling)
        """Camera of the light that `develop` expects, undistorted and with a sufficiently large field of view."""

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
        radiance = self.distort(radiance)
        draw_precipitation(radiance.luminance, weather, pose, self._lens, draws, velocity)
        if lens is not None and settings.lens_drops:
            draw_drops_on_lens(radiance.luminance, weather, lens)
        exposure = meter_exposure(radiance.luminance, settings)
        rgb = develop(radiance.luminance, exposure, settings.noise, draws)
        return CameraImage(rgb, radiance.depth, radiance.segmentation)

    def distort(self, radiance: Radiance) -> Radiance:
        """Return the image of the lens; depth and segmentation are those of the nearest ray, not interpolated."""

        import cv2

        luminance: Any
        supersampling = self.settings.supersampling
        luminance, depth, segmentation = radiance
        if supersampling > 1:
            size = (self.pinhole.width // supersampling, self.pinhole.height // supersampling)
            luminance = cv2.resize(luminance, size, interpolation=cv2.INTER_AREA)
            middle = slice(supersampling // 2, None, supersampling)
            depth, segmentation = depth[middle, middle], segmentation[middle, middle]
        if self._distortion is not None:
            x, y = self._distortion.x, self._distortion.y
            luminance = cv2.remap(luminance, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            row, column = np.rint(y).astype(np.intp), np.rint(x).astype(np.intp)
            depth, segmentation = depth[row, column], segmentation[row, column]
        return Radiance(luminance, depth, segmentation)

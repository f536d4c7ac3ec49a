"""Settings of sensors as a person types them: meters, degrees, hertz."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from eidrive_scenario.settings import Settings

Rate = Annotated[float, Field(ge=0.01, le=10_000.0)]
"""Readings per second [Hz]."""
MAX_RANGE = 1e5
"""Largest range of a sensor [m]."""
MAX_RAYS = 2_000_000
"""Maximum number of rays of one reading: of a revolution of a LiDAR, or between two readings."""
MAX_PIXELS = 32_000_000
"""Maximum number of pixels that are computed for one picture, those of supersampling counted."""

MountName = Literal["front", "left", "right", "back", "roof"]


class Mount(Settings):
    """Where a sensor sits in the actor's frame [m] and where it looks [degrees]: yaw to the left, pitch downwards."""

    x: Annotated[float, Field(ge=-1000.0, le=1000.0)]
    y: Annotated[float, Field(ge=-1000.0, le=1000.0)]
    z: Annotated[float, Field(ge=-1000.0, le=1000.0)]
    yaw: Annotated[float, Field(ge=-3600.0, le=3600.0)] = 0.0
    pitch: Annotated[float, Field(ge=-3600.0, le=3600.0)] = 0.0


def _mount(value: Any) -> Any:
    """A mount may be written as a list: x, y, z, then yaw and pitch if they are not 0."""
    if isinstance(value, (list, tuple)) and all(isinstance(part, (int, float)) for part in value):
        if not 3 <= len(value) <= 5:
            raise ValueError("a mount has three to five numbers: x, y, z [m], yaw, pitch [degrees]")
        return dict(zip(("x", "y", "z", "yaw", "pitch"), value, strict=False))
    return value


MountSetting = Annotated[Mount | MountName | None, BeforeValidator(_mount)]


class SensorSettings(Settings):
    """What all sensors have: a mount (None is the usual one of the kind) and a rate (None is each tick)."""

    mount: MountSetting = None
    rate: Rate | None = None
    """[Hz]"""


class TruthSettings(SensorSettings):
    """The sensor behind the oracle: exact boxes of what is in its line of sight.

    range          to the center of an object from the center of the own body [m]
    field_of_view  horizontal, about the mount's heading [degrees]
    visibility     least share of an object's sampled points that must be in sight
    """

    kind: Literal["truth"] = "truth"
    range: Annotated[float, Field(gt=0.0, le=MAX_RANGE)] = 50.0
    field_of_view: float = Field(default=360.0, gt=0.0, le=360.0)
    visibility: float = Field(default=0.1, gt=0.0, le=1.0)


class NoiseSettings(Settings):
    """Of a camera's sensor, in electrons: what a pixel holds when it is full, and the deviation of reading it."""

    full_well: Annotated[float, Field(ge=1.0, le=1e9)] = 12_000.0
    read_noise: Annotated[float, Field(ge=0.0, le=1e6)] = 4.0


def _distortion(value: Any) -> Any:
    """Distortion as a list of up to five coefficients, in OpenCV's order."""
    if isinstance(value, (list, tuple)):
        if len(value) > 5:
            raise ValueError("distortion has up to five coefficients: k1, k2, p1, p2, k3")
        return tuple(value) + (0.0,) * (5 - len(value))
    return value


def _noise(value: Any) -> Any:
    """`none` and `off` are no noise; YAML reads the latter as false."""
    return None if value in ("none", "off", False) else value


class CameraSettings(SensorSettings):
    """A camera. Lengths in meters, `width` and `height` in pixels, times in seconds.

    fov            horizontal, of the picture without distortion [degrees]
    distortion     k1, k2, p1, p2, k3 of Brown and Conrady, as OpenCV has them
    near, far      what is nearer or farther is not drawn
    noise          of the sensor; None is a sensor without
    exposure_time, gain   [s], [dB]; None is automatic, within max_exposure_time and max_gain
    lens_drops     whether rain reaches the lens
    supersampling  rays per pixel and axis: 2 smooths edges at four times the cost
    """

    kind: Literal["camera"] = "camera"
    width: int = Field(default=800, ge=2, le=8192)
    height: int = Field(default=600, ge=2, le=8192)
    fov: float = Field(default=100.0, gt=0.0, lt=180.0)
    distortion: Annotated[tuple[float, float, float, float, float], BeforeValidator(_distortion)] = (0.0,) * 5
    near: Annotated[float, Field(ge=1e-3, le=MAX_RANGE)] = 0.1
    far: Annotated[float, Field(ge=1e-3, le=MAX_RANGE)] = 500.0
    noise: Annotated[NoiseSettings | None, BeforeValidator(_noise)] = NoiseSettings()
    f_number: Annotated[float, Field(ge=0.1, le=1000.0)] = 1.6
    exposure_time: Annotated[float, Field(ge=1e-9, le=100.0)] | None = None
    gain: Annotated[float, Field(ge=-20.0, le=80.0)] | None = None
    max_exposure_time: Annotated[float, Field(ge=1e-9, le=100.0)] = 0.03
    max_gain: float = Field(default=36.0, ge=0.0, le=80.0)
    lens_drops: bool = True
    supersampling: int = Field(default=1, ge=1, le=4)

    @model_validator(mode="after")
    def _something_between(self) -> CameraSettings:
        if self.near >= self.far:
            raise ValueError(f"near {self.near:g} is not before far {self.far:g}")
        if self.width * self.height * self.supersampling**2 > MAX_PIXELS:
            raise ValueError(f"more than {MAX_PIXELS} pixels with supersampling: lower width, height or supersampling")
        if any(abs(coefficient) > 1e3 for coefficient in self.distortion):
            raise ValueError("a coefficient of the distortion is beyond 1000")
        return self

    @model_validator(mode="after")
    def _lens_maps_one_to_one(self) -> CameraSettings:
        """Every pixel must see one direction: the distorted radius grows with the true one as far as the corners.

        At radius r, p1 and p2 move a point by at most 3 |p| r², so that much less of the growth is certain.
        """
        k1, k2, p1, p2, k3 = self.distortion
        if not any(self.distortion):
            return self
        decentering = 3.0 * math.hypot(p1, p2)
        half = math.tan(math.radians(self.fov) / 2.0)
        corner = 1.1 * half * math.hypot(1.0, self.height / self.width)
        radius = distorted = 0.0
        for step in range(1, 401):
            radius = 4.0 * corner * step / 400
            square = radius * radius
            further = radius * (1.0 + square * (k1 + square * (k2 + square * k3))) - decentering * square
            if further <= distorted:
                break
            distorted = further
            if distorted >= corner:
                return self._with_straight_picture(radius / corner)
        raise ValueError(
            f"this distortion folds the picture {math.degrees(math.atan(radius)):.0f} degrees off its axis"
        )

    def _with_straight_picture(self, scale: float) -> CameraSettings:
        """Bound the picture without distortion, which is `scale` times as wide and high, by as many pixels."""
        if self.width * self.height * self.supersampling**2 * scale**2 > 1.1 * MAX_PIXELS:
            raise ValueError(
                f"the picture without this distortion has more than {MAX_PIXELS} pixels: lower width, height, "
                "supersampling or fov"
            )
        return self


class LidarSettings(SensorSettings):
    """A spinning LiDAR: rings spread evenly over the vertical field of view [degrees], or as `elevations` say.

    range          beyond it nothing is measured [m]
    points_per_second  rays, of all channels
    rotation       revolutions per second [Hz]
    field_of_view  horizontal, about the mount's heading [degrees]
    elevations     of the rings above the horizon, from the highest on [degrees]; None spreads them
    attenuation    of the intensity with distance, besides that by the weather [1/m]
    range_noise    standard deviation of a distance [m]
    ten_percent_range  in clear air, as far a surface that returns a tenth of the light is measured [m]
    dropoff        share of returns that are lost at random
    dropoff_intensity, dropoff_dark   a return below this intensity is lost with a probability that rises to
                   `dropoff_dark` where it is black
    weather        whether fog, rain and snow weaken returns and give false ones
    """

    kind: Literal["lidar"] = "lidar"
    channels: Annotated[int, Field(ge=1, le=4096)] = 32
    range: Annotated[float, Field(gt=0.0, le=MAX_RANGE)] = 50.0
    points_per_second: Annotated[int, Field(ge=1, le=100_000_000)] = 100_000
    rotation: Annotated[float, Field(ge=0.1, le=1000.0)] = 20.0
    upper_fov: float = Field(default=10.0, ge=-90.0, le=90.0)
    lower_fov: float = Field(default=-30.0, ge=-90.0, le=90.0)
    field_of_view: float = Field(default=360.0, gt=0.0, le=360.0)
    elevations: tuple[Annotated[float, Field(ge=-90.0, le=90.0)], ...] | None = None
    attenuation: Annotated[float, Field(ge=0.0, le=100.0)] = 0.004
    range_noise: Annotated[float, Field(ge=0.0, le=10.0)] = 0.02
    ten_percent_range: Annotated[float, Field(ge=0.1, le=MAX_RANGE)] = 150.0
    dropoff: float = Field(default=0.0, ge=0.0, lt=1.0)
    dropoff_intensity: float = Field(default=0.0, ge=0.0, le=1.0)
    dropoff_dark: float = Field(default=0.0, ge=0.0, le=1.0)
    weather: bool = True

    @model_validator(mode="after")
    def _ordered(self) -> LidarSettings:
        if self.lower_fov > self.upper_fov:
            raise ValueError(f"lower_fov {self.lower_fov:g} lies above upper_fov {self.upper_fov:g}")
        if self.elevations is not None and len(self.elevations) != self.channels:
            raise ValueError(f"{self.channels} channels need as many elevations, found {len(self.elevations)}")
        rays = max(self.points_per_second / self.rotation, self.points_per_second / (self.rate or math.inf))
        if rays > MAX_RAYS:
            raise ValueError(f"{rays:.3g} rays in one reading are more than {MAX_RAYS}: lower points_per_second")
        columns = self.points_per_second / self.channels / self.rotation
        if columns < 1.0:
            raise ValueError(
                f"{self.points_per_second} points per second are less than one column in each of "
                f"{self.rotation:g} revolutions of {self.channels} channels"
            )
        return self


class GnssSettings(SensorSettings):
    """A satellite receiver that tells where the station's reference point is. Standard deviations.

    position_noise, height_noise   white, per reading: each horizontal axis, and upwards [m]
    bias           of each horizontal axis when the run begins [m]
    bias_walk      how fast that wanders [m/√s]
    oracle         exact readings
    """

    kind: Literal["gnss"] = "gnss"
    rate: Rate | None = 10.0
    position_noise: Annotated[float, Field(ge=0.0, le=1e4)] = 0.3
    height_noise: Annotated[float, Field(ge=0.0, le=1e4)] = 0.6
    bias: Annotated[float, Field(ge=0.0, le=1e4)] = 0.0
    bias_walk: Annotated[float, Field(ge=0.0, le=1e4)] = 0.0
    oracle: bool = False


class ImuSettings(SensorSettings):
    """An inertial unit at the station's reference point. Noise as densities, biases as standard deviations.

    accelerometer_noise, gyroscope_noise   white [m/s²/√Hz], [rad/s/√Hz]
    accelerometer_bias, gyroscope_bias     of each axis when the run begins [m/s²], [rad/s]
    accelerometer_walk, gyroscope_walk     how fast these wander [m/s²/√s], [rad/s/√s]
    oracle         exact readings
    """

    kind: Literal["imu"] = "imu"
    accelerometer_noise: Annotated[float, Field(ge=0.0, le=100.0)] = 0.02
    gyroscope_noise: Annotated[float, Field(ge=0.0, le=10.0)] = 0.002
    accelerometer_bias: Annotated[float, Field(ge=0.0, le=100.0)] = 0.0
    gyroscope_bias: Annotated[float, Field(ge=0.0, le=10.0)] = 0.005
    accelerometer_walk: Annotated[float, Field(ge=0.0, le=100.0)] = 0.0
    gyroscope_walk: Annotated[float, Field(ge=0.0, le=10.0)] = 1e-4
    oracle: bool = False


AnySensorSettings = Annotated[
    TruthSettings | CameraSettings | LidarSettings | GnssSettings | ImuSettings, Field(discriminator="kind")
]

KINDS = ("truth", "camera", "lidar", "gnss", "imu")

"""User settings of sensors, in meters, degrees and hertz."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from eidrive_scenario.extensions.settings import Settings

Rate = Annotated[float, Field(ge=0.01, le=10_000.0)]
"""Readings per second [Hz]."""
MAX_RANGE = 1e5
"""Maximum range of a sensor [m]."""
MAX_RAYS = 2_000_000
"""Maximum number of rays of a lidar revolution, which is the maximum of a reading."""
MAX_PIXELS = 32_000_000
"""Maximum number of computed pixels of one image, including supersampling."""

MountName = Literal["front", "left", "right", "back", "roof"]


class Mount(Settings):
    """Sensor pose in the frame of the actor: x, y, z [m]; yaw, pitch [degrees], yaw to the left, pitch downwards."""

    x: Annotated[float, Field(ge=-1000.0, le=1000.0)]
    y: Annotated[float, Field(ge=-1000.0, le=1000.0)]
    z: Annotated[float, Field(ge=-1000.0, le=1000.0)]
    yaw: Annotated[float, Field(ge=-3600.0, le=3600.0)] = 0.0
    pitch: Annotated[float, Field(ge=-3600.0, le=3600.0)] = 0.0


def _mount(value: Any) -> Any:
    """Return a mount given as a list as a mapping: x, y, z, then optional yaw and pitch."""
    if isinstance(value, (list, tuple)) and all(
        isinstance(part, (int, float)) and not isinstance(part, bool) for part in value
    ):
        if not 3 <= len(value) <= 5:
            raise ValueError("three to five numbers are expected: x, y, z [m], yaw, pitch [degrees]")
        return dict(zip(("x", "y", "z", "yaw", "pitch"), value, strict=False))
    return value


MountSetting = Annotated[
    Mount | MountName | None, BeforeValidator(_mount, Mount | MountName | tuple[float, ...] | None)
]


MIN_ROTATION = 0.1
"""Minimum rate of revolutions of a lidar [Hz]."""


class SensorSettings(Settings):
    """Settings of all sensors: a mount (None: default of the kind) and a rate (None: each tick)."""

    kind: str
    """Name under which the sensor is registered."""
    mount: MountSetting = None
    rate: Rate | None = None
    """Rate [Hz]."""


class TruthSettings(SensorSettings):
    """Settings of the sensor of the oracle: exact boxes of objects in the line of sight.

    range          maximum distance between the centers of the object and the ego body [m]
    field_of_view  horizontal, about the heading of the mount [degrees]
    visibility     minimum share of the sampled points of an object in sight
    """

    kind: Literal["truth"] = "truth"
    range: Annotated[float, Field(gt=0.0, le=MAX_RANGE)] = 50.0
    field_of_view: float = Field(default=360.0, gt=0.0, le=360.0)
    visibility: float = Field(default=0.1, gt=0.0, le=1.0)


class NoiseSettings(Settings):
    """Noise of an image sensor.

    full_well   full-well capacity of a pixel [electrons]
    read_noise  standard deviation of the readout [electrons]
    """

    full_well: Annotated[float, Field(ge=1.0, le=1e9)] = 12_000.0
    read_noise: Annotated[float, Field(ge=0.0, le=1e6)] = 4.0


def _distortion(value: Any) -> Any:
    """Return distortion as five coefficients in OpenCV's order; missing ones are 0."""
    if isinstance(value, (list, tuple)):
        if len(value) > 5:
            raise ValueError("up to five coefficients are expected: k1, k2, p1, p2, k3")
        return tuple(value) + (0.0,) * (5 - len(value))
    return value


def _noise(value: Any) -> Any:
    """Return None for `none` and `off`, which YAML reads as false."""
    return None if value in ("none", "off", False) else value


class CameraSettings(SensorSettings):
    """Settings of a camera.

    width, height  [pixels]
    fov            horizontal, of the undistorted image [degrees]
    distortion     k1, k2, p1, p2, k3 of Brown and Conrady, as in OpenCV
    near, far      distances between which objects are drawn [m]
    noise          of the image sensor; None: no noise
    exposure_time, gain   [s], [dB]; None: automatic, within the maxima
    max_exposure_time, max_gain   maxima of automatic exposure [s], [dB]
    lens_drops     whether rain reaches the lens
    supersampling  rays per pixel and axis: 2 smooths edges at four times the cost
    """

    kind: Literal["camera"] = "camera"
    width: int = Field(default=800, ge=2, le=8192)
    height: int = Field(default=600, ge=2, le=8192)
    fov: float = Field(default=100.0, ge=1e-3, lt=180.0)
    distortion: Annotated[tuple[float, float, float, float, float], BeforeValidator(_distortion, tuple[float, ...])] = (
        0.0,
    ) * 5
    near: Annotated[float, Field(ge=1e-3, le=MAX_RANGE)] = 0.1
    far: Annotated[float, Field(ge=1e-3, le=MAX_RANGE)] = 500.0
    noise: Annotated[
        NoiseSettings | None, BeforeValidator(_noise, NoiseSettings | Literal["none", "off", False] | None)
    ] = NoiseSettings()
    f_number: Annotated[float, Field(ge=0.1, le=1000.0)] = 1.6
    exposure_time: Annotated[float, Field(ge=1e-9, le=100.0)] | None = None
    gain: Annotated[float, Field(ge=-20.0, le=80.0)] | None = None
    max_exposure_time: Annotated[float, Field(ge=1e-9, le=100.0)] = 0.03
    max_gain: float = Field(default=36.0, ge=0.0, le=80.0)
    lens_drops: bool = True
    supersampling: int = Field(default=1, ge=1, le=4)

    @model_validator(mode="after")
    def _check_limits(self) -> CameraSettings:
        if self.near >= self.far:
            raise ValueError(f"near is not smaller than far (got {self.near:g} and {self.far:g})")
        pixels = self.width * self.height * self.supersampling**2
        if pixels > MAX_PIXELS:
            raise ValueError(
                f"the image has too many pixels with supersampling (got {pixels}; expected at most {MAX_PIXELS})"
            )
        if any(abs(coefficient) > 1e3 for coefficient in self.distortion):
            raise ValueError("a coefficient of the distortion is out of range (expected -1000 to 1000)")
        return self

    @model_validator(mode="after")
    def _lens_maps_one_to_one(self) -> CameraSettings:
        """Check that each pixel has one direction: the distorted radius increases with the true one up to the corners.

        At radius r, p1 and p2 move a point by at most 3 |p| r², which reduces the guaranteed increase.
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
            next_distorted = radius * (1.0 + square * (k1 + square * (k2 + square * k3))) - decentering * square
            if next_distorted <= distorted:
                break
            distorted = next_distorted
            if distorted >= corner:
                break
        if distorted < corner:
            raise ValueError(
                f"the distortion folds the image {math.degrees(math.atan(radius)):.0f} degrees off the optical axis"
            )
        # The undistorted image is radius / corner times as wide and high.
        if self.width * self.height * self.supersampling**2 * (radius / corner) ** 2 > 1.1 * MAX_PIXELS:
            raise ValueError(
                f"the undistorted image has more than {MAX_PIXELS} pixels (reduce width, height, supersampling or fov)"
            )
        return self


class LidarSettings(SensorSettings):
    """Settings of a rotating lidar with rings at equal spacing over the vertical field of view, or at `elevations`.

    range          maximum measured distance [m]
    points_per_second  rays of all channels
    rotation       revolutions per second [Hz]
    upper_fov, lower_fov  elevations of the highest and the lowest ring above the horizon [degrees]
    field_of_view  horizontal, about the heading of the mount [degrees]
    elevations     of the rings above the horizon, from the highest on [degrees]; None: equal spacing
    attenuation    of the intensity with distance, in addition to that of the weather [1/m]
    range_noise    standard deviation of a distance [m]
    ten_percent_range  maximum measured distance of a surface of reflectivity 0.1 in clear air [m]
    dropoff        share of returns that are lost at random
    dropoff_intensity, dropoff_dark   a return below this intensity is lost with a probability that rises to
                   `dropoff_dark` at intensity 0
    weather        whether fog, rain and snow attenuate returns and cause false ones
    """

    kind: Literal["lidar"] = "lidar"
    channels: Annotated[int, Field(ge=1, le=4096)] = 32
    range: Annotated[float, Field(gt=0.0, le=MAX_RANGE)] = 50.0
    points_per_second: Annotated[int, Field(ge=1, le=100_000_000)] = 100_000
    rotation: Annotated[float, Field(ge=MIN_ROTATION, le=1000.0)] = 20.0
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
    def _check_consistency(self) -> LidarSettings:
        if self.lower_fov > self.upper_fov:
            raise ValueError(f"lower_fov exceeds upper_fov (got {self.lower_fov:g} and {self.upper_fov:g})")
        if self.elevations is not None and len(self.elevations) != self.channels:
            raise ValueError(f"elevations has the wrong length (got {len(self.elevations)}; expected {self.channels})")
        if self.elevations is not None and any(low > high for high, low in pairwise(self.elevations)):
            raise ValueError(f"elevations rise (got {list(self.elevations)}; expected the highest ring first)")
        rays = self.points_per_second / self.rotation
        if rays > MAX_RAYS:
            raise ValueError(
                f"points_per_second gives too many rays in one reading (got {rays:.3g}; expected at most {MAX_RAYS})"
            )
        columns = self.points_per_second / self.channels / self.rotation
        if columns < 1.0:
            raise ValueError(
                f"points_per_second gives less than one column per revolution (got {self.points_per_second}; "
                f"expected at least {self.channels} channels x {self.rotation:g} revolutions)"
            )
        return self


class GnssSettings(SensorSettings):
    """Settings of a GNSS receiver that measures the reference point of the station. Standard deviations.

    position_noise, height_noise   white, per reading: each horizontal axis, and vertical [m]
    bias           of each horizontal axis at the start of the run [m]
    bias_walk      random walk of the bias [m/√s]
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
    """Settings of an IMU at the reference point of the station. Noise as densities, biases as standard deviations.

    accelerometer_noise, gyroscope_noise   white [m/s²/√Hz], [rad/s/√Hz]
    accelerometer_bias, gyroscope_bias     of each axis at the start of the run [m/s²], [rad/s]
    accelerometer_walk, gyroscope_walk     random walk of the biases [m/s²/√s], [rad/s/√s]
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

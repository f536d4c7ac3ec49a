"""Settings of sensors as a person types them: metres, degrees, hertz."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

from eidrive_scenario.settings import Settings

MountName = Literal["front", "left", "right", "back", "roof"]


class Mount(Settings):
    """Where a sensor sits in the actor's frame [m] and where it looks [degrees]: yaw to the left, pitch downwards."""

    x: float
    y: float
    z: float
    yaw: float = 0.0
    pitch: float = 0.0


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
    rate: PositiveFloat | None = None
    """[Hz]"""


class TruthSettings(SensorSettings):
    """The sensor behind the oracle: exact boxes of what is in its line of sight.

    range          to the centre of an object from the centre of the own body [m]
    field_of_view  horizontal, about the mount's heading [degrees]
    visibility     least share of an object's sampled points that must be in sight
    """

    kind: Literal["truth"] = "truth"
    range: PositiveFloat = 50.0
    field_of_view: float = Field(default=360.0, gt=0.0, le=360.0)
    visibility: float = Field(default=0.1, gt=0.0, le=1.0)


class CameraSettings(SensorSettings):
    """A pinhole camera; `fov` is horizontal [degrees], `width` and `height` in pixels, `near` and `far` in metres."""

    kind: Literal["camera"] = "camera"
    width: PositiveInt = 800
    height: PositiveInt = 600
    fov: float = Field(default=100.0, gt=0.0, lt=180.0)
    near: PositiveFloat = 0.1
    far: PositiveFloat = 200.0


class LidarSettings(SensorSettings):
    """A spinning LiDAR: rings spread evenly over the vertical field of view [degrees], range [m].

    rotation     revolutions per second [Hz]
    attenuation  of the intensity with distance [1/m]
    """

    kind: Literal["lidar"] = "lidar"
    channels: PositiveInt = 32
    range: PositiveFloat = 50.0
    points_per_second: PositiveInt = 100_000
    rotation: PositiveFloat = 20.0
    upper_fov: float = Field(default=10.0, ge=-90.0, le=90.0)
    lower_fov: float = Field(default=-30.0, ge=-90.0, le=90.0)
    attenuation: NonNegativeFloat = 0.004

    @model_validator(mode="after")
    def _ordered(self) -> LidarSettings:
        if self.lower_fov > self.upper_fov:
            raise ValueError(f"lower_fov {self.lower_fov:g} lies above upper_fov {self.upper_fov:g}")
        return self


AnySensorSettings = Annotated[TruthSettings | CameraSettings | LidarSettings, Field(discriminator="kind")]

KINDS = ("truth", "camera", "lidar")

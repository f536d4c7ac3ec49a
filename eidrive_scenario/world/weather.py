"""Weather of a world: settings, and derived properties of light, air and road."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Literal

from pydantic import Field, model_validator

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.extensions.library import resolve
from eidrive_scenario.extensions.settings import Settings, parse_settings
from eidrive_scenario.files.bounded import path_argument
from eidrive_scenario.files.yaml_text import load_yaml_file

CONTRAST_THRESHOLD = 0.02
"""Contrast of a black object against the sky at the visual range (Koschmieder)."""
EXTINCTION_AT_RANGE = -math.log(CONTRAST_THRESHOLD)
"""Optical thickness of the air along the visual range, 3.912."""
DECIBEL_PER_KM = math.log(10.0) / 10.0 / 1000.0
"""One dB/km as a coefficient of extinction [1/m]."""
RAIN_LAW = (1.076, 0.67)
"""Attenuation of light by rain of R mm/h: k R^a [dB/km] (ITU-R P.1814, measured in France)."""
SNOW_LAW = (5.5253, 1.38)
"""Attenuation of light by dry snow at 550 nm (ITU-R P.1814)."""
WET_GRIP_LOSS = 0.41
"""Loss of grip on standing water.

Peak adhesion on asphalt is 0.85 if dry and down to 0.5 if wet (Wong, Theory of Ground Vehicles, table of road adhesion
after Taborek 1957): 0.5 / 0.85 = 0.59 of the dry grip remains.
"""
SNOW_GRIP = 0.235
"""Grip on hard-packed snow by the same table, 0.2 / 0.85."""
DARK = 1.0
"""Elevation of the sun below which vehicles switch on their lamps automatically [degrees]."""
POOR_SIGHT = 1500.0
"""Visual range below which vehicles switch on their lamps automatically [m]."""

BRIGHTEST = 1e9
"""Maximum illuminance [lx]; images compute light in single precision."""

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Illuminance = Annotated[float, Field(ge=0.0, le=BRIGHTEST)]


class Weather(Settings):
    """Sun, clouds, air, precipitation and road. The default is a clear day with a high sun.

    sun_azimuth       0 is north (y), 90 east (x) [degrees]
    sun_elevation     above the horizon, negative at night [degrees]
    sun_illuminance   direct light of the sun across its rays [lx]; None for the value by its elevation times sun_share
    sun_share         factor of the direct light of the sun
    cloud_cover       share of the sky
    visual_range      by Koschmieder, of the air without precipitation [m]; fog below 1000
    precipitation, precipitation_intensity  kind, and amount of water [mm/h]
    wetness           of the road: 0 dry, 0.25 moist, 0.5 wet with puddles, 0.75 and 1 flooded
    friction          grip of the tires as a share of that on a dry road; None for the value by wetness and snow
    wind_direction    direction to which the wind blows, 0 along x, 90 along y [degrees]
    wind_speed        [m/s]
    street_lighting   illuminance on the roads by street lamps at night [lx]
    headlights        `auto` switches on those of vehicles in the dark and in thick air
    """

    name: str = ""
    description: str = ""
    sun_azimuth: float = 130.0
    sun_elevation: float = Field(default=55.0, ge=-90.0, le=90.0)
    sun_illuminance: Illuminance | None = None
    sun_share: Share = 1.0
    cloud_cover: Share = 0.1
    visual_range: float = Field(default=30_000.0, ge=1e-3)
    precipitation: Literal["none", "rain", "snow"] = "none"
    precipitation_intensity: float = Field(default=0.0, ge=0.0, le=500.0)
    wetness: Share = 0.0
    friction: Annotated[float, Field(gt=0.0, le=2.0)] | None = None
    wind_direction: float = 0.0
    wind_speed: float = Field(default=0.0, ge=0.0, le=100.0)
    street_lighting: Illuminance = 0.0
    headlights: Literal["auto", "on", "off"] = "auto"

    @model_validator(mode="after")
    def _check_precipitation(self) -> Weather:
        if self.precipitation_intensity > 0.0 and self.precipitation == "none":
            raise ValueError("precipitation_intensity above 0 needs `precipitation: rain` or `precipitation: snow`")
        return self

    @property
    def sun_direction(self) -> tuple[float, float, float]:
        """Unit vector to the sun: x east, y north, z up."""
        azimuth, elevation = math.radians(self.sun_azimuth), math.radians(self.sun_elevation)
        flat = math.cos(elevation)
        return flat * math.sin(azimuth), flat * math.cos(azimuth), math.sin(elevation)

    @property
    def fog_extinction(self) -> float:
        """Extinction of the air without precipitation [1/m]: 3.912 / visual range (Koschmieder 1924)."""
        return EXTINCTION_AT_RANGE / self.visual_range

    @property
    def precipitation_extinction(self) -> float:
        """Extinction by drops or flakes [1/m]."""
        if self.precipitation == "none" or self.precipitation_intensity == 0.0:
            return 0.0
        factor, power = RAIN_LAW if self.precipitation == "rain" else SNOW_LAW
        return float(factor * self.precipitation_intensity**power * DECIBEL_PER_KM)

    @property
    def extinction(self) -> float:
        """Extinction of visible light [1/m]: the share exp(-extinction · d) of light passes the distance d."""
        return self.fog_extinction + self.precipitation_extinction

    @property
    def friction_scale(self) -> float:
        """Grip of the tires as a share of that on a dry road."""
        if self.friction is not None:
            return self.friction
        if self.precipitation == "snow" and self.precipitation_intensity > 0.0:
            return SNOW_GRIP
        return 1.0 - WET_GRIP_LOSS * self.wetness

    @property
    def lamps_on(self) -> bool:
        """Whether vehicles switch on their lamps automatically."""
        if self.headlights != "auto":
            return self.headlights == "on"
        return self.sun_elevation < DARK or EXTINCTION_AT_RANGE / self.extinction < POOR_SIGHT


def load_weather(source: str | os.PathLike[str], *, origin: str = "") -> Weather:
    """Return a weather preset of the library by name, or a YAML file.

    `origin` is the source of the name, such as an option. Raise SettingError with file and line of each error, or with
    `origin` if the file does not exist.
    """
    try:
        path = resolve("weather", path_argument(source, "source", "the name or the file of a weather preset"))
    except SettingError as error:
        raise SettingError([replace(diagnostic, source=origin) for diagnostic in error.diagnostics]) from error
    data, lines = load_yaml_file(path)
    if not isinstance(data, Mapping):
        message = f"weather is not a mapping (got {'nothing' if data is None else type(data).__name__})"
        raise SettingError(Diagnostic(message, "write `cloud_cover: 0.5`", str(path), 1))
    weather = parse_settings(Weather, data, source=str(path), line=1, lines=lines)
    return weather if weather.name else weather.model_copy(update={"name": path.stem})

"""The weather of a world: what a person may set, and what follows from it for light, air and road."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.library import resolve
from eidrive_scenario.settings import Settings, load_yaml_file, parse_settings

CONTRAST_THRESHOLD = 0.02
"""Koschmieder: one sees as far as the contrast of a black object against the sky is this."""
EXTINCTION_AT_RANGE = -math.log(CONTRAST_THRESHOLD)
"""3.912: optical thickness of the air along the visual range."""
DECIBEL_PER_KM = math.log(10.0) / 10.0 / 1000.0
"""One dB/km as a coefficient of extinction [1/m]."""
RAIN_LAW = (1.076, 0.67)
"""Attenuation of light by rain of R mm/h: k R^a [dB/km] (ITU-R P.1814, measured in France)."""
SNOW_LAW = (5.5253, 1.38)
"""The same for dry snow at 550 nm (ITU-R P.1814)."""
WET_GRIP_LOSS = 0.41
"""Peak adhesion on asphalt is 0.85 where dry and down to 0.5 where wet (Wong, Theory of Ground Vehicles, table of road
adhesion after Taborek 1957): 0.5 / 0.85 = 0.59 of the dry grip is left on standing water."""
SNOW_GRIP = 0.235
"""The same table: 0.2 on hard-packed snow."""
DARK = 1.0
"""Sun's elevation below which vehicles light their lamps by themselves [degrees]."""

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Weather(Settings):
    """Sun, clouds, air, precipitation and road. The default is a clear day with a high sun.

    sun_azimuth    0 is north (y), 90 east (x) [degrees]
    sun_elevation  above the horizon, negative at night [degrees]
    sun_illuminance  direct light of the sun across its rays [lx]; None is what a sun of this height gives, times
    sun_share      which dims it
    cloud_cover    share of the sky
    visual_range   Koschmieder's, of the air without precipitation [m]; fog below 1000
    precipitation, precipitation_intensity  what falls, and how much water [mm/h]
    wetness        of the road: 0 dry, 0.25 moist, 0.5 wet with puddles, 0.75 and 1 flooded
    friction       grip of the tires as a share of that on a dry road; None is what wetness and snow leave
    wind_direction, wind_speed  where the wind blows to, 0 along x, 90 along y [degrees]; [m/s]
    street_lighting  illuminance on the roads by lamps that stand there, at night [lx]
    headlights     `auto` lights those of vehicles when it is dark or the air is thick
    """

    name: str = ""
    description: str = ""
    sun_azimuth: float = 130.0
    sun_elevation: float = Field(default=55.0, ge=-90.0, le=90.0)
    sun_illuminance: NonNegativeFloat | None = None
    sun_share: Share = 1.0
    cloud_cover: Share = 0.1
    visual_range: PositiveFloat = 30_000.0
    precipitation: Literal["none", "rain", "snow"] = "none"
    precipitation_intensity: float = Field(default=0.0, ge=0.0, le=500.0)
    wetness: Share = 0.0
    friction: Annotated[float, Field(gt=0.0, le=2.0)] | None = None
    wind_direction: float = 0.0
    wind_speed: float = Field(default=0.0, ge=0.0, le=100.0)
    street_lighting: NonNegativeFloat = 0.0
    headlights: Literal["auto", "on", "off"] = "auto"

    @model_validator(mode="after")
    def _something_falls(self) -> Weather:
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
        """Of the air without precipitation [1/m]: 3.912 / visual range (Koschmieder 1924)."""
        return EXTINCTION_AT_RANGE / self.visual_range

    @property
    def precipitation_extinction(self) -> float:
        """By drops or flakes [1/m]."""
        if self.precipitation == "none" or self.precipitation_intensity == 0.0:
            return 0.0
        factor, power = RAIN_LAW if self.precipitation == "rain" else SNOW_LAW
        return float(factor * self.precipitation_intensity**power * DECIBEL_PER_KM)

    @property
    def extinction(self) -> float:
        """Of visible light [1/m]: of the light of a thing at distance d, exp(-extinction · d) arrives."""
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
        """Whether vehicles whose lamps nobody switches have them on."""
        if self.headlights != "auto":
            return self.headlights == "on"
        return self.sun_elevation < DARK or EXTINCTION_AT_RANGE / self.extinction < 1500.0


def load_weather(source: str | Path, *, origin: str = "") -> Weather:
    """A preset of the library by name, or a YAML file; `origin` says where the name was given, such as an option.

    Raise SettingError with the file and line of each mistake, or with `origin` where there is no such file.
    """
    try:
        path = resolve("weather", source)
    except SettingError as error:
        raise SettingError([replace(diagnostic, source=origin) for diagnostic in error.diagnostics]) from error
    data, lines = load_yaml_file(path)
    if not isinstance(data, Mapping):
        found = "nothing" if data is None else type(data).__name__
        raise SettingError(
            Diagnostic(f"a weather is a mapping, found {found}", "write `cloud_cover: 0.5`", str(path), 1)
        )
    weather = parse_settings(Weather, data, source=str(path), line=1, lines=lines)
    return weather if weather.name else weather.model_copy(update={"name": path.stem})

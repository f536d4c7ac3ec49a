"""Time of day, weather and road condition by the scenario, and the weather of the world that they make."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from eidrive_scenario.world.weather import BRIGHTEST, Weather


@dataclass(frozen=True)
class Environment:
    """Current environment; None for values that the scenario has not set.

    date_time      ISO 8601, at time `clock_since` [s] of the run
    clock_runs     False if the time of day is constant
    friction       factor of the grip of tires, 1 on a dry road
    wetness, clouds, precipitation   values of the standard
    precipitation_intensity [mm/h], precipitation_share in [0, 1] (files of 1.0)
    fog_range      visual range [m]
    illuminance    of the sun [lx]
    sun_azimuth, sun_elevation, wind_direction [rad];  wind_speed [m/s]
    temperature [K], pressure [Pa]
    """

    name: str = ""
    date_time: str | None = None
    clock_runs: bool = False
    clock_since: float = 0.0
    friction: float = 1.0
    wetness: str | None = None
    clouds: str | None = None
    sun_azimuth: float | None = None
    sun_elevation: float | None = None
    illuminance: float | None = None
    fog_range: float | None = None
    precipitation: str | None = None
    precipitation_intensity: float | None = None
    precipitation_share: float | None = None
    wind_direction: float | None = None
    wind_speed: float | None = None
    temperature: float | None = None
    pressure: float | None = None
    dome_image: str | None = None

    @property
    def moves_sun(self) -> bool:
        """Whether the time of day determines the position of the sun, and runs."""
        return self.clock_runs and self.date_time is not None and self.sun_elevation is None

    def clock(self, time: float) -> datetime | None:
        """Return the simulated date and time at a time of the run [s]; at most the end of the year 9999."""
        if self.date_time is None:
            return None
        start = datetime.fromisoformat(self.date_time)
        if not self.clock_runs:
            return start
        try:
            return start + timedelta(seconds=time - self.clock_since)
        except OverflowError:
            return datetime.max.replace(tzinfo=start.tzinfo)


LATITUDE = 48.0
"""Latitude for the elevation of the sun by the time of day [degrees]; the clock shows solar time."""
LEAST_FRICTION = 1e-3
"""Minimum friction. The standard permits a road without friction, which the tire model does not support."""
HURRICANE = 100.0
"""Maximum wind speed; higher values are limited to it [m/s]."""
CLEAR = 1e6
"""Maximum visual range; higher values are limited to it [m]. The standard permits an infinite one."""
HEAVY_RAIN = 50.0
"""Intensity of a share of 1 in files of OpenSCENARIO 1.0, whose precipitation has no unit [mm/h]."""
FULL_SUN = 1.0
"""Maximum intensity of the sun that is a share of the illuminance by its elevation, as in many files. A higher one is
in lux, as in the standard.
"""
WET_BY_RAIN = 0.5
"""Default wetness of a road in rain."""

_WETNESS = {"dry": 0.0, "moist": 0.25, "wetWithPuddles": 0.5, "lowFlooded": 0.75, "highFlooded": 1.0}
_CLOUDS = {"free": 0.0, "cloudy": 0.5, "overcast": 1.0, "rainy": 1.0, "skyOff": 0.0} | {
    f"{word}Oktas": min(eighths, 8) / 8
    for eighths, word in enumerate(("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine"))
}


def weather_from_environment(environment: Environment, time: float = 0.0) -> Weather:
    """Return the weather at a time of the run [s]. Values that the environment omits are the defaults of `Weather`.

    Angles follow the standard: azimuth of the sun from north (y) over east (x), direction of the wind from x over y.
    """
    wind = environment.wind_direction
    values: dict[str, Any] = {
        "name": environment.name,
        "friction": min(max(environment.friction, LEAST_FRICTION), 2.0),
        "wind_direction": math.degrees(math.fmod(wind, math.tau)) if wind is not None else None,
        "wind_speed": min(environment.wind_speed, HURRICANE) if environment.wind_speed is not None else None,
        "visual_range": min(max(environment.fog_range, 1.0), CLEAR) if environment.fog_range is not None else None,
        "cloud_cover": _CLOUDS.get(environment.clouds or ""),
        "wetness": _WETNESS.get(environment.wetness or ""),
    }
    values |= _sun(environment, time)
    amount = environment.precipitation_intensity
    if amount is None and environment.precipitation_share is not None:
        amount = HEAVY_RAIN * environment.precipitation_share
    if environment.precipitation in ("rain", "snow") and amount:
        values |= {"precipitation": environment.precipitation, "precipitation_intensity": min(amount, 500.0)}
        if values["wetness"] is None and environment.precipitation == "rain":
            values["wetness"] = WET_BY_RAIN
    return Weather(**{key: value for key, value in values.items() if value is not None})


def solar_position(moment: datetime, latitude: float = LATITUDE) -> tuple[float, float]:
    """Return azimuth from north over east and elevation of the sun [degrees] at solar time.

    Declination by Cooper, The absorption of radiation in solar stills (1969), with an error below half a degree.
    """
    declination = math.radians(23.45) * math.sin(2.0 * math.pi * (284 + moment.timetuple().tm_yday) / 365.0)
    hours = moment.hour + moment.minute / 60.0 + moment.second / 3600.0
    turn = math.radians(15.0 * (hours - 12.0))
    phi = math.radians(latitude)
    up = math.sin(phi) * math.sin(declination) + math.cos(phi) * math.cos(declination) * math.cos(turn)
    east = -math.cos(declination) * math.sin(turn)
    north = math.cos(phi) * math.sin(declination) - math.sin(phi) * math.cos(declination) * math.cos(turn)
    return math.degrees(math.atan2(east, north)) % 360.0, math.degrees(math.asin(max(-1.0, min(1.0, up))))


def _sun(environment: Environment, time: float) -> dict[str, float]:
    elevation = environment.sun_elevation
    if elevation is None:
        moment = environment.clock(time)
        if moment is None:
            return {}
        azimuth, height = solar_position(moment)
        return {"sun_azimuth": azimuth, "sun_elevation": height}
    azimuth = math.degrees(math.fmod(environment.sun_azimuth or 0.0, math.tau))
    height = math.degrees(math.remainder(elevation, 2.0 * math.pi))
    if abs(height) > 90.0:
        azimuth, height = azimuth + 180.0, math.copysign(180.0 - abs(height), height)
    sun = {"sun_azimuth": azimuth, "sun_elevation": height}
    given = environment.illuminance
    if given is not None and given > FULL_SUN:
        sun["sun_illuminance"] = min(given, BRIGHTEST)
    elif given is not None:
        sun["sun_share"] = max(given, 0.0)
    return sun

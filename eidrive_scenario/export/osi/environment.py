"""Environmental conditions of a GroundTruth message, in the classes of OSI."""

from __future__ import annotations

from bisect import bisect_right
from typing import Any

from eidrive_scenario.export.osi.schemas import Osi
from eidrive_scenario.world.environment import Environment
from eidrive_scenario.world.environment_weather import weather_from_environment
from eidrive_scenario.world.render.illumination.daylight import daylight
from eidrive_scenario.world.render.tone_mapping import LUMA

_RAIN = (0.1, 0.5, 1.9, 8.1, 34.0, 149.0)
"""Limits of the classes of precipitation [mm/h]."""
_RAINS = ("NONE", "VERY_LIGHT", "LIGHT", "MODERATE", "HEAVY", "VERY_HEAVY", "EXTREME")
_RANGE = (50.0, 200.0, 1000.0, 2000.0, 4000.0, 10_000.0, 40_000.0)
"""Limits of the classes of fog by visual range [m]."""
_FOGS = (
    *("DENSE", "THICK", "LIGHT", "MIST", "POOR_VISIBILITY", "MODERATE_VISIBILITY", "GOOD_VISIBILITY"),
    "EXCELLENT_VISIBILITY",
)
_LIGHT = (0.01, 1.0, 3.0, 10.0, 20.0, 400.0, 1000.0, 10_000.0)
"""Limits of the classes of ambient illumination [lx]."""


def set_environment(osi: Osi, conditions: Any, environment: Environment, time: float) -> None:
    """Set the values that the scenario specifies, at `time` [s] of the run.

    The ambient illumination is that of level ground in camera images, by the sun and the clouds.
    """
    kinds, weather = osi.environment, weather_from_environment(environment, time)
    given = environment.precipitation_intensity, environment.precipitation_share
    if environment.precipitation == "dry" or given != (None, None):
        intensity = weather.precipitation_intensity
        conditions.precipitation = kinds.Precipitation.Value(f"PRECIPITATION_{_RAINS[bisect_right(_RAIN, intensity)]}")
    if environment.fog_range is not None:
        conditions.fog = kinds.Fog.Value(f"FOG_{_FOGS[bisect_right(_RANGE, environment.fog_range)]}")
    if (environment.sun_elevation, environment.date_time) != (None, None):
        level = bisect_right(_LIGHT, float(daylight(weather).ground @ LUMA)) + 1
        name = f"AMBIENT_ILLUMINATION_LEVEL{level}"
        conditions.ambient_illumination = kinds.AmbientIllumination.Value(name)
    if environment.temperature is not None:
        conditions.temperature = environment.temperature
    if environment.pressure is not None:
        conditions.atmospheric_pressure = environment.pressure
    clock = environment.clock(time)
    if clock is not None:
        conditions.time_of_day.seconds_since_midnight = clock.hour * 3600 + clock.minute * 60 + clock.second
        if clock.tzinfo is not None:
            conditions.unix_timestamp = int(clock.timestamp())

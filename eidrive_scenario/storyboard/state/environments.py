"""Update of the environment by an EnvironmentAction; values that the action omits are kept."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from eidrive_scenario.openscenario import model
from eidrive_scenario.world.environment import Environment


def merge_environment(before: Environment, given: model.Environment, now: float) -> Environment:
    """Return the environment after an EnvironmentAction at `now` [s]. A given time of day restarts the clock."""
    after = replace(before, name=given.name)
    if given.time_of_day is not None:
        after = replace(
            after,
            date_time=given.time_of_day.date_time.isoformat(),
            clock_runs=given.time_of_day.animation,
            clock_since=now,
        )
    if given.road_condition is not None:
        wetness = given.road_condition.wetness
        after = replace(
            after,
            friction=given.road_condition.friction_scale_factor,
            wetness=wetness.value if wetness is not None else after.wetness,
        )
    return after if given.weather is None else replace(after, **_weather(given.weather))


def _weather(weather: model.Weather) -> dict[str, Any]:
    """Return the values that a Weather specifies, by the field names of Environment."""
    values: dict[str, Any] = {"temperature": weather.temperature, "pressure": weather.atmospheric_pressure}
    clouds = weather.fractional_cloud_cover or weather.cloud_state
    if clouds is not None:
        values["clouds"] = clouds.value
    if weather.sun is not None:
        sun = weather.sun
        values |= {"sun_azimuth": sun.azimuth, "sun_elevation": sun.elevation}
        values["illuminance"] = sun.illuminance if sun.illuminance is not None else sun.intensity
    if weather.fog is not None:
        values["fog_range"] = weather.fog.visual_range
    given_values = {name: value for name, value in values.items() if value is not None}
    if weather.precipitation is not None:
        rain = weather.precipitation
        given_values |= {
            "precipitation": rain.precipitation_type.value,
            "precipitation_intensity": rain.precipitation_intensity,
            "precipitation_share": rain.intensity,
        }
    if weather.wind is not None:
        given_values |= {"wind_direction": weather.wind.direction, "wind_speed": weather.wind.speed}
    if weather.dome_image is not None:
        given_values["dome_image"] = weather.dome_image.dome_file.filepath
    return given_values

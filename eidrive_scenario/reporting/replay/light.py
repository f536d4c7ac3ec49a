"""Light of a run for the view in three dimensions: sun, sky and exposure by the weather, as the cameras see them."""

from __future__ import annotations

import base64
import math
from functools import lru_cache
from typing import Any

import numpy as np
from pydantic import ValidationError

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.rendering.daylight import CLEAR_AIR, GROUND_ALBEDO, daylight, dome, horizon
from eidrive_scenario.rendering.shading import STREET_LAMP
from eidrive_scenario.rendering.surfaces import DARKENING
from eidrive_scenario.rendering.tone_mapping import BLACK, HEADROOM, LUMA, tone_map, white_of_mean
from eidrive_scenario.world.environment import Environment, weather_from_environment
from eidrive_scenario.world.weather import Weather

SKY_SIZE = 384
"""Width and height of the image of the sky in the page [pixels]."""
SURROUNDINGS = 0.05
"""Albedo of asphalt and its surroundings, of which a picture shows about as much as of the sky."""
_PERIOD = 60.0
"""Time between two positions of a moving sun [s]."""
_MOST = 60
"""Maximum number of changes of the light in a page."""


def light_entry(weather: Weather, time: float) -> dict[str, Any]:
    """Return the light from a time [s] on. Luminance and illuminance are in units of the exposure, as the tone curve
    of the cameras needs them.

    towards       unit vector to the sun
    sun           illuminance across the rays of the sun
    sky, ground   illuminance of a level surface from above, and from below
    dome          image of the sky as a data URI; column and row are x / (1 + z) and y / (1 + z) of the direction
    air           luminance of large distances; extinction of the air beyond that of a clear day [1/m]
    wet           factor of the albedo of roads
    """
    light = daylight(weather)
    lamps = weather.street_lighting * STREET_LAMP if weather.lamps_on else np.zeros(3)
    below, above = (light.ground + lamps) * SURROUNDINGS / math.pi, horizon(weather)
    mean = math.sqrt(max(float(below @ LUMA), BLACK) * max(float(above @ LUMA), BLACK))
    white = white_of_mean(mean)
    scale = HEADROOM / white
    return {
        "time": round(time, 3),
        "towards": _rounded(light.towards),
        "sun": _rounded(scale * light.sun),
        "sky": _rounded(scale * (light.sky + lamps)),
        "ground": _rounded(scale * (GROUND_ALBEDO * light.ground + 0.35 * lamps)),
        "dome": _sky_image(weather, white),
        "air": _rounded(scale * above),
        "extinction": round(max(weather.extinction - CLEAR_AIR, 0.0), 6),
        "wet": round(1.0 - DARKENING * min(2.0 * weather.wetness, 1.0), 3),
    }


@lru_cache(maxsize=16)
def _sky_image(weather: Weather, white: float) -> str:
    import cv2

    small = cv2.resize(dome(weather), (SKY_SIZE, SKY_SIZE), interpolation=cv2.INTER_AREA)
    image = tone_map(np.asarray(small, dtype=np.float32), white)
    _, content = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 80])
    return "data:image/jpeg;base64," + base64.b64encode(content.tobytes()).decode("ascii")


def _rounded(values: Array) -> Any:
    return np.round(values, 4).tolist()


class LightChanges:
    """Changes of the light of a run.

    weather  that of an option of the run, which overrides the scenario; None without one
    """

    def __init__(self, weather: Weather | None = None) -> None:
        self._weather = weather
        self._environment: Environment | None = None
        self._since = -math.inf
        self._count = 0

    def observe(self, frame: Frame) -> list[dict[str, Any]]:
        """Return the light of a frame if it has changed, otherwise no entry."""
        environment, time = frame.environment, frame.view.time
        moves = environment is not None and environment.moves_sun and time >= self._since + _PERIOD
        is_new = self._count == 0 or (self._weather is None and (moves or environment != self._environment))
        if not is_new or self._count >= _MOST:
            return []
        self._environment, self._since, self._count = environment, time, self._count + 1
        return [light_entry(self._weather or _weather(environment, time), time)]


def _weather(environment: Environment | None, time: float) -> Weather:
    """Return the weather of an environment, or the default weather without one or for one of a damaged recording."""
    try:
        return Weather() if environment is None else weather_from_environment(environment, time)
    except (ValidationError, ArithmeticError, TypeError, ValueError):
        return Weather()


def parse_weather(profile: Any) -> Weather | None:
    """Return the weather of the settings of a run, None without one."""
    try:
        return Weather.model_validate(profile) if profile else None
    except ValidationError:
        return None

"""GroundTruth messages from frames, with their environment."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import Any

from eidrive_scenario.export.osi.lanes import LaneMap
from eidrive_scenario.export.osi.moving_objects import ACTOR, VEHICLES, add_moving_objects
from eidrive_scenario.export.osi.schemas import Identifiers, Osi
from eidrive_scenario.export.osi.signals import Signals
from eidrive_scenario.export.osi.stationary_objects import add_stationary_objects
from eidrive_scenario.export.recorded_run import RecordedRun
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.run_files import ROAD_FILE
from eidrive_scenario.rendering.daylight import daylight
from eidrive_scenario.rendering.tone_mapping import LUMA
from eidrive_scenario.world.environment import CLEAR, Environment, weather_from_environment
from eidrive_scenario.world.weather import Weather

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
_EIGHTHS = ("ZERO", "ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT")
_OBSCURED = "nineOktas"
"""Value of the standard for a sky that cannot be seen."""
_NO_SKY = "skyOff"
"""Value of files up to version 1.1 for a sky that is not drawn, whose clouds are unknown."""


def set_environment(
    osi: Osi, conditions: Any, environment: Environment | None, time: float, fixed: Weather | None
) -> None:
    """Set the values that the scenario or an option of the run specifies, at `time` [s] of the run.

    fixed  weather that overrides that of the scenario
    """
    if fixed is not None:
        _set_weather(osi.environment, conditions, fixed)
    if environment is None:
        return
    if fixed is None:
        _set_weather(osi.environment, conditions, weather_from_environment(environment, time), environment)
    if environment.temperature is not None:
        conditions.temperature = environment.temperature
    if environment.pressure is not None:
        conditions.atmospheric_pressure = environment.pressure
    clock = environment.clock(time)
    if clock is not None:
        conditions.time_of_day.seconds_since_midnight = clock.hour * 3600 + clock.minute * 60 + clock.second
        if clock.tzinfo is not None:
            conditions.unix_timestamp = int(clock.timestamp())


def _set_weather(kinds: Any, conditions: Any, weather: Weather, given: Environment | None = None) -> None:
    """Set the values of the weather; of an environment, only those that it contains.

    Directions are counterclockwise from north (y) [rad]. OSI has the origin of the wind, and the illuminance of the sun
    without clouds [lx].
    """
    amounts = () if given is None else (given.precipitation_intensity, given.precipitation_share)
    if given is None or given.precipitation == "dry" or amounts != (None, None):
        name = _RAINS[bisect_right(_RAIN, weather.precipitation_intensity)]
        conditions.precipitation = kinds.Precipitation.Value(f"PRECIPITATION_{name}")
    if given is None or given.fog_range is not None:
        conditions.fog = kinds.Fog.Value(f"FOG_{_FOGS[bisect_right(_RANGE, weather.visual_range)]}")
    if given is None or given.clouds not in (None, _NO_SKY):
        is_obscured = given is not None and given.clouds == _OBSCURED
        # Only a sky without a cloud and a full one are 0 and 8 eighths
        eighths, cover = round(8.0 * weather.cloud_cover), weather.cloud_cover
        name = _EIGHTHS[min(max(eighths, 1), 7) if 0.0 < cover < 1.0 else eighths]
        value = f"FRACTIONAL_CLOUD_COVER_{'SKY_OBSCURED' if is_obscured else f'{name}_OKTAS'}"
        conditions.clouds.fractional_cloud_cover = kinds.CloudLayer.FractionalCloudCover.Value(value)
    if given is None or given.wind_speed is not None:
        conditions.wind.origin_direction = math.radians((weather.wind_direction + 90.0) % 360.0)
        conditions.wind.speed = weather.wind_speed if given is None else given.wind_speed
    if given is None or (given.sun_elevation, given.date_time) != (None, None):
        # The light on level ground in camera images
        lamps = weather.street_lighting if weather.lamps_on else 0.0
        level = bisect_right(_LIGHT, float(daylight(weather).ground @ LUMA) + lamps) + 1
        conditions.ambient_illumination = kinds.AmbientIllumination.Value(f"AMBIENT_ILLUMINATION_LEVEL{level}")
        conditions.sun.azimuth = math.radians(-weather.sun_azimuth % 360.0)
        conditions.sun.elevation = math.radians(weather.sun_elevation)
        clear = weather.model_copy(update={"cloud_cover": 0.0, "precipitation": "none", "visual_range": CLEAR})
        conditions.sun.intensity = float(daylight(clear).sun @ LUMA)


_EGOS = frozenset({"ego", "hero", "ego_vehicle"})


class GroundTruthBuilder:
    """Builder of the messages of one run. The first one contains lanes, boundaries, signs and objects of the map."""

    def __init__(self, osi: Osi, run: RecordedRun) -> None:
        self._osi = osi
        self._run = run
        self._ids = Identifiers()
        self._lanes = LaneMap(osi, run.roads, self._ids)
        self._signals = Signals(osi, run.roads, self._ids)
        self._host = host_vehicle(run)
        self._has_map = False

    def build(self, frame: Frame) -> Any:
        """Return the message of the next frame."""
        message = self._osi.begin(self._osi.ground_truth(), frame.view.time)
        if self._host is not None:
            message.host_vehicle_id.value = self._ids.of(ACTOR, self._host)
        if self._run.roads is not None:
            message.map_reference = ROAD_FILE
            message.proj_string = self._run.roads.header.geo_reference
            if any(shift := self._run.roads.header.offset):
                offset = message.proj_frame_offset
                offset.position.x, offset.position.y, offset.position.z, offset.yaw = shift
        if not self._has_map:
            self._lanes.add(message)
            self._signals.add_signs(message)
            if self._run.roads is not None:
                without = self._run.external_objects
                add_stationary_objects(self._osi, message, self._run.roads, self._ids, without)
            self._has_map = True
        lanes = self._lanes.assigned(frame.view)
        add_moving_objects(self._osi, message, frame, self._ids, lanes, self._run)
        self._signals.add_lights(message, frame.signals)
        if frame.environment is not None or self._run.weather is not None:
            conditions = message.environmental_conditions
            set_environment(self._osi, conditions, frame.environment, frame.view.time, self._run.weather)
        return message


def host_vehicle(run: RecordedRun) -> str | None:
    """Return the host vehicle of a run, which may enter the world later.

    It is the first station that drives, else an actor named as an ego, else the first vehicle. The frames are read
    until a station drives. A trailer is no host.
    """
    ego = vehicle = None
    towed = run.towed
    for frame in run.frames():
        view = frame.view
        driven = next((name for name, step in frame.steps.items() if step.control is not None and name in view), None)
        if driven is not None:
            return driven
        ego = ego or next((name for name in view.names if name.lower() in _EGOS), None)
        bodies = zip(view.names, view.categories, strict=True)
        vehicles = (name for name, category in bodies if category in VEHICLES and name not in towed)
        vehicle = vehicle or next(vehicles, None)
    return ego or vehicle

"""Time of day, weather and road condition by the scenario."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta


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

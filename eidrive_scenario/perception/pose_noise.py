"""Random error of the pose that a station assumes: independent in each time step, or correlated over time."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from msgspec.structs import replace
from pydantic import Field

from eidrive_scenario.arrays import Array
from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.perception.localization import at_pose
from eidrive_scenario.randomness import generator
from eidrive_scenario.sensing.readings import Readings
from eidrive_scenario.settings import Settings


class PoseNoise(Settings):
    """Normal error of the assumed pose with zero mean.

    position          standard deviation of x, and of y [m]
    yaw               standard deviation of the heading [degrees]
    correlation_time  time after which the correlation of the error is 1/e [s]; 0: independent in each time step
    """

    position: Annotated[float, Field(ge=0.0, le=100.0)] = 0.0
    yaw: Annotated[float, Field(ge=0.0, le=180.0)] = 0.0
    correlation_time: Annotated[float, Field(ge=0.0, le=1e9)] = 0.0


class PoseNoiseProcess:
    """Pose error of one station over time.

    It is a stationary Gauss-Markov process of first order, sampled exactly at any times (Gelb, Applied optimal
    estimation, 1974, section 3.8). Equal seeds give equal draws, which the standard deviations scale.
    """

    def __init__(self, settings: PoseNoise, station: str, seed: int) -> None:
        self.settings = settings
        self._random = generator(seed, "pose noise", station)
        self._deviations: Array = np.array([settings.position, settings.position, math.radians(settings.yaw)])
        self._unit: Array | None = None
        """Error in standard deviations (3,): x, y, yaw."""
        self._time = -math.inf
        self._kept = 0.0
        """Correlation of the error with that of the last call."""

    @property
    def pose_covariance(self) -> Array:
        """Covariance (3, 3) of the errors of x, y [m] and yaw [rad]."""
        return np.diag(self._deviations**2)

    @property
    def lagged_covariance(self) -> Array:
        """Covariance (3, 3) of the errors of x, y [m] and yaw [rad] with those of the last call of `error`; 0 at the
        first one."""
        return self._kept * self.pose_covariance

    def error(self, time: float) -> Array:
        """Return the error (3,) of x, y [m] and yaw [rad] at `time` [s], which does not decrease between calls."""
        if self._unit is None:
            self._unit = self._random.standard_normal(3)
        elif time > self._time:
            span = self.settings.correlation_time
            kept = self._kept = math.exp(-(time - self._time) / span) if span > 0.0 else 0.0
            self._unit = kept * self._unit + math.sqrt(1.0 - kept * kept) * self._random.standard_normal(3)
        self._time = time
        errors: Array = self._deviations * self._unit
        return errors

    def displaced(self, readings: Readings) -> Readings:
        """Return the readings as if the station were at its pose plus the error."""
        ego = readings.ego
        x, y, yaw = self.error(readings.time).tolist()
        position = ego.position + np.array([x, y, 0.0])
        return at_pose(readings, replace(ego, position=position, yaw=wrap_angle(ego.yaw + yaw)))

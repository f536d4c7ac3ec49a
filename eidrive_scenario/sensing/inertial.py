"""GNSS receiver and inertial measurement unit (IMU)."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import rotation_matrix
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.sensing.readings import GnssReading, ImuReading
from eidrive_scenario.sensing.sensor import Scene, Sensor
from eidrive_scenario.sensing.settings import GnssSettings, ImuSettings, SensorSettings
from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.view import WorldView

EXACT = 1e-3
"""Standard deviation that an oracle reading states, as filters require a positive one [m]."""
FIRST_INTERVAL = 0.05
"""Integration time of the first reading of a unit that is read each tick [s]."""


class Gnss(Sensor):
    """GNSS position of the reference point: the true position, a random-walk bias, and white noise.

    The covariance of a reading contains the noise and the initial bias; a receiver cannot measure the later drift of
    the bias. Noise and random walk are drawn by seed, station, name and tick.
    """

    settings_type: ClassVar[type[SensorSettings]] = GnssSettings
    unique: ClassVar[bool] = True
    settings: GnssSettings

    def __init__(self, settings: GnssSettings, spec: ActorSpec, name: str = "gnss", seed: int = 0) -> None:
        super().__init__(settings, spec, name, seed)
        self._key = (seed, "gnss", spec.name, name)
        self._bias = _RandomWalkBias(generator(*self._key, "bias"), 2, settings.bias, settings.bias_walk)
        across = settings.position_noise**2 + settings.bias**2
        self._covariance = np.diag([max(v, EXACT**2) for v in (across, across, settings.height_noise**2)])

    def read(self, scene: Scene, view: WorldView, row: int) -> GnssReading:
        """Return the measured position of the actor in this row."""
        position = view.position[row]
        if self.settings.oracle:
            return GnssReading(position, np.eye(3) * EXACT**2)
        draws, settings = generator(*self._key, view.tick), self.settings
        deviation = (settings.position_noise, settings.position_noise, settings.height_noise)
        measured = position + deviation * draws.standard_normal(3)
        measured[:2] += self._bias.at(view.time, draws)
        return GnssReading(measured, self._covariance)


class Imu(Sensor):
    """Acceleration and turn rates in the body frame: true values, random-walk biases, and white noise.

    Noise of density n in readings of an interval T has the standard deviation n / √T (IEEE 952, annex C). Noise and
    random walk are drawn by seed, station, name and tick.
    """

    settings_type: ClassVar[type[SensorSettings]] = ImuSettings
    unique: ClassVar[bool] = True
    settings: ImuSettings

    def __init__(self, settings: ImuSettings, spec: ActorSpec, name: str = "imu", seed: int = 0) -> None:
        super().__init__(settings, spec, name, seed)
        self._key = (seed, "imu", spec.name, name)
        push, turn = (generator(*self._key, name, "bias") for name in ("push", "turn"))
        self._accelerometer_bias = _RandomWalkBias(push, 3, settings.accelerometer_bias, settings.accelerometer_walk)
        self._gyroscope_bias = _RandomWalkBias(turn, 3, settings.gyroscope_bias, settings.gyroscope_walk)
        self._last: float | None = None

    def read(self, scene: Scene, view: WorldView, row: int) -> ImuReading:
        """Return the reading of the unit on the actor in this row."""
        settings = self.settings
        body = rotation_matrix(view.yaw[row], view.pitch[row], view.roll[row])
        acceleration = view.acceleration[row] @ body
        rates = np.array([0.0, 0.0, float(view.yaw_rate[row])]) @ body
        interval = view.time - self._last if self._last is not None else 1.0 / (settings.rate or 1.0 / FIRST_INTERVAL)
        self._last = view.time
        if settings.oracle:
            return ImuReading(acceleration, rates)
        draws = generator(*self._key, view.tick)
        white = draws.standard_normal((2, 3)) / math.sqrt(max(interval, 1e-6))
        return ImuReading(
            acceleration + settings.accelerometer_noise * white[0] + self._accelerometer_bias.at(view.time, draws),
            rates + settings.gyroscope_noise * white[1] + self._gyroscope_bias.at(view.time, draws),
        )


class _RandomWalkBias:
    """Bias (N,) with a random initial value and random walk: its variance grows by walk² per second."""

    def __init__(self, draws: np.random.Generator, axes: int, start: float, walk: float) -> None:
        self._value = start * draws.standard_normal(axes)
        self._walk = walk
        self._time: float | None = None

    def at(self, time: float, draws: np.random.Generator) -> Array:
        elapsed = max(time - self._time, 0.0) if self._time is not None else 0.0
        self._time = time
        if self._walk > 0.0:
            self._value = self._value + self._walk * math.sqrt(elapsed) * draws.standard_normal(len(self._value))
        return self._value

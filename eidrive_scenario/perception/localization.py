"""Where a station takes itself to be: an extended Kalman filter on GNSS and IMU."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.geometry import wrap_angle
from eidrive_scenario.randomness import generator
from eidrive_scenario.sensing.readings import CameraReading, EgoState, GnssReading, ImuReading, LidarReading, Readings
from eidrive_scenario.sensing.settings import ImuSettings

X, Y, YAW, SPEED, TURN_BIAS, ACCELERATION_BIAS = range(6)
PLANE = np.ix_((X, Y, YAW), (X, Y, YAW))


@dataclass(frozen=True)
class MotionNoise:
    """What the filter does not know of its motion. The slip is that of a car whose tires give way by 0.075 m/s for each
    m/s² across, in curves of some two seconds.

    acceleration, turn_rate            white noise of the inertial unit [m/s²/√Hz], [rad/s/√Hz]
    acceleration_bias, turn_bias       biases that it may have, standard deviations [m/s²], [rad/s]
    acceleration_walk, turn_walk       how fast these change [m/s²/√s], [rad/s/√s]
    slip                               of tires in curves: velocity across the heading, which the model does not have,
                                       white, per lateral acceleration [m/√s per m/s²]
    drift                              the same when driving straight [m/√s]
    """

    acceleration: float = 0.02
    turn_rate: float = 0.002
    acceleration_bias: float = 0.0
    turn_bias: float = 0.005
    acceleration_walk: float = 0.0
    turn_walk: float = 1e-4
    slip: float = 0.15
    drift: float = 0.02


def motion_noise(imu: ImuSettings) -> MotionNoise:
    """The noise that the data sheet of an inertial unit states."""
    return MotionNoise(
        acceleration=imu.accelerometer_noise,
        turn_rate=imu.gyroscope_noise,
        acceleration_bias=imu.accelerometer_bias,
        turn_bias=imu.gyroscope_bias,
        acceleration_walk=imu.accelerometer_walk,
        turn_walk=imu.gyroscope_walk,
    )


@dataclass(frozen=True)
class StartNoise:
    """How well a station knows its place when the run starts: standard deviations [m], [rad], [m/s]."""

    position: float = 0.5
    yaw: float = math.radians(1.0)
    speed: float = 0.2


class Estimate(NamedTuple):
    """x, y [m], yaw [rad], speed [m/s], biases of turn rate [rad/s] and acceleration [m/s²]; covariance (6, 6)."""

    state: Array
    covariance: Array


class InertialFilter:
    """The extended Kalman filter of Thrun, Burgard and Fox (Probabilistic robotics, 2005, section 3.3) over a vehicle
    that moves along its heading, driven by the inertial unit, whose biases are states as in Groves (Principles of GNSS,
    inertial, and multisensor integrated navigation systems, 2013, section 14.2)."""

    def __init__(self, start: Estimate, noise: MotionNoise) -> None:
        self.estimate = start
        self._noise = noise

    def predict(self, imu: ImuReading, step: float) -> None:
        """The vehicle has moved for `step` seconds as the inertial unit says."""
        x, y, yaw, speed, turn_bias, acceleration_bias = self.estimate.state.tolist()
        turn = float(imu.angular_rate[2]) - turn_bias
        gain = float(imu.acceleration[0]) - acceleration_bias
        # The reading covers the step: the way is that of the mean speed in the mean direction.
        middle, mean = yaw + 0.5 * turn * step, speed + 0.5 * gain * step
        cos, sin = math.cos(middle), math.sin(middle)
        way = mean * step
        state = np.array(
            [x + way * cos, y + way * sin, yaw + turn * step, speed + gain * step, turn_bias, acceleration_bias]
        )
        forward = np.eye(6)
        forward[X, YAW], forward[Y, YAW] = -way * sin, way * cos
        forward[X, SPEED], forward[Y, SPEED] = step * cos, step * sin
        forward[X, TURN_BIAS], forward[Y, TURN_BIAS] = 0.5 * step * way * sin, -0.5 * step * way * cos
        forward[X, ACCELERATION_BIAS], forward[Y, ACCELERATION_BIAS] = -0.5 * step**2 * cos, -0.5 * step**2 * sin
        forward[YAW, TURN_BIAS] = forward[SPEED, ACCELERATION_BIAS] = -step
        noise = self._noise
        drive = np.zeros((6, 5))
        drive[:, 0] = -forward[:, ACCELERATION_BIAS]
        drive[:, 1] = -forward[:, TURN_BIAS]
        drive[ACCELERATION_BIAS, 0] = drive[TURN_BIAS, 1] = 0.0
        drive[X, 2], drive[Y, 2], drive[SPEED, 2] = -sin, cos, turn
        drive[TURN_BIAS, 3] = drive[ACCELERATION_BIAS, 4] = 1.0
        drive[:, :2] *= (noise.acceleration / math.sqrt(step), noise.turn_rate / math.sqrt(step))
        across = noise.drift + noise.slip * abs(speed * turn)
        drive[:, 2:] *= np.array([across, noise.turn_walk, noise.acceleration_walk]) * math.sqrt(step)
        self.estimate = Estimate(state, forward @ self.estimate.covariance @ forward.T + drive @ drive.T)

    def correct(self, gnss: GnssReading) -> None:
        """The receiver measured the place."""
        state, covariance = self.estimate
        noise = gnss.covariance[:2, :2]
        gain = np.linalg.solve(covariance[:2, :2] + noise, covariance[:2]).T
        rest = np.eye(6)
        rest[:, :2] -= gain
        state = state + gain @ (gnss.position[:2] - state[:2])
        state[YAW] = wrap_angle(float(state[YAW]))
        self.estimate = Estimate(state, rest @ covariance @ rest.T + gain @ noise @ gain.T)


class Localizer:
    """Turns the readings of a station into what it can know, and keeps its estimate up.

    The filter starts at the first reading with the true place and motion, off by a draw of `start` for this seed and
    station. Height, pitch and roll stay true. What sensors measured in their own frames is kept; where that is in the
    world follows from the estimate.
    """

    def __init__(
        self, station: str, seed: int, *, noise: MotionNoise | None = None, start: StartNoise | None = None
    ) -> None:
        self._key = (seed, "localization", station)
        self._noise = noise or MotionNoise()
        self._start = start or StartNoise()
        self._filter: InertialFilter | None = None
        self._imu: ImuReading | None = None
        self._time = 0.0
        self._ego: EgoState | None = None

    @property
    def estimate(self) -> Estimate:
        """The newest estimate. Raises ValueError before the first reading."""
        if self._filter is None:
            raise ValueError("there is no estimate before the first reading")
        return self._filter.estimate

    def with_estimated_pose(self, readings: Readings) -> Readings:
        """The readings with the estimated motion, and the poses of the sensors that follow from it."""
        truth = readings.ego
        if self._filter is None:
            self._filter = InertialFilter(self._first(truth), self._noise)
        elif self._imu is not None or readings.imu is not None:
            imu = readings.imu or self._imu
            if imu is not None and readings.time > self._time:
                self._filter.predict(imu, readings.time - self._time)
        self._imu, self._time = readings.imu or self._imu, readings.time
        if readings.gnss is not None:
            self._filter.correct(readings.gnss)
        x, y, yaw, speed, turn_bias, acceleration_bias = self._filter.estimate.state.tolist()
        self._ego = replace(
            truth,
            position=np.array([x, y, float(truth.position[2])]),
            yaw=yaw,
            speed=speed,
            yaw_rate=float(self._imu.angular_rate[2]) - turn_bias if self._imu is not None else 0.0,
            acceleration=float(self._imu.acceleration[0]) - acceleration_bias if self._imu is not None else 0.0,
        )
        return _moved(readings, self._ego)

    def _first(self, truth: EgoState) -> Estimate:
        seed, *key = self._key
        start, noise = self._start, self._noise
        deviations = np.array(
            [start.position, start.position, start.yaw, start.speed, noise.turn_bias, noise.acceleration_bias]
        )
        drawn = generator(seed, *key).standard_normal(6) * deviations
        x, y, _ = truth.position.tolist()
        state = np.array([x, y, truth.yaw, truth.speed, 0.0, 0.0]) + drawn * (1.0, 1.0, 1.0, 1.0, 0.0, 0.0)
        return Estimate(state, np.diag(deviations**2))


def _moved(readings: Readings, ego: EgoState) -> Readings:
    """The readings as if the station were where it takes itself to be."""
    truth = readings.ego
    turn = ego.yaw - truth.yaw
    cos, sin = math.cos(turn), math.sin(turn)
    rigid = np.eye(4)
    rigid[:2, :2] = [[cos, -sin], [sin, cos]]
    rigid[:2, 3] = ego.position[:2] - rigid[:2, :2] @ truth.position[:2]
    seen = readings.truth
    if seen is not None:
        boxes = seen.boxes.copy()
        boxes[:, :2] = boxes[:, :2] @ rigid[:2, :2].T + rigid[:2, 3]
        boxes[:, 6] = wrap_angle(boxes[:, 6] + turn)
        seen = replace(seen, boxes=boxes, velocity=seen.velocity @ rigid[:2, :2].T)
    return replace(
        readings,
        ego=ego,
        truth=seen,
        cameras={name: _camera(reading, rigid) for name, reading in readings.cameras.items()},
        lidars={name: _lidar(reading, rigid) for name, reading in readings.lidars.items()},
    )


def _camera(reading: CameraReading, rigid: Array) -> CameraReading:
    return replace(reading, pose=rigid @ reading.pose)


def _lidar(reading: LidarReading, rigid: Array) -> LidarReading:
    return replace(reading, pose=rigid @ reading.pose)

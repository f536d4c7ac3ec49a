"""Localization of a station: an extended Kalman filter on GNSS and IMU."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np
from msgspec.structs import replace
from pydantic import Field

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import is_teleport, rotation, wrap_angle
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.sensing.readings import EgoState, GnssReading, ImuReading, Readings
from eidrive_scenario.sensing.settings import ImuSettings

X, Y, YAW, SPEED, TURN_BIAS, ACCELERATION_BIAS = range(6)
PLANE = np.ix_((X, Y, YAW), (X, Y, YAW))


@dataclass(frozen=True)
class MotionNoise:
    """Process noise of the filter.

    The default slip is that of a car whose tires yield by 0.075 m/s per m/s² of lateral acceleration, in curves of
    about two seconds.

    imu    noise and biases that the data sheet of the IMU states
    slip   lateral velocity of the tires in curves, which the model omits: white noise per lateral acceleration
           [m/√s per m/s²]
    drift  the same on a straight course [m/√s]
    """

    imu: ImuSettings = field(default_factory=ImuSettings)
    slip: float = 0.15
    drift: float = 0.02


@dataclass(frozen=True)
class StartNoise:
    """Uncertainty of the initial pose and speed: standard deviations [m], [rad], [m/s]."""

    position: float = 0.5
    yaw: float = math.radians(1.0)
    speed: float = 0.2


class Estimate(NamedTuple):
    """State x, y [m], yaw [rad], speed [m/s], biases of turn rate [rad/s], acceleration [m/s²]; covariance (6, 6)."""

    state: Array
    covariance: Array


class InertialFilter:
    """Extended Kalman filter over a vehicle that moves along its heading, driven by the IMU.

    The filter is that of Thrun, Burgard and Fox (Probabilistic robotics, 2005, section 3.3). The biases of the IMU are
    states as in Groves (Principles of GNSS, inertial, and multisensor integrated navigation systems, 2013, section
    14.2).
    """

    def __init__(self, start: Estimate, noise: MotionNoise) -> None:
        self.estimate = start
        self._noise = noise
        self.propagation = np.zeros((6, 6))
        """Covariance of the error of the state with its error at the start of the time step."""

    def predict(self, imu: ImuReading, step: float, pitch: float = 0.0) -> None:
        """Predict the state by `step` [s] with the accelerations and turn rates of the IMU, at this pitch [rad].

        Speed and acceleration are along the vehicle, and the displacement in the plane is their horizontal part.
        """
        x, y, yaw, speed, turn_bias, acceleration_bias = self.estimate.state.tolist()
        turn = float(imu.angular_rate[2]) - turn_bias
        gain = float(imu.acceleration[0]) - acceleration_bias
        # The reading covers the step: the displacement has the mean speed and the mean direction.
        middle, mean = yaw + 0.5 * turn * step, speed + 0.5 * gain * step
        cos, sin = math.cos(middle), math.sin(middle)
        level = step * math.cos(pitch)
        distance = mean * level
        pose = x + distance * cos, y + distance * sin, yaw + turn * step
        state = np.array([*pose, speed + gain * step, turn_bias, acceleration_bias])
        forward = np.eye(6)
        forward[X, YAW], forward[Y, YAW] = -distance * sin, distance * cos
        forward[X, SPEED], forward[Y, SPEED] = level * cos, level * sin
        forward[X, TURN_BIAS], forward[Y, TURN_BIAS] = 0.5 * step * distance * sin, -0.5 * step * distance * cos
        forward[X, ACCELERATION_BIAS], forward[Y, ACCELERATION_BIAS] = (
            -0.5 * step * level * cos,
            -0.5 * step * level * sin,
        )
        forward[YAW, TURN_BIAS] = forward[SPEED, ACCELERATION_BIAS] = -step
        noise = self._noise
        drive = np.zeros((6, 5))
        drive[:, 0] = -forward[:, ACCELERATION_BIAS]
        drive[:, 1] = -forward[:, TURN_BIAS]
        drive[ACCELERATION_BIAS, 0] = drive[TURN_BIAS, 1] = 0.0
        drive[X, 2], drive[Y, 2], drive[SPEED, 2] = -sin, cos, turn
        drive[TURN_BIAS, 3] = drive[ACCELERATION_BIAS, 4] = 1.0
        drive[:, :2] *= np.array([noise.imu.accelerometer_noise, noise.imu.gyroscope_noise]) / math.sqrt(step)
        across = noise.drift + noise.slip * abs(speed * turn)
        drive[:, 2:] *= np.array([across, noise.imu.gyroscope_walk, noise.imu.accelerometer_walk]) * math.sqrt(step)
        self.propagation = forward @ self.propagation
        self.estimate = Estimate(state, forward @ self.estimate.covariance @ forward.T + drive @ drive.T)

    def correct(self, gnss: GnssReading) -> None:
        """Update the state with a position measured by the GNSS receiver."""
        state, covariance = self.estimate
        noise = gnss.covariance[:2, :2]
        gain = np.linalg.solve(covariance[:2, :2] + noise, covariance[:2]).T
        rest = np.eye(6)
        rest[:, :2] -= gain
        state = state + gain @ (gnss.position[:2] - state[:2])
        state[YAW] = wrap_angle(float(state[YAW]))
        self.propagation = rest @ self.propagation
        self.estimate = Estimate(state, rest @ covariance @ rest.T + gain @ noise @ gain.T)


class Localizer:
    """Estimate the pose of a station and replace the true pose in its readings.

    The filter starts at the first reading, and again after a teleport, with the true pose and speed plus an error drawn
    from `start` for this seed and station. Height, pitch and roll stay true. Measurements in sensor frames are
    unchanged; the sensor poses follow from the estimate.
    """

    def __init__(
        self, station: str, seed: int, *, noise: MotionNoise | None = None, start: StartNoise | None = None
    ) -> None:
        self._draws = generator(seed, "localization", station)
        self._noise = noise or MotionNoise()
        self._start = start or StartNoise()
        self._filter: InertialFilter | None = None
        self._imu: ImuReading | None = None
        self._last: EgoState | None = None
        """True motion in the last reading."""

    @property
    def estimate(self) -> Estimate:
        """Newest estimate. Raise ValueError before the first reading."""
        return self._started.estimate

    @property
    def pose_covariance(self) -> Array:
        """Covariance (3, 3) of the errors of the estimated x, y [m] and yaw [rad]."""
        return self.estimate.covariance[PLANE]

    @property
    def lagged_covariance(self) -> Array:
        """Covariance (3, 3) of these errors with those of the last reading; 0 at the first one."""
        return self._started.propagation[PLANE]

    @property
    def _started(self) -> InertialFilter:
        if self._filter is None:
            raise ValueError("there is no estimate before the first reading")
        return self._filter

    def with_estimated_pose(self, readings: Readings) -> Readings:
        """Return the readings with the estimated motion, and with the sensor poses that follow from it."""
        truth, last = readings.ego, self._last
        self._last = truth
        self._imu = readings.imu or self._imu
        if self._filter is None or last is None or _is_teleported(last, truth):
            self._filter = InertialFilter(self._initial_estimate(truth), self._noise)
        else:
            self._filter.propagation = self._filter.estimate.covariance
            if self._imu is not None and truth.time > last.time:
                self._filter.predict(self._imu, truth.time - last.time, truth.pitch)
        if readings.gnss is not None:
            self._filter.correct(readings.gnss)
        x, y, yaw, speed, turn_bias, acceleration_bias = self._filter.estimate.state.tolist()
        ego = replace(
            truth,
            position=np.array([x, y, float(truth.position[2])]),
            yaw=yaw,
            speed=speed,
            yaw_rate=float(self._imu.angular_rate[2]) - turn_bias if self._imu is not None else 0.0,
            acceleration=float(self._imu.acceleration[0]) - acceleration_bias if self._imu is not None else 0.0,
        )
        return at_pose(readings, ego)

    def _initial_estimate(self, truth: EgoState) -> Estimate:
        start, imu = self._start, self._noise.imu
        deviations = np.array(
            [start.position, start.position, start.yaw, start.speed, imu.gyroscope_bias, imu.accelerometer_bias]
        )
        drawn = self._draws.standard_normal(6) * deviations
        x, y, _ = truth.position.tolist()
        state = np.array([x, y, truth.yaw, truth.speed, 0.0, 0.0]) + drawn * (1.0, 1.0, 1.0, 1.0, 0.0, 0.0)
        return Estimate(state, np.diag(deviations**2))


def _is_teleported(last: EgoState, now: EgoState) -> bool:
    distance = math.dist(last.position[:2], now.position[:2])
    return is_teleport(distance, max(abs(last.speed), abs(now.speed)), now.time - last.time)


def at_pose(readings: Readings, ego: EgoState) -> Readings:
    """Return the readings as if the station were at this pose."""
    truth = readings.ego
    turn = ego.yaw - truth.yaw
    rigid = np.eye(4)
    rigid[:2, :2] = rotation(turn)
    rigid[:2, 3] = ego.position[:2] - rigid[:2, :2] @ truth.position[:2]
    truth_reading = readings.truth
    if truth_reading is not None:
        boxes = _moved(truth_reading.boxes, rigid, turn)
        truth_reading = replace(truth_reading, boxes=boxes, velocity=truth_reading.velocity @ rigid[:2, :2].T)
    return replace(
        readings,
        ego=ego,
        truth=truth_reading,
        attached=_moved(readings.attached, rigid, turn) if len(readings.attached) else readings.attached,
        cameras={name: reading.at(rigid @ reading.pose) for name, reading in readings.cameras.items()},
        lidars={name: replace(reading, pose=rigid @ reading.pose) for name, reading in readings.lidars.items()},
    )


def add_pose_error(readings: Readings, x: float, y: float, yaw: float) -> Readings:
    """Return the readings as if the station were at its pose plus an error of x, y [m] and yaw [rad]."""
    ego = readings.ego
    position = ego.position + np.array([x, y, 0.0])
    return at_pose(readings, replace(ego, position=position, yaw=wrap_angle(ego.yaw + yaw)))


def _moved(boxes: Array, rigid: Array, turn: float) -> Array:
    """Return boxes (N, 7) after a rigid motion (4, 4) in the plane that turns by this angle [rad]."""
    moved = boxes.copy()
    moved[:, :2] = moved[:, :2] @ rigid[:2, :2].T + rigid[:2, 3]
    moved[:, 6] = wrap_angle(moved[:, 6] + turn)
    return moved


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

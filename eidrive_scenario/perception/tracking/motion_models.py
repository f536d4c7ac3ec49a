"""Motion models of tracks: constant velocity, or constant turn rate and speed; for all tracks at once."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import wrap_angle

HEADING = 2
"""Index of the heading in the state of a model that measures it."""
ACCELERATION_DENSITY = 6.0
"""Spectral density of white acceleration [m²/s³]: a speed changes by 2.4 m/s in a second (standard deviation)."""
TURN_DENSITY = 0.15
"""Spectral density of white yaw acceleration [rad²/s³]: a turn rate changes by 0.4 rad/s in a second."""
UNKNOWN_SPEED = 12.0
"""Standard deviation of the velocity of an object at its first detection [m/s]."""
KNOWN_SPEED = 0.5
"""Standard deviation of a detected or reported velocity in each axis [m/s]; a detector may state another one for moving
objects."""
HEADING_DEVIATION = math.radians(6.0)
"""Standard deviation between the axes of a box and of its object [rad]."""
WANDERING_DENSITY = 0.01
"""Spectral density of the position of a standing object [m²/s]: 0.1 m in a second (standard deviation)."""
UNKNOWN_TURN = 0.3
"""Standard deviation of the turn rate of an object at its first detection [rad/s]."""
BACKWARDS = 0.5
"""Backward speed above which the front of a box is assumed at its other end [m/s]."""


class Estimates(NamedTuple):
    """States (N, D) of tracks and their covariances (N, D, D); x and y come first.

    States beyond those of a motion model are constant for it, and corrected by their correlation with the others.
    """

    state: Array
    covariance: Array


class Update(NamedTuple):
    """Estimates after a measurement, and the log-likelihoods (N,) of the measurements without constants."""

    estimates: Estimates
    log_likelihood: Array


class MotionModel(ABC):
    """State of a track and its transition. Positions [m], angles [rad], all in the world frame."""

    size: int
    """Number of states."""
    motion: slice
    """Indices of the states that are 0 for an object at rest."""
    measures_heading: bool = False
    """Whether a box corrects the third state, a heading, by its axis."""

    @abstractmethod
    def begin(self, boxes: Array, velocity: Array, noise: Array) -> Estimates:
        """Return initial estimates from boxes (N, 7), velocities (N, 2) or NaN, and position noise (N, 2, 2)."""

    @abstractmethod
    def predict(self, tracks: Estimates, step: float) -> Estimates:
        """Return the estimates after `step` [s]."""

    @abstractmethod
    def update(self, tracks: Estimates, boxes: Array, noise: Array) -> Update:
        """Return the estimates updated with one measured box per track (N, 7) and position noise (N, 2, 2)."""


class MovingModel(MotionModel):
    """Model of a moving object.

    velocity_deviation  standard deviation of its detected velocity in each axis [m/s]
    """

    def __init__(self, velocity_deviation: float = KNOWN_SPEED) -> None:
        self.velocity_deviation = velocity_deviation

    @abstractmethod
    def velocity(self, state: Array) -> Array:
        """Return velocities (N, 2) [m/s]."""

    @abstractmethod
    def speed_variance(self, tracks: Estimates, directions: Array | None = None) -> Array:
        """Return the variances (N,) of the speeds in these directions (N, 2), None: those of motion [m²/s²]."""


class ConstantVelocity(MovingModel):
    """Model with state x, y, vx, vy and white acceleration noise.

    Bar-Shalom, Li and Kirubarajan, Estimation with applications to tracking and navigation, 2001, section 6.2.2.
    """

    size = 4
    motion = slice(2, 4)

    def begin(self, boxes: Array, velocity: Array, noise: Array) -> Estimates:
        has_velocity = np.asarray(np.all(np.isfinite(velocity), axis=1))
        state = np.concatenate([boxes[:, :2], np.where(has_velocity[:, None], velocity, 0.0)], axis=1)
        covariance = np.zeros((len(boxes), 4, 4))
        covariance[:, :2, :2] = noise
        variance = np.where(has_velocity, self.velocity_deviation, UNKNOWN_SPEED) ** 2
        covariance[:, 2, 2] = covariance[:, 3, 3] = variance
        return Estimates(state, covariance)

    def predict(self, tracks: Estimates, step: float) -> Estimates:
        size = tracks.state.shape[1]
        forward = np.eye(size)
        forward[0, 2] = forward[1, 3] = step
        drift = np.zeros((size, size))
        drift[0, 0] = drift[1, 1] = step**3 / 3.0
        drift[2, 2] = drift[3, 3] = step
        drift[0, 2] = drift[2, 0] = drift[1, 3] = drift[3, 1] = step**2 / 2.0
        covariance = forward @ tracks.covariance @ forward.T + ACCELERATION_DENSITY * drift
        return Estimates(tracks.state @ forward.T, covariance)

    def update(self, tracks: Estimates, boxes: Array, noise: Array) -> Update:
        return _correct(tracks, boxes[:, :2] - tracks.state[:, :2], noise)

    def velocity(self, state: Array) -> Array:
        return state[:, 2:4]

    def speed_variance(self, tracks: Estimates, directions: Array | None = None) -> Array:
        along = tracks.state[:, 2:4] if directions is None else directions
        variance = np.einsum("ni,nij,nj->n", along, tracks.covariance[:, 2:4, 2:4], along)
        return np.asarray(variance / np.maximum(np.square(along).sum(axis=1), 1e-12))


class TurnRate(MovingModel):
    """Model with state x, y, heading, speed, turn rate; speed and turn rate are constant except for white noise.

    Schubert, Richter and Wanielik, Comparison and evaluation of advanced motion models for vehicle tracking, FUSION
    2008, section III.
    """

    size = 5
    motion = slice(3, 5)
    measures_heading = True

    def begin(self, boxes: Array, velocity: Array, noise: Array) -> Estimates:
        has_velocity = np.asarray(np.all(np.isfinite(velocity), axis=1))
        vx, vy = np.where(has_velocity[:, None], velocity, 0.0).T
        state = np.zeros((len(boxes), 5))
        state[:, :2], state[:, 2] = boxes[:, :2], boxes[:, 6]
        state[:, 3] = vx * np.cos(boxes[:, 6]) + vy * np.sin(boxes[:, 6])
        covariance = np.zeros((len(boxes), 5, 5))
        covariance[:, :2, :2] = noise
        covariance[:, 2, 2] = HEADING_DEVIATION**2
        covariance[:, 3, 3] = np.where(has_velocity, self.velocity_deviation, UNKNOWN_SPEED) ** 2
        covariance[:, 4, 4] = UNKNOWN_TURN**2
        return Estimates(state, covariance)

    def predict(self, tracks: Estimates, step: float) -> Estimates:
        x, y, heading, speed, turn = tracks.state[:, :5].T
        half = 0.5 * turn * step
        # Chord of the arc: its length is v·T·sin(half)/half, its direction that at half the turn.
        shrink = np.sinc(half / np.pi)
        middle = heading + half
        cos, sin = np.cos(middle), np.sin(middle)
        chord = speed * step * shrink
        state = tracks.state.copy()
        state[:, 0], state[:, 1], state[:, 2] = x + chord * cos, y + chord * sin, heading + turn * step
        slope = np.where(np.abs(half) > 1e-4, (np.cos(half) - shrink) / np.where(half == 0.0, 1.0, half), -half / 3.0)
        bend = speed * step * slope * 0.5 * step
        forward: Array = np.broadcast_to(np.eye(state.shape[1]), tracks.covariance.shape).copy()
        forward[:, 0, 2], forward[:, 1, 2] = -chord * sin, chord * cos
        forward[:, 0, 3], forward[:, 1, 3] = step * shrink * cos, step * shrink * sin
        forward[:, 0, 4] = bend * cos - chord * sin * 0.5 * step
        forward[:, 1, 4] = bend * sin + chord * cos * 0.5 * step
        forward[:, 2, 4] = step
        gain = np.zeros((*state.shape, 2))
        gain[:, 0, 0], gain[:, 1, 0], gain[:, 3, 0] = 0.5 * step * np.cos(heading), 0.5 * step * np.sin(heading), 1.0
        gain[:, 2, 1], gain[:, 4, 1] = 0.5 * step, 1.0
        density = step * np.array([ACCELERATION_DENSITY, TURN_DENSITY])
        covariance = forward @ tracks.covariance @ transposed(forward) + (gain * density) @ transposed(gain)
        return Estimates(state, covariance)

    def update(self, tracks: Estimates, boxes: Array, noise: Array) -> Update:
        """Update with the position, and with the box axis if it is closer to the heading than the other axis."""
        off = (boxes[:, 6] - tracks.state[:, 2] + np.pi / 2.0) % np.pi - np.pi / 2.0
        usable = np.abs(off) < np.pi / 4.0
        innovation = np.column_stack([boxes[:, :2] - tracks.state[:, :2], np.where(usable, off, 0.0)])
        full = np.zeros((len(boxes), 3, 3))
        full[:, :2, :2] = noise
        full[:, 2, 2] = np.where(usable, HEADING_DEVIATION**2, 1e6)
        (state, covariance), likelihood = _correct(tracks, innovation, full)
        backwards = state[:, 3] < -BACKWARDS
        if backwards.any():
            # The same motion with the front at the other end: heading + pi, -speed.
            state[backwards, 2] += np.pi
            state[backwards, 3] *= -1.0
            mirror = np.ones(state.shape[1])
            mirror[3] = -1.0
            covariance[backwards] *= mirror[:, None] * mirror
        state[:, 2] = wrap_angle(state[:, 2])
        return Update(Estimates(state, covariance), likelihood)

    def velocity(self, state: Array) -> Array:
        return np.stack([state[:, 3] * np.cos(state[:, 2]), state[:, 3] * np.sin(state[:, 2])], axis=1)

    def speed_variance(self, tracks: Estimates, directions: Array | None = None) -> Array:
        return tracks.covariance[:, 3, 3]


class Standing(MotionModel):
    """Model of an object at rest, with the states of another model whose motion is 0.

    The center of its box wanders as the visible part of the object changes.
    """

    def __init__(self, base: MotionModel) -> None:
        self._base = base
        self.size, self.motion, self.measures_heading = base.size, base.motion, base.measures_heading

    def begin(self, boxes: Array, velocity: Array, noise: Array) -> Estimates:
        return self._at_rest(self._base.begin(boxes, velocity, noise))

    def predict(self, tracks: Estimates, step: float) -> Estimates:
        state, covariance = self._at_rest(tracks)
        covariance[:, 0, 0] += WANDERING_DENSITY * step
        covariance[:, 1, 1] += WANDERING_DENSITY * step
        return Estimates(state, covariance)

    def update(self, tracks: Estimates, boxes: Array, noise: Array) -> Update:
        return self._base.update(tracks, boxes, noise)

    def _at_rest(self, tracks: Estimates) -> Estimates:
        state, covariance = tracks.state.copy(), tracks.covariance.copy()
        state[:, self.motion] = 0.0
        covariance[:, self.motion] = 0.0
        covariance[:, :, self.motion] = 0.0
        return Estimates(state, covariance)


def _correct(tracks: Estimates, innovation: Array, noise: Array) -> Update:
    """Return the Kalman update in Joseph form; the first entries of the state are measured."""
    measured, size = innovation.shape[1], tracks.state.shape[1]
    spread = tracks.covariance[:, :measured, :measured] + noise
    gain = transposed(np.asarray(np.linalg.solve(spread, tracks.covariance[:, :measured]), dtype=np.float64))
    squared = np.einsum("ni,ni->n", innovation, np.linalg.solve(spread, innovation[:, :, None])[:, :, 0])
    likelihood = -0.5 * (squared + np.log(np.linalg.det(spread)))
    state = tracks.state + np.einsum("nij,nj->ni", gain, innovation)
    rest: Array = np.broadcast_to(np.eye(size), (len(state), size, size)).copy()
    rest[:, :, :measured] -= gain
    covariance = rest @ tracks.covariance @ transposed(rest) + gain @ noise @ transposed(gain)
    return Update(Estimates(state, covariance), likelihood)


def transposed(matrices: Array) -> Array:
    """Return the transposed matrices (N, M, K) of matrices (N, K, M)."""
    return np.swapaxes(matrices, 1, 2)

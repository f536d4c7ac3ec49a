"""Tracking by a station with a random pose error: each track estimates the error with its object."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.perception.tracking.motion_models import Estimates, MotionModel, transposed

HEADING = 2
"""Index of the heading in the state of a model that measures it."""


class PoseUncertainty(NamedTuple):
    """Random error of the pose that a station assumes: a Gauss-Markov process of first order.

    x, y              assumed position [m]
    covariance        (3, 3) of the errors of x, y [m] and yaw [rad]
    correlation_time  time after which the correlation of the error is 1/e [s]; 0: independent in each time step
    """

    x: float
    y: float
    covariance: Array
    correlation_time: float


def pose_jacobian(points: Array, x: float, y: float) -> Array:
    """Return the derivatives (N, 2, 3) of measured points (N, 2) by x, y and yaw of the station at (x, y).

    J = [I | R'(ψ) p] for p in the frame of the station. In the world frame, R'(ψ) p is the vector from the station to
    the point, rotated by a right angle.
    """
    jacobian = np.zeros((len(points), 2, 3))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0
    jacobian[:, 0, 2], jacobian[:, 1, 2] = y - points[:, 1], points[:, 0] - x
    return jacobian


class UncertainPose(MotionModel):
    """Motion model whose last three states are the pose error of the station.

    A measurement of an object at x is m = x + J e + noise, with the pose error e = (x, y, yaw). Its correlation over
    time is that of a colored measurement noise, which the state contains (Bar-Shalom, Li and Kirubarajan, Estimation
    with applications to tracking and navigation, 2001, section 8.3). The state holds m without noise in place of x:
    positions relative to the assumed pose, whose covariance does not contain that of the pose.

    The pose error of a long correlation time remains in m. One that is independent in each time step does not move x,
    so that it does not appear as a velocity.
    """

    def __init__(self, base: MotionModel, pose: PoseUncertainty) -> None:
        self._base = base
        self.size = base.size + 3
        self.measures_heading = base.measures_heading
        self.pose = pose

    def begin(self, boxes: Array, velocity: Array, noise: Array) -> Estimates:
        held, size = self._base.begin(boxes, velocity, noise), self._base.size
        state = np.zeros((len(boxes), self.size))
        covariance = np.zeros((len(boxes), self.size, self.size))
        state[:, :size], covariance[:, :size, :size] = held.state, held.covariance
        covariance[:, size:, size:] = self.pose.covariance
        return Estimates(state, covariance)

    def predict(self, tracks: Estimates, step: float) -> Estimates:
        state, covariance = self._base.predict(self._shifted(tracks, -1.0), step)
        span = self.pose.correlation_time
        kept = math.exp(-step / span) if span > 0.0 else 0.0
        decay = np.ones(self.size)
        decay[-3:] = kept
        covariance = covariance * (decay[:, None] * decay)
        covariance[:, -3:, -3:] += (1.0 - kept * kept) * self.pose.covariance
        return self._shifted(Estimates(state * decay, covariance), 1.0)

    def update(self, tracks: Estimates, boxes: Array, noise: Array) -> Estimates:
        return self._base.update(tracks, boxes, noise)

    def velocity(self, state: Array) -> Array:
        return self._base.velocity(state)

    def _shifted(self, tracks: Estimates, sign: float) -> Estimates:
        """Return the tracks with the effect of the pose error on their position and heading added or subtracted."""
        shift: Array = np.broadcast_to(np.eye(self.size), tracks.covariance.shape).copy()
        shift[:, :2, -3:] = sign * pose_jacobian(tracks.state[:, :2], self.pose.x, self.pose.y)
        if self.measures_heading:
            shift[:, HEADING, -1] = sign
        state = np.einsum("nij,nj->ni", shift, tracks.state)
        return Estimates(state, shift @ tracks.covariance @ transposed(shift))

"""Tracking by a station with a random pose error: each track estimates the error with its object."""

from __future__ import annotations

from bisect import bisect_right
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.perception.tracking.motion_models import HEADING, Estimates, MotionModel, Update, transposed

MAX_STEPS = 1000
"""Maximum number of time steps between two scans whose poses are stored; tracks do not coast for longer."""


class PoseUncertainty(NamedTuple):
    """Random error of the pose that a station assumes, in one time step.

    time        time of the pose [s]
    x, y        assumed position [m]
    covariance  (3, 3) of the errors of x, y [m] and yaw [rad]
    transition  (3, 3) regression of the error on that of the last time step: 0 if they are independent, the identity
                if the error is constant
    """

    time: float
    x: float
    y: float
    covariance: Array
    transition: Array


def pose_jacobian(points: Array, x: float, y: float) -> Array:
    """Return the derivatives (N, 2, 3) of measured points (N, 2) by x, y and yaw of the station at (x, y).

    J = [I | R'(ψ) p] for p in the frame of the station. In the world frame, R'(ψ) p is the vector from the station to
    the point, rotated by a right angle.
    """
    jacobian = np.zeros((len(points), 2, 3))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0
    jacobian[:, 0, 2], jacobian[:, 1, 2] = y - points[:, 1], points[:, 0] - x
    return jacobian


def pose_effect(state: Array, pose: PoseUncertainty, *, measures_heading: bool) -> Array:
    """Return the derivatives (N, D, 3) of the states (N, D) of tracks, the last three included, by the pose error."""
    effect = np.zeros((*state.shape, 3))
    effect[:, :2] = pose_jacobian(state[:, :2], pose.x, pose.y)
    if measures_heading:
        effect[:, HEADING, 2] = 1.0
    effect[:, -3:] = np.eye(3)
    return effect


def pose_covariance_at(dx: float, dy: float, covariance: Array) -> Array:
    """Return the covariance (3, 3) of the pose error of a station at the place (dx, dy) [m] from it.

    An error of the yaw moves a point at distance d by d times the error: there, the error e is T e with
    T = [[1, 0, -dy], [0, 1, dx], [0, 0, 1]].
    """
    about = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
    return np.asarray(about @ covariance @ about.T)


class PoseErrors:
    """Uncertainty of the pose of a station in the time steps since the last scan."""

    def __init__(self) -> None:
        self._poses: list[PoseUncertainty] = []
        self.independent = np.zeros((3, 3))
        """Covariance (3, 3) of the part of the error in the last scan that is independent of the scan before."""

    def add(self, pose: PoseUncertainty) -> None:
        """Store the pose of the next time step."""
        self._poses.append(pose)
        if len(self._poses) > MAX_STEPS:
            del self._poses[0]

    @property
    def last_covariance(self) -> Array:
        """Covariance (3, 3) in the last time step; 0 before the first one."""
        return self._poses[-1].covariance if self._poses else np.zeros((3, 3))

    @property
    def of_scan(self) -> PoseUncertainty:
        """Pose in the last scan."""
        return self._poses[0]

    def at(self, time: float) -> PoseUncertainty:
        """Return the pose of the last time step up to `time` [s]."""
        return self._poses[self._last_until(time)]

    def advance(self, time: float) -> Array:
        """Begin a scan at `time` [s]; return the covariance (3, 3) of the change of the error since the last scan."""
        regression, self.independent = self.regression(time)
        before, after = self.of_scan.covariance, self.at(time).covariance
        lagged = regression @ before
        del self._poses[: self._last_until(time)]
        change: Array = before + after - lagged - lagged.T
        return change

    def regression(self, time: float) -> tuple[Array, Array]:
        """Return the regression (3, 3) of the error at `time` [s] on that of the last scan, and the covariance (3, 3)
        of the independent part."""
        regression, independent = np.eye(3), np.zeros((3, 3))
        for before, pose in pairwise(self._poses[: self._last_until(time) + 1]):
            step = pose.transition
            regression = step @ regression
            independent = step @ (independent - before.covariance) @ step.T + pose.covariance
        return regression, independent

    def _last_until(self, time: float) -> int:
        return max(bisect_right(self._poses, time + TIME_TOLERANCE, key=lambda pose: pose.time) - 1, 0)


class UncertainPose(MotionModel):
    """Motion model whose last three states are the pose error of the station.

    A measurement of an object at x is m = x + J e + noise, with the pose error e = (x, y, yaw). Its correlation over
    time is that of a colored measurement noise, which the state contains (Bar-Shalom, Li and Kirubarajan, Estimation
    with applications to tracking and navigation, 2001, section 8.3). The state holds m without noise in place of x:
    positions relative to the assumed pose, whose covariance does not contain that of the pose.

    The pose error of a long correlation time remains in m. One that is independent in each time step does not move x,
    so that it does not appear as a velocity.
    """

    def __init__(self, base: MotionModel, errors: PoseErrors) -> None:
        self._base = base
        self.size = base.size + 3
        self.motion, self.measures_heading = base.motion, base.measures_heading
        self._errors = errors

    def begin(self, boxes: Array, velocity: Array, noise: Array) -> Estimates:
        held, size = self._base.begin(boxes, velocity, noise), self._base.size
        state = np.zeros((len(boxes), self.size))
        covariance = np.zeros((len(boxes), self.size, self.size))
        state[:, :size], covariance[:, :size, :size] = held.state, held.covariance
        covariance[:, size:, size:] = self._errors.of_scan.covariance
        return Estimates(state, covariance)

    def predict(self, tracks: Estimates, step: float) -> Estimates:
        before = self._errors.of_scan
        after = self._errors.at(before.time + step)
        regression, independent = self._errors.regression(before.time + step)
        state, covariance = self._base.predict(self._shifted(tracks, before, -1.0), step)
        change = np.eye(self.size)
        change[-3:, -3:] = regression
        moved = self._shifted(Estimates(state @ change.T, change @ covariance @ change.T), after, 1.0)
        # At the position with the pose error, where InteractingModels.share_pose_change takes this part away again
        effect = pose_effect(moved.state, after, measures_heading=self.measures_heading)
        return Estimates(moved.state, moved.covariance + effect @ independent @ transposed(effect))

    def update(self, tracks: Estimates, boxes: Array, noise: Array) -> Update:
        return self._base.update(tracks, boxes, noise)

    def _shifted(self, tracks: Estimates, pose: PoseUncertainty, sign: float) -> Estimates:
        """Return the tracks with the effect of the pose error on their position and heading added or subtracted."""
        shift: Array = np.broadcast_to(np.eye(self.size), tracks.covariance.shape).copy()
        effect = pose_effect(tracks.state, pose, measures_heading=self.measures_heading)
        shift[:, :-3, -3:] = sign * effect[:, :-3]
        state = np.einsum("nij,nj->ni", shift, tracks.state)
        return Estimates(state, shift @ tracks.covariance @ transposed(shift))

"""Tracks of objects that stand or move: the interacting multiple model filter."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.perception.tracking.motion_models import (
    HEADING,
    KNOWN_SPEED,
    Estimates,
    MotionModel,
    MovingModel,
    Standing,
    transposed,
)
from eidrive_scenario.perception.tracking.uncertain_pose import PoseErrors, UncertainPose, pose_effect, pose_jacobian

SOJOURN = 10.0
"""Mean time for which an object stands before it moves, and moves before it stands [s]: a probability of 0.99 per scan
of 0.1 s to keep on, in the usual range of 0.95 to 0.99."""
MOVING = 1.0
"""Minimum speed of an object whose direction of motion is certain [m/s]."""
SIGNIFICANT = 2.0
"""Minimum speed of such an object in standard deviations."""
CERTAIN = 3.0
"""Minimum speed of an object in its first scans in standard deviations: two or three positions are hardly a motion."""
COMMON_SHARE = 0.02
"""Share of the variance of a box by which the position of a standing object becomes uncertain again at the next box.
Errors of successive boxes are alike, as they come from the same visible part and the same assumed size: without it,
many bad boxes would seem to be one good one. The variance of the position stays above an eighth of that of a box."""
STANDS, MOVES = 0, 1
"""Indices of the models."""

Rows = list[int] | NDArray[np.intp]


class Tracks(NamedTuple):
    """Estimates of N tracks by both models: states (2, N, D), covariances (2, N, D, D), probabilities (2, N)."""

    state: Array
    covariance: Array
    probability: Array

    def take(self, rows: Rows) -> Self:
        """Return these tracks."""
        return type(self)(*(values[:, rows] for values in self))

    def put(self, rows: Rows, tracks: Self) -> None:
        """Replace these tracks."""
        for values, new in zip(self, tracks, strict=True):
            values[:, rows] = new

    def join(self, tracks: Self) -> Self:
        """Return these tracks, followed by others."""
        return type(self)(*(np.concatenate(pair, axis=1) for pair in zip(self, tracks, strict=True)))


class InteractingModels:
    """Filter whose objects stand or move by a motion model, each with a probability.

    A velocity from noisy positions has a large error, as the model of a moving object admits large accelerations. That
    an object rests at one place becomes certain with each scan instead, and is disproved by its first displacements
    (Blom and Bar-Shalom, The interacting multiple model algorithm for systems with Markovian switching coefficients,
    IEEE Transactions on Automatic Control 33(8), 1988).

    pose_errors  random errors of the pose of the station; None: its pose is exact
    """

    def __init__(self, model: MovingModel, pose_errors: PoseErrors | None = None) -> None:
        self._base = model
        self._pose_errors = pose_errors
        models: tuple[MotionModel, ...] = (Standing(model), model)
        if pose_errors is not None:
            models = tuple(UncertainPose(inner, pose_errors) for inner in models)
        self._models = models

    def no_tracks(self) -> Tracks:
        """Return the estimates of no track."""
        size = self._models[MOVES].size
        return Tracks(np.empty((2, 0, size)), np.empty((2, 0, size, size)), np.empty((2, 0)))

    def begin(self, boxes: Array, velocity: Array, noise: Array) -> Tracks:
        """Return initial tracks from boxes (N, 7), velocities (N, 2) or NaN, and position noise (N, 2, 2).

        The odds that an object stands are those of its measured velocity, at rest and at this velocity.
        """
        squared = np.nan_to_num(np.square(velocity).sum(axis=1))
        odds = np.exp(-0.5 * squared / KNOWN_SPEED**2)
        probability = np.stack([odds, np.ones(len(odds))]) / (1.0 + odds)
        return _stacked([model.begin(boxes, velocity, noise) for model in self._models], probability)

    def predict(self, tracks: Tracks, step: float) -> Tracks:
        """Return the tracks after `step` [s], in which objects may set off or come to rest."""
        changed = 0.5 * (1.0 - math.exp(-2.0 * step / SOJOURN))
        switch = np.array([[1.0 - changed, changed], [changed, 1.0 - changed]])
        probability = switch @ tracks.probability
        origin = switch[:, :, None] * tracks.probability / probability[:, None]
        """Probability (after, before, N) of the model before the step, given that after it."""
        held = self._aligned(tracks.state)
        mixed = [_moments(held, tracks.covariance, weights) for weights in origin]
        return _stacked(
            [model.predict(estimates, step) for model, estimates in zip(self._models, mixed, strict=True)], probability
        )

    def update(self, tracks: Tracks, boxes: Array, noise: Array) -> Tracks:
        """Return the tracks updated with one measured box per track (N, 7) and position noise (N, 2, 2)."""
        updates = [
            model.update(Estimates(state, covariance), boxes, noise)
            for model, state, covariance in zip(self._models, tracks.state, tracks.covariance, strict=True)
        ]
        likelihood = np.stack([update.log_likelihood for update in updates])
        posterior = tracks.probability * np.exp(likelihood - likelihood.max(axis=0))
        return _stacked([update.estimates for update in updates], posterior / posterior.sum(axis=0))

    def add_common_errors(self, tracks: Tracks, rows: Rows, noise: Array) -> Tracks:
        """Return predicted tracks in which the positions of standing objects are uncertain by what the errors of
        successive boxes have in common.

        rows   of tracks with a measured box, of position noise (M, 2, 2)
        """
        covariance = tracks.covariance.copy()
        covariance[STANDS, rows, :2, :2] += COMMON_SHARE * noise
        return tracks._replace(covariance=covariance)

    def share_pose_change(self, tracks: Tracks, rows: Rows, boxes: Array, noise: Array) -> Tracks:
        """Return predicted tracks in which the change of the pose error is estimated from the boxes of other tracks.

        A motion that standing objects have in common is that of the own pose. Each track gets what all others show; its
        own box is used by `update`.

        rows   of tracks with a measured box (M, 7) and position noise (M, 2, 2)
        """
        if self._pose_errors is None or len(rows) < 2:
            return tracks
        pose, prior = self._pose_errors.of_scan, self._pose_errors.independent
        detected = tracks.take(rows)
        state, covariance = detected.state[STANDS], detected.covariance[STANDS]
        jacobian = pose_jacobian(state[:, :2], pose.x, pose.y)
        spread = covariance[:, :2, :2] + noise - jacobian @ prior @ transposed(jacobian)
        stands = self.update(detected, boxes, noise).probability[STANDS]
        weighted = stands[:, None, None] * transposed(np.linalg.solve(spread, jacobian))
        information = weighted @ jacobian
        measured = (weighted @ (boxes[:, :2] - state[:, :2])[:, :, None])[:, :, 0]
        of_others = np.tile(information.sum(axis=0), (tracks.state.shape[1], 1, 1))
        shown = np.tile(measured.sum(axis=0), (tracks.state.shape[1], 1))
        of_others[rows] -= information
        shown[rows] -= measured
        posterior = np.linalg.solve(np.eye(3) + prior @ of_others, prior[None])
        change = np.einsum("nij,nj->ni", posterior, shown)
        heading = self._base.measures_heading
        effect = np.stack([pose_effect(states, pose, measures_heading=heading) for states in tracks.state])
        return Tracks(
            tracks.state + np.einsum("mnij,nj->mni", effect, change),
            tracks.covariance + effect @ (posterior - prior) @ np.swapaxes(effect, 2, 3),
            tracks.probability,
        )

    def combined(self, tracks: Tracks) -> Estimates:
        """Return mean and covariance of each track over both models."""
        return _moments(self._aligned(tracks.state), tracks.covariance, tracks.probability)

    def velocity(self, tracks: Tracks, recent: Bools | None = None, across: Array | None = None) -> Array:
        """Return the mean velocities (N, 2) [m/s].

        recent  whether objects (N,) have been detected in few scans: their velocity is 0 unless it is certain, and so
                is its component in the directions `across` their bodies (N, 2), in which vehicles do not move
        """
        moves = Estimates(tracks.state[MOVES], tracks.covariance[MOVES])
        velocity, probability = self._base.velocity(moves.state), tracks.probability[MOVES]
        if recent is not None and across is not None and recent.any():
            least = CERTAIN**2 * self._base.speed_variance(moves)
            probability = np.where(recent & (np.square(velocity).sum(axis=1) < least), 0.0, probability)
            drift = np.einsum("ni,ni->n", velocity, across)
            least = CERTAIN**2 * self._base.speed_variance(moves, across)
            velocity = velocity - np.where(recent & (np.square(drift) < least), drift, 0.0)[:, None] * across
        return np.asarray(probability[:, None] * velocity)

    def velocity_variance(self, tracks: Tracks, velocity: Array, recent: Bools) -> Array:
        """Return the mean squares (N,) of the errors of these velocities (N, 2) in each axis [m²/s²].

        recent  whether objects (N,) have been detected in few scans: that they stand is not likelier than at first
        """
        moves = Estimates(tracks.state[MOVES], tracks.covariance[MOVES])
        squares = np.stack([np.square(velocity), np.square(velocity - self._base.velocity(moves.state))])
        for axis, direction in enumerate(np.eye(2)):
            squares[MOVES, :, axis] += self._base.speed_variance(moves, np.tile(direction, (len(velocity), 1)))
        moving = np.where(recent, np.maximum(tracks.probability[MOVES], 0.5), tracks.probability[MOVES])
        return np.asarray((np.stack([1.0 - moving, moving]) * squares.mean(axis=2)).sum(axis=0))

    def course(self, tracks: Tracks) -> Array:
        """Return the directions (N,) in which objects certainly move [rad], NaN for others.

        The front of a vehicle that stands must not follow the noise of its velocity.
        """
        velocity = self.velocity(tracks)
        squared = np.square(velocity).sum(axis=1)
        least = np.maximum(MOVING**2, SIGNIFICANT**2 * self._base.speed_variance(self.combined(tracks)))
        return np.where(squared > least, np.arctan2(velocity[:, 1], velocity[:, 0]), np.nan)

    def _aligned(self, state: Array) -> Array:
        """Return states (2, N, D) in which an object that stands has its front at the same end as one that moves."""
        if not self._base.measures_heading:
            return state
        aligned = state.copy()
        off = wrap_angle(state[STANDS, :, HEADING] - state[MOVES, :, HEADING])
        off = np.where(np.abs(off) > math.pi / 2.0, off - np.copysign(math.pi, off), off)
        aligned[STANDS, :, HEADING] = state[MOVES, :, HEADING] + off
        return aligned


def _stacked(estimates: list[Estimates], probability: Array) -> Tracks:
    states, covariances = zip(*estimates, strict=True)
    return Tracks(np.stack(states), np.stack(covariances), probability)


def _moments(state: Array, covariance: Array, weights: Array) -> Estimates:
    """Return the moments of mixtures of states (2, N, D) with covariances (2, N, D, D) and weights (2, N)."""
    first, second = weights[:, :, None]
    mean = first * state[0] + second * state[1]
    offset = state[1] - state[0]
    spread = (first * second)[:, :, None] * offset[:, :, None] * offset[:, None, :]
    mixed = first[:, :, None] * covariance[0] + second[:, :, None] * covariance[1] + spread
    return Estimates(mean, mixed)

"""Filter of objects that stand or move: closed forms, changes of motion, and a pose error that all objects share."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.perception.tracking.interacting_models import MOVES, STANDS, InteractingModels, Tracks
from eidrive_scenario.perception.tracking.motion_models import (
    WANDERING_DENSITY,
    ConstantVelocity,
    Estimates,
    MovingModel,
    Standing,
    TurnRate,
)
from eidrive_scenario.perception.tracking.uncertain_pose import PoseErrors, PoseUncertainty

MODELS = [ConstantVelocity, TurnRate]
STEP = 0.1
DEVIATION = 0.1
"""Standard deviation of measured positions [m]."""


def boxes_at(places: Array) -> Array:
    """Return boxes (N, 7) of cars along the x axis at places (N, 2)."""
    return np.column_stack([places, np.tile([0.7, 4.0, 1.8, 1.4, 0.0], (len(places), 1))])


def noise(count: int) -> Array:
    return np.tile(DEVIATION**2 * np.eye(2), (count, 1, 1))


def unknown(count: int) -> Array:
    return np.full((count, 2), np.nan)


def tracked(models: InteractingModels, places: Array, seed: int = 1) -> list[Tracks]:
    """Return the tracks after each scan of objects at places (K, N, 2) with noise."""
    measured = places + np.random.default_rng(seed).normal(0.0, DEVIATION, places.shape)
    count = places.shape[1]
    held = [models.begin(boxes_at(measured[0]), unknown(count), noise(count))]
    for scan in measured[1:]:
        held.append(models.update(models.predict(held[-1], STEP), boxes_at(scan), noise(count)))
    return held


@pytest.mark.parametrize("model", MODELS)
def test_standing_model_averages_positions(model: type[MovingModel]) -> None:
    """Closed form: without wandering, n equal measurements leave the variance s²/n; wandering adds q T per step. With
    p' = p + q T and p = p' s² / (p' + s²), its limit is the positive root of p² + q T p - q T s² = 0."""
    stands = Standing(model())
    held = stands.begin(boxes_at(np.zeros((1, 2))), np.array([[3.0, 0.0]]), noise(1))
    assert not held.state[0, stands.motion].any()
    for _ in range(200):
        held = stands.update(stands.predict(held, STEP), boxes_at(np.zeros((1, 2))), noise(1)).estimates
    added = WANDERING_DENSITY * STEP
    limit = 0.5 * (math.sqrt(added**2 + 4.0 * added * DEVIATION**2) - added)
    assert held.covariance[0, 0, 0] == pytest.approx(limit)
    assert held.covariance[0, :, stands.motion].any() is np.False_
    still = held
    for _ in range(10):
        still = stands.predict(still, 1.0)
    assert still.state[0, :2] == pytest.approx(held.state[0, :2])


@pytest.mark.parametrize("model", MODELS)
def test_odds_at_begin_follow_measured_velocity(model: type[MovingModel]) -> None:
    """The odds are exp(-v² / (2 · 0.5²)): even at rest and without a velocity, 0.02 for a pedestrian at 1.4 m/s."""
    velocity = np.array([[0.0, 0.0], [np.nan, np.nan], [0.0, 1.4], [10.0, 0.0]])
    tracks = InteractingModels(model()).begin(boxes_at(np.zeros((4, 2))), velocity, noise(4))
    odds = math.exp(-0.5 * 1.4**2 / 0.5**2)
    assert tracks.probability[STANDS] == pytest.approx([0.5, 0.5, odds / (1.0 + odds), 0.0], abs=1e-9)
    assert tracks.probability.sum(axis=0) == pytest.approx(np.ones(4))


@pytest.mark.parametrize("model", MODELS)
def test_motion_is_recognized_within_a_second_and_rest_again(model: type[MovingModel]) -> None:
    """A car and a pedestrian stand for 3 s, move for 3 s with 5 and 1.4 m/s, and stand again. With positions to 0.1 m,
    0.7 m of displacement contradict a standing pedestrian after half a second."""
    times = STEP * np.arange(90)
    gone = np.clip(times - 3.0, 0.0, 3.0)
    places = np.stack([np.column_stack([5.0 * gone, 0.0 * gone]), np.column_stack([1.4 * gone, 0.0 * gone])], axis=1)
    models = InteractingModels(model())
    held = tracked(models, places)
    speeds = np.array([np.hypot(*models.velocity(tracks).T) for tracks in held])
    assert speeds[10:30].max() < 0.3
    assert speeds[40:60].mean(axis=0) == pytest.approx([5.0, 1.4], abs=0.15)
    assert speeds[80:].max() < 0.3
    assert held[45].probability[MOVES].min() > 0.9
    assert held[-1].probability[STANDS].min() > 0.9


@pytest.mark.parametrize("model", MODELS)
def test_course_of_standing_objects_is_unknown(model: type[MovingModel]) -> None:
    """Of 400 standing cars none gets a front from the noise of its positions; all moving ones do."""
    gone = 0.1 * 8.0 * np.arange(40)
    standing, moving = np.zeros((40, 400, 2)), np.zeros((40, 10, 2))
    moving[:, :, 0] = -gone[:, None]
    models = InteractingModels(model())
    held = tracked(models, np.concatenate([standing, moving], axis=1))
    courses = np.array([models.course(tracks) for tracks in held[5:]])
    assert np.isnan(courses[:, :400]).all()
    assert np.cos(courses[-1, 400:]) == pytest.approx(-np.ones(10), abs=0.02)


def test_mixture_has_moments_of_gaussian_mixture() -> None:
    """Closed form: means 0 and 2 with weights 1/4 and 3/4 have mean 1.5 and variance 1 + 3/16 · 2²."""
    models = InteractingModels(ConstantVelocity())
    state = np.zeros((2, 1, 4))
    state[1, 0, 0] = 2.0
    tracks = Tracks(state, np.tile(np.eye(4), (2, 1, 1, 1)), np.array([[0.25], [0.75]]))
    mean, covariance = models.combined(tracks)
    assert mean[0].tolist() == [1.5, 0.0, 0.0, 0.0]
    assert covariance[0, 0, 0] == pytest.approx(1.75)
    assert covariance[0, 1, 1] == pytest.approx(1.0)


def scene_with_pose_error(shared: bool) -> tuple[Tracks, Tracks, InteractingModels]:
    """Return tracks of five standing cars and one at 4 m/s, without and with the pose change that all others show.

    The station at the origin has a pose error of 0.4 m, drawn in each scan.
    """
    errors = PoseErrors()
    models = InteractingModels(ConstantVelocity(), errors)
    random = np.random.default_rng(5)
    covariance = np.diag([0.16, 0.16, 1e-8])
    around = np.array([[20.0, 5.0], [30.0, -5.0], [-20.0, 8.0], [5.0, 25.0], [0.0, -30.0], [40.0, 0.0]])
    count = len(around)
    held: Tracks | None = None
    predicted: Tracks | None = None
    for scan in range(60):
        errors.add(PoseUncertainty(STEP * scan, 0.0, 0.0, covariance, np.zeros((3, 3))))
        around[5, 0] -= 0.4
        shift = random.normal(0.0, 0.4, 2)
        boxes = boxes_at(around + shift + random.normal(0.0, 0.02, (count, 2)))
        if held is None:
            held = models.begin(boxes, unknown(count), noise(count))
            continue
        predicted = models.predict(held, STEP)
        errors.advance(STEP * scan)
        held = models.share_pose_change(predicted, list(range(count)), boxes, noise(count)) if shared else predicted
        predicted = held
        held = models.update(held, boxes, noise(count))
    assert held is not None
    assert predicted is not None
    return predicted, held, models


def test_common_motion_of_standing_objects_is_that_of_the_own_pose() -> None:
    """Each track expects its box by what the five others show: their mean is known to 0.1 m / √5 and their places to
    a few centimeters, instead of the pose error of 0.4 m."""
    alone, _, models = scene_with_pose_error(shared=False)
    together, held, _ = scene_with_pose_error(shared=True)
    before, after = (models.combined(tracks).covariance[:5, 0, 0] for tracks in (alone, together))
    assert (before > 0.16).all()
    assert (after < 0.02).all()
    velocity = models.velocity(held)
    assert np.hypot(*velocity[:5].T).max() < 0.1
    assert velocity[5] == pytest.approx([-4.0, 0.0], abs=0.5)


def test_object_alone_in_view_shares_nothing() -> None:
    errors = PoseErrors()
    models = InteractingModels(ConstantVelocity(), errors)
    errors.add(PoseUncertainty(0.0, 0.0, 0.0, 0.04 * np.eye(3), np.zeros((3, 3))))
    tracks = models.begin(boxes_at(np.array([[10.0, 0.0]])), unknown(1), noise(1))
    assert models.share_pose_change(tracks, [0], boxes_at(np.array([[10.5, 0.0]])), noise(1)) is tracks


def test_change_of_pose_error_follows_its_process() -> None:
    """Closed forms of a stationary process with variance 1 and correlation c over a step. After k steps the regression
    is c^k and the independent part 1 - c^2k; the change has the variance 2 (1 - c^k). After a constant error it is 0,
    and after independent ones 2."""
    for kept, change in ((0.8, 2.0 * (1.0 - 0.8**3)), (1.0, 0.0), (0.0, 2.0)):
        errors = PoseErrors()
        for step in range(5):
            errors.add(PoseUncertainty(STEP * step, 0.0, 0.0, np.eye(3), kept * np.eye(3)))
        regression, independent = errors.regression(3 * STEP)
        assert regression == pytest.approx(kept**3 * np.eye(3))
        assert independent == pytest.approx((1.0 - kept**6) * np.eye(3))
        assert errors.advance(3 * STEP) == pytest.approx(change * np.eye(3))
        assert errors.of_scan.time == pytest.approx(3 * STEP)
        assert errors.advance(3 * STEP) == pytest.approx(np.zeros((3, 3)))


def test_pose_errors_without_scans_stay_bounded() -> None:
    errors = PoseErrors()
    for step in range(5000):
        errors.add(PoseUncertainty(STEP * step, 0.0, 0.0, np.eye(3), np.zeros((3, 3))))
    assert errors.of_scan.time > 390.0
    assert errors.advance(499.9) == pytest.approx(2.0 * np.eye(3))


def test_estimates_of_both_models_keep_their_order() -> None:
    tracks = InteractingModels(TurnRate()).begin(boxes_at(np.arange(6.0).reshape(3, 2)), unknown(3), noise(3))
    both = tracks.take([2]).join(tracks.take([0, 1]))
    assert both.state[MOVES, :, 0].tolist() == [4.0, 0.0, 2.0]
    both.put([0], tracks.take([1]))
    assert both.state[STANDS, :, 0].tolist() == [2.0, 0.0, 2.0]
    assert isinstance(InteractingModels(TurnRate()).combined(both), Estimates)

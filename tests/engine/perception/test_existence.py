"""Probability of existence: closed forms, and calibration by simulated tracks; plausible covariances."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.perception.tracking.association import (
    detected,
    likelihood_ratio,
    make_plausible,
    missed,
    survived,
)
from eidrive_scenario.perception.tracking.method import TrackerSettings
from eidrive_scenario.perception.tracking.tracker import Tracker


@pytest.mark.parametrize("detection", [0.3, 0.9])
@pytest.mark.parametrize("misses", [1, 2, 5])
def test_missed_repeated_equals_bayes_in_one_step(detection: float, misses: int) -> None:
    """k misses have the probability (1 - p)^k if the object exists, else 1: Bayes' rule in one step."""
    prior = 0.7
    existence = np.array([prior])
    for _ in range(misses):
        existence = missed(existence, detection)
    unseen = (1.0 - detection) ** misses
    assert existence[0] == pytest.approx(prior * unseen / (prior * unseen + 1.0 - prior))


def test_missed_outside_view_returns_equal_existence() -> None:
    np.testing.assert_allclose(missed(np.array([0.0, 0.3, 1.0]), 0.0), [0.0, 0.3, 1.0])


def test_detected_multiplies_odds_by_ratio() -> None:
    prior, ratio = np.array([0.2, 0.5]), np.array([6.0, 0.5])
    after = detected(prior, ratio)
    np.testing.assert_allclose(after / (1.0 - after), prior / (1.0 - prior) * ratio)
    np.testing.assert_allclose(detected(np.array([0.0, 1.0]), np.array([9.0, 0.1])), [0.0, 1.0])


def test_detected_and_missed_commute() -> None:
    one = missed(detected(np.array([0.4]), np.array([5.0])))
    other = detected(missed(np.array([0.4])), np.array([5.0]))
    assert one[0] == pytest.approx(other[0])


def test_survived_in_many_steps_equals_one_step() -> None:
    once = survived(np.array([0.8]), 0.6, 5.0)
    often = np.array([0.8])
    for _ in range(6):
        often = survived(often, 0.1, 5.0)
    assert once[0] == pytest.approx(0.8 * math.exp(-0.12))
    assert often[0] == pytest.approx(once[0])


def test_likelihood_ratio_equals_ipda_formula() -> None:
    """1 - p + p g / c with g = 1 / (2 pi 0.25) at the center of a covariance of 0.25 I, and c from the birth odds."""
    detection, birth, score = 0.8, 0.02, 0.6
    clutter = birth * detection * (1.0 - score) / score
    density = 1.0 / (2.0 * math.pi * 0.25)
    ratio = likelihood_ratio(np.array([0.0]), np.array([0.0625]), np.array([score]), detection, birth)
    assert ratio[0] == pytest.approx(1.0 - detection + detection * density / clutter)
    farther = likelihood_ratio(np.array([9.0]), np.array([0.0625]), np.array([score]), detection, birth)
    assert farther[0] < ratio[0]


def test_existence_of_simulated_tracks_is_calibrated() -> None:
    """Stationary objects and false detections, drawn from the model that the tracker assumes.

    Of all tracks with an existence in a bin, the share with a true object is within 0.1 of the mean existence. Births
    have density b, false detections c = b p (1 - s) / s, and objects live 2 s on average, as the settings state.
    """
    rng = np.random.default_rng(3)
    detection, score, scans, birth, lifetime, step = 0.6, 0.3, 400, 2e-4, 2.0, 0.1
    clutter = birth * detection * (1.0 - score) / score
    settings = TrackerSettings(
        confirm=(1, 1),
        confirm_existence=0.0,
        delete_existence=0.0,
        coast=1.0,
        detection_probability=detection,
        birth_density=birth,
        lifetime=lifetime,
        gate=0.999,
    )
    side = 60.0
    tracker, objects = Tracker(settings), np.empty((0, 2))
    stated: list[float] = []
    true: list[bool] = []
    for scan in range(scans):
        objects = objects[rng.uniform(size=len(objects)) < math.exp(-step / lifetime)]
        objects = np.concatenate([objects, rng.uniform(0.0, side, (rng.poisson(birth * side**2), 2))])
        found = objects[rng.uniform(size=len(objects)) < detection] + 0.0
        found = found + rng.normal(0.0, 0.1, found.shape)
        found = np.concatenate([found, rng.uniform(0.0, side, (rng.poisson(clutter * side**2), 2))])
        count = len(found)
        boxes = np.column_stack([found, np.tile([0.75, 4.6, 1.8, 1.5, 0.0], (count, 1))])
        tracks = tracker.update(
            Detections(
                scan * step,
                boxes,
                np.full(count, score),
                ("car",) * count,
                np.zeros((count, 2)),
                np.tile(0.01 * np.eye(2), (count, 1, 1)),
            )
        )
        apart = np.linalg.norm(tracks.boxes[:, None, :2] - objects[None], axis=2)
        stated += tracks.existence.tolist()
        true += (apart < 1.0).any(axis=1).tolist() if len(objects) else [False] * len(tracks)
    existence, exists = np.array(stated), np.array(true)
    for low, high in ((0.0, 0.1), (0.1, 0.5), (0.5, 0.9), (0.9, 1.0)):
        inside = (existence >= low) & (existence <= high)
        assert inside.sum() > 200
        assert exists[inside].mean() == pytest.approx(existence[inside].mean(), abs=0.1)


@pytest.mark.parametrize(
    ("stated", "least"),
    [
        ([[0.09, 0.09], [0.09, 0.09]], 0.0025),
        ([[0.288, 0.384], [0.384, 0.512]], 0.0025),
        ([[0.09, 0.0], [0.0, 0.05**2]], 0.0025),
        ([[0.09, 0.03], [0.03, 0.09]], 0.06),
        ([[0.0, 0.0], [0.0, 0.0]], 0.0025),
    ],
)
def test_make_plausible_raises_singular_covariances(stated: list[list[float]], least: float) -> None:
    """Smallest eigenvalues: 0 is raised by 0.05², 0.0025 and 0.06 are unchanged."""
    covariance = np.array([stated])
    make_plausible(covariance)
    assert float(np.linalg.eigvalsh(covariance)[0, 0]) == pytest.approx(least)

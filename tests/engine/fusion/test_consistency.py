"""Consistency of fusion: normalized squared errors over 1,000 draws."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.fusion.method import Report
from eidrive_scenario.v2x.messages.message import StationState

Make = Callable[..., Report]
Fuse = Callable[..., Detections]

DRAWS = 1000
UPPER = 1.09
"""Maximum mean of 1,000 normalized squared errors per dimension of a consistent estimate.

A chi-square of 2,000 degrees of freedom, divided by 2,000, is below 1.0 + 2.8 · sqrt(2 / 2000) with 99.7 %.
"""


def normalized(fused: Detections, truth: np.ndarray) -> np.ndarray:
    """Return the normalized squared errors (N,) per dimension."""
    nearest = np.argmin(np.linalg.norm(fused.boxes[:, None, :2] - truth, axis=2), axis=0)
    error = fused.boxes[nearest, :2] - truth
    found: np.ndarray = np.einsum("ni,nij,nj->n", error, np.linalg.inv(fused.covariance[nearest]), error) / 2.0
    return found


def field(count: int) -> np.ndarray:
    """Return objects on a grid that is wider than the association gate."""
    return np.stack(np.meshgrid(np.arange(count), np.arange(count)), axis=-1).reshape(-1, 2) * 30.0


@pytest.mark.parametrize(
    ("correlation", "expected", "independent"), [(0.0, 0.50, 1.00), (0.5, 0.70, 1.40), (0.9, 0.86, 1.72)]
)
def test_fusion_with_correlated_errors_is_consistent(
    correlation: float, expected: float, independent: float, report: Make, fuse: Fuse
) -> None:
    """Covariances are diag(0.25, 1) and diag(1, 0.25) m². See test_covariance for the expected values.

    `independent` is the normalized error of fusion that assumes independence, which is overconfident.
    """
    rng = generator(11, "stations", round(10 * correlation))
    a, b = np.diag([0.25, 1.0]), np.diag([1.0, 0.25])
    cross = 0.5 * correlation * np.eye(2)
    root = np.linalg.cholesky(np.block([[a, cross], [cross, b]]))
    truth = field(10)
    found, naive = [], []
    for _ in range(DRAWS // len(truth)):
        errors = rng.normal(size=(len(truth), 4)) @ root.T
        first, second = truth + errors[:, :2], truth + errors[:, 2:]
        fused = fuse([report("A", 0.0, first, covariance=a), report("B", 0.0, second, covariance=b)], 0.0)
        assert len(fused) == len(truth)
        found.append(normalized(fused, truth))
        information = np.linalg.inv(a) + np.linalg.inv(b)
        both = errors[:, :2] @ np.linalg.inv(a) + errors[:, 2:] @ np.linalg.inv(b)
        naive.append(np.einsum("ni,ij,nj->n", both, np.linalg.inv(information), both) / 2.0)
    assert np.mean(found) == pytest.approx(expected, rel=0.1)
    assert np.mean(found) < UPPER
    assert np.mean(naive) == pytest.approx(independent, rel=0.1)


def test_fusion_of_late_positions_is_consistent(report: Make, fuse: Fuse) -> None:
    """White noise acceleration, white position errors and a delay of 0.3 s match the filter model: the mean is 1."""
    rng = generator(12, "filter")
    truth = field(10)
    found = []
    for _ in range(DRAWS // len(truth)):
        place, velocity = truth.copy(), rng.normal(size=truth.shape) * 8.0
        reports = []
        for tick in range(27):
            if tick <= 20:
                seen = place + rng.normal(size=place.shape) * 0.3
                reports.append(report("A", 0.05 * tick, seen, covariance=0.09, arrived=0.05 * tick + 0.3))
            if tick < 26:
                noise = rng.multivariate_normal(
                    np.zeros(2), 6.0 * np.array([[0.05**3 / 3, 0.05**2 / 2], [0.05**2 / 2, 0.05]]), size=place.shape
                )
                place = place + 0.05 * velocity + noise[..., 0]
                velocity = velocity + noise[..., 1]
        fused = fuse(reports, 1.3)
        assert len(fused) == len(truth)
        found.append(normalized(fused, place))
    assert 0.9 < np.mean(found) < UPPER


@pytest.mark.exhaustive
def test_fusion_with_pose_error_of_the_sender_is_consistent(report: Make, fuse: Fuse) -> None:
    """Ten reports with the same pose error: filtering does not reduce it, and the covariance includes it."""
    rng = generator(13, "pose")
    deviations = np.array([0.3, 0.3, math.radians(0.8)])
    truth = np.array([[40.0, 10.0]])
    found = []
    for _ in range(DRAWS):
        dx, dy, turn = (rng.normal(size=3) * deviations).tolist()
        state = StationState(0.0, dx, dy, 0.0, turn, 0.0, np.diag(deviations**2))
        rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        reports = [
            report("A", 0.05 * tick, (truth + rng.normal(size=(1, 2)) * 0.1) @ rotation.T + (dx, dy),
                   covariance=0.01, state=state)
            for tick in range(10)
        ]  # fmt: skip
        found.append(normalized(fuse(reports, 0.45), truth))
    assert 0.85 < np.mean(found) < UPPER

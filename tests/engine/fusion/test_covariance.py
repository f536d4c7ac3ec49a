"""Covariance intersection of two estimates."""

from __future__ import annotations

import numpy as np
import pytest

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.fusion import covariance as ci
from eidrive_scenario.fusion.covariance import TRACE_TOLERANCE


def intersect(a: Array, cov_a: Array, b: Array, cov_b: Array) -> tuple[Array, Array, Array]:
    """Return mean, covariance and weight of a, fused from means (..., 2) with covariances (..., 2, 2)."""
    fused, weight = ci.intersect(ci.estimates(a, cov_a), ci.estimates(b, cov_b))
    return ci.means(fused), ci.covariances(fused), weight


def random_covariances(count: int, *key: int) -> np.ndarray:
    """Return pairs of covariances (count, 2, 2, 2): arbitrary, nearly equal, and isotropic ones."""
    rng = generator(1, "covariances", *key)
    roots = rng.normal(size=(count, 2, 2, 2)) * rng.choice([0.01, 1.0, 10.0], size=(count, 2, 1, 1))
    pairs: np.ndarray = roots @ np.swapaxes(roots, -1, -2) + 1e-4 * np.eye(2)
    third = count // 3
    pairs[:third] = pairs[:third, :1] * rng.uniform(0.8, 1.2, size=(third, 2, 1, 1))
    pairs[third : 2 * third] = rng.uniform(0.5, 2.0, size=(third, 2, 1, 1)) * np.eye(2)
    return pairs


def test_intersect_of_complementary_sensors_equals_hand_calculation() -> None:
    """w = 1/2, P⁻¹ = diag(5/8, 5/8); independent errors would result in 0.8 I."""
    mean, covariance, weight = intersect(np.zeros(2), np.diag([1.0, 4.0]), np.ones(2), np.diag([4.0, 1.0]))
    assert weight == pytest.approx(0.5, abs=1e-12)
    np.testing.assert_allclose(covariance, 1.6 * np.eye(2), atol=1e-12)
    np.testing.assert_allclose(mean, [0.2, 0.8], atol=1e-12)


def test_intersect_trace_is_minimal_within_one_percent() -> None:
    pairs = random_covariances(600)
    zeros = np.zeros((len(pairs), 2))
    _, covariance, weight = intersect(zeros, pairs[:, 0], zeros, pairs[:, 1])
    information = np.linalg.inv(pairs)
    weights = np.linspace(0.0, 1.0, 1001)[:, None, None, None]
    traces = np.trace(
        np.linalg.inv(weights * information[:, 0] + (1 - weights) * information[:, 1]), axis1=-2, axis2=-1
    )
    ratio = np.trace(covariance, axis1=1, axis2=2) / traces.min(axis=0)
    assert ratio.min() > 1.0 - 1e-9
    assert ratio.max() < 1.0 + TRACE_TOLERANCE + 1e-6
    assert np.all((weight >= 0.0) & (weight <= 1.0))


def test_intersect_is_symmetric_in_its_arguments() -> None:
    pairs = random_covariances(600)
    means = generator(1, "means").normal(size=(600, 2, 2))
    one = intersect(means[:, 0], pairs[:, 0], means[:, 1], pairs[:, 1])
    other = intersect(means[:, 1], pairs[:, 1], means[:, 0], pairs[:, 0])
    np.testing.assert_allclose(one[0], other[0], rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(one[1], other[1], rtol=1e-7)
    np.testing.assert_allclose(one[2], 1.0 - other[2], atol=1e-9)


def test_intersect_weight_is_continuous_for_similar_covariances() -> None:
    """The minimum trace alone would switch from one estimate to the other at ratio 1."""
    ratios = np.linspace(0.97, 1.03, 121)
    own = np.broadcast_to(np.eye(2), (len(ratios), 2, 2))
    weight = intersect(np.zeros((121, 2)), own, np.ones((121, 2)), ratios[:, None, None] * own)[2]
    assert weight[60] == 0.5
    assert np.abs(np.diff(weight)).max() < 0.1
    assert np.all(np.diff(weight) >= -1e-12), "the weight grows with the accuracy"


def test_intersect_of_similar_shapes_weights_the_more_accurate_one() -> None:
    mean, covariance, weight = intersect(np.zeros(2), np.eye(2), np.ones(2), 9.0 * np.eye(2))
    assert weight > 0.98
    assert np.trace(covariance) <= 2.0 * (1.0 + TRACE_TOLERANCE) + 1e-12
    assert mean[0] < 0.01


def test_intersect_of_equal_estimates_is_unchanged() -> None:
    covariance = np.array([[2.0, 0.5], [0.5, 1.0]])
    mean, fused, _ = intersect(np.array([3.0, 4.0]), covariance, np.array([3.0, 4.0]), covariance)
    np.testing.assert_array_equal(mean, [3.0, 4.0])
    np.testing.assert_allclose(fused, covariance, rtol=1e-14)


@pytest.mark.parametrize(
    ("correlation", "expected", "naive"), [(0.0, 0.50, 1.00), (0.5, 0.70, 1.40), (0.9, 0.86, 1.73)]
)
def test_intersect_is_consistent_for_any_correlation_unlike_independent_fusion(
    correlation: float, expected: float, naive: float
) -> None:
    """Normalized squared error of estimates with errors diag(1, 4) and diag(4, 1) and a given correlation.

    With A = diag(1, 4), B = diag(4, 1) and cross-covariance c sqrt(A) sqrt(B) = 2 c I, the error of the result has the
    variance (w² a⁻¹ + (1-w)² b⁻¹ + 4 c w (1-w) / (a b)) p² per axis, p² = 2.56: 0.8 + 0.64 c, of 1.6; and
    (a⁻¹ + b⁻¹ + 4 c / (a b)) 0.64 = 0.8 + 0.64 c, of 0.8. The shares are 0.50, 0.70, 0.86 and 1.00, 1.40, 1.72.
    """
    draws = 1000
    rng = generator(7, "consistency", round(correlation * 10))
    a, b = np.diag([1.0, 4.0]), np.diag([4.0, 1.0])
    cross = 2.0 * correlation * np.eye(2)
    root = np.linalg.cholesky(np.block([[a, cross], [cross, b]]))
    errors = rng.normal(size=(draws, 4)) @ root.T
    mean, covariance, _ = intersect(errors[:, :2], np.tile(a, (draws, 1, 1)), errors[:, 2:], np.tile(b, (draws, 1, 1)))
    found = np.einsum("ni,nij,nj->n", mean, np.linalg.inv(covariance), mean).mean() / 2.0
    information = np.linalg.inv(a) + np.linalg.inv(b)
    independent = np.linalg.solve(
        information, (np.linalg.inv(a) @ errors[:, :2].T + np.linalg.inv(b) @ errors[:, 2:].T)
    ).T
    overconfident = np.einsum("ni,ij,nj->n", independent, information, independent).mean() / 2.0
    # The mean of 1,000 values of a chi-square with 2 degrees of freedom, halved, deviates by 3 % (one sigma).
    assert found == pytest.approx(expected, rel=0.1)
    assert overconfident == pytest.approx(naive, rel=0.1)
    assert found < 1.0, "the error does not exceed the covariance"


def test_fuse_of_disagreeing_ellipses_is_between_both_means() -> None:
    """Two cameras see a van from both ends, each takes its end for the center: the long axes meet beside the van."""
    a, cov_a = np.array([48.9, -2.9]), np.array([[0.051, 0.057], [0.057, 0.208]])
    b, cov_b = np.array([51.1, -2.6]), np.array([[0.199, -0.177], [-0.177, 0.267]])
    crossing, _, weight = intersect(a, cov_a, b, cov_b)
    assert crossing[1] > -2.2
    first, second = (ci.estimates(mean[None], spread[None]) for mean, spread in ((a, cov_a), (b, cov_b)))
    fused = ci.fuse(first, second, gate=9.21)
    np.testing.assert_allclose(ci.means(fused)[0], weight * a + (1.0 - weight) * b)
    off = b - a
    mixture = weight * cov_a + (1.0 - weight) * cov_b + weight * (1.0 - weight) * np.outer(off, off)
    np.testing.assert_allclose(ci.covariances(fused)[0], mixture)


def test_fuse_disagreement_is_the_mahalanobis_distance() -> None:
    """dᵀ (P + Q)⁻¹ d, of random estimates: on either side of the gate the result is that of the closed forms."""
    pairs = random_covariances(300, 7)
    rng = generator(1, "means")
    a, b = rng.normal(size=(300, 2)) * 3.0, rng.normal(size=(300, 2)) * 3.0
    off = a - b
    squared = np.einsum("ni,nij,nj->n", off, np.linalg.inv(pairs[:, 0] + pairs[:, 1]), off)
    first, second = ci.estimates(a, pairs[:, 0]), ci.estimates(b, pairs[:, 1])
    met, weight = ci.intersect(first, second)
    between = weight[:, None] * a + (1.0 - weight[:, None]) * b
    expected = np.where((squared > 9.21)[:, None], between, ci.means(met))
    assert 50 < np.count_nonzero(squared > 9.21) < 250
    np.testing.assert_allclose(ci.means(ci.fuse(first, second, gate=9.21)), expected, atol=1e-6)

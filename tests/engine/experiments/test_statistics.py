"""Published values of intervals, and closed forms of paired comparisons."""

from __future__ import annotations

import math
from collections.abc import Callable
from statistics import NormalDist

import pytest

from eidrive_scenario.experiments.statistics.intervals import (
    interval_text,
    jackknife_interval,
    mean_interval,
    summarize,
    wilson,
)
from eidrive_scenario.experiments.statistics.paired import (
    PairedDifference,
    paired_difference,
    paired_ratio,
    paired_spread,
)

Compare = Callable[[list[float], list[float]], PairedDifference]
SQRT_3 = math.sqrt(3.0)


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        (8, 39, 0.108, 0.355),
        (32, 39, 0.673, 0.910),
        (19, 39, 0.339, 0.638),
        (59, 60, 0.911, 0.997),
        (60, 60, 0.940, 1.0),
        (0, 60, 0.0, 0.060),
    ],
)
def test_wilson_interval_equals_published_values(successes: int, trials: int, low: float, high: float) -> None:
    interval = wilson(successes, trials)
    assert (round(interval.low, 3), round(interval.high, 3)) == (low, high)


@pytest.mark.parametrize("confidence", [0.5, 0.9, 0.95, 0.99])
def test_wilson_bounds_solve_the_score_equation(confidence: float) -> None:
    """Wilson 1927: both bounds p satisfy (k/n - p)² = z² p (1 - p) / n, with the normal quantile z."""
    z = NormalDist().inv_cdf(0.5 + confidence / 2.0)
    for trials in (1, 2, 7, 20, 300):
        for successes in range(0, trials + 1, max(1, trials // 5)):
            interval = wilson(successes, trials, confidence)
            assert interval.low <= interval.share <= interval.high
            for bound in (interval.low, interval.high):
                score = z * z * bound * (1.0 - bound) / trials
                assert (interval.share - bound) ** 2 == pytest.approx(score, abs=1e-12)


@pytest.mark.parametrize(("successes", "trials"), [(1, 0), (-1, 5), (6, 5)])
def test_wilson_of_invalid_counts_raises_value_error(successes: int, trials: int) -> None:
    with pytest.raises(ValueError, match="invalid counts"):
        wilson(successes, trials)


@pytest.mark.parametrize("confidence", [0.0, 1.0, -0.5, math.nan])
def test_wilson_of_invalid_confidence_raises_value_error(confidence: float) -> None:
    with pytest.raises(ValueError, match="confidence"):
        wilson(1, 2, confidence)


def test_summary_has_both_standard_deviations() -> None:
    summary = summarize([2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0])
    assert (summary.mean, summary.population_sd) == (5.0, 2.0)
    assert summary.sample_sd == pytest.approx(math.sqrt(32 / 7))
    assert (summary.count, summary.smallest, summary.largest) == (8, 2.0, 9.0)


def test_summary_of_single_value_has_no_sample_sd() -> None:
    summary = summarize([3.5])
    assert summary.population_sd == 0.0
    assert math.isnan(summary.sample_sd)


@pytest.mark.parametrize("values", [[], [1.0, math.nan], [math.inf]])
def test_summary_of_non_finite_values_raises_value_error(values: list[float]) -> None:
    with pytest.raises(ValueError, match="finite"):
        summarize(values)


def test_mean_interval_is_that_of_student() -> None:
    """1, 2, 3: mean 2, deviation 1. Quantiles of t with 2 degrees of freedom: 4.303 (95 %) and 9.925 (99 %)."""
    interval = mean_interval([1.0, 2.0, 3.0])
    assert interval.mean == 2.0
    assert (interval.low, interval.high) == pytest.approx((2.0 - 4.303 / SQRT_3, 2.0 + 4.303 / SQRT_3), abs=1e-3)
    assert mean_interval([1.0, 2.0, 3.0], confidence=0.99).high == pytest.approx(2.0 + 9.925 / SQRT_3, abs=1e-3)


def test_mean_interval_of_single_value_has_no_limits() -> None:
    interval = mean_interval([4.5])
    assert interval.mean == 4.5
    assert math.isnan(interval.low)
    assert math.isnan(interval.high)
    assert interval_text(interval.low, interval.high, ".1f") == "no interval, too few values"


@pytest.mark.parametrize("confidence", [0.0, 1.0, math.nan])
def test_mean_interval_with_invalid_confidence_raises(confidence: float) -> None:
    with pytest.raises(ValueError, match="confidence"):
        mean_interval([1.0, 2.0], confidence=confidence)


def test_jackknife_interval_of_a_mean_is_that_of_its_values() -> None:
    """The pseudo-values of a mean are the values."""
    values = [0.5, 2.0, 7.0, 1.5]
    left_out = [(sum(values) - value) / 3 for value in values]
    found, expected = jackknife_interval(sum(values) / 4, left_out), mean_interval(values)
    assert (found.mean, found.low, found.high) == pytest.approx((expected.mean, expected.low, expected.high))


def test_paired_difference_of_constant_shift_has_zero_width() -> None:
    difference = paired_difference([1.0, 5.0, 9.0], [1.5, 5.5, 9.5])
    assert (difference.mean, difference.low, difference.high) == (0.5, 0.5, 0.5)


def test_paired_difference_uses_the_spread_of_the_differences() -> None:
    """Differences 1, 2 and 3 of values that are far apart."""
    difference = paired_difference([0.0, 50.0, 100.0], [1.0, 52.0, 103.0])
    assert (difference.pairs, difference.mean) == (3, 2.0)
    assert (difference.low, difference.high) == pytest.approx((2.0 - 4.303 / SQRT_3, 2.0 + 4.303 / SQRT_3), abs=1e-3)


@pytest.mark.parametrize("compare", [paired_difference, paired_ratio, paired_spread])
def test_single_pair_has_no_limits(compare: Compare) -> None:
    found = compare([2.0], [3.0])
    assert found.pairs == 1
    assert math.isnan(found.low)
    assert math.isnan(found.high)


@pytest.mark.parametrize("compare", [paired_difference, paired_ratio, paired_spread])
@pytest.mark.parametrize("arms", [([], []), ([1.0], [1.0, 2.0])])
def test_arms_of_unequal_or_no_length_raise(compare: Compare, arms: tuple[list[float], list[float]]) -> None:
    with pytest.raises(ValueError, match="lengths differ or are 0"):
        compare(*arms)


def test_paired_spread_is_difference_of_population_standard_deviations() -> None:
    """±1 has the standard deviation 1, ±3 has 3, whatever their means."""
    wide, narrow = [10.0 - 3.0, 10.0 + 3.0] * 10, [-1.0, 1.0] * 10
    spread = paired_spread(narrow, wide)
    assert spread.mean == pytest.approx(2.0)
    assert spread.low <= 2.0 <= spread.high
    assert paired_spread(wide, wide).high == 0.0


def test_paired_spread_has_limits_from_five_pairs_on() -> None:
    values = [1.0, 2.0, 4.0, 8.0, 16.0]
    assert math.isnan(paired_spread(values[:4], [0.0] * 4).low)
    assert paired_spread(values, [0.0] * 5).low < paired_spread(values, [0.0] * 5).mean < 0.0


def test_paired_spread_of_a_single_outlier_has_finite_limits() -> None:
    """Without the outlier there is no spread, so that the interval reaches nearly to 0."""
    spread = paired_spread([1.0] * 10, [1.0] * 9 + [5.0])
    assert spread.mean == pytest.approx(4.0 * math.sqrt(0.09))
    assert 0.0 < spread.low < 0.1
    assert math.isfinite(spread.high)


def test_paired_ratio_is_ratio_of_means() -> None:
    """Twice the values: the ratio is 2 without any of the pairs."""
    ratio = paired_ratio([1.0, 2.0, 3.0], [2.0, 4.0, 6.0])
    assert (ratio.mean, ratio.low, ratio.high) == pytest.approx((2.0, 2.0, 2.0))
    found = paired_ratio([1.0, 3.0], [3.0, 5.0])
    assert found.mean == pytest.approx(2.0)
    assert 0.0 < found.low < 2.0 < found.high
    inverse = paired_ratio([3.0, 5.0], [1.0, 3.0])
    assert (inverse.low, inverse.high) == pytest.approx((1.0 / found.high, 1.0 / found.low))


@pytest.mark.parametrize("arms", [([0.0, 1.0], [1.0, 1.0]), ([1.0, 1.0], [1.0, -1.0])])
def test_paired_ratio_of_values_that_are_not_positive_raises(arms: tuple[list[float], list[float]]) -> None:
    with pytest.raises(ValueError, match="not positive"):
        paired_ratio(*arms)


def test_paired_ratio_of_values_far_apart_has_finite_limits() -> None:
    found = paired_ratio([1e-300, 1.0], [1e300, 1.0])
    assert math.isfinite(found.high)

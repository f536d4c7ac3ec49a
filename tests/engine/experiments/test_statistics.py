"""Published values of intervals, and closed forms of paired comparisons."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
import pytest

from eidrive_scenario.experiments.statistics.paired import paired_difference, paired_ratio, paired_spread
from eidrive_scenario.experiments.statistics.proportions import wilson
from eidrive_scenario.experiments.statistics.samples import mean_interval, summarize


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


def test_paired_difference_of_constant_shift_has_zero_width() -> None:
    difference = paired_difference([1.0, 5.0, 9.0], [1.5, 5.5, 9.5])
    assert (difference.mean, difference.low, difference.high) == (0.5, 0.5, 0.5)


def test_paired_difference_of_single_pair_has_zero_width() -> None:
    difference = paired_difference([1.0], [1.5])
    assert (difference.pairs, difference.mean, difference.low, difference.high) == (1, 0.5, 0.5, 0.5)


def test_paired_difference_interval_has_nominal_coverage() -> None:
    """About 93 % of 300 intervals contain the true difference of 0.3: percentile bootstrap intervals of 20 pairs are
    slightly narrow."""
    random = np.random.default_rng(5)
    covered = 0
    for sample in range(300):
        first = random.normal(3.0, 1.0, 20)
        second = first + random.normal(0.3, 0.2, 20)
        interval = paired_difference(list(first), list(second), resamples=500, seed=sample)
        covered += interval.low <= 0.3 <= interval.high
    assert 0.88 <= covered / 300 <= 0.97


def test_paired_difference_is_deterministic() -> None:
    first, second = [1.0, 2.0, 4.0, 8.0], [2.0, 1.0, 6.0, 9.0]
    assert paired_difference(first, second) == paired_difference(first, second)


def test_mean_interval_of_normal_sample_is_near_its_closed_form() -> None:
    """The half width of the interval of a mean is 1.96 s / sqrt(n)."""
    values = [NormalDist(3.0, 0.5).inv_cdf((index + 0.5) / 200) for index in range(200)]
    interval = mean_interval(values)
    half = 1.96 * float(np.std(values)) / math.sqrt(200)
    assert interval.mean == pytest.approx(3.0)
    assert (interval.low, interval.high) == pytest.approx((3.0 - half, 3.0 + half), abs=0.01)


def test_mean_interval_of_single_value_has_zero_width() -> None:
    interval = mean_interval([4.5])
    assert (interval.mean, interval.low, interval.high) == (4.5, 4.5, 4.5)


def test_paired_spread_is_difference_of_population_standard_deviations() -> None:
    """±1 has the standard deviation 1, ±3 has 3, whatever their means."""
    wide, narrow = [10.0 - 3.0, 10.0 + 3.0] * 10, [-1.0, 1.0] * 10
    spread = paired_spread(narrow, wide)
    assert spread.mean == pytest.approx(2.0)
    assert 1.5 < spread.low <= 2.0 <= spread.high < 2.5
    assert paired_spread(wide, wide).high == 0.0


def test_paired_ratio_is_ratio_of_means() -> None:
    """Twice the values: each resample has the ratio 2."""
    ratio = paired_ratio([1.0, 2.0, 3.0], [2.0, 4.0, 6.0])
    assert (ratio.mean, ratio.low, ratio.high) == pytest.approx((2.0, 2.0, 2.0))
    assert paired_ratio([1.0, 3.0], [3.0, 5.0]).mean == pytest.approx(2.0)
    with pytest.raises(ValueError, match="not positive"):
        paired_ratio([0.0, 1.0], [1.0, 1.0])

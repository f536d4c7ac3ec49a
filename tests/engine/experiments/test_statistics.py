"""Golden numbers of intervals, and the paper's standard deviation from its raw episodes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import binomtest

from eidrive_scenario.experiments.statistics import paired_difference, paired_outcomes, summarize, wilson


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
def test_wilson_interval_equals_the_published_golden_numbers(
    successes: int, trials: int, low: float, high: float
) -> None:
    interval = wilson(successes, trials)
    assert (round(interval.low, 3), round(interval.high, 3)) == (low, high)


@pytest.mark.parametrize("confidence", [0.5, 0.9, 0.95, 0.99])
def test_wilson_interval_agrees_with_scipy(confidence: float) -> None:
    for trials in (1, 2, 7, 20, 300):
        for successes in range(0, trials + 1, max(1, trials // 5)):
            theirs = binomtest(successes, trials).proportion_ci(confidence, method="wilson")
            ours = wilson(successes, trials, confidence)
            assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), abs=1e-12)


@pytest.mark.parametrize(("successes", "trials"), [(1, 0), (-1, 5), (6, 5)])
def test_wilson_refuses_what_is_no_share(successes: int, trials: int) -> None:
    with pytest.raises(ValueError, match="is no share"):
        wilson(successes, trials)


def test_summary_knows_both_standard_deviations() -> None:
    summary = summarize([2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0])
    assert (summary.mean, summary.population_sd) == (5.0, 2.0)
    assert summary.sample_sd == pytest.approx(math.sqrt(32 / 7))
    assert (summary.count, summary.smallest, summary.largest) == (8, 2.0, 9.0)


def test_summary_of_one_value_has_no_sample_sd() -> None:
    summary = summarize([3.5])
    assert summary.population_sd == 0.0
    assert math.isnan(summary.sample_sd)


@pytest.mark.parametrize("values", [[], [1.0, math.nan], [math.inf]])
def test_summary_refuses_what_has_no_mean(values: list[float]) -> None:
    with pytest.raises(ValueError, match="finite"):
        summarize(values)


def test_paired_difference_of_a_constant_shift_has_no_width() -> None:
    difference = paired_difference([1.0, 5.0, 9.0], [1.5, 5.5, 9.5])
    assert (difference.mean, difference.low, difference.high) == (0.5, 0.5, 0.5)
    assert (difference.larger, difference.smaller, difference.clear) == (3, 0, True)


def test_paired_difference_interval_covers_as_often_as_it_says() -> None:
    """True difference 0.3: of 300 samples of 20 pairs about 93 % (percentile bootstrap is a little narrow) cover it."""
    random = np.random.default_rng(5)
    covered = 0
    for sample in range(300):
        first = random.normal(3.0, 1.0, 20)
        second = first + random.normal(0.3, 0.2, 20)
        interval = paired_difference(list(first), list(second), resamples=500, seed=sample)
        covered += interval.low <= 0.3 <= interval.high
    assert 0.88 <= covered / 300 <= 0.97


def test_paired_difference_is_the_same_each_time() -> None:
    first, second = [1.0, 2.0, 4.0, 8.0], [2.0, 1.0, 6.0, 9.0]
    assert paired_difference(first, second) == paired_difference(first, second)


def test_mcnemar_counts_only_the_pairs_that_disagree() -> None:
    first = [True] * 10 + [False] * 9 + [True]
    second = [True] * 10 + [True] * 9 + [False]
    outcome = paired_outcomes(first, second)
    assert (outcome.both, outcome.first_only, outcome.second_only, outcome.neither) == (10, 1, 9, 0)
    assert outcome.p_value == pytest.approx(binomtest(1, 10).pvalue)


def test_mcnemar_without_disagreement_finds_nothing() -> None:
    assert paired_outcomes([True, False], [True, False]).p_value == 1.0

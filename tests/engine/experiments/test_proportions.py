"""Intervals of proportions: exact, score, and confidence sequences."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.experiments.statistics.intervals import (
    anytime_interval,
    clopper_pearson,
    exact_percentage,
    percentage,
    wilson,
)

KNOWN = [
    (19, 20, (0.763869, 0.991119), (0.751267, 0.998735), (0.657592, 0.999881)),
    (20, 20, (0.838875, 1.0), (0.831567, 1.0), (0.739329, 1.0)),
    (48, 50, (0.865399, 0.988961), (0.862862, 0.995119), (0.797836, 0.999086)),
    (57, 60, (0.862995, 0.982850), (0.860757, 0.989568), (0.800006, 0.996945)),
    (95, 100, (0.888250, 0.978456), (0.887165, 0.983568), (0.839741, 0.993423)),
]
"""Successes, trials, and Wilson, Clopper-Pearson and beta-binomial mixture intervals of other code."""


@pytest.mark.parametrize(("successes", "trials", "score", "exact", "anytime"), KNOWN)
def test_intervals_equal_those_of_other_program(
    successes: int, trials: int, score: tuple[float, ...], exact: tuple[float, ...], anytime: tuple[float, ...]
) -> None:
    for function, expected in ((wilson, score), (clopper_pearson, exact), (anytime_interval, anytime)):
        found = function(successes, trials)
        assert (found.low, found.high) == pytest.approx(expected, abs=6e-7)


def test_anytime_interval_of_1000_runs_equals_known_one() -> None:
    found = anytime_interval(950, 1000)
    assert (found.low, found.high) == pytest.approx((0.919829, 0.971765), abs=6e-7)


def test_anytime_interval_is_symmetric_in_successes_and_failures() -> None:
    for successes, trials in ((0, 1), (3, 10), (10, 10), (123, 1000)):
        one, other = anytime_interval(successes, trials), anytime_interval(trials - successes, trials)
        assert (one.low, one.high) == pytest.approx((1.0 - other.high, 1.0 - other.low), abs=1e-9)


def test_anytime_interval_without_runs_is_complete() -> None:
    found = anytime_interval(0, 0)
    assert (found.low, found.high) == (0.0, 1.0)
    assert math.isnan(found.share)


@pytest.mark.exhaustive
@pytest.mark.parametrize("rate", [0.5, 0.8, 0.95, 0.99])
def test_confidence_sequence_covers_at_all_times(rate: float) -> None:
    """2,000 series of 200 runs: all 200 intervals of a series contain the rate in at least 95 % of them.

    Wilson's interval, which holds for one number of runs, misses the rate at some time in a third of the series.
    """
    successes = (generator(3, f"sequence at {rate}").random((2000, 200)) < rate).cumsum(axis=1)
    trials = np.arange(1, 201)
    limits = {
        (k, n): anytime_interval(k, n)
        for n in trials.tolist()
        for k in range(max(0, int(rate * n - 60)), n + 1)
        if abs(k - rate * n) <= 6.0 * math.sqrt(n) + 6.0
    }
    table = np.ones((201, 201), dtype=bool)
    for (k, n), one in limits.items():
        table[k, n] = not one.low <= rate <= one.high
    missed = table[successes, trials[None, :]].any(axis=1).mean()
    assert missed <= 0.05


@pytest.mark.parametrize("function", [wilson, clopper_pearson, anytime_interval])
@pytest.mark.parametrize(
    ("counts", "confidence", "expected"), [((3, 2), 0.95, "counts"), ((-1, 2), 0.95, "counts"), ((1, 2), 1.0, "confi")]
)
def test_intervals_with_invalid_arguments_raise(
    function: object, counts: tuple[int, int], confidence: float, expected: str
) -> None:
    assert callable(function)
    with pytest.raises(ValueError, match=expected):
        function(*counts, confidence)


@pytest.mark.parametrize(
    ("share", "decimals", "text"),
    [
        (0.0, 1, "0.0%"),
        (1.0, 0, "100%"),
        (0.985, 1, "98.5%"),
        (399 / 400, 0, "99.8%"),
        (1 / 400, 0, "0.2%"),
        (4999 / 5000, 1, "99.98%"),
        (1 - 1e-12, 1, "100.0%"),
    ],
)
def test_share_below_all_and_above_none_is_not_rounded_to_them(share: float, decimals: int, text: str) -> None:
    """100 · 399/400 = 99.75, which rounds to the even digit. A share that differs from 1 by less than 5e-12 is 1."""
    assert percentage(share, decimals) == text
    assert percentage(-share, decimals, "+") == f"-{text}"


@pytest.mark.parametrize(
    ("setting", "decimals", "text"),
    [
        (0.95, 0, "95%"),
        (0.995, 0, "99.5%"),
        (1.0 - 0.001, 0, "99.9%"),
        (0.975, 0, "97.5%"),
        (0.05, 1, "5.0%"),
        (0.0004, 1, "0.04%"),
    ],
)
def test_percentage_of_setting_has_all_decimals(setting: float, decimals: int, text: str) -> None:
    assert exact_percentage(setting, decimals) == text

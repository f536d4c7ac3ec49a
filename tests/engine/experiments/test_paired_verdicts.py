"""Paired verdicts of two settings: McNemar's test, score interval, and non-inferiority."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.experiments.statistics.paired import PairedVerdicts


@pytest.mark.parametrize(
    ("only_first", "only_second", "exact", "mid"),
    [(3, 12, 0.03515625, 0.02127075), (1, 9, 0.021484375, 0.01171875), (5, 5, 1.0, 1 - 126 / 1024), (0, 0, 1.0, 1.0)],
)
def test_p_value_equals_mcnemar_of_other_program(only_first: int, only_second: int, exact: float, mid: float) -> None:
    """Values of statsmodels (exact) and of the mid-p formula; equal counts lose half of their probability, 252/1024."""
    verdicts = PairedVerdicts(20, only_first, only_second, 4)
    assert verdicts.p_value() == pytest.approx(exact, abs=1e-8)
    assert verdicts.p_value(mid=True) == pytest.approx(mid, abs=1e-8)


def test_of_counts_outcomes_by_pair() -> None:
    verdicts = PairedVerdicts.of([True, True, False, False, True], [True, False, True, False, False])
    assert verdicts == PairedVerdicts(1, 2, 1, 1)
    assert verdicts.pairs == 5
    assert verdicts.difference == pytest.approx(-0.2)


@pytest.mark.parametrize(("lost", "gained"), [(3, 12), (6, 9), (0, 4), (0, 3), (2, 9), (20, 38), (20, 30)])
def test_interval_contains_zero_as_mcnemar_without_correction(lost: int, gained: int) -> None:
    """At a difference of 0 the score statistic is (c - b) / sqrt(b + c)."""
    low, high = PairedVerdicts(50, lost, gained, 10).interval()
    statistic = (gained - lost) / math.sqrt(gained + lost)
    assert (low <= 0.0 <= high) == (abs(statistic) <= 1.959964)


def test_interval_is_antisymmetric_in_settings() -> None:
    low, high = PairedVerdicts(30, 2, 9, 9).interval(0.9)
    assert PairedVerdicts(30, 9, 2, 9).interval(0.9) == pytest.approx((-high, -low), abs=1e-9)
    assert -1.0 < low < 7 / 50 < high < 1.0


def test_interval_of_equal_verdicts_contains_zero() -> None:
    """No discordant pair in 100: the interval is that of the score test, about z² / (n + z²) on each side."""
    low, high = PairedVerdicts(100, 0, 0, 0).interval()
    z = 1.959964**2
    assert high == pytest.approx(z / (100 + z), abs=1e-4)
    assert low == pytest.approx(-high, abs=1e-9)


def test_interval_covers_true_difference() -> None:
    """4,000 samples of 60 pairs with outcomes (0.7, 0.15, 0.05, 0.1): the coverage is 95 % within 1.5 %."""
    counts = generator(5, "paired verdicts").multinomial(60, [0.7, 0.15, 0.05, 0.1], size=4000)
    known: dict[tuple[int, ...], bool] = {}
    covered = []
    for row in counts.tolist():
        key = tuple(row)
        if key not in known:
            low, high = PairedVerdicts(*key).interval()
            known[key] = low <= -0.1 <= high
        covered.append(known[key])
    assert np.mean(covered) == pytest.approx(0.95, abs=0.015)


def test_p_value_worse_decides_non_inferiority() -> None:
    """Equal verdicts in 100 pairs exclude a loss of 5 %, not of 1 %; a loss of 10 in 100 excludes neither."""
    equal = PairedVerdicts(95, 0, 0, 5)
    assert equal.p_value_worse(0.05) < 0.05
    assert equal.p_value_worse(0.01) > 0.05
    assert PairedVerdicts(85, 10, 0, 5).p_value_worse(0.05) > 0.5
    assert PairedVerdicts(80, 0, 15, 5).p_value_worse() < 0.001


def test_p_value_worse_is_consistent_with_interval() -> None:
    """The one-sided test at 2.5 % rejects exactly if the lower limit of the 95 % interval is above minus the margin."""
    for verdicts in (PairedVerdicts(40, 3, 5, 2), PairedVerdicts(90, 4, 2, 4), PairedVerdicts(10, 0, 1, 0)):
        low, _ = verdicts.interval()
        for margin in (0.01, 0.05, 0.1, 0.2):
            assert (verdicts.p_value_worse(margin) < 0.025) == (low > -margin)


@pytest.mark.parametrize("method", ["interval", "p_value_worse"])
def test_comparison_without_pairs_raises(method: str) -> None:
    with pytest.raises(ValueError, match="none"):
        getattr(PairedVerdicts(0, 0, 0, 0), method)()


def test_invalid_arguments_raise() -> None:
    with pytest.raises(ValueError, match="lengths differ"):
        PairedVerdicts.of([True], [])
    with pytest.raises(ValueError, match="margin"):
        PairedVerdicts(1, 0, 0, 0).p_value_worse(1.0)
    with pytest.raises(ValueError, match="confidence"):
        PairedVerdicts(1, 0, 0, 0).interval(0.0)

"""Sequential tests of success rates: decisions, exact characteristics, and error rates of simulated series."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.experiments.statistics.sequential import Decision, RatioTest, success_rate

WALD = RatioTest(good=0.95, bad=0.80, limit=2000)
SERIES = 2000


def first_decision(test: RatioTest, outcomes: np.ndarray) -> tuple[Decision, int]:
    """Return the decision of a series of outcomes (K,) and the number of runs until then."""
    successes = 0
    for trials, success in enumerate(outcomes.tolist(), 1):
        successes += success
        decision = test.decision(successes, trials)
        if decision is not None:
            return decision, trials
    raise AssertionError("the series is shorter than the limit of the test")


def test_bounds_and_steps_equal_those_of_wald() -> None:
    """Values for p0 = 0.95, p1 = 0.80 and risks of 5 %, computed with other code from Wald's formulas."""
    assert WALD.bounds == pytest.approx((-2.9444389791664403, 2.9444389791664403), abs=1e-14)
    assert WALD.step_of_success == pytest.approx(-0.17185025692665915, abs=1e-15)
    assert WALD.step_of_failure == pytest.approx(1.3862943611198895, abs=1e-15)


@pytest.mark.parametrize(("failures", "passes_at"), [(0, 18), (1, 27), (2, 36), (3, 45), (4, 54)])
def test_decision_passes_from_known_number_of_runs(failures: int, passes_at: int) -> None:
    assert WALD.decision(passes_at - 1 - failures, passes_at - 1) is None
    assert WALD.decision(passes_at - failures, passes_at) is Decision.PASSED


@pytest.mark.parametrize(("failures", "fails_up_to"), [(3, 10), (4, 19), (5, 28), (6, 37), (7, 46), (8, 55)])
def test_decision_fails_up_to_known_number_of_runs(failures: int, fails_up_to: int) -> None:
    assert WALD.decision(fails_up_to - failures, fails_up_to) is Decision.FAILED
    assert WALD.decision(fails_up_to + 1 - failures, fails_up_to + 1) is None


@pytest.mark.parametrize(
    ("rate", "passed", "runs"),
    [
        (0.99, 0.99986, 19.78),
        (0.95, 0.96777, 30.56),
        (0.90, 0.63534, 44.11),
        (0.80, 0.04462, 22.59),
        (0.70, 0.00236, 11.83),
    ],
)
def test_characteristics_equal_exact_ones_of_other_program(rate: float, passed: float, runs: float) -> None:
    """Probability to accept and mean number of runs without truncation, from a recursion in other code."""
    found = WALD.characteristics(rate)
    assert found.passed == pytest.approx(passed, abs=6e-6)
    assert found.mean_runs == pytest.approx(runs, abs=6e-3)
    assert found.passed + found.failed + found.undecided == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("rate", [0.95, 0.80])
def test_errors_of_simulated_series_are_within_promised_ones(
    rate: float, record_property: Callable[[str, object], None]
) -> None:
    """2,000 series: wrong decisions at most 5 % within the binomial error, fewer runs than a test of fixed size.

    A test with 50 runs that accepts up to 5 failures has the same risks (3.8 and 4.8 %).
    """
    test = RatioTest(good=0.95, bad=0.80, limit=500)
    outcomes = generator(7, f"series at {rate}").random((SERIES, test.limit)) < rate
    ends = [first_decision(test, series) for series in outcomes]
    right = Decision.PASSED if rate == 0.95 else Decision.FAILED
    wrong = sum(decision is not right for decision, _ in ends) / SERIES
    assert wrong <= 0.05 + 3.0 * math.sqrt(0.05 * 0.95 / SERIES)
    mean = sum(runs for _, runs in ends) / SERIES
    record_property("mean_runs", f"{mean:.1f}")
    record_property("runs_of_fixed_size", 50)
    assert mean < 50.0
    exact = test.characteristics(rate)
    assert mean == pytest.approx(exact.mean_runs, rel=0.06)


def test_undecided_at_limit_keeps_error_rates() -> None:
    """With few runs the test is often undecided, and is wrong at most as often as without a limit."""
    short = RatioTest(good=0.95, bad=0.80, limit=25)
    assert short.decision(23, 25) is Decision.UNDECIDED
    good, bad = short.characteristics(0.95), short.characteristics(0.80)
    assert good.undecided > 0.2
    assert good.failed <= 0.05
    assert bad.passed <= 0.05
    assert good.mean_runs <= 25.0


def test_characteristics_at_certain_rates() -> None:
    """Without failures the test passes after 18 runs; with failures only it fails after 3."""
    assert WALD.characteristics(1.0).mean_runs == 18.0
    assert WALD.characteristics(1.0).passed == 1.0
    assert WALD.characteristics(0.0).mean_runs == 3.0
    assert WALD.characteristics(0.0).failed == 1.0


def test_success_rate_rarely_passes_below_required_rate() -> None:
    """The guarantee of a pass holds at the required rate itself, that of a failure at the expected one."""
    test = success_rate(0.9, confidence=0.95, limit=2000)
    assert (test.bad, test.good) == (0.9, 0.95)
    assert test.characteristics(0.9).passed <= 0.05
    assert test.characteristics(0.85).passed <= 0.05
    assert test.characteristics(0.95).failed <= 0.05
    assert success_rate(0.9, expected=0.99).characteristics(0.99).mean_runs < test.characteristics(0.99).mean_runs


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"good": 0.8, "bad": 0.9}, "not 0 < bad < good < 1"),
        ({"good": 1.0, "bad": 0.9}, "not 0 < bad < good < 1"),
        ({"good": 0.9, "bad": 0.0}, "not 0 < bad < good < 1"),
        ({"good": 0.9, "bad": math.nan}, "not 0 < bad < good < 1"),
        ({"good": 0.9, "bad": 0.8, "false_pass": 0.5}, "false_pass"),
        ({"good": 0.9, "bad": 0.8, "false_failure": 0.0}, "false_failure"),
        ({"good": 0.9, "bad": 0.8, "limit": 0}, "limit"),
    ],
)
def test_ratio_test_with_invalid_arguments_raises(arguments: dict[str, float], expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        RatioTest(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("at_least", [0.0, 1.0, 1.2, -0.1, math.nan])
def test_success_rate_with_impossible_rate_raises(at_least: float) -> None:
    with pytest.raises(ValueError, match=r"^at_least: not between 0 and 1"):
        success_rate(at_least)


@pytest.mark.parametrize("expected", [0.8, 0.9, 1.0, math.nan])
def test_success_rate_with_impossible_expected_rate_raises(expected: float) -> None:
    with pytest.raises(ValueError, match=r"^expected: not between at_least and 1"):
        success_rate(0.9, expected=expected)


def test_success_rate_with_low_confidence_raises() -> None:
    with pytest.raises(ValueError, match="confidence"):
        success_rate(0.9, confidence=0.5)


@pytest.mark.parametrize(("successes", "trials"), [(-1, 3), (4, 3), (0, -1)])
def test_decision_with_invalid_counts_raises(successes: int, trials: int) -> None:
    with pytest.raises(ValueError, match="invalid counts"):
        WALD.decision(successes, trials)


def test_decision_before_first_run_is_none() -> None:
    assert WALD.decision(0, 0) is None

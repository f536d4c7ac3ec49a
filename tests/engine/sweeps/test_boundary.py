"""Search of a boundary of success with simulated outcomes of known rates."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import expit

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.experiments.sweeps.searches import Boundary, BoundarySearch, is_found


def searched(
    seed: int, runs: int, rate_at: object, *, low: float = 0.0, high: float = 1.0, bound: float = 0.5
) -> Boundary:
    """Return the estimate after runs whose success rate is `rate_at(x)`."""
    return estimates_after(seed, (runs,), rate_at, low=low, high=high, bound=bound)[0]


def estimates_after(
    seed: int, numbers: tuple[int, ...], rate_at: object, *, low: float = 0.0, high: float = 1.0, bound: float = 0.5
) -> list[Boundary]:
    """Return the estimates of one search after each of these numbers of runs, in ascending order."""
    assert callable(rate_at)
    rng, search = generator(seed, "boundary"), BoundarySearch(low, high, bound)
    estimates = []
    for runs in numbers:
        while search.runs < runs:
            for x in search.proposals(8):
                search.add(x, bool(rng.random() < rate_at(x)))
        estimates.append(search.estimate())
    return estimates


def falling(x: float) -> float:
    """Return the rate of a curve with the boundary 0.37 and the width 0.05."""
    return float(expit(-(x - 0.37) / 0.05))


@pytest.fixture(scope="module")
def estimates() -> list[tuple[Boundary, Boundary]]:
    """Return the estimates of 30 searches on the falling curve after 40 and 80 runs."""
    return [(early, late) for early, late in (estimates_after(seed, (40, 80), falling) for seed in range(30))]


@pytest.mark.statistical
@pytest.mark.parametrize(("stage", "error"), [(0, 0.0267), (1, 0.0172)], ids=["40 runs", "80 runs"])
def test_error_is_at_most_that_of_probabilistic_bisection(
    estimates: list[tuple[Boundary, Boundary]], stage: int, error: float
) -> None:
    """Root mean square errors of probabilistic bisection on the same curve, from 400 repetitions in other code."""
    errors = [search[stage].value - 0.37 for search in estimates]
    assert math.sqrt(np.mean(np.square(errors))) <= 1.25 * error


@pytest.mark.statistical
def test_interval_covers_boundary(estimates: list[tuple[Boundary, Boundary]]) -> None:
    """30 searches of 80 runs: 95 % credible intervals contain the boundary in at least 85 % of them."""
    assert np.mean([late.low <= 0.37 <= late.high for _, late in estimates]) >= 0.85


@pytest.mark.statistical
def test_sharp_boundary_needs_few_runs() -> None:
    """A step at 0.113 within ±0.02 after at most 40 runs; a grid of this resolution has 26 values of several runs."""
    for seed in range(8):
        found = searched(seed, 40, lambda x: float(x < 0.113))
        assert abs(found.value - 0.113) <= 0.02
        assert is_found(found, 0.02)
        assert found.rising < 0.01


@pytest.mark.statistical
def test_interval_contains_steps_between_coarse_boundaries() -> None:
    """The first range tests boundaries 0.008 apart and values 0.017 apart, and shrinks to resolve ±0.004."""
    steps = [0.05 + 0.0913 * k for k in range(10)]
    estimates = [searched(1, 64, lambda x, step=step: float(x < step)) for step in steps]
    assert all(is_found(estimate, 0.004) for estimate in estimates)
    assert all(abs(estimate.value - step) <= 0.004 for estimate, step in zip(estimates, steps, strict=True))
    assert sum(each.low <= step <= each.high for each, step in zip(estimates, steps, strict=True)) >= 8


def test_rising_rate_and_other_range_are_found() -> None:
    found = searched(1, 80, lambda x: float(expit((x - 8.0) / 0.2)), low=6.0, high=12.0)
    assert found.value == pytest.approx(8.0, abs=0.3)
    assert found.rising > 0.99


@pytest.mark.statistical
def test_bound_selects_other_place_of_curve() -> None:
    """The rate of 0.9 is at 0.37 - 0.05 ln 9 = 0.260."""
    boundaries = [searched(seed, 160, falling, bound=0.9).value for seed in range(10)]
    assert np.median(boundaries) == pytest.approx(0.26, abs=0.02)


@pytest.mark.parametrize("always", [True, False])
def test_constant_outcome_has_no_boundary_in_range(always: bool) -> None:
    found = searched(1, 64, lambda x: float(always))
    assert found.inside < 0.5
    assert not is_found(found, 0.1)


@pytest.mark.statistical
def test_lapses_do_not_move_boundary() -> None:
    """One outcome in twenty is random; the median of ten searches is at the boundary."""
    boundaries = [searched(seed, 120, lambda x: 0.025 + 0.95 * float(x < 0.6)).value for seed in range(10)]
    assert np.median(boundaries) == pytest.approx(0.6, abs=0.02)


@pytest.mark.parametrize(
    ("low", "high", "bound"), [(1.0, 1.0, 0.5), (2.0, 1.0, 0.5), (0.0, math.inf, 0.5), (0, 1, 1.0)]
)
def test_invalid_search_raises(low: float, high: float, bound: float) -> None:
    with pytest.raises(ValueError, match="not"):
        BoundarySearch(low, high, bound)

"""Coverage of all intervals of 95 %: the share of samples whose interval contains the true value.

Of SAMPLES samples, a right interval covers between 93 and 98 % of them with odds above 10,000 to 1: the standard error
of a share of 95 % is 0.4 %.

Counts have few outcomes, so that the coverage of proportions oscillates with the true rate (Brown, Cai and DasGupta,
Interval estimation for a binomial proportion, Statistical Science 16, 2001). That of proportions is therefore the mean
over a uniform rate, computed without simulation. Intervals that promise at least 95 % at each rate have no upper bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from eidrive_reports.cooperative_perception.scores import FULL_SCORE, PerceptionRecord, Pool, Tally
from scipy.stats import binom

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.experiments.statistics.intervals import (
    Proportion,
    anytime_interval,
    clopper_pearson,
    mean_interval,
    wilson,
)
from eidrive_scenario.experiments.statistics.paired import (
    LEAST_PAIRS,
    PairedDifference,
    PairedVerdicts,
    paired_difference,
    paired_ratio,
    paired_spread,
)
from eidrive_scenario.experiments.sweeps.searches import BoundarySearch

SAMPLES = 3000
LEAST, MOST = 0.93, 0.98
COUNTS = (3, 5, 10, 20, 50)

Compare = Callable[[list[float], list[float]], PairedDifference]
Limits = tuple[float, float]
Arms = tuple[Array, Array]


def normal_pairs(count: int) -> Arms:
    """Return samples of pairs (SAMPLES, count): means 10 and 12, standard deviations 1 and 2, correlation 0.5."""
    random = generator(count, "coverage of pairs")
    first, other = random.standard_normal((2, SAMPLES, count))
    return 10.0 + first, 12.0 + 2.0 * (0.5 * first + math.sqrt(0.75) * other)


def coverage(intervals: list[Limits], truth: float) -> float:
    return float(np.mean([low <= truth <= high for low, high in intervals]))


@pytest.mark.parametrize("count", COUNTS)
def test_mean_of_normal_values(count: int) -> None:
    intervals = [mean_interval(values) for values in normal_pairs(count)[1].tolist()]
    assert LEAST <= coverage([(one.low, one.high) for one in intervals], 12.0) <= MOST


@pytest.mark.statistical
@pytest.mark.parametrize(("compare", "truth"), [(paired_difference, 2.0), (paired_ratio, 1.2), (paired_spread, 1.0)])
@pytest.mark.parametrize("count", COUNTS)
def test_comparison_of_normal_pairs(compare: Compare, truth: float, count: int) -> None:
    if compare is paired_spread and count < LEAST_PAIRS:
        return
    pairs = zip(*(arm.tolist() for arm in normal_pairs(count)), strict=True)
    intervals = [compare(first, second) for first, second in pairs]
    assert LEAST <= coverage([(one.low, one.high) for one in intervals], truth) <= MOST


RATES = (np.arange(2000) + 0.5) / 2000


def coverage_by_rate(function: Callable[[int, int], Proportion], trials: int) -> Array:
    """Return the exact coverage at each of RATES."""
    covered = np.zeros(len(RATES))
    for successes in range(trials + 1):
        interval = function(successes, trials)
        is_inside = (interval.low <= RATES) & (interval.high >= RATES)
        covered += binom.pmf(successes, trials, RATES) * is_inside
    return covered


@pytest.mark.parametrize("count", COUNTS)
def test_score_interval_of_a_proportion(count: int) -> None:
    """Wilson's interval: 95 % in the mean over the rates, not at each of them."""
    covered = coverage_by_rate(wilson, count)
    assert LEAST <= covered.mean() <= MOST
    assert covered.min() > 0.82


@pytest.mark.parametrize("function", [clopper_pearson, anytime_interval])
@pytest.mark.parametrize("count", COUNTS)
def test_guaranteed_interval_of_a_proportion(function: Callable[[int, int], Proportion], count: int) -> None:
    assert coverage_by_rate(function, count).min() >= 0.95 - 1e-9


@pytest.mark.parametrize("count", COUNTS)
def test_difference_of_paired_rates(count: int) -> None:
    """The score interval, in the mean over uniform shares of the four outcomes; it is conservative below 10 pairs."""
    random = generator(count, "coverage of verdicts")
    shares = random.dirichlet((1.0, 1.0, 1.0, 1.0), SAMPLES // 2)
    verdicts = [PairedVerdicts(*random.multinomial(count, one).tolist()) for one in shares]
    # Only the discordant pairs and the number of pairs matter
    limits = {(one.only_first, one.only_second): one for one in verdicts}
    intervals = {key: one.interval() for key, one in limits.items()}
    covered = [
        low <= gained - lost <= high
        for (low, high), (_, lost, gained, _) in zip(
            (intervals[one.only_first, one.only_second] for one in verdicts), shares.tolist(), strict=True
        )
    ]
    assert LEAST <= np.mean(covered) <= (MOST if count >= 10 else 0.995)


def perception_runs(count: int) -> list[PerceptionRecord]:
    """Return runs of about 20 objects, of which easier ones have more correct and fewer wrong detections."""
    random = generator(1, "coverage of perception")
    records = []
    for ease in random.normal(0.4, 0.4, count).tolist():
        objects, hidden = int(random.poisson(20)) + 1, int(random.poisson(10)) + 1
        share = 1.0 / (1.0 + math.exp(-ease))
        right, wrong = int(random.binomial(objects, share)), int(random.poisson(10.0 * (1.0 - share)))
        scores = (
            np.rint(100.0 * np.concatenate([random.beta(4, 2, right), random.beta(2, 3, wrong)])) * FULL_SCORE // 100
        )
        codes = np.concatenate([np.ones(right), np.zeros(wrong)])
        found = int(random.binomial(hidden, share))
        tally = Tally(scores.astype("<u2").tobytes(), codes.astype("<u2").tobytes(), ((found, 0, 0),) * 3, 0.0)
        records.append(PerceptionRecord(1, (objects, 0, 0), (objects, 0, 0), (hidden, 0, 0), {"arm": tally}))
    return records


@pytest.fixture(scope="module")
def population() -> list[PerceptionRecord]:
    return perception_runs(2000)


@pytest.mark.statistical
@pytest.mark.parametrize("count", COUNTS)
def test_average_precision_and_recall_of_runs(population: list[PerceptionRecord], count: int) -> None:
    """A quarter of the samples: the standard error of a share of 95 % is 0.8 %."""
    whole = Pool(population, "arm")
    drawn = generator(count, "samples of runs").integers(0, len(population), (SAMPLES // 4, count)).tolist()
    pools = [Pool([population[number] for number in numbers], "arm") for numbers in drawn]
    precisions, recalls = [pool.precision(0) for pool in pools], [pool.hidden_recall(0) for pool in pools]
    assert LEAST <= coverage([(one.low, one.high) for one in precisions], whole.precision(0).value) <= MOST
    assert LEAST <= coverage([(one.low, one.high) for one in recalls], whole.hidden_recall(0).value) <= MOST


@pytest.mark.statistical
def test_boundary_of_success() -> None:
    """Credible intervals cover at least 95 % in the mean over the prior within the range.

    It is more with few runs, as the prior goes beyond the range. Of 100 searches, at least 88 cover with odds above 200
    to 1.
    """
    random = generator(1, "coverage of boundaries")
    covered: dict[int, list[bool]] = {count: [] for count in COUNTS}
    for _ in range(100):
        search = BoundarySearch(0.0, 1.0)
        place, width, sign = random.uniform(), 0.002 * 250.0 ** random.uniform(), random.choice((-1.0, 1.0))
        for value in random.uniform(size=COUNTS[-1]).tolist():
            search.add(value, bool(random.uniform() < 0.5 + 0.5 * math.tanh(sign * (value - place) / (2.0 * width))))
            if search.runs in covered:
                estimate = search.estimate()
                covered[search.runs].append(estimate.low <= place <= estimate.high)
    assert [len(one) for one in covered.values()] == [100] * len(COUNTS)
    assert all(np.mean(one) >= 0.88 for one in covered.values())

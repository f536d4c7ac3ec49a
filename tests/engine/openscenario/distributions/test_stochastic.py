"""Stochastic distributions: draws have the distribution of the file, and depend only on seed, parameter and run.

The seed is fixed, so each test has one outcome. Its odds, over all seeds, of failing for a right implementation are
the stated level of 1 in 1,000.
"""

import itertools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_distribution

Write = Callable[..., Path]

LEVEL = 0.001
RUNS = 4000
RANGE = '<Range lowerLimit="{}" upperLimit="{}"/>'


def drawn(path: Path) -> list[float]:
    return [float(run.parameters["P"]) for run in load_distribution(path)]


def normal(mean: float, variance: float, inside: str = "", kind: str = "NormalDistribution") -> str:
    return f'<{kind} expectedValue="{mean}" variance="{variance}">{inside}</{kind}>'


def poisson(mean: float, inside: str = "") -> str:
    return f'<PoissonDistribution expectedValue="{mean}">{inside}</PoissonDistribution>'


def uniform(lower: str, upper: str) -> str:
    return f"<UniformDistribution>{RANGE.format(lower, upper)}</UniformDistribution>"


def histogram(*bins: tuple[str, str, str]) -> str:
    one = '<Bin weight="{}">' + RANGE + "</Bin>"
    return "<Histogram>\n" + "\n".join(one.format(*given) for given in bins) + "\n</Histogram>"


def weighted(*elements: tuple[str, str]) -> str:
    inside = "".join('<Element value="{}" weight="{}"/>'.format(*one) for one in elements)
    return f"<ProbabilityDistributionSet>{inside}</ProbabilityDistributionSet>"


@pytest.mark.element("UniformDistribution", "NormalDistribution", "LogNormalDistribution")
@pytest.mark.parametrize(
    ("distribution", "expected"),
    [
        (uniform("-3", "5"), stats.uniform(-3, 8)),
        (normal(22.222, 10), stats.norm(22.222, math.sqrt(10))),
        (
            normal(22.222, 10, RANGE.format(15, 24)),
            stats.truncnorm((15 - 22.222) / math.sqrt(10), (24 - 22.222) / math.sqrt(10), 22.222, math.sqrt(10)),
        ),
        (normal(0, 4, RANGE.format(3, "INF")), stats.truncnorm(1.5, math.inf, 0, 2)),
        # 60 standard deviations from the mean the distribution is exponential with the rate 60 in this unit.
        (normal(0, 1, RANGE.format(60, 61)), stats.truncexpon(60, loc=60, scale=1 / 60)),
        (normal(0.5, 0.25, kind="LogNormalDistribution"), stats.lognorm(0.5, scale=math.exp(0.5))),
    ],
    ids=["uniform", "normal", "normal cut", "normal cut on one side", "normal far out", "log-normal"],
)
def test_draws_have_the_stated_distribution(stochastic: Write, distribution: str, expected: Any) -> None:
    values = drawn(stochastic(distribution, runs=RUNS))
    assert stats.kstest(values, expected.cdf).pvalue > LEVEL
    assert len(set(values)) == RUNS


@pytest.mark.element("LogNormalDistribution")
def test_log_normal_is_truncated_at_its_range(stochastic: Write) -> None:
    values = drawn(stochastic(normal(0, 1, RANGE.format(0.5, 2), kind="LogNormalDistribution"), runs=RUNS))
    whole = stats.lognorm(1)
    below, above = whole.cdf(0.5), whole.cdf(2)
    assert stats.kstest(values, lambda x: (whole.cdf(x) - below) / (above - below)).pvalue > LEVEL
    assert 0.5 <= min(values) < max(values) <= 2


@pytest.mark.element("Histogram")
def test_histogram_is_uniform_in_its_bins(stochastic: Write) -> None:
    values = drawn(stochastic(histogram(("1", "0", "1"), ("3", "2", "4"), ("0", "4", "9")), runs=RUNS))
    assert stats.kstest(values, lambda x: np.interp(x, [0, 1, 2, 4], [0, 0.25, 0.25, 1])).pvalue > LEVEL


@pytest.mark.element("PoissonDistribution")
@pytest.mark.parametrize(
    ("distribution", "support"),
    [
        (poisson(2.5), range(12)),
        (poisson(2.5, RANGE.format(1, 4)), range(1, 5)),
        (poisson(2.5, RANGE.format(6.5, "INF")), range(7, 15)),
        (poisson(40, RANGE.format("-INF", 30.5)), range(31)),
        (poisson(1000, RANGE.format(999, 1001)), range(999, 1002)),
    ],
)
def test_counts_have_the_stated_distribution(stochastic: Write, distribution: str, support: range) -> None:
    """Chi-squared test over counts with an expectation of at least five; the others are combined."""
    path = stochastic(distribution, runs=RUNS)
    texts = [run.parameters["P"] for run in load_distribution(path)]
    mean = float(distribution.split('"')[1])
    weights = stats.poisson(mean).pmf(np.array(support))
    expected = RUNS * weights / weights.sum()
    assert all(text.isdigit() for text in texts), "counts are written as whole numbers"
    observed = np.array([texts.count(str(count)) for count in support], dtype=float)
    often = expected >= 5
    frequencies = np.append(observed[often], RUNS - observed[often].sum())
    theory = np.append(expected[often], RUNS - expected[often].sum())
    if theory[-1] < 5:
        frequencies, theory = (np.append(each[:-2], each[-2:].sum()) for each in (frequencies, theory))
    assert stats.chisquare(frequencies, theory).pvalue > LEVEL
    assert {int(text) for text in texts} <= set(
        range(support.start, support.stop + (5 if "INF" in distribution else 0))
    )


@pytest.mark.element("ProbabilityDistributionSet")
def test_value_set_draws_follow_weights(stochastic: Write) -> None:
    texts = [
        run.parameters["P"]
        for run in load_distribution(
            stochastic(weighted(("car", "6"), ("van", "3"), ("", "0"), ("bus", "1")), runs=RUNS)
        )
    ]
    observed = [texts.count(value) for value in ("car", "van", "bus")]
    assert sum(observed) == RUNS, "what weighs nothing never comes"
    assert stats.chisquare(observed, [RUNS * share for share in (0.6, 0.3, 0.1)]).pvalue > LEVEL


class TestReproducibility:
    BODY = """<Stochastic numberOfTestRuns="{runs}" {seed}>{inside}</Stochastic>"""
    ONE = '<StochasticDistribution parameterName="{}">' + uniform("0", "1") + "</StochasticDistribution>"

    def values(self, path: Path, name: str = "A", seed: float = 0) -> list[str]:
        return [run.parameters[name] for run in load_distribution(path, seed=seed)]

    def test_run_does_not_depend_on_earlier_draws(self, stochastic: Write) -> None:
        path = stochastic(normal(0, 1), runs=50)
        forwards = [run.parameters for run in load_distribution(path)]
        runs = load_distribution(path)
        backwards = [runs[number].parameters for number in reversed(range(50))]
        assert backwards[::-1] == forwards
        assert runs[7].parameters == forwards[7]

    def test_run_does_not_depend_on_other_parameters_or_run_count(self, distribution_file: Write) -> None:
        one = self.BODY.format(runs=5, seed='randomSeed="3"', inside=self.ONE.format("A"))
        two = self.BODY.format(runs=9, seed='randomSeed="3"', inside=self.ONE.format("B") + self.ONE.format("A"))
        alone = self.values(distribution_file(one))
        path = distribution_file(two)
        assert self.values(path)[:5] == alone
        assert self.values(path, "B")[:5] != alone

    def test_parameters_are_independent(self, distribution_file: Write) -> None:
        inside = "".join(self.ONE.format(name) for name in "ABC")
        path = distribution_file(self.BODY.format(runs=RUNS, seed="", inside=inside))
        columns = [[float(text) for text in self.values(path, name)] for name in "ABC"]
        for left, right in itertools.combinations(columns, 2):
            assert stats.pearsonr(left, right).pvalue > LEVEL
            assert stats.pearsonr(left[1:], right[:-1]).pvalue > LEVEL

    def test_spread_of_draws_returns_the_first(self, stochastic: Write) -> None:
        assert list(load_distribution(stochastic(normal(0, 1), runs=50)).spread(3)) == [0, 1, 2]

    @pytest.mark.parametrize("seed", ["0", "7", "7.25", "-1", "1e300"])
    def test_random_seed_of_the_file_takes_precedence(self, distribution_file: Write, seed: str) -> None:
        given = distribution_file(self.BODY.format(runs=3, seed=f'randomSeed="{seed}"', inside=self.ONE.format("A")))
        assert self.values(given, seed=1) == self.values(given, seed=2)
        other = self.values(given)
        given = distribution_file(self.BODY.format(runs=3, seed='randomSeed="8"', inside=self.ONE.format("A")))
        assert self.values(given) != other

    def test_file_without_random_seed_uses_given_seed(self, distribution_file: Write) -> None:
        path = distribution_file(self.BODY.format(runs=3, seed="", inside=self.ONE.format("A")))
        assert self.values(path, seed=1) == self.values(path, seed=1)
        assert self.values(path, seed=1) != self.values(path, seed=2)

    def test_draws_of_a_seed_are_stable(self, stochastic: Write) -> None:
        """Recorded values: published results with a seed must be reproducible."""
        path = stochastic(uniform("0", "1"), runs=2)
        assert drawn(path) == pytest.approx(RECORDED, abs=0)


RECORDED = [0.04999420891592776, 0.5056805047517539]


@pytest.mark.parametrize(
    ("distribution", "line", "message"),
    [
        (uniform("2", "1"), 7, "the range from 2 to 1 is empty"),
        (uniform("-INF", "1"), 7, "the range from -inf to 1 is infinite"),
        (normal(0, 0), 7, "NormalDistribution has the variance 0; specify a number above zero"),
        (normal(0, -1), 7, "NormalDistribution has the variance -1"),
        ('<NormalDistribution expectedValue="INF" variance="1"/>', 7, "has the expected value inf"),
        (
            normal(0, 1, RANGE.format(0, 1), kind="LogNormalDistribution"),
            7,
            "Range has the lower limit 0; specify a limit above 0 for LogNormalDistribution",
        ),
        (normal(1e4, 1, kind="LogNormalDistribution"), 7, "has values that are not finite"),
        (poisson(-1), 7, "PoissonDistribution has the expected value -1"),
        (poisson(5, RANGE.format(2.2, 2.8)), 7, "has a range without a whole number"),
        (poisson(1, RANGE.format(10000, 10001)), 7, "has a probability of 0 in its range"),
        (histogram(("1", "0", "2"), ("1", "1", "3")), 9, "HistogramBin overlaps another bin"),
        (histogram(("0", "0", "2")), 7, "Histogram has weights with the sum 0"),
        (histogram(("-1", "0", "2"), ("2", "2", "3")), 8, "HistogramBin has the weight -1"),
        (weighted(("a", "NaN"), ("b", "1")), 7, "has the weight nan"),
        (
            '<UserDefinedDistribution type="mine">x</UserDefinedDistribution>',
            7,
            "write one of Histogram, LogNormalDistribution, NormalDistribution",
        ),
    ],
)
def test_invalid_distribution_error_has_line(stochastic: Write, distribution: str, line: int, message: str) -> None:
    path = stochastic(distribution)
    with pytest.raises(ScenarioError) as caught:
        load_distribution(path)
    assert [(diagnostic.source, diagnostic.line) for diagnostic in caught.value.diagnostics] == [(str(path), line)]
    assert message in str(caught.value)


def test_zero_test_runs_is_an_error(stochastic: Write) -> None:
    with pytest.raises(ScenarioError, match=r":5: Stochastic has numberOfTestRuns 0; specify a number above zero"):
        load_distribution(stochastic(uniform("0", "1"), runs=0))


def test_duplicate_parameter_is_an_error(distribution_file: Write) -> None:
    one = f'<StochasticDistribution parameterName="P">{uniform("0", "1")}</StochasticDistribution>\n'
    path = distribution_file(f'<Stochastic numberOfTestRuns="1">\n{one}{one}</Stochastic>')
    with pytest.raises(ScenarioError, match=":7: parameter 'P' is also varied by another distribution; see line 6"):
        load_distribution(path)


def test_log_normal_distribution_requires_version_1_3(distribution_file: Write) -> None:
    inside = normal(0, 1, kind="LogNormalDistribution")
    body = (
        '<Stochastic numberOfTestRuns="1"><StochasticDistribution parameterName="P">'
        f"{inside}</StochasticDistribution></Stochastic>"
    )
    with pytest.raises(ScenarioError, match=r"part of OpenSCENARIO since 1\.3; the version of the file is 1\.2"):
        load_distribution(distribution_file(body, minor=2))

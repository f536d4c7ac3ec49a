"""Stochastic distributions as quantile functions: a share of all outcomes, 0 to 1, gives a value.

A run needs one uniform number for each parameter, whatever the distribution and however it is cut off, so that no draw
depends on another. Weights count relative to their sum. What is cut off at a range keeps the distribution's shape in
the range; both limits belong to it.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from scipy.special import log_ndtr, ndtri_exp, pdtr, pdtrc

from eidrive_scenario.errors import Diagnostic
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.distributions.deterministic import (
    Assignments,
    place,
    refuse_user_defined,
    valid_range,
    varied_once,
)
from eidrive_scenario.openscenario.model import (
    Element,
    Histogram,
    HistogramBin,
    LogNormalDistribution,
    NormalDistribution,
    PoissonDistribution,
    ProbabilityDistributionSet,
    ProbabilityDistributionSetElement,
    Range,
    Stochastic,
    StochasticDistribution,
    UniformDistribution,
)
from eidrive_scenario.openscenario.values.parameters import Assignment, written
from eidrive_scenario.randomness import generator

Quantile = Callable[[float], "float | str"]
_SMALLEST, _LARGEST = 2.0**-54, 1 - 2.0**-53
_MOST_EVENTS = 2.0**53
"""Whole numbers beyond have no neighbors among floating-point numbers."""


def quantile_of(distribution: StochasticDistribution, collector: DiagnosticCollector) -> Quantile | None:
    """How the parameter's value follows from a share; None where the distribution is wrong, which is a finding."""
    chosen = distribution.chosen()
    build = _BUILD.get(type(chosen))
    if build is None:
        instead = ", ".join(sorted(kind.__name__ for kind in _BUILD))
        refuse_user_defined(chosen, distribution.parameter_name, f"one of {instead}", collector)
        return None
    before = len(collector.errors)
    quantile: Quantile = build(chosen, collector)
    if len(collector.errors) > before:
        return None
    for share in (_SMALLEST, _LARGEST):
        value = quantile(share)
        if isinstance(value, float) and not math.isfinite(value):
            _wrong(chosen, "reaches beyond what a number can hold", "cut it off at a Range", collector)
            return None
    return quantile


@dataclass(frozen=True)
class StochasticSampler:
    """A value for each parameter in each run; it depends on seed, parameter and run, on nothing drawn before.

    quantiles   by parameter
    names       the parameters, and where the file says how they are drawn
    """

    count: int
    seed: float
    quantiles: Mapping[str, Quantile]
    names: Mapping[str, Diagnostic]

    def at(self, index: int) -> Assignments:
        """The values in the run of that index."""
        return {name: Assignment(self._drawn(name, index), self.names[name]) for name in self.quantiles}

    def _drawn(self, name: str, run: int) -> str:
        share = float(generator(0, "parameter value distribution", repr(self.seed), name, run).random())
        value = self.quantiles[name](max(share, _SMALLEST))
        return value if isinstance(value, str) else written(value)


def draws_of(stochastic: Stochastic, seed: float, collector: DiagnosticCollector) -> StochasticSampler:
    """The distributions of the parameters; what is wrong with them becomes a finding.

    seed    for a file that names no randomSeed
    """
    if stochastic.number_of_test_runs < 1:
        message = "Stochastic asks for no test run"
        collector.error(message, "give a number above zero", source=stochastic.source, line=stochastic.line)
    distributions = stochastic.stochastic_distribution
    varied_once(((one.parameter_name, place(one)) for one in distributions), collector)
    found = {one.parameter_name: quantile_of(one, collector) for one in distributions}
    return StochasticSampler(
        stochastic.number_of_test_runs,
        float(seed if stochastic.random_seed is None else stochastic.random_seed),
        {name: quantile for name, quantile in found.items() if quantile is not None},
        {one.parameter_name: place(one) for one in distributions},
    )


def _uniform(given: UniformDistribution, collector: DiagnosticCollector) -> Quantile:
    valid_range(given.range, collector, finite=True)
    return partial(_from_range, given.range.lower_limit, given.range.upper_limit)


def _from_range(lower: float, upper: float, share: float) -> float:
    return min(max(lower * (1 - share) + upper * share, lower), upper)


def _normal(given: NormalDistribution, collector: DiagnosticCollector) -> Quantile:
    lower, upper = _limits(given.range, collector)
    _check_normal(given, collector)
    return partial(_from_normal, given.expected_value, math.sqrt(max(given.variance, 0)), lower, upper)


def _log_normal(given: LogNormalDistribution, collector: DiagnosticCollector) -> Quantile:
    """Expected value and variance are those of the logarithm: the standard lets the former be negative."""
    lower, upper = _limits(given.range, collector)
    _check_normal(given, collector)
    if given.range is not None and lower <= 0:
        _wrong(
            given.range, f"has the lower limit {written(lower)}", "that of LogNormalDistribution is above 0", collector
        )
    return partial(_from_log_normal, given.expected_value, math.sqrt(max(given.variance, 0)), max(lower, 0), upper)


def _check_normal(given: NormalDistribution | LogNormalDistribution, collector: DiagnosticCollector) -> None:
    if not math.isfinite(given.expected_value):
        _wrong(given, f"has the expected value {written(given.expected_value)}", "give a finite number", collector)
    if not 0 < given.variance < math.inf:
        _wrong(given, f"has the variance {written(given.variance)}", "give a number above zero", collector)


def _from_normal(mean: float, deviation: float, lower: float, upper: float, share: float) -> float:
    value = mean + deviation * _standard_normal((lower - mean) / deviation, (upper - mean) / deviation, share)
    return min(max(value, lower), upper)


def _from_log_normal(mean: float, deviation: float, lower: float, upper: float, share: float) -> float:
    low, high = (math.log(limit) if limit > 0 else -math.inf for limit in (lower, upper))
    with np.errstate(over="ignore"):
        value = float(np.exp(_from_normal(mean, deviation, low, high, share)))
    return min(max(value, lower), upper)


def _standard_normal(low: float, high: float, share: float) -> float:
    """The quantile of the standard normal distribution between two limits, exact in its tails too.

    Probabilities are kept as logarithms below the middle, where they have their full precision.
    """
    if low > 0:
        return -_standard_normal(-high, -low, 1 - share)
    below, above = float(log_ndtr(low)), float(log_ndtr(high))
    if above == -math.inf:
        return high
    ratio = math.exp(below - above)
    return min(max(float(ndtri_exp(above + math.log(ratio + share * (1 - ratio)))), low), high)


def _poisson(given: PoissonDistribution, collector: DiagnosticCollector) -> Quantile:
    mean = given.expected_value
    lower, upper = _limits(given.range, collector)
    low = max(0, math.ceil(lower)) if math.isfinite(lower) else 0
    high = math.floor(upper) if math.isfinite(upper) else None
    if not 0 < mean < _MOST_EVENTS:
        _wrong(
            given, f"has the expected value {written(mean)}", f"give one between 0 and {_MOST_EVENTS:.0f}", collector
        )
    elif high is not None and high < low:
        _wrong(given, "has a range without a whole number from 0 on", "it counts events", collector)
    elif _less(mean, low, high, None) == _less(mean, low, high, low):
        _wrong(given, "has no probability left in its range", "bring range and expected value together", collector)
    return partial(_from_poisson, mean, low, high)


def _from_poisson(mean: float, low: int, high: int | None, share: float) -> float:
    start, end = (_less(mean, low, high, count) for count in (low, None))
    wanted = start + share * (end - start)
    least, most = low - 1, high
    if most is None:
        most = max(low, int(mean)) + 1
        while _less(mean, low, high, most + 1) < wanted:
            least, most = most, 2 * most
    while most - least > 1:
        middle = (least + most) // 2
        if _less(mean, low, high, middle + 1) < wanted:
            least = middle
        else:
            most = middle
    return float(most)


def _less(mean: float, low: int, high: int | None, count: int | None) -> float:
    """The probability of fewer events than `count`, where None is one more than `high`.

    In the upper tail it is less by 1, a difference that cancels out, and keeps its precision.
    """
    if count is None:
        count = None if high is None else high + 1
    if low > mean:
        return 0.0 if count is None else -float(pdtrc(count - 1, mean)) if count > 0 else -1.0
    return 1.0 if count is None else float(pdtr(count - 1, mean)) if count > 0 else 0.0


def _histogram(given: Histogram, collector: DiagnosticCollector) -> Quantile:
    if all([valid_range(one.range, collector, finite=True) for one in given.bin]):
        _check_overlap(given.bin, collector)
    limits = tuple((one.range.lower_limit, one.range.upper_limit) for one in given.bin)
    return partial(_from_histogram, limits, _accumulated(given, given.bin, collector))


def _check_overlap(bins: tuple[HistogramBin, ...], collector: DiagnosticCollector) -> None:
    for before, after in pairwise(sorted(bins, key=lambda one: (one.range.lower_limit, one.range.upper_limit))):
        if after.range.lower_limit < before.range.upper_limit:
            later = max(before, after, key=lambda one: one.line)
            _wrong(later, "overlaps another", "the ranges of a histogram may only touch", collector)


def _from_histogram(limits: tuple[tuple[float, float], ...], accumulated: tuple[float, ...], share: float) -> float:
    index, within = _weighed(accumulated, share)
    return _from_range(*limits[index], within)


def _value_set(given: ProbabilityDistributionSet, collector: DiagnosticCollector) -> Quantile:
    values = tuple(one.value for one in given.element)
    return partial(_from_values, values, _accumulated(given, given.element, collector))


def _from_values(values: tuple[str, ...], accumulated: tuple[float, ...], share: float) -> str:
    return values[_weighed(accumulated, share)[0]]


def _accumulated(
    given: Element,
    parts: tuple[HistogramBin, ...] | tuple[ProbabilityDistributionSetElement, ...],
    collector: DiagnosticCollector,
) -> tuple[float, ...]:
    """The weights added up from the first part on."""
    for one in parts:
        if not 0 <= one.weight < math.inf:
            _wrong(one, f"has the weight {written(one.weight)}", "give a number from zero on", collector)
    sums = tuple(accumulate(one.weight for one in parts))
    if not 0 < sums[-1] < math.inf and all(0 <= one.weight < math.inf for one in parts):
        _wrong(given, f"has weights that add up to {written(sums[-1])}", "give weights above zero", collector)
    return sums


def _weighed(accumulated: tuple[float, ...], share: float) -> tuple[int, float]:
    """The part in which a share of all weights falls, and the share of that part's own weight."""
    reached = min(share * accumulated[-1], math.nextafter(accumulated[-1], 0))
    index = bisect_right(accumulated, reached)
    start = accumulated[index - 1] if index else 0.0
    return index, (reached - start) / (accumulated[index] - start)


def _limits(given: Range | None, collector: DiagnosticCollector) -> tuple[float, float]:
    if given is None:
        return -math.inf, math.inf
    valid_range(given, collector)
    return given.lower_limit, given.upper_limit


def _wrong(element: Element, what: str, hint: str, collector: DiagnosticCollector) -> None:
    kind = type(element).__name__
    collector.error(f"{kind} {what}", hint, source=element.source, line=element.line)


_BUILD: dict[type[Element], Callable[[Any, DiagnosticCollector], Quantile]] = {
    Histogram: _histogram,
    LogNormalDistribution: _log_normal,
    NormalDistribution: _normal,
    PoissonDistribution: _poisson,
    ProbabilityDistributionSet: _value_set,
    UniformDistribution: _uniform,
}

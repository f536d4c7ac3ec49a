"""Stochastic distributions as quantile functions of a probability from 0 to 1.

A run needs one uniform number per parameter for every distribution, truncated or not, so that no draw depends on
another one. Weights are relative to their sum. A distribution that is truncated at a range keeps its shape inside;
both limits belong to the range.
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

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.openscenario import model
from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector, Location
from eidrive_scenario.openscenario.distributions.deterministic import (
    Assignments,
    reject_user_defined,
    valid_range,
    varied_once,
)
from eidrive_scenario.openscenario.values.parameters import Assignment, format_value

Quantile = Callable[[float], "float | str"]
_SMALLEST, _LARGEST = 2.0**-54, 1 - 2.0**-53
_MAX_EVENTS = 2.0**53
"""Maximum expected number of events; adjacent integers above are not distinct in floating point."""


def quantile_of(distribution: model.StochasticDistribution, collector: DiagnosticCollector) -> Quantile | None:
    """Return the quantile function of a distribution; None if it is invalid, which is reported."""
    chosen = distribution.chosen()
    build = _BUILD.get(type(chosen))
    if build is None:
        instead = ", ".join(sorted(kind.__name__ for kind in _BUILD))
        reject_user_defined(chosen, distribution.parameter_name, f"one of {instead}", collector)
        return None
    before = len(collector.errors)
    quantile: Quantile = build(chosen, collector)
    if len(collector.errors) > before:
        return None
    for share in (_SMALLEST, _LARGEST):
        value = quantile(share)
        if isinstance(value, float) and not math.isfinite(value):
            _report(chosen, "has values that are not finite", "truncate it by a Range", collector)
            return None
    return quantile


@dataclass(frozen=True)
class StochasticSampler:
    """Values of each parameter in each run, which depend only on seed, parameter and number of the run.

    quantiles  quantile functions by parameter
    names      parameters, with the locations of their distributions
    """

    count: int
    seed: float
    quantiles: Mapping[str, Quantile]
    names: Mapping[str, Location]

    def at(self, index: int) -> Assignments:
        """Return the values in the run of an index."""
        return {name: Assignment(self._drawn(name, index), self.names[name]) for name in self.quantiles}

    def _drawn(self, name: str, run: int) -> str:
        share = float(generator(0, "parameter value distribution", repr(self.seed), name, run).random())
        value = self.quantiles[name](max(share, _SMALLEST))
        return value if isinstance(value, str) else format_value(value)


def draws_of(stochastic: model.Stochastic, seed: float, collector: DiagnosticCollector) -> StochasticSampler:
    """Return the sampler of all distributions; report their errors.

    seed  seed for a file without randomSeed
    """
    if stochastic.number_of_test_runs < 1:
        message = f"Stochastic has numberOfTestRuns {stochastic.number_of_test_runs}"
        collector.error(message, "specify a number above zero", at=stochastic)
    distributions = stochastic.stochastic_distribution
    varied_once(((distribution.parameter_name, Location.of(distribution)) for distribution in distributions), collector)
    quantiles = {distribution.parameter_name: quantile_of(distribution, collector) for distribution in distributions}
    return StochasticSampler(
        stochastic.number_of_test_runs,
        float(seed if stochastic.random_seed is None else stochastic.random_seed),
        {name: quantile for name, quantile in quantiles.items() if quantile is not None},
        {distribution.parameter_name: Location.of(distribution) for distribution in distributions},
    )


def _uniform(given: model.UniformDistribution, collector: DiagnosticCollector) -> Quantile:
    valid_range(given.range, collector, finite=True)
    return partial(_from_range, given.range.lower_limit, given.range.upper_limit)


def _from_range(lower: float, upper: float, share: float) -> float:
    return min(max(lower * (1 - share) + upper * share, lower), upper)


def _normal(given: model.NormalDistribution, collector: DiagnosticCollector) -> Quantile:
    lower, upper = _limits(given.range, collector)
    _check_normal(given, collector)
    return partial(_from_normal, given.expected_value, math.sqrt(max(given.variance, 0)), lower, upper)


def _log_normal(given: model.LogNormalDistribution, collector: DiagnosticCollector) -> Quantile:
    """Build the log-normal quantile; expected value and variance are those of the logarithm, as in the standard."""
    lower, upper = _limits(given.range, collector)
    _check_normal(given, collector)
    if given.range is not None and lower <= 0:
        _report(
            given.range,
            f"has the lower limit {format_value(lower)}",
            "specify a limit above 0 for LogNormalDistribution",
            collector,
        )
    return partial(_from_log_normal, given.expected_value, math.sqrt(max(given.variance, 0)), max(lower, 0), upper)


def _check_normal(
    given: model.NormalDistribution | model.LogNormalDistribution, collector: DiagnosticCollector
) -> None:
    if not math.isfinite(given.expected_value):
        _report(
            given, f"has the expected value {format_value(given.expected_value)}", "specify a finite number", collector
        )
    if not 0 < given.variance < math.inf:
        _report(given, f"has the variance {format_value(given.variance)}", "specify a number above zero", collector)


def _from_normal(mean: float, deviation: float, lower: float, upper: float, share: float) -> float:
    value = mean + deviation * _standard_normal((lower - mean) / deviation, (upper - mean) / deviation, share)
    return min(max(value, lower), upper)


def _from_log_normal(mean: float, deviation: float, lower: float, upper: float, share: float) -> float:
    low, high = (math.log(limit) if limit > 0 else -math.inf for limit in (lower, upper))
    with np.errstate(over="ignore"):
        value = float(np.exp(_from_normal(mean, deviation, low, high, share)))
    return min(max(value, lower), upper)


def _standard_normal(low: float, high: float, share: float) -> float:
    """Return the quantile of the truncated standard normal distribution, also exact in its tails.

    Probabilities are logarithms in the lower half, where they have full precision.
    """

    from scipy.special import log_ndtr, ndtri_exp

    if low > 0:
        return -_standard_normal(-high, -low, 1 - share)
    below, above = float(log_ndtr(low)), float(log_ndtr(high))
    if above == -math.inf:
        return high
    ratio = math.exp(below - above)
    return min(max(float(ndtri_exp(above + math.log(ratio + share * (1 - ratio)))), low), high)


def _poisson(given: model.PoissonDistribution, collector: DiagnosticCollector) -> Quantile:
    mean = given.expected_value
    lower, upper = _limits(given.range, collector)
    low = max(0, math.ceil(lower)) if math.isfinite(lower) else 0
    high = math.floor(upper) if math.isfinite(upper) else None
    if not 0 < mean < _MAX_EVENTS:
        _report(
            given,
            f"has the expected value {format_value(mean)}",
            f"specify one between 0 and {_MAX_EVENTS:.0f}",
            collector,
        )
    elif high is not None and high < low:
        _report(given, "has a range without a whole number from 0 on", "specify a range of event counts", collector)
    elif _less(mean, low, high, None) == _less(mean, low, high, low):
        _report(given, "has a probability of 0 in its range", "adapt the range or the expected value", collector)
    return partial(_from_poisson, mean, low, high)


def _from_poisson(mean: float, low: int, high: int | None, share: float) -> float:
    start, end = (_less(mean, low, high, count) for count in (low, None))
    target = start + share * (end - start)
    least, most = low - 1, high
    if most is None:
        most = max(low, int(mean)) + 1
        while _less(mean, low, high, most + 1) < target:
            least, most = most, 2 * most
    while most - least > 1:
        middle = (least + most) // 2
        if _less(mean, low, high, middle + 1) < target:
            least = middle
        else:
            most = middle
    return float(most)


def _less(mean: float, low: int, high: int | None, count: int | None) -> float:
    """Return the probability of fewer events than `count`; None is one more than `high`.

    In the upper tail the result is lower by 1. This offset cancels out, and the precision is preserved.
    """

    from scipy.special import pdtr, pdtrc

    if count is None:
        count = None if high is None else high + 1
    if low > mean:
        return 0.0 if count is None else -float(pdtrc(count - 1, mean)) if count > 0 else -1.0
    return 1.0 if count is None else float(pdtr(count - 1, mean)) if count > 0 else 0.0


def _histogram(given: model.Histogram, collector: DiagnosticCollector) -> Quantile:
    if all([valid_range(part.range, collector, finite=True) for part in given.bin]):
        _check_overlap(given.bin, collector)
    limits = tuple((part.range.lower_limit, part.range.upper_limit) for part in given.bin)
    return partial(_from_histogram, limits, _accumulated(given, given.bin, collector))


def _check_overlap(bins: tuple[model.HistogramBin, ...], collector: DiagnosticCollector) -> None:
    for before, after in pairwise(sorted(bins, key=lambda part: (part.range.lower_limit, part.range.upper_limit))):
        if after.range.lower_limit < before.range.upper_limit:
            later = max(before, after, key=lambda part: part.line or 0)
            _report(later, "overlaps another bin", "specify disjoint ranges", collector)


def _from_histogram(limits: tuple[tuple[float, float], ...], accumulated: tuple[float, ...], share: float) -> float:
    index, within = _select_part(accumulated, share)
    return _from_range(*limits[index], within)


def _value_set(given: model.ProbabilityDistributionSet, collector: DiagnosticCollector) -> Quantile:
    values = tuple(element.value for element in given.element)
    return partial(_from_values, values, _accumulated(given, given.element, collector))


def _from_values(values: tuple[str, ...], accumulated: tuple[float, ...], share: float) -> str:
    return values[_select_part(accumulated, share)[0]]


def _accumulated(
    given: model.Element,
    parts: tuple[model.HistogramBin, ...] | tuple[model.ProbabilityDistributionSetElement, ...],
    collector: DiagnosticCollector,
) -> tuple[float, ...]:
    """Return the cumulative weights; report invalid ones."""
    for part in parts:
        if not 0 <= part.weight < math.inf:
            _report(part, f"has the weight {format_value(part.weight)}", "specify a number of at least zero", collector)
    sums = tuple(accumulate(part.weight for part in parts))
    if not 0 < sums[-1] < math.inf and all(0 <= part.weight < math.inf for part in parts):
        _report(given, f"has weights with the sum {format_value(sums[-1])}", "specify weights above zero", collector)
    return sums


def _select_part(accumulated: tuple[float, ...], share: float) -> tuple[int, float]:
    """Return the part that contains a share of the total weight, and the relative position inside."""
    reached = min(share * accumulated[-1], math.nextafter(accumulated[-1], 0))
    index = bisect_right(accumulated, reached)
    start = accumulated[index - 1] if index else 0.0
    return index, (reached - start) / (accumulated[index] - start)


def _limits(given: model.Range | None, collector: DiagnosticCollector) -> tuple[float, float]:
    if given is None:
        return -math.inf, math.inf
    valid_range(given, collector)
    return given.lower_limit, given.upper_limit


def _report(element: model.Element, what: str, hint: str, collector: DiagnosticCollector) -> None:
    kind = type(element).__name__
    collector.error(f"{kind} {what}", hint, at=element)


_BUILD: dict[type[model.Element], Callable[[Any, DiagnosticCollector], Quantile]] = {
    model.Histogram: _histogram,
    model.LogNormalDistribution: _log_normal,
    model.NormalDistribution: _normal,
    model.PoissonDistribution: _poisson,
    model.ProbabilityDistributionSet: _value_set,
    model.UniformDistribution: _uniform,
}

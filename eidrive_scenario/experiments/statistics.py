"""Statistics of repeated runs: means, proportions with intervals, and paired comparisons."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import binomtest, bootstrap

from eidrive_scenario.arrays import Array
from eidrive_scenario.randomness import generator


@dataclass(frozen=True)
class Summary:
    """Summary of a sample, in the unit of its values."""

    count: int
    mean: float
    population_sd: float
    """Standard deviation with divisor n, as in the tables of the paper."""
    sample_sd: float
    """Standard deviation with divisor n - 1; NaN for a single value."""
    smallest: float
    largest: float


def summarize(values: Sequence[float]) -> Summary:
    """Return the summary of at least one finite value. Raise ValueError otherwise."""
    sample = np.asarray(values, dtype=np.float64)
    if sample.ndim != 1 or not len(sample) or not np.isfinite(sample).all():
        raise ValueError(f"sample: not a list of finite numbers (got {values!r})")
    return Summary(
        count=len(sample),
        mean=float(sample.mean()),
        population_sd=float(sample.std()),
        sample_sd=float(sample.std(ddof=1)) if len(sample) > 1 else math.nan,
        smallest=float(sample.min()),
        largest=float(sample.max()),
    )


@dataclass(frozen=True)
class Proportion:
    """Proportion k/n with the confidence interval of the true proportion."""

    successes: int
    trials: int
    low: float
    high: float
    confidence: float

    @property
    def share(self) -> float:
        """Observed proportion k/n."""
        return self.successes / self.trials


def wilson(successes: int, trials: int, confidence: float = 0.95) -> Proportion:
    """Return a proportion with its score interval (Wilson 1927), which is valid for 0 of n and n of n, too.

    Raise ValueError if `successes` is not within 0 … `trials`, there is no trial, or `confidence` is not within (0, 1).
    """
    if trials < 1 or not 0 <= successes <= trials:
        raise ValueError(f"proportion: invalid counts (got {successes} of {trials})")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence: not between 0 and 1 (got {confidence})")
    interval = binomtest(successes, trials).proportion_ci(confidence, method="wilson")
    return Proportion(successes, trials, float(interval.low), float(interval.high), confidence)


@dataclass(frozen=True)
class MeanInterval:
    """Mean of a sample with its bootstrap interval, in the unit of its values."""

    mean: float
    low: float
    high: float


def mean_interval(values: Sequence[float], *, confidence: float = 0.95) -> MeanInterval:
    """Return the mean of at least one value with its percentile bootstrap interval, of zero width for a single value.

    The bootstrap, because minimum distances of runs with and without a crash have two modes.
    """
    difference = paired_difference([0.0] * len(values), values, confidence=confidence)
    return MeanInterval(difference.mean, difference.low, difference.high)


@dataclass(frozen=True)
class PairedDifference:
    """Difference, second minus first, of pairs with equal seeds, with its bootstrap interval."""

    pairs: int
    mean: float
    low: float
    high: float
    confidence: float


def paired_difference(
    first: Sequence[float], second: Sequence[float], *, confidence: float = 0.95, resamples: int = 10_000, seed: int = 0
) -> PairedDifference:
    """Compare the means of two arms with equal seeds in equal order (percentile bootstrap over the pairs).

    A single pair has an interval of zero width. Raise ValueError if the arms differ in length or are empty.
    """
    return _compare(_mean_difference, first, second, confidence, resamples, seed)


def paired_spread(
    first: Sequence[float], second: Sequence[float], *, confidence: float = 0.95, resamples: int = 10_000, seed: int = 0
) -> PairedDifference:
    """Compare the population standard deviations of two arms as `paired_difference` compares their means."""
    return _compare(_spread_difference, first, second, confidence, resamples, seed)


def paired_ratio(
    first: Sequence[float], second: Sequence[float], *, confidence: float = 0.95, resamples: int = 10_000, seed: int = 0
) -> PairedDifference:
    """Return the ratio of the means, second over first, as `paired_difference` returns their difference.

    Raise ValueError if a value of the first arm is not positive, too.
    """
    if min(first, default=1.0) <= 0.0:
        raise ValueError(f"ratio: not positive (got {min(first)})")
    return _compare(_mean_ratio, first, second, confidence, resamples, seed)


def _mean_ratio(first: Array, second: Array, axis: int = -1) -> Any:
    return np.mean(second, axis=axis) / np.mean(first, axis=axis)


def _mean_difference(first: Array, second: Array, axis: int = -1) -> Any:
    return np.mean(second - first, axis=axis)


def _spread_difference(first: Array, second: Array, axis: int = -1) -> Any:
    return np.std(second, axis=axis) - np.std(first, axis=axis)


def _compare(
    difference: Callable[..., Any],
    first: Sequence[float],
    second: Sequence[float],
    confidence: float,
    resamples: int,
    seed: int,
) -> PairedDifference:
    if len(first) != len(second) or not first:
        raise ValueError(f"pairs: lengths differ or are 0 (got {len(first)} and {len(second)} values)")
    arms = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)

    value = float(difference(*arms))
    low, high = value, value
    if len(first) > 1:
        interval = bootstrap(
            arms,
            difference,
            paired=True,
            n_resamples=resamples,
            confidence_level=confidence,
            method="percentile",
            rng=generator(seed, "paired bootstrap"),
        ).confidence_interval
        low, high = float(interval.low), float(interval.high)
    return PairedDifference(pairs=len(first), mean=value, low=low, high=high, confidence=confidence)

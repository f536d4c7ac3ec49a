"""Paired comparisons of two settings with common random numbers: equal seeds have equal starts, noise and losses."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.stats import binom, binomtest, bootstrap, norm

from eidrive_scenario.arrays import Array
from eidrive_scenario.randomness import generator


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


@dataclass(frozen=True)
class PairedVerdicts:
    """Verdicts of two settings with equal seeds: numbers of pairs by outcome."""

    both: int
    only_first: int
    only_second: int
    neither: int

    @classmethod
    def of(cls, first: Sequence[bool], second: Sequence[bool]) -> PairedVerdicts:
        """Return the numbers of pairs in which both, one or no setting passed. Raise ValueError for unequal lengths."""
        if len(first) != len(second):
            raise ValueError(f"pairs: lengths differ (got {len(first)} and {len(second)} verdicts)")
        counts = [sum((a, b) == pair for a, b in zip(first, second, strict=True)) for pair in _OUTCOMES]
        return cls(*counts)

    @property
    def pairs(self) -> int:
        """Number of pairs."""
        return self.both + self.only_first + self.only_second + self.neither

    @property
    def difference(self) -> float:
        """Success rate of the second setting minus that of the first one. Raise ZeroDivisionError without a pair."""
        return (self.only_second - self.only_first) / self.pairs

    def p_value(self, *, mid: bool = False) -> float:
        """Return the two-sided p-value of McNemar's exact test that both settings have one success rate.

        mid  the mid-p value, which is less conservative (Fagerland, Lydersen and Laake, BMC Medical Research
             Methodology 13:91, 2013)
        """
        discordant = self.only_first + self.only_second
        if discordant == 0:
            return 1.0
        fewer = min(self.only_first, self.only_second)
        exact = float(binomtest(fewer, discordant).pvalue)
        return max(0.0, exact - float(binom.pmf(fewer, discordant, 0.5))) if mid else exact

    def interval(self, confidence: float = 0.95) -> tuple[float, float]:
        """Return the score interval of the difference of the success rates (Tango, Statistics in Medicine 17, 1998).

        It contains 0 if and only if McNemar's test without correction does not reject. Raise ValueError without a pair,
        or for a confidence out of (0, 1).
        """
        if not self.pairs:
            raise ValueError("pairs: there is none")
        if not 0.0 < confidence < 1.0:
            raise ValueError(f"confidence: not between 0 and 1 (got {confidence})")
        bound = float(norm.ppf(0.5 + confidence / 2.0))
        low = _root(lambda difference: self._score(difference) - bound, -1.0, self.difference)
        high = _root(lambda difference: self._score(difference) + bound, self.difference, 1.0)
        return low, high

    def p_value_worse(self, margin: float = 0.0) -> float:
        """Return the one-sided p-value of the score test that the second rate is lower by `margin` or more.

        A small value shows that the second setting is not worse than the first one by the margin (non-inferiority).
        Raise ValueError without a pair, or for a margin out of [0, 1).
        """
        if not self.pairs:
            raise ValueError("pairs: there is none")
        if not 0.0 <= margin < 1.0:
            raise ValueError(f"margin: not between 0 and 1 (got {margin})")
        return float(norm.sf(self._score(-margin)))

    def _score(self, difference: float) -> float:
        """Return the score statistic of a true difference; its limits are infinite at the ends of [-1, 1]."""
        gained, lost, count = self.only_second, self.only_first, self.pairs
        offset = gained - lost - count * difference
        b = -gained - lost + (2 * count - gained + lost) * difference
        c = -lost * difference * (1.0 - difference)
        q = (math.sqrt(max(b * b - 8.0 * count * c, 0.0)) - b) / (4.0 * count)
        variance = count * (2.0 * q + difference * (1.0 - difference))
        if variance <= 0.0:
            return 0.0 if offset == 0.0 else math.copysign(math.inf, offset)
        return offset / math.sqrt(variance)


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the root of a decreasing function in an interval, or the end beside which there is none."""
    if function(low) <= 0.0:
        return low
    if function(high) >= 0.0:
        return high
    return float(brentq(lambda x: max(-1e6, min(1e6, function(x))), low, high, xtol=1e-12))


_OUTCOMES = ((True, True), (True, False), (False, True), (False, False))

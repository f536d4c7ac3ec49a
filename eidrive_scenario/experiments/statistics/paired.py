"""Paired comparisons of two settings with common random numbers: equal seeds have equal starts, noise and losses."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import binom, binomtest, norm

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.experiments.statistics.intervals import jackknife_interval, mean_interval

LEAST_PAIRS = 5
"""Minimum number of pairs for the interval of a difference of standard deviations, of which fewer say too little."""


@dataclass(frozen=True)
class PairedDifference:
    """Difference, second minus first, of pairs with equal seeds, with its confidence interval.

    low, high  limits; NaN if there are too few pairs, such as a single one
    """

    pairs: int
    mean: float
    low: float
    high: float
    confidence: float


def paired_difference(first: Sequence[float], second: Sequence[float], *, confidence: float = 0.95) -> PairedDifference:
    """Compare the means of two arms with equal seeds in equal order (Student's t interval of the differences).

    Differences that are all equal have an interval of zero width; for verdicts use `PairedVerdicts`. Raise ValueError
    if the arms differ in length or are empty, or for values that are not finite.
    """
    arms = _arms(first, second)
    interval = mean_interval((arms[1] - arms[0]).tolist(), confidence=confidence)
    return PairedDifference(len(first), interval.mean, interval.low, interval.high, confidence)


def paired_ratio(first: Sequence[float], second: Sequence[float], *, confidence: float = 0.95) -> PairedDifference:
    """Return the ratio of the means, second over first, as `paired_difference` returns their difference.

    The interval is that of the logarithm of the ratio, by the jackknife. Raise ValueError if a value is not positive,
    too.
    """
    arms = _arms(first, second)
    least = min(float(arm.min()) for arm in arms)
    if least <= 0.0:
        raise ValueError(f"ratio: not positive (got {least})")
    ratio = float(arms[1].mean() / arms[0].mean())
    if len(first) == 1:
        return PairedDifference(1, ratio, math.nan, math.nan, confidence)
    # Not the total less each value, whose rounding error may exceed the others
    sums = [np.where(np.eye(len(arm), dtype=bool), 0.0, arm).sum(axis=1) for arm in arms]
    left_out = np.log(sums[1]) - np.log(sums[0])
    interval = jackknife_interval(math.log(ratio), left_out.tolist(), confidence=confidence)
    return PairedDifference(len(first), ratio, _exponential(interval.low), _exponential(interval.high), confidence)


def paired_spread(first: Sequence[float], second: Sequence[float], *, confidence: float = 0.95) -> PairedDifference:
    """Compare the population standard deviations of two arms as `paired_difference` compares their means.

    The interval follows from those of both arms and their correlation (Zou, Psychological Methods 12, 2007). That of an
    arm is the jackknife interval of the logarithm of its standard deviation (Miller, Annals of Mathematical Statistics
    39, 1968), which does not assume normal values. There are limits from LEAST_PAIRS pairs on.
    """
    arms = _arms(first, second)
    deviations = [float(arm.std()) for arm in arms]
    difference, count = deviations[1] - deviations[0], len(first)
    if count < LEAST_PAIRS:
        return PairedDifference(count, difference, math.nan, math.nan, confidence)
    left_out = [_log_deviations(arm) for arm in arms]
    (below_first, above_first), (below_second, above_second) = (
        _margins(deviation, logarithms, confidence) for deviation, logarithms in zip(deviations, left_out, strict=True)
    )
    is_constant = min(float(np.ptp(logarithms)) for logarithms in left_out) == 0.0
    correlation = 0.0 if is_constant else float(np.asarray(np.corrcoef(left_out[0], left_out[1]))[0, 1])
    low = difference - _combined(below_second, above_first, correlation)
    high = difference + _combined(above_second, below_first, correlation)
    return PairedDifference(count, difference, low, high, confidence)


def _log_deviations(arm: Array) -> Array:
    """Return the logarithms of the standard deviation without each value (N,), relative to that of all values.

    A value that alone makes up the variance would leave none; the rest is at least 1/N² of it.
    """
    squares, count = (arm - arm.mean()) ** 2, len(arm)
    total = float(squares.sum())
    if total == 0.0:
        return np.zeros(count)
    rest = 1.0 - count / (count - 1) * squares / total
    return np.asarray(0.5 * np.log(np.maximum(rest, 1.0 / count**2) * (count - 1) / (count - 2)))


def _margins(deviation: float, left_out: Array, confidence: float) -> tuple[float, float]:
    """Return the distances of the limits of a standard deviation from it, below and above."""
    half_width = jackknife_interval(0.0, left_out.tolist(), confidence=confidence).high
    return deviation * (1.0 - _exponential(-half_width)), deviation * (_exponential(half_width) - 1.0)


def _combined(first: float, second: float, correlation: float) -> float:
    return math.sqrt(max(0.0, first**2 + second**2 - 2.0 * correlation * first * second))


def _exponential(logarithm: float) -> float:
    """Return the exponential function, bounded to finite numbers."""
    return math.exp(min(logarithm, 700.0))


def _arms(first: Sequence[float], second: Sequence[float]) -> tuple[Array, Array]:
    if len(first) != len(second) or not first:
        raise ValueError(f"pairs: lengths differ or are 0 (got {len(first)} and {len(second)} values)")
    return np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)


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
        if not mid:
            return exact
        # Equal counts are the limit of both tails, whose sum is 1 and not 1 + point
        point = float(binom.pmf(fewer, discordant, 0.5))
        return exact - (point if self.only_first != self.only_second else point / 2.0)

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

"""Proportions of runs and means of samples with their confidence intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import betaln, stdtrit


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
        """Observed proportion k/n; NaN without a run."""
        return self.successes / self.trials if self.trials else math.nan


def wilson(successes: int, trials: int, confidence: float = 0.95) -> Proportion:
    """Return a proportion with its score interval (Wilson 1927), which is valid for 0 of n and n of n, too.

    Raise ValueError if `successes` is not within 0 … `trials`, there is no trial, or `confidence` is not within (0, 1).
    """
    return _interval(successes, trials, confidence, "wilson")


def clopper_pearson(successes: int, trials: int, confidence: float = 0.95) -> Proportion:
    """Return a proportion with its exact interval (Clopper and Pearson 1934), which covers at least at `confidence`.

    Errors as for `wilson`.
    """
    return _interval(successes, trials, confidence, "exact")


def _interval(successes: int, trials: int, confidence: float, method: Literal["wilson", "exact"]) -> Proportion:
    from scipy.stats import binomtest  # takes half a second, which a run without statistics need not spend

    _check_proportion(successes, trials, confidence)
    interval = binomtest(successes, trials).proportion_ci(confidence, method=method)
    return Proportion(successes, trials, float(interval.low), float(interval.high), confidence)


def anytime_interval(successes: int, trials: int, confidence: float = 0.95) -> Proportion:
    """Return a proportion with the interval of a confidence sequence.

    The intervals after 1, 2, 3 … runs all cover the true proportion at the same time with at least this confidence, so
    that they are valid while runs are added, and a series may be stopped because of them. The interval contains all p
    for which the mixture of the likelihood over a uniform prior is less than 1 / alpha times the likelihood of p
    (Robbins, Statistical methods related to the law of the iterated logarithm, 1970; Howard et al., Time-uniform,
    nonparametric, nonasymptotic confidence sequences, Annals of Statistics 49(2), 2021). Without a run it is 0 to 1.
    Errors as for `wilson`.
    """

    from scipy.optimize import brentq

    if trials == 0 and successes == 0:
        _check_proportion(0, 1, confidence)
        return Proportion(0, 0, 0.0, 1.0, confidence)
    _check_proportion(successes, trials, confidence)
    failures = trials - successes
    bound = -math.log1p(-confidence)
    mixture = float(betaln(successes + 1, failures + 1))

    def excess(p: float) -> float:
        likelihood = (successes * math.log(p) if successes else 0.0) + (failures * math.log1p(-p) if failures else 0.0)
        return mixture - likelihood - bound

    share, least = successes / trials, 1e-15
    low = float(brentq(excess, least, share)) if successes and excess(least) > 0.0 else 0.0
    high = float(brentq(excess, share, 1.0 - least)) if failures and excess(1.0 - least) > 0.0 else 1.0
    return Proportion(successes, trials, low, high, confidence)


def _check_proportion(successes: int, trials: int, confidence: float) -> None:
    if trials < 1 or not 0 <= successes <= trials:
        raise ValueError(f"proportion: invalid counts (got {successes} of {trials})")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence: not between 0 and 1 (got {confidence})")


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
class MeanInterval:
    """Mean of a sample with its confidence interval, in the unit of its values.

    low, high  limits; NaN for a single value, whose spread is unknown
    """

    mean: float
    low: float
    high: float


def mean_interval(values: Sequence[float], *, confidence: float = 0.95) -> MeanInterval:
    """Return the mean of at least one finite value with Student's t interval (Student, Biometrika 6, 1908).

    It covers at `confidence` for normal values, for any number of them from 2 on. The percentile bootstrap does not: it
    is about 1.96 sqrt(1 - 1/n) standard errors wide on each side, which covers less than 80 % of the means of three
    values. Outliers rarer than 1 in n are in few samples and not in their intervals. Equal values have an interval of
    zero width. Raise ValueError without values, for values that are not finite, or a confidence out of (0, 1).
    """
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence: not between 0 and 1 (got {confidence})")
    summary = summarize(values)
    quantile = float(stdtrit(summary.count - 1, 0.5 + confidence / 2.0))
    half_width = quantile * summary.sample_sd / math.sqrt(summary.count)
    return MeanInterval(summary.mean, summary.mean - half_width, summary.mean + half_width)


def jackknife_interval(value: float, left_out: Sequence[float], *, confidence: float = 0.95) -> MeanInterval:
    """Return a smooth function of a sample with Student's t interval of its pseudo-values (Tukey 1958).

    value     of the whole sample
    left_out  of the sample without each of its n elements in turn

    The pseudo-values n · value - (n - 1) · left_out take the place of single measurements: of a mean, they are the
    values themselves. Errors as for `mean_interval`.
    """
    count = len(left_out)
    pseudo_values = count * value - (count - 1) * np.asarray(left_out, dtype=np.float64)
    interval = mean_interval(pseudo_values.tolist(), confidence=confidence)
    return MeanInterval(value, value + interval.low - interval.mean, value + interval.high - interval.mean)


def percentage(share: float, decimals: int = 1, sign: str = "") -> str:
    """Return a share as text in percent, with further decimals if it would be 0 or 100 % without being so."""
    digits = next((digits for digits in range(decimals, 10) if round(100.0 * share, digits) % 100.0), decimals)
    return f"{share:{sign}.{digits}%}"


def exact_percentage(setting: float, decimals: int = 0) -> str:
    """Return a setting, such as a confidence, as text in percent with all its decimals."""
    value = 100.0 * setting
    digits = next((digits for digits in range(decimals, 10) if math.isclose(round(value, digits), value)), 10)
    return f"{setting:.{digits}%}"


def interval_text(low: float, high: float, form: str) -> str:
    """Return the limits of an interval as text, with a format specification such as `+.2f`."""
    return "no interval, too few values" if math.isnan(low) else f"{low:{form}} to {high:{form}}"

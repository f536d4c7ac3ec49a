"""Summaries of samples, and intervals of their means."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit


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
    half_width = _quantile(summary.count, confidence) * summary.sample_sd / math.sqrt(summary.count)
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


def _quantile(count: int, confidence: float) -> float:
    """Return the quantile of Student's t distribution for `count` values; NaN for a single one."""
    return float(stdtrit(count - 1, 0.5 + confidence / 2.0)) if count > 1 else math.nan


def interval_text(low: float, high: float, form: str) -> str:
    """Return the limits of an interval as text, with a format specification such as `+.2f`."""
    return "no interval, too few values" if math.isnan(low) else f"{low:{form}} to {high:{form}}"

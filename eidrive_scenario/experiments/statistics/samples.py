"""Summaries of samples, and intervals of their means."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.experiments.statistics.paired import paired_difference


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

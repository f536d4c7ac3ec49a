"""What a handful of runs allows one to say: means, shares with an interval, and paired comparisons."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from eidrive_scenario.randomness import generator


@dataclass(frozen=True)
class Summary:
    """A sample in a few numbers, in the unit of its values."""

    count: int
    mean: float
    population_sd: float
    """Divided by n: what the paper's tables give."""
    sample_sd: float
    """Divided by n - 1; NaN for a single value."""
    smallest: float
    largest: float


def summarize(values: Sequence[float]) -> Summary:
    """The summary of at least one finite value. Raise ValueError otherwise."""
    sample = np.asarray(values, dtype=np.float64)
    if sample.ndim != 1 or not len(sample) or not np.isfinite(sample).all():
        raise ValueError(f"expected a list of finite numbers, not {values!r}")
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
    """k of n, and the interval in which the true share lies with the given confidence."""

    successes: int
    trials: int
    low: float
    high: float
    confidence: float

    @property
    def share(self) -> float:
        """k / n."""
        return self.successes / self.trials


def wilson(successes: int, trials: int, confidence: float = 0.95) -> Proportion:
    """A share with its score interval (Wilson 1927), which behaves at 0 of n and n of n where mean ± sd does not.

    Raise ValueError where `successes` is not within 0 … `trials`, or there is no trial.
    """
    if trials < 1 or not 0 <= successes <= trials:
        raise ValueError(f"{successes} of {trials} is no share")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence is {confidence}, expected a number between 0 and 1")
    z = NormalDist().inv_cdf(0.5 + confidence / 2)
    share = successes / trials
    center = share + z * z / (2 * trials)
    half = z * math.sqrt(share * (1 - share) / trials + z * z / (4 * trials * trials))
    scale = 1 + z * z / trials
    low = 0.0 if successes == 0 else (center - half) / scale
    high = 1.0 if successes == trials else (center + half) / scale
    return Proportion(successes, trials, low, high, confidence)


@dataclass(frozen=True)
class PairedDifference:
    """Second minus first of pairs that share a seed, with a bootstrap interval of the mean."""

    pairs: int
    mean: float
    low: float
    high: float
    confidence: float
    larger: int
    """Pairs in which the second is larger."""
    smaller: int

    @property
    def clear(self) -> bool:
        """True where the interval leaves zero out."""
        return self.low > 0.0 or self.high < 0.0


def paired_difference(
    first: Sequence[float], second: Sequence[float], *, confidence: float = 0.95, resamples: int = 10_000, seed: int = 0
) -> PairedDifference:
    """Compare two arms run with the same seeds, given in the same order (percentile bootstrap over the pairs).

    Raise ValueError where the two do not pair up.
    """
    if len(first) != len(second) or not first:
        raise ValueError(f"{len(first)} and {len(second)} values do not pair up")
    difference = np.asarray(second, dtype=np.float64) - np.asarray(first, dtype=np.float64)
    rows = generator(seed, "paired bootstrap").integers(0, len(difference), size=(resamples, len(difference)))
    tail = 50.0 * (1.0 - confidence)
    low, high = np.percentile(difference[rows].mean(axis=1), [tail, 100.0 - tail])
    return PairedDifference(
        pairs=len(difference),
        mean=float(difference.mean()),
        low=float(low),
        high=float(high),
        confidence=confidence,
        larger=int((difference > 0).sum()),
        smaller=int((difference < 0).sum()),
    )


@dataclass(frozen=True)
class PairedOutcomes:
    """Pass or fail of pairs that share a seed. `p_value` is McNemar's exact two-sided test."""

    both: int
    first_only: int
    second_only: int
    neither: int
    p_value: float


def paired_outcomes(first: Sequence[bool], second: Sequence[bool]) -> PairedOutcomes:
    """Do two arms pass equally often? Only the pairs that disagree tell (McNemar 1947, exact binomial form).

    Raise ValueError where the two do not pair up.
    """
    if len(first) != len(second) or not first:
        raise ValueError(f"{len(first)} and {len(second)} outcomes do not pair up")
    counts = {(a, b): 0 for a in (True, False) for b in (True, False)}
    for a, b in zip(first, second, strict=True):
        counts[bool(a), bool(b)] += 1
    disagree = counts[True, False] + counts[False, True]
    fewer = min(counts[True, False], counts[False, True])
    tail = sum(math.comb(disagree, i) for i in range(fewer + 1)) / 2**disagree
    return PairedOutcomes(
        both=counts[True, True],
        first_only=counts[True, False],
        second_only=counts[False, True],
        neither=counts[False, False],
        p_value=min(1.0, 2.0 * tail),
    )

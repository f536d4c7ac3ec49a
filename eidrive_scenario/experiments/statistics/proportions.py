"""Proportions of runs with confidence intervals, for a fixed number of runs and for one that grows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal


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

    _check(successes, trials, confidence)
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
    from scipy.special import betaln

    if trials == 0 and successes == 0:
        _check(0, 1, confidence)
        return Proportion(0, 0, 0.0, 1.0, confidence)
    _check(successes, trials, confidence)
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


def _check(successes: int, trials: int, confidence: float) -> None:
    if trials < 1 or not 0 <= successes <= trials:
        raise ValueError(f"proportion: invalid counts (got {successes} of {trials})")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence: not between 0 and 1 (got {confidence})")

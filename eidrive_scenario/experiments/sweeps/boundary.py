"""Boundary of success: the value of one axis at which the success rate crosses a bound, from noisy outcomes.

Adaptive Bayesian estimation of a curve, as in psychophysics (Kontsevich and Tyler, Bayesian adaptive estimation of
psychometric slope and threshold, Vision Research 39, 1999). The success rate at x is

    p(x) = lapse / 2 + (1 - lapse) / (1 + exp(-(d (x - m) / s + c))),    p(m) = bound,

with the boundary m, the width s, the direction d = 1 or -1, and a share of outcomes that do not depend on x. The prior
is uniform in m over the range and half of its length on either side, in log s, d and the lapses. The next run is at the
value with the minimum expected entropy of m. Unlike in plain bisection, no single outcome is final.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.arrays import Array

PLACES = 241
"""Number of tested boundaries, over the range and half of its length on either side."""
WIDTHS = 12
"""Number of tested widths."""
NARROWEST, WIDEST = 0.002, 0.5
"""Minimum and maximum width s, as a share of the range."""
LAPSES = (0.0, 0.02, 0.1)
"""Tested shares of outcomes that do not depend on the value."""
TRIED = 61
"""Number of values among which the next run is chosen."""


@dataclass(frozen=True)
class Boundary:
    """Estimate of a boundary.

    value      median of the boundary; NaN if it is not in the range
    low, high  limits of the credible interval; the ends of the range if it extends beyond them
    inside     probability that the boundary is in the range
    rising     probability that the success rate rises with the value
    runs       number of runs
    """

    value: float
    low: float
    high: float
    inside: float
    rising: float
    runs: int


class BoundarySearch:
    """Search of the value in [low, high] at which the success rate crosses `bound`.

    Raise ValueError for an empty range, or a bound out of (0, 1).
    """

    def __init__(self, low: float, high: float, bound: float = 0.5) -> None:
        from scipy.special import logit

        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ValueError(f"range: not low < high (got {low} and {high})")
        if not 0.0 < bound < 1.0:
            raise ValueError(f"bound: not between 0 and 1 (got {bound})")
        self.low, self.high = low, high
        length = high - low
        self._places = np.linspace(low - length / 2.0, high + length / 2.0, PLACES)
        widths = length * np.geomspace(NARROWEST, WIDEST, WIDTHS)
        place, width, sign, lapse = np.meshgrid(self._places, widths, (-1.0, 1.0), LAPSES, indexing="ij")
        self._tried = np.linspace(low, high, TRIED)
        # The rate at the boundary is the bound, except for the lapses.
        share = np.clip((bound - lapse / 2.0) / (1.0 - lapse), 1e-6, 1.0 - 1e-6)
        self._shape = place, width, sign, lapse, logit(share)
        self._rates = np.stack([self._rate(x) for x in self._tried])
        self._log = np.zeros(place.shape)
        self.runs = 0

    def _rate(self, x: float) -> Array:
        from scipy.special import expit

        place, width, sign, lapse, level = self._shape
        return np.asarray(lapse / 2.0 + (1.0 - lapse) * expit(sign * (x - place) / width + level))

    def add(self, x: float, success: bool) -> None:
        """Add the outcome of a run at a value."""
        self._log += self._log_likelihood(x, success)
        self.runs += 1

    def _log_likelihood(self, x: float, success: bool) -> Array:
        rate = self._rate(x)
        return np.log(np.maximum(rate if success else 1.0 - rate, 1e-12))

    def proposals(self, count: int) -> list[float]:
        """Return the values of the next runs. Their outcomes are assumed to be the likelier ones for each other."""
        held, found = self._log.copy(), []
        for _ in range(count):
            x, likelier = self._next(held)
            found.append(x)
            held = held + self._log_likelihood(x, likelier)
        return found

    def _next(self, log: Array) -> tuple[float, bool]:
        """Return the value with the minimum expected entropy of the boundary, and its likelier outcome."""
        posterior = _normalized(log)
        weighted = self._rates * posterior
        success = weighted.reshape(TRIED, PLACES, -1).sum(axis=2)
        total = posterior.reshape(PLACES, -1).sum(axis=1)
        rate = success.sum(axis=1)
        entropy = _entropy(success) + _entropy(total[None] - success)
        best = int(np.argmin(entropy))
        return float(self._tried[best]), bool(rate[best] >= 0.5)

    def estimate(self, confidence: float = 0.95) -> Boundary:
        """Return the estimate with its central credible interval."""
        posterior = _normalized(self._log)
        marginal = posterior.reshape(PLACES, -1).sum(axis=1)
        cumulated = np.cumsum(marginal)
        step = self._places[1] - self._places[0]
        ends = self._places + step / 2.0
        low, middle, high = (
            float(np.interp(share, cumulated, ends))
            for share in ((1.0 - confidence) / 2.0, 0.5, (1.0 + confidence) / 2.0)
        )
        is_inside = (self._places >= self.low) & (self._places <= self.high)
        inside = float(marginal[is_inside].sum())
        rising = float(posterior[:, :, 1].sum())
        value = middle if self.low <= middle <= self.high else math.nan
        return Boundary(value, max(low, self.low), min(high, self.high), inside, rising, self.runs)


def _normalized(log: Array) -> Array:
    weights = np.exp(log - log.max())
    return np.asarray(weights / weights.sum())


def _entropy(joint: Array) -> Array:
    """Return the entropy of each row (R, N) after normalization, weighted by the sum of the row."""
    from scipy.special import xlogy

    total = joint.sum(axis=1)
    return np.asarray(xlogy(total, total) - xlogy(joint, np.maximum(joint, 1e-300)).sum(axis=1))


def is_found(boundary: Boundary, tolerance: float) -> bool:
    """Return whether the interval of the boundary is at most as wide as twice the tolerance."""
    return boundary.high - boundary.low <= 2.0 * tolerance and boundary.inside > 0.5

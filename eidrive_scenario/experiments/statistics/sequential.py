"""Sequential tests of a success rate, which stop as soon as the runs decide."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

LIMIT = 500
"""Default maximum number of runs."""


class Decision(StrEnum):
    """Decision of a sequential test."""

    PASSED = "passed"
    FAILED = "failed"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class Characteristics:
    """Properties of a test at one true success rate: probabilities of the decisions and mean number of runs."""

    passed: float
    failed: float
    undecided: float
    mean_runs: float


@dataclass(frozen=True)
class RatioTest:
    """Sequential probability ratio test of a success rate (Wald, Sequential analysis, 1947).

    good, bad         rates with bad < good, both within (0, 1): the test should pass at the first, fail at the second
    false_pass        nominal probability to pass at a rate of `bad` or below
    false_failure     nominal probability to fail at a rate of `good` or above
    limit             maximum number of runs, after which the test is undecided; both probabilities do not increase

    By Wald's bounds the probability to pass is at most false_pass / (1 - false_failure), that to fail at most
    false_failure / (1 - false_pass), and their sum at most that of the nominal ones; `characteristics` returns them.

    Between both rates either decision is possible. The logarithm of the likelihood ratio of both rates changes by a
    constant with each success and each failure; the test ends when it leaves an interval. Raise ValueError for rates,
    probabilities or a limit out of range.
    """

    good: float
    bad: float
    false_pass: float = 0.05
    false_failure: float = 0.05
    limit: int = LIMIT

    def __post_init__(self) -> None:
        if not 0.0 < self.bad < self.good < 1.0:
            raise ValueError(f"rates: not 0 < bad < good < 1 (got {self.bad} and {self.good})")
        for name in ("false_pass", "false_failure"):
            if not 0.0 < getattr(self, name) < 0.5:
                raise ValueError(f"{name}: not between 0 and 0.5 (got {getattr(self, name)})")
        if self.limit < 1:
            raise ValueError(f"limit: not a positive number (got {self.limit})")

    @property
    def step_of_success(self) -> float:
        """Change of the logarithm of the likelihood ratio of `bad` over `good` with a success."""
        return math.log(self.bad / self.good)

    @property
    def step_of_failure(self) -> float:
        """Change of the logarithm of the likelihood ratio with a failure."""
        return math.log((1.0 - self.bad) / (1.0 - self.good))

    @property
    def bounds(self) -> tuple[float, float]:
        """Lower and upper bound of the logarithm of the likelihood ratio: the test passes or fails there."""
        return (
            math.log(self.false_pass / (1.0 - self.false_failure)),
            math.log((1.0 - self.false_pass) / self.false_failure),
        )

    def decision(self, successes: int, trials: int) -> Decision | None:
        """Return the decision after these runs; None if a further run is required.

        Counts are those after each run in turn: a test that has ended does not continue. Raise ValueError for invalid
        counts.
        """
        if trials < 0 or not 0 <= successes <= trials:
            raise ValueError(f"runs: invalid counts (got {successes} of {trials})")
        ratio = successes * self.step_of_success + (trials - successes) * self.step_of_failure
        low, high = self.bounds
        if ratio <= low:
            return Decision.PASSED
        if ratio >= high:
            return Decision.FAILED
        return Decision.UNDECIDED if trials >= self.limit else None

    def characteristics(self, rate: float) -> Characteristics:
        """Return the properties at a true rate, exact by recursion over the number of failures after each run.

        Raise ValueError for a rate out of [0, 1].
        """
        if not 0.0 <= rate <= 1.0:
            raise ValueError(f"rate: not between 0 and 1 (got {rate})")
        low, high = self.bounds
        waiting = np.ones(1)
        passed = failed = mean = 0.0
        for trials in range(1, self.limit + 1):
            mean += float(waiting.sum())
            after = np.zeros(len(waiting) + 1)
            after[:-1] += rate * waiting
            after[1:] += (1.0 - rate) * waiting
            failures = np.arange(len(after))
            ratio = (trials - failures) * self.step_of_success + failures * self.step_of_failure
            passed += float(after[ratio <= low].sum())
            failed += float(after[ratio >= high].sum())
            after[(ratio <= low) | (ratio >= high)] = 0.0
            waiting = after
            if waiting.sum() < 1e-15:
                break
        return Characteristics(passed, failed, float(waiting.sum()), mean)


def success_rate(
    at_least: float, *, confidence: float = 0.95, expected: float | None = None, limit: int = LIMIT
) -> RatioTest:
    """Return the test that the success rate of a stochastic scenario is at least a required one.

    A pass is wrong, and a failure is wrong at a rate of `expected`, with a probability of about 1 - confidence, at most
    (1 - confidence) / confidence.
    `expected` is the rate of a system that should pass; the default is half of the permitted failures. The nearer it is
    to the required rate, the more runs are needed. Raise ValueError as `RatioTest`, and for a rate or confidence out
    of range.
    """
    if not 0.5 < confidence < 1.0:
        raise ValueError(f"confidence: not between 0.5 and 1 (got {confidence})")
    if not 0.0 < at_least < 1.0:
        raise ValueError(f"at_least: not between 0 and 1 (got {at_least})")
    if expected is not None and not at_least < expected < 1.0:
        raise ValueError(f"expected: not between at_least and 1 (got {expected} and {at_least})")
    risk = 1.0 - confidence
    return RatioTest((1.0 + at_least) / 2.0 if expected is None else expected, at_least, risk, risk, limit)

"""Searches in a sweep: boundary of success along one axis, and failures in a space of several axes.

Runs are proposed in batches of a fixed size, so that a search depends neither on the number of workers nor on
interruptions: known results are taken from the store.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.imports import optional_import
from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.experiments.sweeps.axes import Axis, Point
from eidrive_scenario.experiments.sweeps.jobs import SweepJob, SweepPlan
from eidrive_scenario.experiments.sweeps.store import FAILED, PASSED, StoredRun

BOUNDARIES = 241
"""Number of tested boundaries, over the tested range and half of its length on either side."""
FEWEST = 4
"""Minimum number of steps between tested boundaries in the interval; at fewer, the tested range shrinks around it."""
SHRUNK = 8
"""Length of a shrunk range, in lengths of the interval."""
WIDTHS = 12
"""Number of tested widths."""
NARROWEST, WIDEST = 0.002, 0.5
"""Minimum and maximum width s, as a share of the range."""
LAPSES = (0.0, 0.02, 0.1)
"""Tested shares of outcomes that do not depend on the value."""
CONFIDENCE = 0.95
"""Confidence of the interval of the boundary."""
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
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ValueError(f"range: not low < high (got {low} and {high})")
        if not 0.0 < bound < 1.0:
            raise ValueError(f"bound: not between 0 and 1 (got {bound})")
        self.low, self.high = low, high
        self._bound = bound
        self._outcomes: list[tuple[float, bool]] = []
        self._set_range(low, high)

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self._outcomes)

    def _set_range(self, low: float, high: float) -> None:
        """Lay tested boundaries, widths and values over a range within that of the search."""
        from scipy.special import logit

        length = high - low
        self._boundaries = np.linspace(low - length / 2.0, high + length / 2.0, BOUNDARIES)
        widths = np.geomspace(NARROWEST * length, WIDEST * (self.high - self.low), WIDTHS)
        boundary, width, sign, lapse = np.meshgrid(self._boundaries, widths, (-1.0, 1.0), LAPSES, indexing="ij")
        self._tried = np.linspace(low, high, TRIED)
        # The rate at the boundary is the bound, except for the lapses.
        share = np.clip((self._bound - lapse / 2.0) / (1.0 - lapse), 1e-6, 1.0 - 1e-6)
        self._shape = boundary, width, sign, lapse, logit(share)
        self._rates = np.stack([self._rate(x) for x in self._tried])
        self._log = np.zeros(boundary.shape)
        for x, success in self._outcomes:
            self._log += _log_likelihood(self._rate(x), success)

    def _rate(self, x: float) -> Array:
        from scipy.special import expit

        boundary, width, sign, lapse, level = self._shape
        return np.asarray(lapse / 2.0 + (1.0 - lapse) * expit(sign * (x - boundary) / width + level))

    def add(self, x: float, success: bool) -> None:
        """Add the outcome of a run at a value."""
        self._outcomes.append((x, success))
        self._log += _log_likelihood(self._rate(x), success)
        self._shrink()

    def proposals(self, count: int) -> list[float]:
        """Return the values of the next runs. Their outcomes are assumed to be the likelier ones for each other."""
        held, proposals = self._log.copy(), []
        for _ in range(count):
            best, likelier = self._next_value(held)
            proposals.append(float(self._tried[best]))
            held += _log_likelihood(self._rates[best], likelier)
        return proposals

    def _shrink(self) -> None:
        """Shrink the tested range if the boundaries in the interval are too few to resolve it."""
        low, middle, high = self._quantiles()
        step = self._boundaries[1] - self._boundaries[0]
        if high - low < FEWEST * step and self.low <= middle <= self.high:
            reach = SHRUNK * (high - low) / 2.0
            self._set_range(max(middle - reach, self.low), min(middle + reach, self.high))

    def _quantiles(self) -> tuple[float, float, float]:
        """Return the lower limit of the central credible interval of the boundary, its median and its upper limit."""
        marginal = _normalized(self._log).reshape(BOUNDARIES, -1).sum(axis=1)
        ends = self._boundaries + (self._boundaries[1] - self._boundaries[0]) / 2.0
        shares = (1.0 - CONFIDENCE) / 2.0, 0.5, (1.0 + CONFIDENCE) / 2.0
        low, middle, high = np.interp(shares, np.cumsum(marginal), ends).tolist()
        return low, middle, high

    def _next_value(self, log: Array) -> tuple[int, bool]:
        """Return the index of the value with the minimum expected entropy of the boundary, and its likelier outcome."""
        posterior = _normalized(log)
        success = np.einsum("vbwsl,bwsl->vb", self._rates, posterior)
        total = posterior.reshape(BOUNDARIES, -1).sum(axis=1)
        rate = success.sum(axis=1)
        entropy = _entropy(success) + _entropy(total[None] - success)
        best = int(np.argmin(entropy))
        return best, bool(rate[best] >= 0.5)

    def estimate(self) -> Boundary:
        """Return the estimate with its central credible interval."""
        posterior = _normalized(self._log)
        marginal = posterior.reshape(BOUNDARIES, -1).sum(axis=1)
        low, middle, high = self._quantiles()
        is_inside = (self._boundaries >= self.low) & (self._boundaries <= self.high)
        inside = float(marginal[is_inside].sum())
        rising = float(posterior[:, :, 1].sum())
        value = middle if self.low <= middle <= self.high else math.nan
        return Boundary(value, max(low, self.low), min(high, self.high), inside, rising, self.runs)


def _log_likelihood(rate: Array, success: bool) -> Array:
    return np.log(np.maximum(rate if success else 1.0 - rate, 1e-12))


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


BATCH = 8
"""Number of runs that are proposed at a time."""
Execute = Callable[[Sequence[SweepJob]], Sequence[StoredRun]]
"""Function that runs jobs, unless the store has their results, and returns their rows in order."""


def find_boundary(
    plan: SweepPlan,
    axis: Axis,
    execute: Execute,
    *,
    bound: float,
    tolerance: float,
    runs: int,
    shown: Callable[[Boundary], None] = lambda boundary: None,
) -> Boundary:
    """Return the boundary of success along an interval; the other values are those of the first point of the plan.

    bound      success rate at the boundary;  tolerance  half of the width of the interval at which the search ends
    runs       maximum number of runs, with seeds 1, 2, 3 …
    shown      function that gets the estimate after each batch

    Runs without a verdict do not count. Raise SettingError if there is none in a batch.
    """
    search = BoundarySearch(axis.low, axis.high, bound)
    started = 0
    while started < runs:
        values = [axis.nearest(value) for value in search.proposals(min(BATCH, runs - started))]
        jobs = [
            plan.job(started + index, {**plan.points[0], axis.name: value}, started + index + 1)
            for index, value in enumerate(values)
        ]
        executed = execute(jobs)
        started += len(jobs)
        judged = [(value, run) for value, run in zip(values, executed, strict=True) if run.has_verdict]
        if not judged:
            raise _without_verdict(executed)
        for value, run in judged:
            search.add(value, run.status == PASSED)
        boundary = search.estimate()
        shown(boundary)
        if is_found(boundary, tolerance):
            break
    return search.estimate()


SHOWN_FAILURES = 10
"""Maximum number of failures that a search returns."""


@dataclass(frozen=True)
class Falsification:
    """Result of a search for failures.

    runs      number of different runs;  failed  failed ones
    failures  the most different failures, the first found first
    least     run with the least objective; None without one
    """

    runs: int
    failed: int
    failures: tuple[StoredRun, ...]
    least: StoredRun | None


def falsify(
    plan: SweepPlan,
    axes: Sequence[Axis],
    execute: Execute,
    *,
    runs: int,
    objective: str | None = None,
    shown: Callable[[int, int], None] = lambda done, failed: None,
) -> Falsification:
    """Search a space for failed runs with Optuna's TPE sampler, and return the most different ones.

    objective  metric or column of the result whose small values are near a failure, such as `min_distance.A.B.box`;
               None: the least margin of all criteria with a value and a limit, relative to the larger one of both
    shown      function that gets the numbers of different runs and of failures after each batch

    The sampler may propose a combination of lists again; it counts once.
    Raise SettingError without Optuna, or if no run of a batch has a verdict or the objective.
    """
    optuna = optional_import("optuna", "search")
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)  # of the options of the sampler
        sampler = optuna.samplers.TPESampler(seed=1, multivariate=True, constant_liar=True)
    study = optuna.create_study(sampler=sampler)
    executed: list[StoredRun] = []
    different: dict[str, StoredRun] = {}
    failed: list[StoredRun] = []
    while len(executed) < runs:
        trials = [study.ask(_distributions(optuna, axes)) for _ in range(min(BATCH, runs - len(executed)))]
        jobs = [
            plan.job(len(executed) + index, {**plan.points[0], **trial.params}, plan.seeds[0])
            for index, trial in enumerate(trials)
        ]
        batch = execute(jobs)
        if not any(run.has_verdict for run in batch):
            raise _without_verdict(batch)
        for trial, run in zip(trials, batch, strict=True):
            value = _objective(run, objective) if run.has_verdict else None
            if value is None:
                study.tell(trial, state=optuna.trial.TrialState.FAIL)
            else:
                study.tell(trial, value)
        executed += batch
        if objective is not None and not any(objective in run.result for run in executed):
            names = sorted({name for run in executed for name, value in run.result.items() if _is_number(value)})
            raise SettingError(Diagnostic(f"--objective: no run has {objective!r}", f"known: {', '.join(names)}"))
        different = {run.key: run for run in executed}
        failed = [run for run in different.values() if run.status == FAILED]
        shown(len(different), len(failed))
    valued = [(value, run) for run in executed if (value := _objective(run, objective)) is not None]
    least = min(valued, key=lambda pair: pair[0])[1] if valued else None
    return Falsification(len(different), len(failed), tuple(most_different(failed, axes, SHOWN_FAILURES)), least)


def most_different(runs: Sequence[StoredRun], axes: Sequence[Axis], count: int) -> list[StoredRun]:
    """Return `count` runs that are far from each other, the first one first (farthest point sampling).

    Distances are those of the shares of the intervals; different values of a list have the distance 1.
    """
    if len(runs) <= count:
        return list(runs)
    coordinates = np.array([_coordinates(run.point, axes) for run in runs])
    chosen = [0]
    away = _distances(coordinates, coordinates[0])
    while len(chosen) < count:
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, _distances(coordinates, coordinates[chosen[-1]]))
    return [runs[index] for index in chosen]


def _coordinates(point: Point, axes: Sequence[Axis]) -> list[float]:
    """Return the coordinates of a point: one for an interval, one for each value of a list."""
    coordinates: list[float] = []
    for axis in axes:
        value = point[axis.name]
        if axis.is_interval:
            coordinates.append((float(value) - axis.low) / (axis.high - axis.low))
        else:
            coordinates += [float(value == other) / np.sqrt(2.0) for other in axis.values]
    return coordinates


def _distances(points: Array, point: Array) -> Array:
    return np.asarray(np.linalg.norm(points - point, axis=1))


def _objective(run: StoredRun, name: str | None) -> float | None:
    if name is not None:
        value: Any = run.result.get(name)
        return float(value) if _is_number(value) else None
    margins = [margin for criterion in run.criteria if (margin := _margin(run, criterion)) is not None]
    return min(margins, default=1.0 if run.criteria else None)


def _margin(run: StoredRun, criterion: str) -> float | None:
    """Return the margin of a criterion: distance of its value from its limit over the larger one of both, at most 1 for
    values and limits of equal sign, negative if it failed.

    The metric `margin` of a criterion takes precedence if it passed. One that passed without value or limit has none:
    it would hide the larger margins of others, as would a margin over the limit, which has no maximum.
    """
    passed = bool(run.result[f"{criterion}.passed"])
    stated: Any = run.result.get(f"{criterion}.margin")
    if passed and _is_number(stated):
        return float(stated)
    value: Any = run.result.get(f"{criterion}.value")
    limit: Any = run.result.get(f"{criterion}.limit")
    if _is_number(value) and _is_number(limit) and limit != 0 and math.isfinite(limit):
        smaller, larger = sorted((abs(float(value)), abs(float(limit))))
        margin = 1.0 - math.copysign(smaller / larger, float(value) * float(limit))
        return margin if passed else -margin
    return None if passed else -1.0


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and not math.isnan(value)


def _distributions(optuna: Any, axes: Sequence[Axis]) -> dict[str, Any]:
    kinds = optuna.distributions
    distributions = {}
    for axis in axes:
        if axis.is_whole:
            distributions[axis.name] = kinds.IntDistribution(*axis.ends)
        elif axis.is_interval:
            distributions[axis.name] = kinds.FloatDistribution(*axis.ends)
        else:
            distributions[axis.name] = kinds.CategoricalDistribution(axis.values)
    return distributions


def _without_verdict(runs: Sequence[StoredRun]) -> SettingError:
    return SettingError(Diagnostic(f"no run has a verdict: {runs[0].status}: {runs[0].error}", "correct the settings"))

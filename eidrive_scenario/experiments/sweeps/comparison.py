"""Comparison of two sweeps, such as those of two releases, or of the values of an axis, by runs with equal seeds."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import Diagnostic, SettingError, quoted, suggestion
from eidrive_scenario.experiments.statistics.paired import PairedDifference, PairedVerdicts, paired_difference
from eidrive_scenario.experiments.sweeps.axes import axis_identity, text_of_value
from eidrive_scenario.experiments.sweeps.results import (
    Identity,
    identity,
    indistinct,
    partner_identity,
    stored_runs,
    stored_sides,
    value_of,
    values_of,
)
from eidrive_scenario.experiments.sweeps.store import ABORTED, CRASHED, INVALID, NOT_JUDGED, PASSED, StoredRun
from eidrive_scenario.simulation.result import typed

NOT_WORSE, WORSE, UNDECIDED = "not worse", "worse", "undecided"
"""Conclusions of a comparison."""


@dataclass(frozen=True)
class Comparison:
    """Comparison of a second sweep with a first one.

    verdicts   pairs of runs by their verdicts
    unpaired   number of runs with a verdict in one sweep only
    lost       number of runs with a verdict in the first sweep that were aborted, crashed or invalid in the second one
    identical  number of pairs with equal trace hashes
    interval   of the difference of the success rates, second minus first
    p_value    McNemar's exact test of equal rates, two-sided
    p_worse    test that the second rate is lower by the margin or more
    margin, confidence   of the decision
    metrics    differences of the metrics in pairs that have finite values of them
    """

    verdicts: PairedVerdicts
    unpaired: int
    lost: int
    identical: int
    interval: tuple[float, float]
    p_value: float
    p_worse: float
    margin: float
    confidence: float
    metrics: Mapping[str, PairedDifference]

    @property
    def is_not_worse(self) -> bool:
        """Whether the runs show that the second sweep is not worse by the margin, and it has lost no verdict."""
        return not self.lost and self.p_worse < 1.0 - self.confidence

    @property
    def rates(self) -> tuple[float, float]:
        """Success rates of both sweeps in the pairs."""
        counts = self.verdicts
        return (counts.both + counts.only_first) / counts.pairs, (counts.both + counts.only_second) / counts.pairs

    @property
    def conclusion(self) -> str:
        """The decision in a word or two: `not worse`, `worse` or `undecided`."""
        return NOT_WORSE if self.is_not_worse else WORSE if self.is_worse else UNDECIDED

    @property
    def is_worse(self) -> bool:
        """Whether the runs show that the second sweep has a lower success rate."""
        return self.interval[1] < 0.0


@dataclass(frozen=True)
class NamedComparison:
    """Comparison with the names of what is compared.

    axis        axis whose values are compared; "" for stores
    first, second  values of the axis, the first one is the reference; paths of stores
    comparison  None if no pair of runs has verdicts
    counts      number of runs of the second one by status
    """

    axis: str
    first: Any
    second: Any
    comparison: Comparison | None
    counts: Mapping[str, int] = field(default_factory=dict)


def compare(
    first: Sequence[Path],
    second: Sequence[Path],
    *,
    margin: float = 0.05,
    confidence: float = 0.95,
    metrics: Sequence[str] = (),
    warn: Callable[[str], None] = warnings.warn,
) -> Comparison:
    """Compare the runs of two sweeps with equal scenario, seed and values of the axes.

    margin   largest decrease of the success rate that counts as not worse
    metrics  metrics whose means are compared, with Student's t intervals
    warn     function that gets a line for each damaged result, which is omitted

    Raise SettingError if a file is not a store, if no runs are equal, or for an unknown metric.
    """
    sides = stored_sides(first, second, warn=warn)
    base, changed = (_by_identity(runs, paths) for runs, paths in zip(sides, (first, second), strict=True))
    comparison = _compared(base, changed, margin, confidence, metrics)
    if comparison is None:
        raise SettingError(Diagnostic("the stores have no run with a verdict in common", "sweep both over equal seeds"))
    _check_metrics(metrics, [comparison], [*base.values(), *changed.values()])
    return comparison


def compare_values(
    paths: Sequence[Path],
    axis: str,
    values: Sequence[Any] = (),
    *,
    margin: float = 0.05,
    confidence: float = 0.95,
    metrics: Sequence[str] = (),
    warn: Callable[[str], None] = warnings.warn,
) -> list[NamedComparison]:
    """Compare the values of an axis of one sweep: each one with the first, by runs that are equal otherwise.

    paths   stores or folders of results, which are combined
    axis    axis, or a parameter that a distribution varies
    values  values of the axis, or their texts, the reference first; () for all, numbers in ascending order
    warn    function that gets a line for each damaged result, which is omitted

    Raise SettingError if a file is not a store, without such an axis or value, with a single or a repeated value, if no
    runs are equal, or for an unknown metric.
    """
    runs = list(stored_runs(paths, warn))
    axes = values_of(runs)
    name = next((name for name in axes if axis_identity(name) == axis_identity(axis)), None)
    if name is None:
        hint = suggestion(axis, axes) if axes else "the runs vary by their seeds only"
        raise SettingError(Diagnostic(f"--between: no axis {quoted(axis)}", hint))
    values = [typed(value) if isinstance(value, str) and value not in axes[name] else value for value in values]
    for value in values:
        if value not in axes[name]:
            hint = f"the runs have {', '.join(map(text_of_value, axes[name]))}"
            raise SettingError(Diagnostic(f"--between: no run has {name}={text_of_value(value)}", hint))
    if len(set(values)) < len(values):
        raise SettingError(Diagnostic(f"--between: a value of {name} is given twice", "give each value once"))
    reference, *others = values or axes[name]
    if not others:
        message = f"--between: a single value of {name} cannot be compared (got {text_of_value(reference)})"
        raise SettingError(Diagnostic(message, f"the runs have {', '.join(map(text_of_value, axes[name]))}"))
    arms: dict[Any, list[StoredRun]] = {value: [] for value in (reference, *others)}
    for run in runs:
        if (value := value_of(run, name)) in arms:
            arms[value].append(run)
    first = _by_identity(arms[reference], paths, name)
    comparisons = []
    for value in others:
        second = _by_identity(arms[value], paths, name)
        comparison = _compared(first, second, margin, confidence, metrics)
        counts = Counter(run.status for run in arms[value])
        comparisons.append(NamedComparison(name, reference, value, comparison, counts))
    compared = [named.comparison for named in comparisons if named.comparison is not None]
    if not compared:
        message = f"--between: no runs with a verdict are equal but for {name}"
        raise SettingError(Diagnostic(message, "sweep all values over equal seeds"))
    _check_metrics(metrics, compared, runs)
    return comparisons


def _compared(
    base: Mapping[Identity, StoredRun],
    changed: Mapping[Identity, StoredRun],
    margin: float,
    confidence: float,
    metrics: Sequence[str],
) -> Comparison | None:
    """Return the comparison of runs by identity; None if no pair has verdicts."""
    # Sums of metrics do not depend on the order in which runs ended
    pairs = [(base[key], changed[key]) for key in sorted(base, key=repr) if key in changed]
    judged = [(a, b) for a, b in pairs if a.has_verdict and b.has_verdict]
    if not judged:
        return None
    verdicts = PairedVerdicts.of([a.status == PASSED for a, _ in judged], [b.status == PASSED for _, b in judged])
    with_verdict = sum(run.has_verdict for runs in (base, changed) for run in runs.values())
    return Comparison(
        verdicts,
        with_verdict - 2 * len(judged),
        sum(a.has_verdict and b.status in (ABORTED, CRASHED, INVALID, NOT_JUDGED) for a, b in pairs),
        sum(a.result.get("trace_hash") == b.result.get("trace_hash") for a, b in judged),
        verdicts.interval(confidence),
        verdicts.p_value(),
        verdicts.p_value_worse(margin),
        margin,
        confidence,
        {name: change for name in metrics if (change := _difference(name, judged, confidence)) is not None},
    )


def _by_identity(runs: Sequence[StoredRun], paths: Sequence[Path], axis: str = "") -> dict[Identity, StoredRun]:
    """Return the runs by what they have in common with their partners."""
    if warning := indistinct(runs):
        hint = "sweep again into a new store, or give a folder of one session, or of one scenario in it"
        raise SettingError(Diagnostic(f"{', '.join(map(str, paths))}: {warning}", hint))
    return {partner_identity(run, axis) if axis else identity(run): run for run in runs}


def _check_metrics(metrics: Sequence[str], comparisons: Sequence[Comparison], runs: Iterable[StoredRun]) -> None:
    """Raise SettingError for a metric without a finite value in both runs of any pair."""
    for name in metrics:
        if not any(name in comparison.metrics for comparison in comparisons):
            numbers = sorted({key for run in runs for key, value in run.result.items() if _is_finite(value)})
            message = f"--metric: no pair of runs has finite numbers {name!r}"
            raise SettingError(Diagnostic(message, f"known: {', '.join(numbers)}"))


def _difference(name: str, pairs: Sequence[tuple[StoredRun, StoredRun]], confidence: float) -> PairedDifference | None:
    """Return the difference of a metric; None without a pair of finite values."""
    values: list[tuple[Any, Any]] = [(a.result.get(name), b.result.get(name)) for a, b in pairs]
    finite = [(float(a), float(b)) for a, b in values if _is_finite(a) and _is_finite(b)]
    if not finite:
        return None
    return paired_difference([a for a, _ in finite], [b for _, b in finite], confidence=confidence)


def _is_finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)

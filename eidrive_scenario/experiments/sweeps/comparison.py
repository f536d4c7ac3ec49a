"""Comparison of two sweeps of the same runs, such as those of two releases, with equal seeds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.experiments.statistics.paired import PairedDifference, PairedVerdicts, paired_difference
from eidrive_scenario.experiments.sweeps.results import Identity, identity, indistinct, stored_runs
from eidrive_scenario.experiments.sweeps.store import ABORTED, CRASHED, FAILED, INVALID, NOT_JUDGED, PASSED, StoredRun


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
    def is_worse(self) -> bool:
        """Whether the runs show that the second sweep has a lower success rate."""
        return self.interval[1] < 0.0


def compare(
    first: Sequence[Path],
    second: Sequence[Path],
    *,
    margin: float = 0.05,
    confidence: float = 0.95,
    metrics: Sequence[str] = (),
) -> Comparison:
    """Compare the runs of two sweeps with equal scenario, seed and values of the axes.

    margin   largest decrease of the success rate that counts as not worse
    metrics  metrics whose means are compared, with Student's t intervals

    Raise SettingError if a file is not a store, if no runs are equal, or for an unknown metric.
    """
    one, other = _by_identity(first), _by_identity(second)
    pairs = [(one[key], other[key]) for key in one if key in other]
    judged = [pair for pair in pairs if all(run.status in (PASSED, FAILED) for run in pair)]
    if not judged:
        raise SettingError(Diagnostic("the stores have no run with a verdict in common", "sweep both over equal seeds"))
    verdicts = PairedVerdicts.of([a.status == PASSED for a, _ in judged], [b.status == PASSED for _, b in judged])
    with_verdict = sum(run.status in (PASSED, FAILED) for runs in (one, other) for run in runs.values())
    return Comparison(
        verdicts,
        with_verdict - 2 * len(judged),
        sum(a.status in (PASSED, FAILED) and b.status in (ABORTED, CRASHED, INVALID, NOT_JUDGED) for a, b in pairs),
        sum(a.result.get("trace_hash") == b.result.get("trace_hash") for a, b in judged),
        verdicts.interval(confidence),
        verdicts.p_value(),
        verdicts.p_value_worse(margin),
        margin,
        confidence,
        {name: _difference(name, judged, confidence) for name in metrics},
    )


def _by_identity(paths: Sequence[Path]) -> dict[Identity, StoredRun]:
    runs = list(stored_runs(paths))
    if warning := indistinct(runs):
        raise SettingError(Diagnostic(f"{', '.join(map(str, paths))}: {warning}", "sweep again into a new store"))
    return {identity(run): run for run in runs}


def _difference(name: str, pairs: Sequence[tuple[StoredRun, StoredRun]], confidence: float) -> PairedDifference:
    values: list[tuple[Any, Any]] = [(a.result.get(name), b.result.get(name)) for a, b in pairs]
    known = [(float(a), float(b)) for a, b in values if _is_finite(a) and _is_finite(b)]
    if not known:
        numbers = sorted({key for run, _ in pairs for key, value in run.result.items() if _is_finite(value)})
        raise SettingError(
            Diagnostic(f"--metric: no pair of runs has finite numbers {name!r}", f"known: {', '.join(numbers)}")
        )
    return paired_difference([a for a, _ in known], [b for _, b in known], confidence=confidence)


def _is_finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)

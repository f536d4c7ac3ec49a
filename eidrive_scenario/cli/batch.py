"""`eidrive run` of a parameter value distribution: its runs in sequence."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from eidrive_scenario.cli.streams import echo
from eidrive_scenario.errors import ConstraintError, Diagnostic, InputError, ScenarioError, SettingError
from eidrive_scenario.exit_codes import INVALID_INPUT, NOT_JUDGED, PASSED
from eidrive_scenario.openscenario import ConcreteRun, DistributionExpansion, load_distribution

RunSeeds = Callable[[ConcreteRun], Sequence[int]]
"""Function that executes a run with each seed and returns the exit codes."""


def run_distribution(
    path: Path, run_seeds: RunSeeds, *, seed: int, repeat: int, max_runs: int | None, parameters: Mapping[str, object]
) -> int:
    """Execute the runs of a distribution, report skipped runs on stderr, and return the highest exit code.

    seed        seed of a stochastic distribution without randomSeed
    repeat      number of seeds per run; each counts as a run in the summary
    max_runs    number of runs, spread over all values; None: all runs
    parameters  values for all runs; parameters that the distribution varies are excluded

    A run that violates the constraints of its parameters is skipped, as the standard requires. An invalid value in the
    first run is an error; in a later run it is reported, and the other runs are executed.
    Raise InputError if the distribution or its first run is invalid, or if all runs are skipped.
    """
    expansion = load_distribution(path, seed=seed)
    _check_not_varied(expansion, parameters)
    numbers = range(len(expansion)) if max_runs is None else expansion.spread(max_runs)
    for warning in expansion.warnings:
        echo(f"warning: {warning}", color="yellow", err=True)
    counts = {"passed": 0, "not passed": 0, "not judged": 0, "excluded by constraints": 0}
    code = 0
    last: ConstraintError | None = None
    for run in (expansion[number] for number in numbers):
        try:
            codes = run_seeds(run)
        except ConstraintError as error:
            last = error
            counts["excluded by constraints"] += repeat
            echo(f"run {run.number} ({run}) is skipped: {error}", color="yellow", err=True)
            continue
        except InputError as error:
            if not counts["passed"] + counts["not passed"] + counts["not judged"]:
                raise
            echo(f"run {run.number} ({run}): {error}", err=True)
            codes = [INVALID_INPUT] * repeat
        passed, unjudged = codes.count(PASSED), codes.count(NOT_JUDGED)
        counts["passed"] += passed
        counts["not judged"] += unjudged
        counts["not passed"] += len(codes) - passed - unjudged
        code = max(code, *codes)
    if last is not None and counts["excluded by constraints"] == repeat * len(numbers):
        raise ScenarioError(last.diagnostics)
    counts["not selected"] = repeat * (len(expansion) - len(numbers))
    summary = ", ".join(f"{count} {outcome}" for outcome, count in counts.items() if count)
    echo(f"{repeat * len(expansion)} runs in {path}: {summary}", err=True)
    return code


def _check_not_varied(expansion: DistributionExpansion, parameters: Mapping[str, object]) -> None:
    diagnostics = [
        Diagnostic(
            f"--param: the distribution varies parameter {name!r}", "remove the option", origin.source, origin.line
        )
        for name, origin in expansion.varied.names.items()
        if name in parameters
    ]
    if diagnostics:
        raise SettingError(diagnostics)

"""`eidrive run` of several runs: those of a parameter value distribution, and seeds that show a success rate."""

from __future__ import annotations

import json as json_text
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from eidrive_scenario.cli.output import echo, print_warnings
from eidrive_scenario.errors import (
    FAILED,
    INVALID_INPUT,
    NOT_JUDGED,
    PASSED,
    ConstraintError,
    Diagnostic,
    InputError,
    ScenarioError,
    SettingError,
    counted,
)
from eidrive_scenario.experiments.statistics.intervals import anytime_interval
from eidrive_scenario.experiments.statistics.sequential import LIMIT, Decision, RatioTest
from eidrive_scenario.experiments.statistics.sequential import success_rate as test_of_rate
from eidrive_scenario.experiments.success_rate import decision_text
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
    print_warnings(map(str, expansion.warnings))
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
    echo(f"{counted(repeat * len(expansion), 'run')} in {path}: {summary}", err=True)
    return code


def _check_not_varied(expansion: DistributionExpansion, parameters: Mapping[str, object]) -> None:
    diagnostics = [
        Diagnostic.at(origin, f"--param: the distribution varies parameter {name!r}", "remove the option")
        for name, origin in expansion.varied.names.items()
        if name in parameters
    ]
    if diagnostics:
        raise SettingError(diagnostics)


def rate_test(at_least: float, confidence: float, repeat: int) -> RatioTest:
    """Return the test of a required rate; `repeat` above 1 is its limit. Raise SettingError for invalid options."""
    if not 0.5 < confidence < 1.0:
        raise SettingError(Diagnostic(f"--confidence is {confidence}", "give a number between 0.5 and 1"))
    try:
        return test_of_rate(at_least, confidence=confidence, limit=repeat if repeat > 1 else LIMIT)
    except ValueError as error:
        raise SettingError(Diagnostic(f"--success-rate is {at_least}", "give a rate between 0 and 1")) from error


def decision_code(test: RatioTest, codes: Sequence[int], *, json: bool) -> int | None:
    """Return the exit code of the test after runs with these exit codes, and print the decision; None before it.

    A run that was aborted or invalid ends the test with its code. An undecided test has the code of a failed one.
    """
    others = [code for code in codes if code not in (PASSED, FAILED)]
    if others:
        return max(others)
    passed = sum(code == PASSED for code in codes)
    decision = test.decision(passed, len(codes))
    if decision is None:
        return None
    rate = anytime_interval(passed, len(codes), 1.0 - test.false_pass)
    if json:
        numbers = {"at_least": test.bad, "decision": str(decision), "passed": passed, "runs": len(codes)}
        echo(json_text.dumps({"success_rate": {**numbers, "low": rate.low, "high": rate.high}}))
    else:
        echo(decision_text(test, decision, rate))
    return PASSED if decision is Decision.PASSED else FAILED

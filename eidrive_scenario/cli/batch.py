"""`eidrive run` on a parameter value distribution: its runs one after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import typer

from eidrive_scenario.cli.error_output import WRONG_INPUT
from eidrive_scenario.errors import ConstraintError, Diagnostic, InputError, ScenarioError, SettingError
from eidrive_scenario.openscenario import ConcreteRun, DistributionExpansion, load_distribution

Play = Callable[[ConcreteRun], int]
"""Plays a run and gives its exit code."""


def run_distribution(path: Path, play: Play, *, seed: int, most: int | None, parameters: Mapping[str, object]) -> int:
    """Play the runs of a distribution and tell on stderr what was left out; the highest exit code is that of all.

    seed        for a stochastic distribution that names no randomSeed
    most        number of runs, spread over all values; None: all runs
    parameters  given for all runs: none of those that the distribution varies

    A run whose parameters the scenario's constraints rule out is left out, as the standard wants. A run with a wrong
    value does not keep the others from being played, unless it is the first.
    Raise InputError if the distribution is wrong, its first run is, or no run is left.
    """
    unfolding = load_distribution(path, seed=seed)
    _refuse_varied(unfolding, parameters)
    numbers = range(len(unfolding)) if most is None else unfolding.spread(most)
    for warning in unfolding.warnings:
        typer.secho(f"warning: {warning}", fg="yellow", err=True)
    counts = {"passed": 0, "not passed": 0, "ruled out by constraints": 0}
    code = 0
    last: ConstraintError | None = None
    for run in _runs(unfolding, numbers):
        try:
            result = play(run)
        except ConstraintError as error:
            last = error
            counts["ruled out by constraints"] += 1
            typer.secho(f"run {run.number} ({run}) is left out: {error}", fg="yellow", err=True)
            continue
        except InputError as error:
            if not counts["passed"] + counts["not passed"]:
                raise
            typer.echo(f"run {run.number} ({run}): {error}", err=True)
            result = WRONG_INPUT
        counts["not passed" if result else "passed"] += 1
        code = max(code, result)
    if last is not None and counts["ruled out by constraints"] == len(numbers):
        raise ScenarioError(last.diagnostics)
    counts["not asked for"] = len(unfolding) - len(numbers)
    told = ", ".join(f"{count} {what}" for what, count in counts.items() if count)
    typer.echo(f"{len(unfolding)} runs in {path}: {told}", err=True)
    return code


def _runs(unfolding: DistributionExpansion, numbers: Sequence[int]) -> Iterator[ConcreteRun]:
    return (unfolding[number] for number in numbers)


def _refuse_varied(unfolding: DistributionExpansion, parameters: Mapping[str, object]) -> None:
    varied = unfolding.varied.names
    diagnostics = [
        Diagnostic(
            f"--param {name!r} would undo what the distribution varies", "leave it out", origin.source, origin.line
        )
        for name, origin in varied.items()
        if name in parameters
    ]
    if diagnostics:
        raise SettingError(diagnostics)

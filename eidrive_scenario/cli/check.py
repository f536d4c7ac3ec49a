"""`eidrive check`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from eidrive_scenario.cli.failures import WRONG_INPUT
from eidrive_scenario.errors import Problem, SettingError
from eidrive_scenario.library import definition, resolve_scenario

_SUFFIX = ".xosc"


def check(
    paths: Annotated[list[str], typer.Argument(metavar="PATH…", help="Files, folders, or names of the library.")],
) -> None:
    """Print every mistake in scenarios and distributions as `file:line: what is wrong; what would be right`."""
    from eidrive_scenario.experiments.distribution_inspection import DistributionFindings, inspect_distribution
    from eidrive_scenario.experiments.inspection import inspect_scenario

    files = list(_files(paths))
    problems: dict[Problem, None] = {}
    warnings: dict[Problem, None] = {}
    for path in files:
        kind = definition(path)
        if kind == "catalog":
            typer.echo(f"{path}: a catalog, checked with the scenarios that use it")
            continue
        findings = inspect_distribution(path) if kind == "distribution" else inspect_scenario(path)
        for problem in findings.problems:
            if problem not in problems:
                typer.echo(str(problem))
        for problem in findings.warnings:
            if problem not in warnings:
                typer.echo(f"{problem} (warning)")
        if isinstance(findings, DistributionFindings) and findings.runs:
            typer.echo(f"{path}: {_count(findings.runs, 'run')}")
        problems.update(dict.fromkeys(findings.problems))
        warnings.update(dict.fromkeys(findings.warnings))
    counts = _count(len(files), "file"), _count(len(problems), "problem"), _count(len(warnings), "warning")
    typer.echo(", ".join(counts))
    raise typer.Exit(WRONG_INPUT if problems else 0)


def _files(paths: list[str]) -> Iterator[Path]:
    for given in paths:
        if not Path(given).is_dir():
            yield resolve_scenario(given)
            continue
        inside = sorted(Path(given).rglob(f"*{_SUFFIX}"))
        if not inside:
            raise SettingError(Problem(f"no {_SUFFIX} file in {given!r}", "give another folder"))
        yield from inside


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"

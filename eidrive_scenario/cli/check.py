"""`eidrive check`."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from eidrive_scenario.cli.failures import BROKEN, WRONG_INPUT, tell
from eidrive_scenario.errors import InputError, Problem
from eidrive_scenario.library import definition, resolve_scenario

_SUFFIX = ".xosc"
_ROADS = ".xodr"


def check(
    context: typer.Context,
    paths: Annotated[list[str], typer.Argument(metavar="PATH…", help="Files, folders, or names of the library.")],
    strict: Annotated[bool, typer.Option("--strict", help="Let warnings count as problems.")] = False,
    ignore: Annotated[
        list[str] | None, typer.Option(metavar="RULE", help="A rule to leave out; repeatable.", show_default="none")
    ] = None,
) -> None:
    """Print every mistake in scenarios, distributions and roads as `file:line: what is wrong; what would be right`.

    Findings end with the rule that made them: `eidrive list checks` names all rules.
    """
    from eidrive_scenario.experiments.distribution_inspection import DistributionFindings, inspect_distribution
    from eidrive_scenario.experiments.inspection import inspect_catalog, inspect_roads, inspect_scenario

    missing: list[Problem] = []
    broken: list[Exception] = []
    files, ignored = list(_files(paths, missing)), tuple(ignore or ())
    told: dict[str, dict[Problem, None]] = {"problem": dict.fromkeys(missing), "warning": {}, "note": {}}
    for problem in missing:
        typer.echo(str(problem))
    for path in files:
        try:
            kind = definition(path)
            if kind == "catalog":
                findings = inspect_catalog(path, ignored)
            elif kind == "roads" or path.suffix == _ROADS:
                findings = inspect_roads(path, ignored)
            else:
                findings = (inspect_distribution if kind == "distribution" else inspect_scenario)(path, ignored)
        except InputError:
            raise
        except Exception as error:
            if context.find_root().params.get("traceback"):
                raise
            tell(error, path)
            broken.append(error)
            continue
        for level, found in zip(told, (findings.problems, findings.warnings, findings.notes), strict=True):
            for problem in found:
                if problem not in told[level]:
                    typer.echo(f"{problem}{_mark(level, problem.rule)}")
            told[level].update(dict.fromkeys(found))
        if isinstance(findings, DistributionFindings) and findings.runs:
            typer.echo(f"{path}: {_count(findings.runs, 'run')}")
    counts = [_count(len(files), "file"), *(_count(len(found), level) for level, found in told.items())]
    typer.echo(", ".join(counts if told["note"] else counts[:-1]))
    if broken:
        raise typer.Exit(BROKEN)
    raise typer.Exit(WRONG_INPUT if told["problem"] or (strict and told["warning"]) else 0)


def _mark(level: str, rule: str) -> str:
    """What stands behind a finding: how grave it is, and its rule."""
    word = "error" if level == "problem" else level
    if rule:
        return f" ({word}: {rule})"
    return "" if level == "problem" else f" ({word})"


def _files(paths: list[str], missing: list[Problem]) -> Iterator[Path]:
    """The files that are meant; what is not there goes to `missing` and keeps no other from being checked.

    A folder stands for its scenarios, which are checked with their roads; one without any for its road files.
    """
    for given in paths:
        if not given or not os.path.isdir(given):
            try:
                yield resolve_scenario(given)
            except InputError as error:
                missing += error.problems
            continue
        inside = sorted(Path(given).rglob(f"*{_SUFFIX}")) or sorted(Path(given).rglob(f"*{_ROADS}"))
        if not inside:
            missing.append(Problem(f"no {_SUFFIX} or {_ROADS} file in {given!r}", "give another folder"))
        yield from inside


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"

"""`eidrive check`."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eidrive_scenario.cli.error_output import BROKEN, WRONG_INPUT, print_error
from eidrive_scenario.cli.hung_check import HungCheck
from eidrive_scenario.cli.supervision import supervise
from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.library import definition, resolve_scenario
from eidrive_scenario.wall_limit import LimitReached, check_wall_limit, limit_wall_time

if TYPE_CHECKING:
    from eidrive_scenario.checks.report import CheckReport

_SUFFIX = ".xosc"
_ROADS = ".xodr"


def check(
    context: typer.Context,
    paths: Annotated[list[str], typer.Argument(metavar="PATH…", help="Files, folders, or names of the library.")],
    strict: Annotated[bool, typer.Option("--strict", help="Let warnings count as problems.")] = False,
    ignore: Annotated[
        list[str] | None, typer.Option(metavar="RULE", help="A rule to leave out; repeatable.", show_default="none")
    ] = None,
    wall_limit: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Maximum wall time of each file.", show_default="none"),
    ] = None,
) -> None:
    """Print every mistake in scenarios, distributions and roads as `file:line: what is wrong; what would be right`.

    Findings end with the rule that made them: `eidrive list rules` names all rules.
    """
    from eidrive_scenario.checks.distribution_checks import DistributionCheckReport

    hung = HungCheck()
    if wall_limit is not None:
        check_wall_limit(wall_limit, "--wall-limit")
        supervise(hung.end, partial(hung.report_dump, wall_limit), "check")
    missing: list[Diagnostic] = []
    broken: list[BaseException] = []
    files, ignored = list(_files(paths, missing)), tuple(ignore or ())
    told: dict[str, dict[Diagnostic, None]] = {"problem": dict.fromkeys(missing), "warning": {}, "note": {}}
    for diagnostic in missing:
        typer.echo(str(diagnostic))
    for path in files:
        hung.file = path
        try:
            collector = _inspect(path, ignored, wall_limit)
        except InputError:
            raise
        except (Exception, SystemExit) as error:
            if context.find_root().params.get("traceback"):
                raise
            print_error(error, path)
            broken.append(error)
            continue
        for level, found in zip(told, (collector.errors, collector.warnings, collector.notes), strict=True):
            for diagnostic in found:
                if diagnostic not in told[level]:
                    typer.echo(f"{diagnostic}{_mark(level, diagnostic.rule)}")
            told[level].update(dict.fromkeys(found))
        if isinstance(collector, DistributionCheckReport) and collector.runs:
            typer.echo(f"{path}: {_count(collector.runs, 'run')}")
    counts = [_count(len(files), "file"), *(_count(len(found), level) for level, found in told.items())]
    typer.echo(", ".join(counts if told["note"] else counts[:-1]))
    if broken:
        raise typer.Exit(BROKEN)
    raise typer.Exit(WRONG_INPUT if told["problem"] or (strict and told["warning"]) else 0)


def _inspect(path: Path, ignored: tuple[str, ...], wall_limit: float | None) -> CheckReport:
    """What is wrong with a file of any kind. Raises WallLimitError if that takes longer than the limit [s]."""
    from eidrive_scenario.checks.catalog_checks import check_catalog
    from eidrive_scenario.checks.distribution_checks import check_distribution
    from eidrive_scenario.checks.scenario_checks import check_road_file, check_scenario
    from eidrive_scenario.simulation.attribution import report_extension

    with limit_wall_time(wall_limit):
        try:
            kind = definition(path)
            if kind == "catalog":
                return check_catalog(path, ignored)
            if kind == "roads" or path.suffix == _ROADS:
                return check_road_file(path, ignored)
            return (check_distribution if kind == "distribution" else check_scenario)(path, ignored)
        except LimitReached as error:
            report_extension(error)  # names the extension that was running, if one was
            raise


def _mark(level: str, rule: str) -> str:
    """What stands behind a finding: how grave it is, and its rule."""
    word = "error" if level == "problem" else level
    if rule:
        return f" ({word}: {rule})"
    return "" if level == "problem" else f" ({word})"


def _files(paths: list[str], missing: list[Diagnostic]) -> Iterator[Path]:
    """The files that are meant; what is not there goes to `missing` and keeps no other from being checked.

    A folder stands for its scenarios, which are checked with their roads; one without any for its road files.
    """
    for given in paths:
        if not given or not os.path.isdir(given):
            try:
                yield resolve_scenario(given)
            except InputError as error:
                missing += error.diagnostics
            continue
        inside = _below(given, _SUFFIX) or _below(given, _ROADS)
        if not inside:
            missing.append(Diagnostic(f"no {_SUFFIX} or {_ROADS} file in {given!r}", "give another folder"))
        yield from inside


def _below(folder: str, suffix: str) -> list[Path]:
    """The files with a suffix in a folder and in those inside it, sorted; folders that cannot be read are left out."""
    files = (Path(place, name) for place, _, names in os.walk(folder) for name in names if name.endswith(suffix))
    return sorted(files)


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"

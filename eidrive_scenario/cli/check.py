"""Command `eidrive check`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eidrive_scenario.base.wall_limit import LimitReached, limit_wall_time
from eidrive_scenario.cli.options import HelpAll, check_output_paths, takes_run_options
from eidrive_scenario.cli.output import echo, print_error, print_unused_projects
from eidrive_scenario.cli.supervision import supervise
from eidrive_scenario.errors import (
    ABORTED,
    INVALID_INPUT,
    Diagnostic,
    InputError,
    SimulationError,
    counted,
    in_one_line,
)
from eidrive_scenario.run_options import FLAGS, RunSettings, check_seconds, diagnostic_with_option_names

if TYPE_CHECKING:
    from eidrive_scenario.checks.rule import CheckReport

_NAMES = {**FLAGS, "no_criteria": f"{FLAGS['no_criteria']} of `eidrive run`"}
"""Options by the name of the setting, in diagnostics of a command that runs nothing."""


@takes_run_options("check", at="wall_limit", before={"planner": "criteria"})
def check(
    settings: RunSettings,
    context: typer.Context,
    paths: Annotated[list[str], typer.Argument(metavar="PATH…", help="Files, folders, or library names.")],
    strict: Annotated[bool, typer.Option("--strict", help="Treat warnings as errors.")] = False,
    ignore: Annotated[
        list[str] | None, typer.Option(metavar="RULE", help="Rule to ignore; repeatable.", show_default="none")
    ] = None,
    wall_limit: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Maximum wall time of each file.", show_default="none"),
    ] = None,
    sarif: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a SARIF log, such as for code scanning.")
    ] = None,
    help_all: HelpAll = False,
) -> None:
    """Print all diagnostics of scenarios, distributions and roads as `file:line: problem; hint`.

    Example: eidrive check scenarios --strict

    A diagnostic of a rule ends with the name of the rule; `eidrive list rules` lists all rules.
    """
    from eidrive_scenario.checks.scenario_checks import DistributionCheckReport

    # Only the child process knows the file and the diagnostics before it
    in_progress: list[Path] = []
    aborted: list[str] = []
    printed: dict[str, dict[Diagnostic, None]] = {"error": {}, "warning": {}, "note": {}}

    def report_hang(error: SimulationError) -> None:
        print_error(error, "check", *in_progress)
        if sarif is not None:
            _write_sarif(sarif, printed, [*aborted, ": ".join(map(str, (*in_progress, error)))])

    if wall_limit is not None:
        check_seconds("--wall-limit", wall_limit)
        supervise(wall_limit, report_hang, what="check")
    missing: list[Diagnostic] = []
    files, ignored = list(_files(paths, missing)), tuple(ignore or ())
    check_output_paths({"--sarif": sarif}, files)
    printed["error"].update(dict.fromkeys(missing))
    for diagnostic in missing:
        echo(str(diagnostic))
    for path in files:
        in_progress[:] = [path]
        try:
            report = _check_file(path, ignored, settings, wall_limit)
        except InputError:
            raise
        except (Exception, SystemExit) as error:
            if context.find_root().params.get("traceback"):
                raise
            print_error(error, "check", path)
            aborted.append(f"{path}: {error}")
            continue
        for level, reported in zip(printed, (report.errors, report.warnings, report.notes), strict=True):
            diagnostics = [diagnostic_with_option_names(diagnostic, _NAMES) for diagnostic in reported]
            for diagnostic in diagnostics:
                if diagnostic not in printed[level]:
                    echo(f"{diagnostic}{_suffix(level, diagnostic.rule)}")
            printed[level].update(dict.fromkeys(diagnostics))
        if isinstance(report, DistributionCheckReport) and report.runs:
            echo(f"{in_one_line(path)}: {counted(report.runs, 'run')}")
    print_unused_projects(printed["error"])
    if sarif is not None:
        _write_sarif(sarif, printed, aborted)
    counts = [
        counted(len(files), "file"),
        *(counted(len(diagnostics), level) for level, diagnostics in printed.items()),
    ]
    echo(", ".join(counts if printed["note"] else counts[:-1]))
    if aborted:
        raise typer.Exit(ABORTED)
    raise typer.Exit(INVALID_INPUT if printed["error"] or (strict and printed["warning"]) else 0)


def _write_sarif(out: Path, printed: Mapping[str, Iterable[Diagnostic]], aborted: Sequence[str]) -> None:
    """Write the printed diagnostics, and the errors of checks that were aborted, as a SARIF log."""
    from eidrive_scenario.checks.rule import Level
    from eidrive_scenario.checks.sarif import write_sarif

    diagnostics = [(Level(level), diagnostic) for level, several in printed.items() for diagnostic in several]
    write_sarif(diagnostics, out, folder=Path.cwd(), aborted=aborted)


def _check_file(path: Path, ignored: tuple[str, ...], settings: RunSettings, wall_limit: float | None) -> CheckReport:
    """Return the diagnostics of a file of any kind. Raise WallLimitError if the limit [s] is exceeded.

    settings  of the runs of scenarios: driving stacks, planner and criteria
    """
    from eidrive_scenario.checks.scenario_checks import (
        check_catalog,
        check_distribution,
        check_road_file,
        check_scenario,
    )
    from eidrive_scenario.extensions.library import ROADS_SUFFIX, definition
    from eidrive_scenario.simulation.attribution import report_extension

    with limit_wall_time(wall_limit):
        try:
            kind = definition(path)
            if kind == "catalog":
                return check_catalog(path, ignored)
            if kind == "roads" or path.suffix == ROADS_SUFFIX:
                return check_road_file(path, ignored)
            return (check_distribution if kind == "distribution" else check_scenario)(path, ignored, settings)
        except LimitReached as error:
            report_extension(error)  # raises an error that names a running extension
            raise


def _suffix(level: str, rule: str) -> str:
    """Return level and rule of a diagnostic in brackets; empty for an error without a rule."""
    if rule:
        return f" ({level}: {rule})"
    return "" if level == "error" else f" ({level})"


def _files(paths: list[str], missing: list[Diagnostic]) -> Iterator[Path]:
    """Yield the selected files, and append a diagnostic to `missing` for each path without a file.

    A folder selects its scenarios, which are checked with their roads, or its road files if it has no scenarios.
    """
    from eidrive_scenario.extensions.library import ROADS_SUFFIX, SCENARIO_SUFFIX, resolve_scenario

    for given in paths:
        if not given or not os.path.isdir(given):
            try:
                yield resolve_scenario(given)
            except InputError as error:
                missing += error.diagnostics
            continue
        selected = _files_below(given, SCENARIO_SUFFIX) or _files_below(given, ROADS_SUFFIX)
        if not selected:
            missing.append(
                Diagnostic(f"no {SCENARIO_SUFFIX} or {ROADS_SUFFIX} file in {given!r}", "give another folder")
            )
        yield from selected


def _files_below(folder: str, suffix: str) -> list[Path]:
    """Return the files with a suffix in a folder and its subfolders, sorted, without unreadable folders."""
    files = (Path(parent, name) for parent, _, names in os.walk(folder) for name in names if name.endswith(suffix))
    return sorted(files)

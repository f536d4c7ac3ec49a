"""Report of many runs as one HTML page: verdicts, reasons and statistics."""

from __future__ import annotations

import math
import os
import platform
import shlex
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from eidrive_scenario.base.installation import ENGINE
from eidrive_scenario.errors import Diagnostic, InputError, counted
from eidrive_scenario.experiments.reported_run import OUTCOMES, ReportedRun, parse_run
from eidrive_scenario.experiments.statistics.intervals import Summary, percentage, summarize
from eidrive_scenario.files.bounded import path_argument
from eidrive_scenario.reporting.page import write_page
from eidrive_scenario.reporting.run_report.rates import (
    parameter_matrix,
    rate_curves,
    rate_maps,
    scenario_matrix,
    success_rate,
)
from eidrive_scenario.reporting.run_report.run_groups import RunGroup, distinct_runs, group_runs
from eidrive_scenario.reporting.run_report.run_table import (
    failure_reason,
    headline,
    metric_titles,
    run_table,
)

PREFERRED = ("min_distance", "time_to_collision", "collision.count", "messages.lost")
"""Prefixes of metrics with priority in the overview."""
MOST_GROUPS = 200
"""Maximum number of combinations of settings in the overview; those with the lowest success rates come first."""
MOST_WARNINGS = 100
"""Maximum number of different warnings of a page; the most frequent ones come first."""
MOST_WITHOUT_SCRIPT = 200
"""Maximum number of runs that a browser without scripts lists."""
SHOWN = 4
"""Maximum number of metrics in the overview."""
EXPIRED = "messages.expired"
"""Metric of the messages that were too old on arrival."""


def write_run_report(
    results: Iterable[Mapping[str, Any] | ReportedRun],
    out: str | os.PathLike[str],
    *,
    omitted: Sequence[str] = (),
    unjudged: Sequence[str] = (),
    template: str | Path = "report.html.jinja",
    **values: Any,
) -> Path:
    """Write a page about results in the format of `--json`, and return its path.

    out      file of the page if it ends in `.html`, else the folder of `report.html`
    omitted  files of runs that `results` do not contain, each with the reason; the page lists them
    unjudged  runs of sweeps without a verdict: one line for each reason
    template, values  name or file of a template that extends the one of the report by a text above it, and its values

    Runs are grouped by the settings in which those of a scenario differ. A run in several folders is listed and counted
    once. Raise InputError without results, or for an invalid result.
    """
    location = path_argument(out, "out")
    page = location if location.suffix == ".html" else location / "report.html"
    given = [parse_run(result) for result in results]
    if not given:
        raise InputError(Diagnostic("no result to report", "give at least one run", str(out)))
    groups = group_runs(distinct_runs(given))
    runs = [run for group in groups for run in group.runs]
    metrics = _common_metrics(runs)
    titles = metric_titles(runs)
    counts = Counter(run.outcome for run in runs)
    overview = sorted(enumerate(groups), key=_rate_order) if len(groups) > MOST_GROUPS else list(enumerate(groups))
    title = headline(runs)
    failures = [run for run in runs if not run.passed]
    common: dict[str, Any] = {"title": title, "footer": f"{ENGINE} {version(ENGINE)}"}
    return write_page(
        page,
        template,
        **{**common, **values},
        headline=title,
        origin=report_origin(runs),
        total=len(runs),
        copies=len(given) - len(runs),
        counts=[(name, counts[name]) for name in OUTCOMES if counts[name]],
        table=run_table(groups),
        failures=failures[:MOST_WITHOUT_SCRIPT],
        unlisted=len(failures[MOST_WITHOUT_SCRIPT:]),
        failure_reason=failure_reason,
        percentage=percentage,
        metrics=[titles[name] for name in metrics],
        groups=[
            {
                "number": number,
                "scenario": group.scenario,
                "channel": group.channel,
                "content": group.content,
                "differing": group.differing,
                "share": success_rate(group.runs),
                "summaries": [_summary(group.runs, name) for name in metrics],
            }
            for number, group in overview[:MOST_GROUPS]
        ],
        left_groups=len(groups[MOST_GROUPS:]),
        matrix=scenario_matrix(groups),
        curves=list(rate_curves(groups)),
        varied=[varied for group in groups if (varied := _varied(group))],
        omitted=omitted,
        unjudged=unjudged,
        warned=sum(bool(run.warnings) for run in runs),
        warnings=_warnings(runs),
    )


def _rate_order(entry: tuple[int, RunGroup]) -> float:
    share = success_rate(entry[1].runs)
    return share.share if share else -1.0


def _varied(group: RunGroup) -> dict[str, Any] | None:
    """Return the tables and heat maps of the values that vary within a group; None without any."""
    matrix = None if group.numbers == group.varied else parameter_matrix(group.runs, group.varied)
    maps = list(rate_maps(group))
    return {"group": group, "matrix": matrix, "maps": maps} if matrix or maps else None


def _warnings(runs: Sequence[ReportedRun]) -> list[str]:
    """Return a line for each different warning, with the number of its runs and the command of one."""
    counts = Counter(warning for run in runs for warning in dict.fromkeys(run.warnings))
    commands: dict[str, str] = {}
    for run in runs:
        for warning in run.warnings:
            commands.setdefault(warning, run.command)
    lines = [
        f"{counted(count, 'run')}: {warning}" + f" (such as {commands[warning]})" * bool(commands[warning])
        for warning, count in counts.most_common(MOST_WARNINGS)
    ]
    left = len(counts) - len(lines)
    return [*lines, f"{left} more in the results of the runs"] if left else lines


def _common_metrics(runs: Sequence[ReportedRun]) -> list[str]:
    """Return the preferred metrics, then the most frequent ones, without times, whose mean has no meaning, and EXPIRED
    if it is not 0."""
    counts = Counter(name for run in runs for name in run.metrics if not name.endswith(".time"))

    def rank(name: str) -> tuple[int, int, str]:
        priority = next((index for index, start in enumerate(PREFERRED) if name.startswith(start)), len(PREFERRED))
        return priority, -counts[name], name

    shown = sorted(counts, key=rank)[:SHOWN]
    return shown if EXPIRED in shown or not any(run.metrics.get(EXPIRED) for run in runs) else [*shown, EXPIRED]


def _summary(runs: Sequence[ReportedRun], metric: str) -> Summary | None:
    given = [run.metrics.get(metric) for run in runs]
    values = [value for value in given if value is not None and math.isfinite(value)]
    return summarize(values) if values else None


def report_origin(runs: Sequence[ReportedRun]) -> dict[str, str]:
    """Return what the header of a report states, by title; without the commit outside of a Git repository."""
    given = [run.settings.get("versions") for run in runs]
    versions = {str(names[ENGINE]) for names in given if isinstance(names, dict) and ENGINE in names}
    machine = f"{platform.node()}, {platform.system()} {platform.machine()}, {counted(os.cpu_count() or 1, 'core')}"
    entries = {
        "version": f"{ENGINE} {', '.join(sorted(versions)) or version(ENGINE)}",
        "commit": _commit(),
        "date": datetime.now().astimezone().isoformat(sep=" ", timespec="minutes"),
        "machine": f"{machine}, Python {platform.python_version()}",
        "command": _command(),
    }
    return {title: text for title, text in entries.items() if text}


def _commit() -> str:
    """Return the commit of the working folder; empty without one."""
    # Whether files differ from it is not asked: Git would execute filters that the settings of the folder name.
    command = ["git", "rev-parse", "--short=10", "HEAD"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""


def _command() -> str:
    """Return the command line of this process; empty in a session of Python."""
    program = Path(sys.argv[0])
    if not program.name or program.name == "-c":
        return ""
    name = f"python -m {program.parent.name}" if program.name == "__main__.py" else program.name
    return " ".join([name, *map(shlex.quote, sys.argv[1:])])

"""Report of many runs as one HTML page: verdicts, reasons and statistics."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.experiments.statistics.intervals import Summary, summarize
from eidrive_scenario.reporting.page import write_page
from eidrive_scenario.reporting.run_report.rates import (
    parameter_matrix,
    rate_curves,
    rate_maps,
    scenario_matrix,
    success_rate,
)
from eidrive_scenario.reporting.run_report.reported_runs import ReportedRun, parse_run
from eidrive_scenario.reporting.run_report.run_groups import group_runs

PREFERRED = ("min_distance", "time_to_collision", "collision.count", "messages.lost")
"""Prefixes of metrics with priority in the overview."""
MOST_LISTED = 1000
"""Maximum number of runs whose verdicts are listed; those that did not pass come first."""
MOST_SETTINGS = 200
"""Maximum number of runs of a page with all settings of each; other runs have their command."""
MOST_WARNINGS = 100
"""Maximum number of different warnings of a page; the most frequent ones come first."""
SHOWN = 4
"""Maximum number of metrics in the overview."""
EXPIRED = "messages.expired"
"""Metric of the messages that were too old on arrival."""
_UNITS = {"count": "", "impact_speed": "m/s"}
"""Units that differ from the unit of the criterion, by the last part of the name of the metric."""


def write_report(
    results: Iterable[Mapping[str, Any] | ReportedRun],
    out: Path,
    *,
    omitted: Sequence[str] = (),
    unjudged: Sequence[str] = (),
    template: str = "report.html.jinja",
    **values: Any,
) -> Path:
    """Write a page about results in the format of `--json`, and return its path.

    out      file of the page if it ends in `.html`, else the folder of `report.html`
    omitted  files of runs that `results` do not contain, each with the reason; the page lists them
    unjudged  runs of sweeps without a verdict: one line for each reason
    template, values  template that extends the one of the report by a text above it, and its values

    Runs are grouped by the settings in which those of a scenario differ. A run in several folders is listed each time
    and counts once. Raise InputError without results, or for an invalid result.
    """
    page = out if out.suffix == ".html" else out / "report.html"
    runs = [parse_run(result) for result in results]
    if not runs:
        raise InputError(Diagnostic("no result to report", "give at least one run", str(out)))
    groups = group_runs(runs)
    counted = [run for group in groups for run in group.distinct]
    metrics = _common_metrics(runs)
    listed = _listed(counted, runs)
    common: dict[str, Any] = {"title": "Scenario report", "footer": f"eidrive-scenario {version('eidrive-scenario')}"}
    return write_page(
        page,
        template,
        **{**common, **values},
        total=len(counted),
        passed=sum(run.passed for run in counted),
        failed=sum(not run.passed and run.finished and run.is_judged for run in counted),
        broken=sum(not run.passed and not run.finished for run in counted),
        without_criteria=sum(not run.is_judged for run in counted),
        metrics=[_title(name, runs) for name in metrics],
        groups=[
            {
                "scenario": group.scenario,
                "channel": group.channel,
                "content": group.content,
                "differing": group.differing,
                "anchor": f"group-{index}",
                "runs": [run for run in group.runs if id(run) in listed],
                "unlisted": sum(id(run) not in listed for run in group.runs),
                "numbered": any(run.run is not None for run in group.runs),
                "copies": len(group.runs) - len(group.distinct),
                "varied": group.varied,
                "matrix": None if group.numbers == group.varied else parameter_matrix(group.distinct, group.varied),
                "maps": list(rate_maps(group)),
                "share": success_rate(group.distinct),
                "summaries": [_summary(group.distinct, name) for name in metrics],
            }
            for index, group in enumerate(groups)
        ],
        matrix=scenario_matrix(groups),
        curves=list(rate_curves(groups)),
        number=_number,
        value_text=_value_text,
        has_replays=any(run.replay for run in runs),
        has_settings=any(run.settings_sha256 for run in runs),
        all_settings=lambda run: (
            json.dumps(run.settings, indent=1, ensure_ascii=False) if len(runs) <= MOST_SETTINGS else ""
        ),
        omitted=omitted,
        unjudged=unjudged,
        warned=sum(bool(run.warnings) for run in counted),
        warnings=_warnings(counted),
    )


def _listed(counted: Sequence[ReportedRun], runs: Sequence[ReportedRun]) -> set[int]:
    """Return the identities of the runs that a page lists: at first those that did not pass, each once."""
    if len(runs) <= MOST_LISTED:
        return {id(run) for run in runs}
    return {id(run) for run in sorted(counted, key=lambda run: run.passed)[:MOST_LISTED]}


def _warnings(runs: Sequence[ReportedRun]) -> list[str]:
    """Return a line for each different warning, with the number of its runs and the command of one."""
    counts = Counter(warning for run in runs for warning in dict.fromkeys(run.warnings))
    commands: dict[str, str] = {}
    for run in runs:
        for warning in run.warnings:
            commands.setdefault(warning, run.command)
    lines = [
        f"{count} run{'' if count == 1 else 's'}: {warning}"
        + f" (such as {commands[warning]})" * bool(commands[warning])
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


def _title(metric: str, runs: Sequence[ReportedRun]) -> str:
    """Return the name of a metric with its unit, which is usually that of its criterion."""
    kind, last = metric.split(".")[0], metric.split(".")[-1]
    units = (criterion.unit for run in runs for criterion in run.criteria if criterion.name == kind)
    unit = _UNITS[last] if last in _UNITS else next(units, "")
    return f"{metric.replace('.', ' ')} [{unit}]" if unit else metric.replace(".", " ")


def _summary(runs: Sequence[ReportedRun], metric: str) -> Summary | None:
    given = [run.metrics.get(metric) for run in runs]
    values = [value for value in given if value is not None and math.isfinite(value)]
    return summarize(values) if values else None


def _value_text(run: ReportedRun, name: str) -> str:
    """Return the value of an axis, or a parameter as its file specifies it."""
    value = run.axes.get(name, run.parameters.get(name, ""))
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _number(value: float | None, unit: str) -> str:
    """Return a measured value with two decimals, so that values and limits align, or a count without decimals."""
    return "" if value is None else f"{value:.2f} {unit}" if unit else f"{value:g}"

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
from eidrive_scenario.experiments.statistics.proportions import wilson
from eidrive_scenario.experiments.statistics.samples import Summary, summarize
from eidrive_scenario.reporting.page import write_page
from eidrive_scenario.reporting.run_report.matrix import parameter_matrix, scenario_matrix
from eidrive_scenario.reporting.run_report.reported_run import ReportedRun, parse_run
from eidrive_scenario.reporting.run_report.run_groups import group_runs

PREFERRED = ("min_distance", "time_to_collision", "collision.count", "messages.lost")
"""Prefixes of metrics with priority in the overview."""
SHOWN = 4
"""Maximum number of metrics in the overview."""
_UNITS = {"count": "", "impact_speed": "m/s"}
"""Units that differ from the unit of the criterion, by the last part of the name of the metric."""


def write_report(results: Iterable[Mapping[str, Any] | ReportedRun], out: Path, *, omitted: Sequence[str] = ()) -> Path:
    """Write a page about results in the format of `--json`, and return its path.

    out      file of the page if it ends in `.html`, else the folder of `report.html`
    omitted  files of runs that `results` do not contain, each with the reason; the page lists them

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
    return write_page(
        page,
        "report.html.jinja",
        title="Scenario report",
        total=len(counted),
        passed=sum(run.passed for run in counted),
        failed=sum(not run.passed and run.finished for run in counted),
        broken=sum(not run.passed and not run.finished for run in counted),
        metrics=[_title(name, runs) for name in metrics],
        groups=[
            {
                "scenario": group.scenario,
                "channel": group.channel,
                "content": group.content,
                "differing": group.differing,
                "anchor": f"group-{index}",
                "runs": group.runs,
                "copies": len(group.runs) - len(group.distinct),
                "varied": _varied(group.runs),
                "matrix": parameter_matrix(group.distinct, _varied(group.runs)),
                "share": wilson(sum(run.passed for run in group.distinct), len(group.distinct)),
                "summaries": [_summary(group.distinct, name) for name in metrics],
            }
            for index, group in enumerate(groups)
        ],
        matrix=scenario_matrix(groups),
        number=_number,
        has_replays=any(run.replay for run in runs),
        has_settings=any(run.settings_sha256 for run in runs),
        all_settings=lambda run: json.dumps(run.settings, indent=1, ensure_ascii=False),
        omitted=omitted,
        footer=f"eidrive-scenario {version('eidrive-scenario')}",
    )


def _common_metrics(runs: Sequence[ReportedRun]) -> list[str]:
    """Return the preferred metrics, then the most frequent ones, without times, whose mean has no meaning."""
    counts = Counter(name for run in runs for name in run.metrics if not name.endswith(".time"))

    def rank(name: str) -> tuple[int, int, str]:
        priority = next((index for index, start in enumerate(PREFERRED) if name.startswith(start)), len(PREFERRED))
        return priority, -counts[name], name

    return sorted(counts, key=rank)[:SHOWN]


def _title(metric: str, runs: Sequence[ReportedRun]) -> str:
    """Return the name of a metric with its unit, which is usually that of its criterion."""
    kind, last = metric.split(".")[0], metric.split(".")[-1]
    units = (criterion.unit for run in runs for criterion in run.criteria if criterion.name == kind)
    unit = _UNITS[last] if last in _UNITS else next(units, "")
    return f"{metric.replace('.', ' ')} [{unit}]" if unit else metric.replace(".", " ")


def _varied(runs: Sequence[ReportedRun]) -> tuple[str, ...]:
    """Return the parameters in which runs of a distribution differ; empty for runs that differ in their seeds."""
    if all(run.run is None for run in runs):
        return ()
    names = dict.fromkeys(name for run in runs for name in run.parameters)
    return tuple(name for name in names if len({run.parameters.get(name) for run in runs}) > 1)


def _summary(runs: Sequence[ReportedRun], metric: str) -> Summary | None:
    given = [run.metrics.get(metric) for run in runs]
    values = [value for value in given if value is not None and math.isfinite(value)]
    return summarize(values) if values else None


def _number(value: float | None, unit: str) -> str:
    """Return a measured value with two decimals, so that values and limits align, or a count without decimals."""
    return "" if value is None else f"{value:.2f} {unit}" if unit else f"{value:g}"

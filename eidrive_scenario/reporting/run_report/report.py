"""One page over many runs: what passed, what failed, and why."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from itertools import chain, repeat
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import Diagnostic, InputError
from eidrive_scenario.experiments.statistics import Summary, summarize, wilson
from eidrive_scenario.reporting.page import write_page
from eidrive_scenario.reporting.run_report.reported_run import ReportedRun, reported
from eidrive_scenario.reporting.run_report.run_groups import group_runs

PREFERRED = ("min_distance", "time_to_collision", "collision.count", "messages.lost")
"""Metrics that the overview shows before others, by how their names begin."""
SHOWN = 4
"""So many metrics stand in the overview."""
_UNITS = {"count": "", "impact_speed": "m/s"}
"""Of metrics that have another unit than the value of their criterion, by the last part of their name."""


def write_report(
    results: Iterable[Mapping[str, Any]], out: Path, *, sources: Sequence[Path] = (), footer: str = ""
) -> Path:
    """One page over these results, given as `--json` prints them. Returns the page's path.

    sources  files of the results in their order, which errors name

    Runs are grouped by the settings in which those of a scenario differ. A run that lies in several folders is listed
    each time, and counts once.

    `out` is the page if it ends in `.html`, else the folder in which `report.html` is written. Raise InputError if
    there are no results, or one of them is none.
    """
    page = out if out.suffix == ".html" else out / "report.html"
    files: Iterable[str | Path] = chain(sources, repeat(""))
    runs = [reported(result, file) for result, file in zip(results, files, strict=False)]
    if not runs:
        raise InputError(Diagnostic("there is no result to report", "give at least one run", str(out)))
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
                "share": wilson(sum(run.passed for run in group.distinct), len(group.distinct)),
                "summaries": [_summary(group.distinct, name) for name in metrics],
            }
            for index, group in enumerate(groups)
        ],
        number=_number,
        has_settings=any(run.settings_sha256 for run in runs),
        all_settings=lambda run: json.dumps(run.settings, indent=1, ensure_ascii=False),
        footer=footer or f"eidrive-scenario {version('eidrive-scenario')}",
    )


def _common_metrics(runs: Sequence[ReportedRun]) -> list[str]:
    """The preferred ones, then those that most runs have; instants of time do not make a mean."""
    counts = Counter(name for run in runs for name in run.metrics if not name.endswith(".time"))

    def rank(name: str) -> tuple[int, int, str]:
        place = next((index for index, start in enumerate(PREFERRED) if name.startswith(start)), len(PREFERRED))
        return place, -counts[name], name

    return sorted(counts, key=rank)[:SHOWN]


def _title(metric: str, runs: Sequence[ReportedRun]) -> str:
    """Its name in words, and its unit where it is that of the criterion which it belongs to."""
    kind, last = metric.split(".")[0], metric.split(".")[-1]
    units = (criterion.unit for run in runs for criterion in run.criteria if criterion.name == kind)
    unit = _UNITS[last] if last in _UNITS else next(units, "")
    return f"{metric.replace('.', ' ')} [{unit}]" if unit else metric.replace(".", " ")


def _varied(runs: Sequence[ReportedRun]) -> tuple[str, ...]:
    """The parameters in which the runs of a distribution differ; of other runs none, as their seeds tell them apart."""
    if all(run.run is None for run in runs):
        return ()
    names = dict.fromkeys(name for run in runs for name in run.parameters)
    return tuple(name for name in names if len({run.parameters.get(name) for run in runs}) > 1)


def _summary(runs: Sequence[ReportedRun], metric: str) -> Summary | None:
    given = [run.metrics.get(metric) for run in runs]
    values = [value for value in given if value is not None and math.isfinite(value)]
    return summarize(values) if values else None


def _number(value: float | None, unit: str) -> str:
    """With two decimals where it is measured, so that limits and values line up; counts as they are."""
    return "" if value is None else f"{value:.2f} {unit}" if unit else f"{value:g}"

"""One page over many runs: what passed, what failed, and why."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from eidrive_scenario.errors import InputError, Problem
from eidrive_scenario.experiments.statistics import Summary, summarise, wilson
from eidrive_scenario.reporting.page import write_page

PREFERRED = ("min_distance", "time_to_collision", "collision.count", "messages.lost")
"""Metrics that the overview shows before others, by how their names begin."""
SHOWN = 4
"""So many metrics stand in the overview."""
_UNITS = {"count": "", "impact_speed": "m/s"}
"""Of metrics that have another unit than the value of their criterion, by the last part of their name."""


class ReportedCriterion(BaseModel):
    """A verdict as `--json` prints it."""

    model_config = ConfigDict(extra="ignore")

    name: str
    passed: bool
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    reason: str = ""


class ReportedRun(BaseModel):
    """A run as `--json` prints it."""

    model_config = ConfigDict(extra="ignore")

    scenario: str
    seed: int
    channel: str = ""
    passed: bool
    end: str
    criteria: tuple[ReportedCriterion, ...] = ()
    metrics: dict[str, float | None] = {}
    simulated_s: float = 0.0
    run: int | None = None
    parameters: dict[str, str] = {}

    @property
    def finished(self) -> bool:
        """False where the run was cut off by its time limit."""
        return self.end != "time limit"


def write_report(results: Iterable[Mapping[str, Any]], out: Path, *, footer: str = "") -> Path:
    """One page over these results, given as `--json` prints them. Returns the page's path.

    `out` is the page if it ends in `.html`, else the folder in which `report.html` is written. Raises InputError if
    there are no results, or one of them is none.
    """
    page = out if out.suffix == ".html" else out / "report.html"
    runs = [reported(result) for result in results]
    if not runs:
        raise InputError(Problem("there is no result to report", "give at least one run", str(out)))
    groups: dict[tuple[str, str], list[ReportedRun]] = {}
    for run in sorted(runs, key=lambda run: (run.scenario, run.channel, run.run or 0, run.seed)):
        groups.setdefault((run.scenario, run.channel), []).append(run)
    metrics = _common_metrics(runs)
    return write_page(
        page,
        "report.html.jinja",
        title="Scenario report",
        total=len(runs),
        passed=sum(run.passed for run in runs),
        failed=sum(not run.passed and run.finished for run in runs),
        broken=sum(not run.passed and not run.finished for run in runs),
        metrics=[_title(name, runs) for name in metrics],
        groups=[
            {
                "scenario": scenario,
                "channel": channel,
                "anchor": f"group-{index}",
                "runs": group,
                "varied": _varied(group),
                "share": wilson(sum(run.passed for run in group), len(group)),
                "summaries": [_summary(group, name) for name in metrics],
            }
            for index, ((scenario, channel), group) in enumerate(groups.items())
        ],
        number=_number,
        footer=footer or f"eidrive-scenario {version('eidrive-scenario')}",
    )


def reported(result: Mapping[str, Any]) -> ReportedRun:
    """What pages tell of a run, from what `--json` prints. Raises InputError if it is none."""
    try:
        return ReportedRun.model_validate(result)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InputError(
            Problem(f"a result's {where!r}: {first['msg'].lower()}", "give what eidrive run --json prints")
        ) from error


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
    values = [value for run in runs if (value := run.metrics.get(metric)) is not None]
    return summarise(values) if values else None


def _number(value: float | None, unit: str) -> str:
    """With two decimals where it is measured, so that limits and values line up; counts as they are."""
    return "" if value is None else f"{value:.2f} {unit}" if unit else f"{value:g}"

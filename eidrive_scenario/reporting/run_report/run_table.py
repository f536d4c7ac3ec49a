"""Table of all runs of a report as compact data, from which a script of the page creates the visible rows."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import Any, TypeAlias

from eidrive_scenario.evaluation.criterion import Verdict
from eidrive_scenario.experiments.reported_run import OUTCOMES, ReportedRun
from eidrive_scenario.experiments.sweeps.axes import is_setting
from eidrive_scenario.reporting.run_report.run_groups import RunGroup
from eidrive_scenario.reporting.run_report.settings_text import flatten
from eidrive_scenario.simulation.result import typed

_SHOWN_SETTINGS = 4
"""Maximum number of settings that differ, and of varied values, that have a column from the start."""
_SHOWN_LETTERS = 24
"""Maximum number of characters of the values of such a column."""
_EXACT = 2**53
"""Integers below are exact in JavaScript; others, such as large seeds, are texts."""
_UNITS = {"count": "", "at_fault": "", "impact_speed": "m/s", "time": "s", "margin": "", "changed": "s"}
"""Units that differ from the unit of the criterion, by the last part of the name of the metric."""


def failure_reason(criterion: Verdict) -> str:
    """Return why a criterion failed: its reason, else its value and limit, as stores of sweeps have no reasons."""
    if criterion.reason or criterion.value is None:
        return criterion.reason
    limit = f", limit {number_text(criterion.limit, criterion.unit)}" if criterion.limit is not None else ""
    return f"{number_text(criterion.value, criterion.unit)}{limit}"


def number_text(value: float, unit: str) -> str:
    """Return a measured value with two decimals, or a count without decimals."""
    return f"{value:.2f} {unit}" if unit else f"{value:g}"


def metric_titles(runs: Sequence[ReportedRun]) -> dict[str, str]:
    """Return the names of all metrics with their units, which are usually those of their criteria.

    The criterion of a metric is the one with the longest name with which that of the metric begins.
    """
    units = {f"{criterion.name}.": criterion.unit for run in reversed(runs) for criterion in run.criteria}
    by_length = sorted(units, key=len, reverse=True)
    titles = {}
    for name in dict.fromkeys(name for run in runs for name in run.metrics):
        last = name.split(".")[-1]
        unit = _UNITS[last] if last in _UNITS else next((units[own] for own in by_length if name.startswith(own)), "")
        titles[name] = f"{name.replace('.', ' ')} [{unit}]" if unit else name.replace(".", " ")
    return titles


def run_table(groups: Sequence[RunGroup]) -> dict[str, Any]:
    """Return the runs of groups as an object of JSON, each run once, those that did not pass first.

    Each entry is a list over the runs, or over the groups. Texts are numbers in the list `texts`, which contains each
    once. Metrics and settings of runs refer to sets of names, which most runs of a scenario share; of settings, only
    those that differ from the first run with the same set follow.
    """
    entries = [(run, number) for number, group in enumerate(groups) for run in group.runs]
    entries.sort(key=lambda entry: OUTCOMES.index(entry[0].outcome))
    runs = [run for run, _ in entries]
    numbers = [number for _, number in entries]
    texts = _numbers()
    titles = metric_titles(runs)
    kinds, metric_sets, setting_sets = _numbers(), _numbers(), _numbers()
    base: list[list[str]] = []
    metrics: list[list[Any]] = []
    settings: list[list[int]] = []
    for run in runs:
        metrics.append([metric_sets[tuple(titles[name] for name in run.metrics)], *map(_rounded, run.metrics.values())])
        flat = flatten(run.settings)
        number = setting_sets[tuple(flat)]
        if number == len(base):
            base.append(list(flat.values()))
        changes = [(at, value) for at, value in enumerate(flat.values()) if value != base[number][at]]
        settings.append([number, *(part for at, value in changes for part in (at, texts[value]))])
    return {
        "columns": _columns(groups, runs, texts),
        "facts": [
            _column("end", [run.end_reason for run in runs], texts, is_shown=False),
            _column("simulated [s]", [run.simulated_s for run in runs], texts),
            _column("settings", [run.settings_sha256[:10] for run in runs], texts, is_shown=False),
        ],
        "outcomes": [OUTCOMES.index(run.outcome) for run in runs],
        "groups": numbers,
        "groupNames": [
            " · ".join([group.scenario, group.channel, *map(": ".join, group.differing.items())]) for group in groups
        ],
        "criteria": [[_verdict(criterion, kinds, texts) for criterion in run.criteria] for run in runs],
        "kinds": [[name, _rounded(limit), unit] for name, limit, unit in kinds],
        "metrics": metrics,
        "metricSets": list(metric_sets),
        "settings": settings,
        "settingSets": [
            {"paths": paths, "values": [texts[value] for value in values]}
            for paths, values in zip(setting_sets, base, strict=True)
        ],
        "warnings": [[texts[warning] for warning in run.warnings] for run in runs],
        "commands": [texts[run.command] for run in runs],
        "replays": [texts[run.replay] for run in runs],
        "texts": list(texts),
    }


Numbers: TypeAlias = defaultdict[Any, int]
"""Values that get a number each, in the order of their first use."""


def _numbers() -> Numbers:
    numbers: Numbers = defaultdict(int)
    numbers.default_factory = numbers.__len__
    return numbers


def _verdict(criterion: Verdict, kinds: Numbers, texts: Numbers) -> list[Any]:
    """Return kind (name, limit, unit), whether the criterion passed, value, reason, and the lines of the state at its
    first violation."""
    reason = criterion.reason if criterion.passed else failure_reason(criterion)
    kind = kinds[criterion.name, criterion.limit, criterion.unit]
    state = (texts[line] for line in criterion.violation_state)
    return [kind, int(criterion.passed), _rounded(criterion.value), texts[reason], *state]


def _columns(groups: Sequence[RunGroup], runs: Sequence[ReportedRun], texts: Numbers) -> list[dict[str, Any]]:
    """Return the columns that identify a run: scenario, channel, what differs between and within groups, seed.

    Those of groups have a value per group. The page makes columns of other settings from the settings of the runs.
    """
    varied = list(dict.fromkeys(name for group in groups for name in group.varied))
    names = list(dict.fromkeys(name for group in groups for name in group.differing if name not in varied))
    differing = names if len(names) <= _SHOWN_SETTINGS else [name for name in names if "." not in name]
    of_groups: dict[str, list[Any]] = {name: [group.differing.get(name) for group in groups] for name in differing}
    of_runs: dict[str, list[Any]] = {name: [_value(run, name) for run in runs] for name in varied}
    short = [name for name, values in (of_groups | of_runs).items() if max(map(_length, values)) <= _SHOWN_LETTERS]
    shown = short[:_SHOWN_SETTINGS]
    by_group = [
        _column("scenario", [group.scenario for group in groups], texts, is_shown=True),
        _column("channel", [group.channel for group in groups], texts),
        *(_column(name, values, texts, is_shown=name in shown) for name, values in of_groups.items()),
    ]
    return [
        *({**column, "grouped": True} for column in by_group),
        _column("run", [run.run for run in runs], texts),
        *(_column(name, values, texts, is_shown=name in shown) for name, values in of_runs.items()),
        _column("seed", [run.seed for run in runs], texts),
    ]


def _value(run: ReportedRun, name: str) -> int | float | str | None:
    """Return the value of an axis of some runs, of other runs that in their settings; None without it."""
    value = run.value_of(name)
    if value is None and is_setting(name):
        text = flatten(run.settings).get(name.replace("channel.", "channel_profile.", 1), "null")
        return None if text == "null" else typed(text)
    return value


def _length(value: object) -> int:
    return len(f"{value:.6g}") if isinstance(value, float) else len(str(value))


def _column(
    title: str, values: Sequence[int | float | str | None], texts: Numbers, *, is_shown: bool | None = None
) -> dict[str, Any]:
    """Return a column, shown by default if its values differ."""
    is_number = all(value is None or _is_number(value) for value in values)
    shown = len(set(values)) > 1 if is_shown is None else is_shown
    listed = [_rounded(value) if is_number else texts["" if value is None else str(value)] for value in values]
    return {"title": title, "number": is_number, "shown": shown, "values": listed}


def _rounded(value: Any) -> int | float | None:
    """Return a number with six significant digits; None without a finite one, which JSON does not have."""
    if not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return int(value) if _is_number(value) and value == int(value) else float(f"{value:.6g}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < _EXACT


_NAMED = 4
"""Maximum number of criteria that a headline names."""


def headline(runs: Sequence[ReportedRun]) -> str:
    """Return what failed in one line, such as `3 of 40 runs failed: collision (2), min_distance (1)`."""
    counts = {name: sum(run.outcome == name for run in runs) for name in OUTCOMES}
    several = len(runs) > 1
    if counts["passed"] == len(runs):
        return f"All {len(runs)} runs passed" if several else "The run passed"
    failures = Counter(
        name
        for run in runs
        if run.outcome == "failed"
        for name in dict.fromkeys(criterion.name for criterion in run.criteria if not criterion.passed)
    )
    names = [f"{name} ({count})" if several else name for name, count in failures.most_common(_NAMED)]
    if len(failures) > _NAMED:
        names.append(f"{len(failures) - _NAMED} more {'criterion' if len(failures) == _NAMED + 1 else 'criteria'}")
    verbs = {"failed": f"failed: {', '.join(names)}" if names else "failed", "did not finish": "did not finish"}
    verbs["not judged"] = "were not judged" if counts["not judged"] > 1 else "was not judged"
    parts = [f"{counts[name]} {verb}" if several else verb for name, verb in verbs.items() if counts[name]]
    if not several:
        return f"The run {parts[0]}"
    return "; ".join([parts[0].replace(" ", f" of {len(runs)} runs ", 1), *parts[1:]])

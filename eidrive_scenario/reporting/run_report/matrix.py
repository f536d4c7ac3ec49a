"""Success rates of runs over two variables, as a table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from eidrive_scenario.experiments.statistics.proportions import Proportion, wilson
from eidrive_scenario.reporting.run_report.levels import levels_of
from eidrive_scenario.reporting.run_report.reported_run import ReportedRun
from eidrive_scenario.reporting.run_report.run_groups import RunGroup

MOST_COLUMNS, MOST_CELLS = 40, 4000
"""Maximum number of columns and cells of a matrix in a page."""


@dataclass(frozen=True)
class Matrix:
    """Success rates with their 95 % intervals (Wilson): one cell per row and column, None without runs.

    corner  names of the variables of the rows and columns
    """

    corner: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, tuple[Proportion | None, ...]], ...]


def scenario_matrix(groups: Sequence[RunGroup]) -> Matrix | None:
    """Return the matrix of scenarios and settings; None for one scenario, one setting or too many settings."""
    names = [(group.scenario, _name(group)) for group in groups]
    detailed = len(set(names)) < len(names)
    found: dict[str, dict[str, list[ReportedRun]]] = {}
    for group in groups:
        found.setdefault(group.scenario, {}).setdefault(_name(group, detailed=detailed), []).extend(group.distinct)
    return _matrix("scenario", found, least_rows=2)


def _name(group: RunGroup, *, detailed: bool = False) -> str:
    """Return the channel and the settings in which a group differs, `detailed` with those of the channel."""
    own = [f"{name}: {value}" for name, value in group.differing.items() if detailed or not name.startswith("channel.")]
    return " · ".join([group.channel or "no channel", *own])


def parameter_matrix(runs: Sequence[ReportedRun], varied: Sequence[str]) -> Matrix | None:
    """Return the matrix of one or two varied parameters; None for other runs.

    Many different numbers are combined to ranges. Values drawn at random, of which none occurs twice, have no matrix.
    """
    if not 1 <= len(varied) <= 2:
        return None
    down = varied[1] if len(varied) == 2 else ""
    across, along = _label(runs, varied[0]), _label(runs, down) if down else lambda run: "passed"
    found: dict[str, dict[str, list[ReportedRun]]] = {}
    for run in runs:
        found.setdefault(along(run), {}).setdefault(across(run), []).append(run)
    columns = {name for cells in found.values() for name in cells}
    if not all(run.is_swept for run in runs) and len(runs) <= max(len(columns), len(found)):
        return None
    return _matrix(f"{down} \\ {varied[0]}" if down else varied[0], found, least_rows=1)


def axis_matrix(groups: Sequence[RunGroup], axis: str) -> Matrix | None:
    """Return the matrix of the groups of a scenario over the axis of a sweep, with one row per group."""
    across = _label([run for group in groups for run in group.distinct], axis)
    found: dict[str, dict[str, list[ReportedRun]]] = {}
    for group, name in zip(groups, group_names(groups), strict=True):
        for run in group.distinct:
            found.setdefault(name, {}).setdefault(across(run), []).append(run)
    return _matrix(axis, found, least_rows=1, ordered=False)


def group_names(groups: Sequence[RunGroup]) -> list[str]:
    """Return a name for each group of a scenario, with as many settings as differ."""
    names = [_name(group) for group in groups]
    return names if len(set(names)) == len(names) else [_name(group, detailed=True) for group in groups]


def _label(runs: Sequence[ReportedRun], name: str) -> Callable[[ReportedRun], str]:
    """Return the function that returns the text of a value of a run."""
    levels = levels_of(runs, name)
    if levels is None:
        return lambda run: str(value) if (value := run.value_of(name)) is not None else ""
    return lambda run: levels.labels[levels.index(run)]


def _matrix(
    corner: str, found: Mapping[str, Mapping[str, Sequence[ReportedRun]]], least_rows: int, *, ordered: bool = True
) -> Matrix | None:
    columns = sorted({name for cells in found.values() for name in cells}, key=_order)
    if len(found) < least_rows or not 2 <= len(columns) <= MOST_COLUMNS or len(found) * len(columns) > MOST_CELLS:
        return None
    names = sorted(found, key=_order) if ordered else list(found)
    rows = [(name, tuple([success_rate(found[name].get(column, ())) for column in columns])) for name in names]
    return Matrix(corner, tuple(columns), tuple(rows))


def success_rate(runs: Sequence[ReportedRun]) -> Proportion | None:
    """Return the share of passed runs among those that are judged; None if there is none."""
    judged = [run.passed for run in runs if run.is_judged]
    return wilson(sum(judged), len(judged)) if judged else None


def _order(text: str) -> tuple[int, float, str]:
    """Return the key that sorts numbers, and ranges by their start, before other texts."""
    try:
        return 0, float(text.partition(" … ")[0]), text
    except ValueError:
        return 1, 0.0, text

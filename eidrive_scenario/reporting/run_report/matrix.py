"""Success rates of runs over two variables, as a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from eidrive_scenario.experiments.statistics.proportions import Proportion, wilson
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
    """Return the matrix of one or two varied parameters with repeated values; None for other runs."""
    if not 1 <= len(varied) <= 2:
        return None
    down = varied[1] if len(varied) == 2 else ""
    found: dict[str, dict[str, list[ReportedRun]]] = {}
    for run in runs:
        row, column = run.parameters.get(down, "passed"), run.parameters.get(varied[0], "")
        found.setdefault(row, {}).setdefault(column, []).append(run)
    columns = {name for cells in found.values() for name in cells}
    if len(runs) <= max(len(columns), len(found)):
        return None  # Drawn values, of which none occurs twice
    return _matrix(f"{down} \\ {varied[0]}" if down else varied[0], found, least_rows=1)


def _matrix(corner: str, found: Mapping[str, Mapping[str, Sequence[ReportedRun]]], least_rows: int) -> Matrix | None:
    columns = sorted({name for cells in found.values() for name in cells}, key=_order)
    if len(found) < least_rows or not 2 <= len(columns) <= MOST_COLUMNS or len(found) * len(columns) > MOST_CELLS:
        return None
    rows = [
        (name, tuple([_share(found[name].get(column)) for column in columns])) for name in sorted(found, key=_order)
    ]
    return Matrix(corner, tuple(columns), tuple(rows))


def _share(runs: Sequence[ReportedRun] | None) -> Proportion | None:
    return wilson(sum(run.passed for run in runs), len(runs)) if runs else None


def _order(text: str) -> tuple[int, float, str]:
    """Return the key that sorts numbers by value, before other texts."""
    try:
        return 0, float(text), text
    except ValueError:
        return 1, 0.0, text

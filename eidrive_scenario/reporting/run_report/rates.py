"""Success rates of runs over one or two variables: a table, a curve, heat maps."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import TypeVar

from markupsafe import Markup
from matplotlib.figure import Figure

from eidrive_scenario.experiments.reported_run import ReportedRun
from eidrive_scenario.experiments.statistics.intervals import Proportion, wilson
from eidrive_scenario.reporting.drawing.charts import (
    RATE,
    ChartSeries,
    MapAxis,
    line_chart,
    number_texts,
    rate_figure,
    rate_map,
    rate_map_figure,
)
from eidrive_scenario.reporting.drawing.vector_canvas import Size
from eidrive_scenario.reporting.run_report.run_groups import RunGroup

Cell = TypeVar("Cell", bound=Hashable)
MOST_VALUES = 24
"""Maximum number of values that are shown one by one."""
RANGES = 10
"""Number of ranges of equal width of an axis with more values."""


@dataclass(frozen=True)
class Levels(MapAxis):
    """Values of an axis with numbers: single ones, or ranges with their centers.

    start, width  lower end of the first range and width of each; width 0 for single values
    """

    start: float = 0.0
    width: float = 0.0

    def index(self, run: ReportedRun) -> int:
        """Return the position of the level of a run. Raise ValueError for a run without this value."""
        value = run.value_of(self.name)
        if not isinstance(value, int | float):
            raise ValueError(f"no number {self.name}")
        if self.width:
            return min(int((value - self.start) / self.width), len(self.centers) - 1)
        return self.centers.index(float(value))


def levels_of(runs: Sequence[ReportedRun], name: str) -> Levels | None:
    """Return the levels of an axis; None if a run has no number for it."""
    values = [run.value_of(name) for run in runs]
    numbers = {value for value in values if isinstance(value, int | float)}
    if not values or not all(isinstance(value, int | float) for value in values):
        return None
    if len(numbers) <= MOST_VALUES:
        ordered = sorted(numbers)
        given = zip(ordered, number_texts(ordered, 6), strict=True)
        texts = tuple(str(value) if isinstance(value, int) else text for value, text in given)
        return Levels(name, tuple(map(float, ordered)), texts)
    start, end = float(min(numbers)), float(max(numbers))
    width = (end - start) / RANGES
    ends = [start + width * index for index in range(RANGES + 1)]
    centers = tuple((low + high) / 2.0 for low, high in pairwise(ends))
    labels = tuple(map(" … ".join, pairwise(number_texts(ends, 3))))
    return Levels(name, centers, labels, start, width)


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
    named = zip(groups, group_names(groups), strict=True)
    return _matrix("scenario", [(group.scenario, name, run) for group, name in named for run in group.runs], 2)


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
    cells = [(along(run), across(run), run) for run in runs]
    most = max(len({row for row, _, _ in cells}), len({column for _, column, _ in cells}))
    if len(runs) <= most and not all(run.is_swept for run in runs):
        return None
    return _matrix(f"{down} \\ {varied[0]}" if down else varied[0], cells)


def axis_matrix(groups: Sequence[RunGroup], axis: str) -> Matrix | None:
    """Return the matrix of the groups of a scenario over the axis of a sweep, with one row per group."""
    across = _label([run for group in groups for run in group.runs], axis)
    named = zip(groups, group_names(groups), strict=True)
    return _matrix(axis, [(name, across(run), run) for group, name in named for run in group.runs], ordered=False)


def group_names(groups: Sequence[RunGroup]) -> list[str]:
    """Return a name for each group that differs from those of the other groups of its scenario."""
    names = [_name(group) for group in groups]
    is_distinct = len({(group.scenario, name) for group, name in zip(groups, names, strict=True)}) == len(names)
    return names if is_distinct else [_name(group, detailed=True) for group in groups]


def _label(runs: Sequence[ReportedRun], name: str) -> Callable[[ReportedRun], str]:
    """Return the function that returns the text of a value of a run."""
    levels = levels_of(runs, name)
    if levels is None:
        return lambda run: str(value) if (value := run.value_of(name)) is not None else ""
    return lambda run: levels.labels[levels.index(run)]


def _matrix(
    corner: str, cells: Sequence[tuple[str, str, ReportedRun]], least_rows: int = 1, *, ordered: bool = True
) -> Matrix | None:
    """Return the matrix of runs with their rows and columns; None for too few or too many of these."""
    names = list(dict.fromkeys(row for row, _, _ in cells))
    columns = sorted({column for _, column, _ in cells}, key=_order)
    if len(names) < least_rows or not 2 <= len(columns) <= MOST_COLUMNS or len(names) * len(columns) > MOST_CELLS:
        return None
    if ordered:
        names.sort(key=_order)
    rates = _rates(((row, column), run) for row, column, run in cells)
    rows = [(name, tuple([rates.get((name, column)) for column in columns])) for name in names]
    return Matrix(corner, tuple(columns), tuple(rows))


def _rates(runs: Iterable[tuple[Cell, ReportedRun]]) -> dict[Cell, Proportion]:
    """Return the success rate of each cell with judged runs."""
    by_cell: dict[Cell, list[ReportedRun]] = defaultdict(list)
    for cell, run in runs:
        by_cell[cell].append(run)
    return {cell: rate for cell, members in by_cell.items() if (rate := success_rate(members)) is not None}


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


COLORS = ("#0284c7", "#d97706", "#059669", "#a855f7", "#dc2626", "#64748b", "#be185d", "#65a30d")
"""Colors of the curves, each readable on light and dark ground."""
MOST_AXES = 4
"""Maximum number of axes whose pairs have heat maps."""


@dataclass(frozen=True)
class RateCurves:
    """Curves of the groups of a scenario over one axis, with the table of their values.

    legend  name and color of each curve; empty for a single one
    omitted number of groups without a curve
    """

    scenario: str
    axis: str
    chart: Markup
    legend: tuple[tuple[str, str], ...]
    matrix: Matrix | None
    omitted: int


@dataclass(frozen=True)
class RateMap:
    """Heat map of two axes, with the table of its values, whose rows are in the order of the map.

    pooled  names of the other axes, over whose values the runs are combined
    """

    chart: Markup
    matrix: Matrix
    pooled: tuple[str, ...]


def rate_curves(groups: Sequence[RunGroup]) -> Iterator[RateCurves]:
    """Yield the curves of each scenario whose groups vary one number only."""
    for scenario, axis, members, lines in _curves(groups):
        chart = line_chart(lines, x_title=axis, y_title=RATE, y_range=(0.0, 1.0), named=False, points=True)
        yield RateCurves(
            scenario,
            axis,
            Markup(chart),
            tuple((line.name, line.color) for line in lines) if len(lines) > 1 else (),
            axis_matrix(members, axis),
            len(members) - len(lines),
        )


def _curves(groups: Sequence[RunGroup]) -> Iterator[tuple[str, str, list[RunGroup], list[ChartSeries]]]:
    """Yield scenario, axis, groups and curves of each scenario whose groups vary one number only."""
    by_axis: dict[tuple[str, str], list[RunGroup]] = defaultdict(list)
    for group in groups:
        if len(group.numbers) == 1:
            by_axis[group.scenario, group.numbers[0]].append(group)
    for (scenario, axis), members in by_axis.items():
        lines = [
            line
            for group, name, color in zip(members, group_names(members), COLORS, strict=False)
            if (line := _line(group.runs, axis, name, color)) is not None
        ]
        if lines:
            yield scenario, axis, members, lines


def _line(runs: Sequence[ReportedRun], axis: str, name: str, color: str) -> ChartSeries | None:
    """Return the rates of a group at each level; None without judged runs, and if no value of other runs than those of
    a sweep occurs twice."""
    levels = levels_of(runs, axis)
    if levels is None or (not runs[0].is_swept and len(levels.centers) == len(runs)):
        return None
    rates = dict(sorted(_rates((levels.index(run), run) for run in runs).items()))
    if not rates:
        return None
    return ChartSeries(
        name,
        color,
        tuple(levels.centers[level] for level in rates),
        tuple(rate.share for rate in rates.values()),
        low=tuple(rate.low for rate in rates.values()),
        high=tuple(rate.high for rate in rates.values()),
    )


def rate_maps(group: RunGroup) -> Iterator[RateMap]:
    """Yield the heat map of each pair of numbers that vary in a group; none for more than four."""
    for columns, rows, rates in _maps(group):
        pair = columns.name, rows.name
        matrix = parameter_matrix(group.runs, pair)
        if matrix is not None:
            upwards = replace(matrix, rows=matrix.rows[::-1])
            yield RateMap(
                Markup(rate_map(columns, rows, rates)),
                upwards,
                tuple(name for name in group.varied if name not in pair),
            )


def _maps(group: RunGroup) -> Iterator[tuple[Levels, Levels, dict[tuple[int, int], Proportion]]]:
    """Yield the levels of columns and rows of each map of a group, and its rates by (column, row)."""
    if not 2 <= len(group.numbers) <= MOST_AXES:
        return
    for pair in combinations(group.numbers, 2):
        columns, rows = (levels_of(group.runs, name) for name in pair)
        if columns is not None and rows is not None:
            rates = _rates(((columns.index(run), rows.index(run)), run) for run in group.runs)
            if rates:
                yield columns, rows, rates


def rate_figures(groups: Sequence[RunGroup], size: Size) -> Iterator[tuple[str, Figure]]:
    """Yield the curves and heat maps of a report as figures of a size [mm] with their names."""
    for scenario, axis, _, lines in _curves(groups):
        yield f"{scenario}-{axis}", rate_figure(lines, x_title=axis, size=size)
    by_scenario: dict[str, list[RunGroup]] = defaultdict(list)
    for group in groups:
        by_scenario[group.scenario].append(group)
    for scenario, members in by_scenario.items():
        for group, name in zip(members, group_names(members), strict=True):
            for columns, rows, rates in _maps(group):
                title = f"{scenario}-{columns.name}-{rows.name}" + f"-{name}" * (len(members) > 1)
                yield title, rate_map_figure(columns, rows, rates, size)

"""Pictures of success rates over numbers that vary: a curve over one axis, heat maps over two."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from markupsafe import Markup

from eidrive_scenario.experiments.statistics.proportions import Proportion, wilson
from eidrive_scenario.reporting.drawing.chart import ChartSeries, line_chart
from eidrive_scenario.reporting.drawing.rate_map import rate_map
from eidrive_scenario.reporting.run_report.levels import levels_of
from eidrive_scenario.reporting.run_report.matrix import Matrix, axis_matrix, group_names, parameter_matrix
from eidrive_scenario.reporting.run_report.reported_run import ReportedRun
from eidrive_scenario.reporting.run_report.run_groups import RunGroup

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
    by_axis: dict[tuple[str, str], list[RunGroup]] = defaultdict(list)
    for group in groups:
        if len(group.numbers) == 1:
            by_axis[group.scenario, group.numbers[0]].append(group)
    for (scenario, axis), members in by_axis.items():
        names = group_names(members)
        lines = [
            line
            for group, name, color in zip(members, names, COLORS, strict=False)
            if (line := _line(group.distinct, axis, name, color)) is not None
        ]
        if not lines:
            continue
        yield RateCurves(
            scenario,
            axis,
            Markup(
                line_chart(
                    lines,
                    x_title=axis,
                    y_title="success rate",
                    x_range=_range([value for line in lines for value in line.x]),
                    y_range=(0.0, 1.0),
                    named=False,
                    points=True,
                )
            ),
            tuple((line.name, line.color) for line in lines) if len(lines) > 1 else (),
            axis_matrix(members, axis),
            len(members) - len(lines),
        )


def _line(runs: Sequence[ReportedRun], axis: str, name: str, color: str) -> ChartSeries | None:
    """Return the rates of a group at each level; None without judged runs, and if no value of other runs than those of
    a sweep occurs twice."""
    levels = levels_of(runs, axis)
    if levels is None or (not runs[0].is_swept and len(levels.centers) == len(runs)):
        return None
    found: dict[int, list[bool]] = defaultdict(list)
    for run in runs:
        if run.is_judged:
            found[levels.index(run)].append(run.passed)
    if not found:
        return None
    rates = {level: wilson(sum(passed), len(passed)) for level, passed in sorted(found.items())}
    return ChartSeries(
        name,
        color,
        tuple(levels.centers[level] for level in rates),
        tuple(rate.share for rate in rates.values()),
        low=tuple(rate.low for rate in rates.values()),
        high=tuple(rate.high for rate in rates.values()),
    )


def _range(values: Sequence[float]) -> tuple[float, float]:
    """Return the limits of the axis, with a width for a single value."""
    low, high = min(values), max(values)
    return (low, high) if low < high else (low - 0.5, high + 0.5)


def rate_maps(group: RunGroup) -> Iterator[RateMap]:
    """Yield the heat map of each pair of numbers that vary in a group; none for more than four."""
    if not 2 <= len(group.numbers) <= MOST_AXES:
        return
    for pair in combinations(group.numbers, 2):
        matrix = parameter_matrix(group.distinct, pair)
        columns, rows = (levels_of(group.distinct, name) for name in pair)
        if matrix is None or columns is None or rows is None:
            continue
        passed: dict[tuple[int, int], list[bool]] = defaultdict(list)
        for run in (run for run in group.distinct if run.is_judged):
            passed[columns.index(run), rows.index(run)].append(run.passed)
        if not passed:
            continue
        rates: dict[tuple[int, int], Proportion] = {place: wilson(sum(one), len(one)) for place, one in passed.items()}
        svg = rate_map(
            columns.centers,
            rows.centers,
            rates,
            x_title=pair[0],
            y_title=pair[1],
            names=(columns.labels, rows.labels),
        )
        upwards = replace(matrix, rows=matrix.rows[::-1])
        yield RateMap(Markup(svg), upwards, tuple(name for name in group.varied if name not in pair))

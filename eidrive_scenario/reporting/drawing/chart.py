"""Line chart as inline SVG of a page, drawn by matplotlib in the colors of the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from eidrive_scenario.reporting.drawing.inline_svg import PAGE_STYLE, PAPER, inline_svg

WIDTH, HEIGHT = 11.0, 3.0
"""Size of the chart [in]; a page scales it to its own width."""
LEFT, RIGHT, TOP, BOTTOM = 0.047, 0.873, 0.95, 0.14
"""Edges of the axes as fractions of the size. The names of the series are to the right of them."""
WIDE = 0.975
"""Right edge of the axes without names; half of the number at the end of the axis is beyond it."""
NAME_SPACING = 11.5
"""Minimum vertical distance between names [pt]."""


@dataclass(frozen=True)
class ChartSeries:
    """Series of a chart: points (x, y), and the index of an optional marked point.

    low, high  limits of the interval of each y, drawn as a band; () without intervals
    """

    name: str
    color: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    dashed: bool = False
    mark: int | None = None
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()


def line_chart(
    lines: Sequence[ChartSeries],
    *,
    x_title: str,
    y_title: str,
    x_range: tuple[float, float] | None = None,
    y_range: tuple[float, float] | None = None,
    named: bool = True,
    points: bool = False,
) -> str:
    """Return the series as an SVG element. A line is interrupted at points outside the ranges.

    named   whether the names of the series are written beside their ends; without them the page needs a legend
    points  whether each point is marked
    """
    with rc_context(PAGE_STYLE):
        figure = Figure(figsize=(WIDTH, HEIGHT))
        axes = figure.add_axes((LEFT, BOTTOM, (RIGHT if named else WIDE) - LEFT, TOP - BOTTOM))
        axes.set_xlim(x_range or _extent([value for line in lines for value in line.x]))
        axes.set_ylim(y_range or (0.0, _extent([value for line in lines for value in line.y])[1]))
        axes.set_xlabel(x_title)
        axes.set_ylabel(y_title)
        axes.xaxis.set_major_locator(MaxNLocator(9, steps=[1, 2, 5, 10]))
        axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        axes.grid(axis="y")
        axes.set_axisbelow(True)
        ends = [end for line in sorted(lines, key=lambda line: line.dashed) if (end := _draw(axes, line)) is not None]
        for line in lines if points else ():
            axes.plot(line.x, line.y, "o", color=line.color, ms=4.0, clip_on=False, zorder=3.0, gid="mark")
        if named:
            _draw_names(axes, ends)
        return inline_svg(figure, f"{y_title} over {x_title}")


def _draw(axes: Axes, line: ChartSeries) -> tuple[float, float, ChartSeries] | None:
    """Draw a series and return its last point inside the ranges, or None without such a point."""
    x, y = np.asarray(line.x, dtype=np.float64), np.asarray(line.y, dtype=np.float64)
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    inside = (left <= x) & (x <= right) & (bottom <= y) & (y <= top)
    if not inside.any():
        return None
    if line.low:
        axes.fill_between(x, line.low, line.high, color=line.color, alpha=0.16, lw=0.0)
    style = (0.0, (3.6, 3.6)) if line.dashed else "-"
    axes.plot(x, np.where(inside, y, np.nan), color=line.color, lw=1.6, ls=style, gid="series")
    if line.mark is not None:
        point = [x[line.mark]], [y[line.mark]]
        axes.plot(*point, "o", color=line.color, ms=6.5, mec=PAPER, mew=1.1, clip_on=False, zorder=3.0, gid="mark")
    last = int(np.flatnonzero(inside)[-1])
    return float(x[last]), float(y[last]), line


def _draw_names(axes: Axes, ends: Sequence[tuple[float, float, ChartSeries]]) -> None:
    """Write the names of the series beside their last points, with a minimum distance between names."""
    bottom, top = axes.get_ylim()
    height = 72.0 * HEIGHT * (TOP - BOTTOM)
    previous = math.inf
    for x, y, line in sorted(ends, key=lambda end: -end[1]):
        previous = min(height * (y - bottom) / ((top - bottom) or 1.0), previous - NAME_SPACING)
        axes.annotate(
            line.name,
            (x, y),
            (1.015, previous),
            textcoords=("axes fraction", "axes points"),
            color=line.color,
            weight="bold",
            va="center",
            arrowprops={"arrowstyle": "-", "color": line.color, "alpha": 0.6, "relpos": (0.0, 0.5), "shrinkA": 0.0},
            annotation_clip=False,
            gid="name",
        )


def _extent(values: Sequence[float]) -> tuple[float, float]:
    return (min(values), max(values)) if values else (0.0, 1.0)

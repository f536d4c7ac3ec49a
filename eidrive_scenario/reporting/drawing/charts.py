"""Line charts and heat maps, drawn by matplotlib: as inline SVG in the colors of a page, or as figures for papers."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import matplotlib
import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import QuadMesh
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedFormatter, FixedLocator, MaxNLocator, PercentFormatter

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.experiments.statistics.intervals import Proportion, percentage
from eidrive_scenario.reporting.drawing.vector_canvas import LABEL, NO_METADATA, PAPER_STYLE, Size, paper_style

PAGE_COLORS = {"#475569": "--axis", "#e5e7eb": "--line", "#334155": "--text", "#ffffff": "--paper"}
"""CSS variables of the page, whose values depend on its light or dark scheme, by the color that matplotlib draws."""
AXIS, GRID, TEXT, PAPER = PAGE_COLORS
PAGE_STYLE: dict[Any, Any] = {
    **PAPER_STYLE,
    "axes.edgecolor": AXIS,
    "axes.labelcolor": TEXT,
    "axes.spines.left": False,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "font.size": 9.0,
    "grid.color": GRID,
    "xtick.color": AXIS,
    "xtick.labelcolor": TEXT,
    "ytick.labelcolor": TEXT,
    "ytick.left": False,
}
"""Settings of matplotlib for figures of a page."""


def inline_svg(figure: Figure, title: str, *, kind: str = "chart", above: str = "") -> str:
    """Return a figure as an SVG element with the colors and fonts of the page, and without ids of its groups.

    kind   class of the element
    above  SVG elements that are drawn last, in points from the upper left corner
    """
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", transparent=True, metadata=NO_METADATA[".svg"])
    svg = buffer.getvalue()
    svg = svg[svg.index("<defs>") : svg.rindex("</svg>")]
    svg = re.sub(r"<style.*?</style>", "", svg, flags=re.DOTALL)  # applies to all elements of a page
    svg = re.sub(r'<g id="(series|mark|name)">', r'<g class="\1">', svg)
    svg = re.sub(r'<g id="[^"]*">', "<g>", svg)
    svg = re.sub(r"font: (?:bold |700 )([\d.]+px)[^;\"]*", r"font-weight: 700; font-size: \1", svg)
    svg = re.sub(r" ?font(?:-family)?: [^;\"]*;", "", svg)
    svg = svg.replace("xlink:href", "href")
    for color, variable in PAGE_COLORS.items():
        svg = svg.replace(color, f"var({variable}, {color})")
    width, height = 72.0 * figure.get_size_inches()
    head = f'<svg xmlns="http://www.w3.org/2000/svg" class="{kind}" viewBox="0 0 {width:g} {height:g}" role="img">'
    return f"{head}<title>{escape(title)}</title>{svg}{above}</svg>"


WIDTH, HEIGHT = 11.0, 3.0
"""Size of the chart [in]; a page scales it to its own width."""
LEFT, RIGHT, TOP, BOTTOM = 0.047, 0.873, 0.95, 0.14
"""Edges of the axes as fractions of the size. The names of the series are to the right of them."""
WIDE = 0.975
"""Right edge of the axes without names; half of the number at the end of the axis is beyond it."""
RATE = "success rate"
"""Title of the axis of rates."""
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
        ends = _draw_lines(axes, lines, (x_title, y_title), (x_range, y_range), ticks=9, points=points)
        if named:
            _draw_names(axes, ends)
        return inline_svg(figure, f"{y_title} over {x_title}")


def rate_figure(lines: Sequence[ChartSeries], *, x_title: str, size: Size) -> Figure:
    """Return rates with their intervals as a figure of a size [mm], with a legend of several series below it."""
    with paper_style():
        figure, axes = _paper_axes(size)
        _draw_lines(axes, lines, (x_title, RATE), (None, (0.0, 1.0)), ticks=6, points=True)
        if len(lines) > 1:
            handles = [Line2D([], [], color=line.color, marker="o", ms=4.0) for line in lines]
            names = [line.name for line in lines]
            figure.legend(handles, names, loc="outside lower center", ncols=2, fontsize=LABEL, frameon=False)
    return figure


def _paper_axes(size: Size) -> tuple[Figure, Axes]:
    """Return a figure of a size [mm] and its axes."""
    figure = Figure(figsize=(size[0] / 25.4, size[1] / 25.4), layout="constrained")
    axes = figure.subplots()
    axes.spines[["right", "top"]].set_visible(False)
    return figure, axes


def _draw_lines(
    axes: Axes,
    lines: Sequence[ChartSeries],
    titles: tuple[str, str],
    ranges: tuple[tuple[float, float] | None, tuple[float, float] | None],
    *,
    ticks: int,
    points: bool,
) -> list[tuple[float, float, ChartSeries]]:
    """Draw the series on a grid, and return the last points of those that have one inside the ranges.

    titles, ranges  of x and y; the ranges are those of the points by default, with a width for a single x
    ticks           maximum number of intervals of x
    """
    xs = [value for line in lines for value in line.x] or [0.0, 1.0]
    low, high = min(xs), max(xs)
    axes.set_xlim(ranges[0] or ((low, high) if low < high else (low - 0.5, high + 0.5)))
    axes.set_ylim(ranges[1] or (0.0, max((value for line in lines for value in line.y), default=1.0)))
    axes.set_xlabel(titles[0])
    axes.set_ylabel(titles[1])
    axes.xaxis.set_major_locator(MaxNLocator(ticks, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    axes.grid(axis="y")
    axes.set_axisbelow(True)
    ends = [end for line in sorted(lines, key=lambda line: line.dashed) if (end := _draw(axes, line)) is not None]
    for line in lines if points else ():
        axes.plot(line.x, line.y, "o", color=line.color, ms=4.0, clip_on=False, zorder=3.0, gid="mark")
    return ends


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


def heat_cells(
    axes: Axes,
    xs: Sequence[float],
    ys: Sequence[float],
    values: Array,
    *,
    colors: str | Colormap,
    scale: Normalize,
    line: float = 0.5,
) -> QuadMesh:
    """Draw values (len(ys), len(xs)) as rectangles around sorted xs and ys, which are the ticks. NaN draws none.

    line  width of the white lines between cells [pt]
    """
    style: dict[str, Any] = {"edgecolors": "white", "linewidth": line} if line else {}
    _mark_values(axes, axes.xaxis, xs)
    _mark_values(axes, axes.yaxis, ys)
    return axes.pcolormesh(cell_edges(xs), cell_edges(ys), values, cmap=colors, norm=scale, **style)


def _mark_values(axes: Axes, axis: Axis, values: Sequence[float]) -> None:
    """Put ticks at the measured values: all of them, or equal steps of their order in too little space."""
    labels = number_texts(values, 4)
    points = float(FontProperties(size=axis.get_tick_params().get("labelsize")).get_size_in_points())
    width, height = 72.0 / axes.figure.dpi * np.array(axes.figure.bbox.size) * axes.get_position().size
    across = axis is axes.xaxis
    needed = points * (0.7 * max(map(len, labels)) + 0.7 if across else 1.6)
    step = max(1, math.ceil(len(values) * needed / (width if across else height)))
    axis.set_major_locator(FixedLocator(values[::step]))
    axis.set_major_formatter(FixedFormatter(labels[::step]))


def number_texts(values: Sequence[float], digits: int) -> list[str]:
    """Return different numbers as texts: with these significant digits, or with as many as distinguish them."""
    several = ([f"{value:.{count}g}" for value in values] for count in range(digits, 18))
    return next((texts for texts in several if len(set(texts)) == len(values)), list(map(repr, values)))


def cell_edges(values: Sequence[float]) -> Array:
    """Return the edges of cells around sorted values."""
    if len(values) == 1:
        return np.array([values[0] - 0.5, values[0] + 0.5])
    inner = (np.array(values[1:]) + np.array(values[:-1])) / 2.0
    return np.concatenate([[2 * values[0] - inner[0]], inner, [2 * values[-1] - inner[-1]]])


MAP_WIDTH, MAP_HEIGHT = 6.2, 4.0
"""Size of the map [in]; a page scales it to its own width."""
MAP_LEFT, MAP_RIGHT, MAP_TOP, MAP_BOTTOM = 0.11, 0.82, 0.975, 0.13
"""Edges of the axes as fractions of the size. The color bar is to the right of them."""
COLORS = "cividis"
"""Color map from 0 (blue) to 1 (yellow), which color-blind readers can distinguish."""
MOST_NUMBERS = 12
"""Maximum number of columns and of rows whose cells contain their percentage."""
_BRIGHT = 0.55
"""Rate from which the text of a cell is dark."""


@dataclass(frozen=True)
class MapAxis:
    """Columns or rows of a heat map: title, and value and text of each, in ascending order."""

    name: str
    centers: tuple[float, ...]
    labels: tuple[str, ...]


Rates = Mapping[tuple[int, int], Proportion]
"""Rates of a heat map by (column, row)."""


def rate_map(columns: MapAxis, rows: MapAxis, rates: Rates) -> str:
    """Return an SVG element with one cell per rate. A tooltip of each has its interval."""
    with rc_context(PAGE_STYLE):
        figure = Figure(figsize=(MAP_WIDTH, MAP_HEIGHT), dpi=72.0)
        axes = figure.add_axes((MAP_LEFT, MAP_BOTTOM, MAP_RIGHT - MAP_LEFT, MAP_TOP - MAP_BOTTOM))
        mesh = _draw_rates(axes, columns, rows, rates)
        beside = figure.add_axes((MAP_RIGHT + 0.03, MAP_BOTTOM, 0.03, MAP_TOP - MAP_BOTTOM))
        bar = figure.colorbar(mesh, cax=beside, format=PercentFormatter(1.0))
        bar.set_label(RATE)
        beside.tick_params(length=0.0)
        bar.outline.set_visible(False)
        above = _tooltips(axes, columns, rows, rates)
        return inline_svg(figure, f"{RATE} over {columns.name} and {rows.name}", kind="map", above=above)


def rate_map_figure(columns: MapAxis, rows: MapAxis, rates: Rates, size: Size) -> Figure:
    """Return the rates as a heat map of a size [mm]."""
    with paper_style():
        figure, axes = _paper_axes(size)
        mesh = _draw_rates(axes, columns, rows, rates)
        bar = figure.colorbar(mesh, format=PercentFormatter(1.0), label=RATE)
        if bar.solids is not None:  # matplotlib draws bars of 50 or more colors as images
            bar.solids.set(rasterized=False, edgecolor="face")
    return figure


def _draw_rates(axes: Axes, columns: MapAxis, rows: MapAxis, rates: Rates) -> QuadMesh:
    """Draw a heat map with its percentages, if they are few, and the values of its cells on the axes."""
    shares = np.full((len(rows.centers), len(columns.centers)), np.nan)
    for (column, row), rate in rates.items():
        shares[row, column] = rate.share
    mesh = heat_cells(axes, columns.centers, rows.centers, shares, colors=COLORS, scale=Normalize(0.0, 1.0))
    axes.set_xlabel(columns.name)
    axes.set_ylabel(rows.name)
    if max(shares.shape) <= MOST_NUMBERS:
        dark = matplotlib.colormaps[COLORS](0.0)
        for row, column in np.argwhere(np.isfinite(shares)).tolist():
            x, y, share = columns.centers[column], rows.centers[row], shares[row, column]
            color = dark if share > _BRIGHT else "#fffffe"
            axes.text(x, y, percentage(share, 0).removesuffix("%"), color=color, ha="center", va="center", fontsize=8.0)
    return mesh


def _tooltips(axes: Axes, columns: MapAxis, rows: MapAxis, rates: Rates) -> str:
    """Return transparent rectangles above the cells, whose titles a browser shows."""
    height = 72.0 * MAP_HEIGHT
    across = axes.transData.transform([(edge, 0.0) for edge in cell_edges(columns.centers)])[:, 0]
    down = height - axes.transData.transform([(0.0, edge) for edge in cell_edges(rows.centers)])[:, 1]
    rectangles = []
    for (column, row), rate in sorted(rates.items()):
        values = f"{columns.name} {columns.labels[column]}, {rows.name} {rows.labels[row]}"
        text = f"{values}: {rate.successes} of {rate.trials} passed, 95 % interval {rate.low:.2f} to {rate.high:.2f}"
        corner = f'x="{across[column]:.2f}" y="{down[row + 1]:.2f}"'
        size = f'width="{across[column + 1] - across[column]:.2f}" height="{down[row] - down[row + 1]:.2f}"'
        rectangles.append(f'<rect {corner} {size} fill="transparent"><title>{escape(text)}</title></rect>')
    return "".join(rectangles)

"""Heat map of success rates over two axes, as inline SVG of a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import matplotlib
import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from eidrive_scenario.arrays import Array
from eidrive_scenario.experiments.statistics.proportions import Proportion
from eidrive_scenario.reporting.drawing.heat_cells import cell_edges, heat_cells
from eidrive_scenario.reporting.drawing.inline_svg import PAGE_STYLE, inline_svg

WIDTH, HEIGHT = 6.2, 4.0
"""Size of the map [in]; a page scales it to its own width."""
LEFT, RIGHT, TOP, BOTTOM = 0.11, 0.82, 0.975, 0.13
"""Edges of the axes as fractions of the size. The color bar is to the right of them."""
COLORS = "cividis"
"""Color map from 0 (blue) to 1 (yellow), which color-blind readers can distinguish."""
MOST_NUMBERS = 12
"""Maximum number of columns and of rows whose cells contain their percentage."""
_BRIGHT = 0.55
"""Rate from which the text of a cell is dark."""


def rate_map(
    xs: Sequence[float],
    ys: Sequence[float],
    rates: Mapping[tuple[int, int], Proportion],
    *,
    x_title: str,
    y_title: str,
    names: tuple[Sequence[str], Sequence[str]],
) -> str:
    """Return an SVG element with one cell per rate, at (column, row). A tooltip of each has its interval.

    names  texts of the values of columns and rows, for the tooltips
    """
    shares = np.full((len(ys), len(xs)), np.nan)
    for (column, row), rate in rates.items():
        shares[row, column] = rate.share
    with rc_context(PAGE_STYLE):
        figure = Figure(figsize=(WIDTH, HEIGHT), dpi=72.0)
        axes = figure.add_axes((LEFT, BOTTOM, RIGHT - LEFT, TOP - BOTTOM))
        mesh = heat_cells(axes, xs, ys, shares, colors=COLORS, scale=Normalize(0.0, 1.0))
        axes.set_xlabel(x_title)
        axes.set_ylabel(y_title)
        axes.xaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 2.5, 5, 10]))
        axes.yaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 2.5, 5, 10]))
        beside = figure.add_axes((RIGHT + 0.03, BOTTOM, 0.03, TOP - BOTTOM))
        bar = figure.colorbar(mesh, cax=beside, format=PercentFormatter(1.0))
        bar.set_label("success rate")
        beside.tick_params(length=0.0)
        bar.outline.set_visible(False)
        if max(len(xs), len(ys)) <= MOST_NUMBERS:
            _write_numbers(axes, xs, ys, shares)
        above = _tooltips(axes, xs, ys, rates, (x_title, y_title), names)
        return inline_svg(figure, f"success rate over {x_title} and {y_title}", kind="map", above=above)


def _write_numbers(axes: Axes, xs: Sequence[float], ys: Sequence[float], shares: Array) -> None:
    colors = matplotlib.colormaps[COLORS]
    for row, y in enumerate(ys):
        for column, x in enumerate(xs):
            share = float(shares[row, column])
            if not np.isnan(share):
                color = colors(0.0) if share > _BRIGHT else "#fffffe"
                axes.text(x, y, f"{100.0 * share:.0f}", color=color, ha="center", va="center", fontsize=8.0)


def _tooltips(
    axes: Axes,
    xs: Sequence[float],
    ys: Sequence[float],
    rates: Mapping[tuple[int, int], Proportion],
    titles: tuple[str, str],
    names: tuple[Sequence[str], Sequence[str]],
) -> str:
    """Return transparent rectangles above the cells, whose titles a browser shows."""
    height = 72.0 * HEIGHT
    across = axes.transData.transform([(edge, 0.0) for edge in cell_edges(xs)])[:, 0]
    down = height - axes.transData.transform([(0.0, edge) for edge in cell_edges(ys)])[:, 1]
    found = []
    for (column, row), rate in sorted(rates.items()):
        values = ", ".join(
            f"{title} {name[place]}" for title, name, place in zip(titles, names, (column, row), strict=True)
        )
        text = f"{values}: {rate.successes} of {rate.trials} passed, 95 % interval {rate.low:.2f} to {rate.high:.2f}"
        place = f'x="{across[column]:.2f}" y="{down[row + 1]:.2f}"'
        size = f'width="{across[column + 1] - across[column]:.2f}" height="{down[row] - down[row + 1]:.2f}"'
        found.append(f'<rect {place} {size} fill="transparent"><title>{escape(text)}</title></rect>')
    return "".join(found)

"""Figures of matplotlib as inline SVG of a page, in its colors and fonts."""

from __future__ import annotations

import io
import re
from html import escape
from typing import Any

from matplotlib.figure import Figure

PAGE_COLORS = {"#475569": "--axis", "#e5e7eb": "--line", "#334155": "--text", "#ffffff": "--paper"}
"""CSS variables of the page, whose values depend on its light or dark scheme, by the color that matplotlib draws."""
AXIS, GRID, TEXT, PAPER = PAGE_COLORS
PAGE_STYLE: dict[Any, Any] = {
    "axes.edgecolor": AXIS,
    "axes.labelcolor": TEXT,
    "axes.spines.left": False,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "font.size": 9.0,
    "grid.color": GRID,
    "svg.fonttype": "none",
    "svg.hashsalt": "eidrive",
    "text.parse_math": False,
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
    without_metadata = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    figure.savefig(buffer, format="svg", transparent=True, metadata=without_metadata)
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

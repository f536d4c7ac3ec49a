"""Pictures for papers, drawn by matplotlib: a section of the world with legend, scale bar and axes."""

from __future__ import annotations

import io
import math
import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch, Rectangle
from matplotlib.path import Path as Outline

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.files.atomic import write_atomically
from eidrive_scenario.files.bounded import path_argument
from eidrive_scenario.reporting.drawing.canvas import LONGEST_LABEL, Canvas, Points
from eidrive_scenario.reporting.drawing.top_view import GROUND, STATION, TRUTH, WHITE, Window

PAPER_STYLE: dict[Any, Any] = {
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "eidrive",
    "text.parse_math": False,
}
"""Settings of matplotlib for pictures: texts stay texts, and equal pictures are equal files. Fonts and their sizes are
those of the user (`matplotlibrc`)."""
Size = tuple[float, float]
"""Width and height of a picture [mm]."""
DEFAULT_SIZE: Size = (160.0, 90.0)
SMALLEST_SIZE, LARGEST_SIZE = 20.0, 2000.0
"""Limits of width and height [mm]."""
RESOLUTION = 203.2
"""Resolution of PNG files [dots per inch]: 8 pixels per millimeter, 1280 x 720 at the default size."""
THINNEST = 0.4
"""Minimum width of a line [pt]."""
LABEL = "x-small"
"""Size of labels and of the legend, relative to `font.size`."""
LEAST_MAP = 0.4
"""Minimum share of the height that the section has beside the legend."""
_MILLIMETER = 72.0 / 25.4
"""Points per millimeter."""
_PAD = 5.0
"""Distance of scale bar and axes from the edge [pt]."""
_ARROW = 15.0
"""Length of the arrows of the axes [pt]."""
NO_METADATA: dict[str, dict[str, None]] = {
    ".png": {"Software": None},
    ".svg": dict.fromkeys(("Creator", "Date", "Format", "Type")),
    ".pdf": dict.fromkeys(("Creator", "CreationDate", "Producer")),
}
"""Entries that would differ between versions and days, by the suffix of a file."""


class LegendEntries(Canvas):
    """Canvas that collects the entries of a legend, and draws nothing."""

    smallest = 4.0

    def __init__(self, window: Window, size: tuple[float, float]) -> None:
        super().__init__(window, size)
        self.entries: dict[str, Patch | Line2D] = {}

    def fill(self, polygon: Points, color: str, opacity: float = 1.0, *, legend: str = "") -> None:
        if legend and legend not in self.entries:
            edge = TRUTH if color in (WHITE, STATION) else color
            self.entries[legend] = Patch(facecolor=to_rgba(color, opacity), edgecolor=edge, linewidth=0.8)

    def line(
        self,
        points: Points,
        color: str,
        width: float,
        *,
        closed: bool = False,
        stroke: float = 0.0,
        legend: str = "",
    ) -> None:
        if legend and legend not in self.entries:
            self.entries[legend] = Line2D([], [], color=color, lw=1.4, ls=(0.0, (2.0, 1.5)) if stroke else "-")

    def label(self, text: str, left: float, base: float, size: float = 1.0, color: str = TRUTH) -> None:
        pass

    def label_size(self, text: str, size: float = 1.0) -> tuple[float, float]:
        return 0.0, 0.0


class VectorCanvas(Canvas):
    """Axes of a figure that show a section of the world; units are points."""

    smallest = 4.0

    def __init__(self, figure: Figure, axes: Axes, window: Window) -> None:
        width, height = (72.0 * figure.get_size_inches() * axes.get_position().size).tolist()
        super().__init__(window, (width, height))
        self._axes = axes
        axes.set_xlim(window.left, window.right)
        axes.set_ylim(window.bottom, window.top)
        self._renderer: RendererAgg = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
        self._order = 1.0
        self.reserved = (*self._draw_scale(), *self._draw_axes())

    def fill(self, polygon: Points, color: str, opacity: float = 1.0, *, legend: str = "") -> None:
        plan = np.asarray(polygon, dtype=float)[:, :2]
        # An edge of the same color closes the gaps that viewers show between neighbors
        edge = {"edgecolor": color, "linewidth": THINNEST} if opacity >= 1.0 else {"linewidth": 0.0}
        self._add(PathPatch(Outline(np.vstack([plan, plan[:1]])), facecolor=to_rgba(color, opacity), **edge))

    def line(
        self,
        points: Points,
        color: str,
        width: float,
        *,
        closed: bool = False,
        stroke: float = 0.0,
        legend: str = "",
    ) -> None:
        plan = np.asarray(points, dtype=float)[:, :2]
        outline = Outline(np.vstack([plan, plan[:1]]), closed=True) if closed else Outline(plan)
        thickness = max(width * self.scale, THINNEST)
        dashes = max(stroke * self.scale, 1.0) / thickness
        self._add(
            PathPatch(
                outline,
                fill=False,
                edgecolor=color,
                linewidth=thickness,
                linestyle=(0.0, (dashes, dashes)) if stroke else "-",
                capstyle="butt",
                joinstyle="round",
            )
        )

    def label(self, text: str, left: float, base: float, size: float = 1.0, color: str = TRUTH) -> None:
        x, y = self._point(left, base)
        self._order += 1.0
        behind = {"boxstyle": "square,pad=0.12", "facecolor": WHITE, "alpha": 0.7, "edgecolor": "none"}
        self._axes.text(
            x,
            y,
            drawable(text),
            fontsize=self._points(size),
            color=color,
            zorder=self._order,
            bbox=behind,
            clip_on=True,
        )

    def label_size(self, text: str, size: float = 1.0) -> tuple[float, float]:
        points = self._points(size)
        with warnings.catch_warnings():  # of missing glyphs, which the writing reports
            warnings.simplefilter("ignore")
            width, _, _ = self._renderer.get_text_width_height_descent(  # type: ignore[no-untyped-call]
                drawable(text), FontProperties(size=points), ismath=False
            )
        return float(width), 0.75 * points

    def _points(self, size: float) -> float:
        return size * float(FontProperties(size=LABEL).get_size_in_points())

    def _point(self, left: float, base: float) -> tuple[float, float]:
        """Return the point at a position [m]."""
        return self.window.left + left / self.scale, self.window.top - base / self.scale

    def _add(self, patch: Patch) -> None:
        self._order += 1.0
        patch.set_zorder(self._order)
        self._axes.add_patch(patch)

    def _draw_scale(self) -> Iterator[tuple[float, float, float, float]]:
        """Draw the scale bar in the lower left corner above all, and yield its rectangle."""
        width, height = self.size
        length = _longest_round_length(width / self.scale / 4.0)
        bar, text = length * self.scale, f"{length:g} m"
        label_width, label_height = self.label_size(text)
        right = 3.0 * _PAD + bar + label_width
        top = height - 2.5 * _PAD - label_height
        yield 0.0, top, right, height
        self._box(0.0, top, right, height)
        line = height - _PAD - label_height / 2.0
        ends = [self._point(_PAD, line), self._point(_PAD + bar, line)]
        ticks = [(self._point(x, line - 2.5), self._point(x, line + 2.5)) for x in (_PAD, _PAD + bar)]
        for begin, end in (ends, *ticks):
            self._axes.plot(*zip(begin, end, strict=True), color=STATION, lw=1.2, zorder=1e6)
        x, y = self._point(2.0 * _PAD + bar, height - _PAD)
        self._axes.text(x, y, text, fontsize=self._points(1.0), color=STATION, zorder=1e6)

    def _draw_axes(self) -> Iterator[tuple[float, float, float, float]]:
        """Draw the directions of x and y in the lower right corner above all, and yield their rectangle."""
        width, height = self.size
        letter, _ = self.label_size("x")
        side = _ARROW + 2.0 * letter + 2.5 * _PAD
        yield width - side, height - side, width, height
        self._box(width - side, height - side, width, height)
        left, base = width - side + _PAD + 2.0 * letter, height - _PAD
        for name, end, at in (
            ("x", (left + _ARROW, base), (left + _ARROW - letter / 2.0, base - _PAD)),
            ("y", (left, base - _ARROW), (left - 1.8 * letter, base - _ARROW + _PAD)),
        ):
            arrow = {"arrowstyle": "-|>", "color": STATION, "lw": 0.8, "shrinkA": 0.0, "shrinkB": 0.0}
            arrow |= {"mutation_scale": 6.0}
            self._axes.annotate("", self._point(*end), self._point(left, base), arrowprops=arrow, zorder=1e6)
            self._axes.text(*self._point(*at), name, fontsize=self._points(1.0), style="italic", zorder=1e6)

    def _box(self, left: float, top: float, right: float, bottom: float) -> None:
        """Draw a light background of a rectangle on the canvas."""
        x, y = self._point(left, bottom)
        size = (right - left) / self.scale, (bottom - top) / self.scale
        self._axes.add_patch(Rectangle((x, y), *size, facecolor=to_rgba(WHITE, 0.8), lw=0.0, zorder=1e6 - 1.0))


def _longest_round_length(longest: float) -> float:
    """Return the largest of 1, 2, 5, 10, … [m] up to a length."""
    power = 10.0 ** math.floor(math.log10(longest))
    return power * next(factor for factor in (5.0, 2.0, 1.0) if factor * power <= longest * (1.0 + 1e-9))


def drawable(text: str) -> str:
    """Return a label without characters that no file may contain."""
    return "".join([letter if letter.isprintable() else "?" for letter in text[:LONGEST_LABEL]])


def scene_figure(
    draw: Callable[[Canvas], None], section: Callable[[float], Window], size: Size = DEFAULT_SIZE
) -> Figure:
    """Return a figure of a section with the legend below it.

    draw     draws the section; called twice, first for the legend only
    section  returns the section for a ratio of width to height

    Raise SettingError if the legend leaves too little of the picture.
    """
    entries = LegendEntries(section(size[0] / size[1]), size)
    draw(entries)
    width, height = size[0] * _MILLIMETER, size[1] * _MILLIMETER
    with paper_style():
        figure = Figure(figsize=(width / 72.0, height / 72.0), dpi=72.0)
        below = _draw_legend(figure, entries.entries)
        if height - below < LEAST_MAP * height:
            got, least = f"{size[0]:g}x{size[1]:g} mm", math.ceil(below / (1.0 - LEAST_MAP) / _MILLIMETER)
            hint = f"give a height of at least {least} mm, or a larger width"
            raise SettingError(Diagnostic(f"--size: too small for the legend (got {got})", hint))
        axes = figure.add_axes((0.0, below / height, 1.0, 1.0 - below / height), facecolor=GROUND)
        axes.set(xticks=[], yticks=[])
        axes.spines[:].set_visible(False)
        draw(VectorCanvas(figure, axes, section(width / (height - below))))
    return figure


def _draw_legend(figure: Figure, entries: dict[str, Patch | Line2D]) -> float:
    """Draw the legend with as many columns as the width permits, and return its height [pt]."""
    if not entries:
        return 0.0
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    width = 72.0 * float(figure.get_size_inches()[0])
    for columns in range(len(entries), 0, -1):
        legend: Legend = figure.legend(
            list(entries.values()),
            [drawable(text) for text in entries],
            loc="lower center",
            ncols=columns,
            frameon=False,
            fontsize=LABEL,
            borderpad=0.2,
            borderaxespad=0.0,
            columnspacing=1.2,
            handlelength=1.6,
            labelspacing=0.3,
        )
        box = legend.get_window_extent(renderer)
        if box.width <= width - 2.0 * _PAD or columns == 1:
            return float(box.height)
        legend.remove()
    return 0.0


@contextmanager
def paper_style() -> Iterator[None]:
    """Set the style of pictures for papers, and ignore characters that the fonts do not have."""
    with rc_context(PAPER_STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")
        yield


def write_figure(figure: Figure, path: str | os.PathLike[str], resolution: float = RESOLUTION) -> None:
    """Write a figure as PNG, SVG or PDF by the suffix of its file. Raise SettingError for another suffix, or if it
    cannot be written.

    resolution  of a PNG file [dots per inch]
    """
    location = path_argument(path, "path")
    check_format("path", location)
    suffix = location.suffix.lower()
    buffer = io.BytesIO()
    with paper_style():
        figure.savefig(buffer, format=suffix[1:], dpi=resolution, metadata=NO_METADATA[suffix])
    with write_atomically(location) as stream:
        stream.write(buffer.getvalue())


def check_format(option: str, path: Path | None, suffixes: tuple[str, ...] = tuple(NO_METADATA)) -> None:
    """Raise SettingError if a picture or film has another suffix than these."""
    if path is not None and path.suffix.lower() not in suffixes:
        hint = f"give a file name in {', '.join(suffixes)}"
        raise SettingError(Diagnostic(f"{option}: unknown format (got {quoted(str(path))})", hint))


def parse_size(text: str | None) -> Size:
    """Return the size [mm] of a text such as `85x60`, the default for None. Raise SettingError for another text."""
    if text is None:
        return DEFAULT_SIZE
    return checked_size(text.lower().removesuffix("mm").strip().split("x"), "--size", text)


def checked_size(size: Any, name: str = "size", given: object = None) -> Size:
    """Return width and height [mm]. Raise SettingError for an object of another form, and for those beyond the limits.

    name, given  name of the setting, and its value if it is not `size`
    """
    try:
        width, height = map(float, size)
    except (TypeError, ValueError):
        width = height = math.nan
    if not all(SMALLEST_SIZE <= side <= LARGEST_SIZE for side in (width, height)):
        message = f"{name}: no width and height in millimeters (got {quoted(size if given is None else given)})"
        hint = f"expected such as 85x60, within {SMALLEST_SIZE:g} to {LARGEST_SIZE:g}"
        raise SettingError(Diagnostic(message, hint))
    return width, height

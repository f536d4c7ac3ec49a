"""Line charts: round ticks, points at their axis positions, names without overlap, colors of the page."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest
from lxml import etree
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from eidrive_scenario.experiments.statistics.intervals import Proportion
from eidrive_scenario.reporting.drawing.charts import (
    BOTTOM,
    HEIGHT,
    LEFT,
    NAME_SPACING,
    PAGE_COLORS,
    RIGHT,
    TOP,
    WIDTH,
    ChartSeries,
    MapAxis,
    heat_cells,
    line_chart,
    rate_map,
)

SVG = "{http://www.w3.org/2000/svg}"


def chart(*lines: ChartSeries, y_range: tuple[float, float] | None = None) -> etree._Element:
    return etree.fromstring(line_chart(lines, x_title="time [s]", y_title="gap [m]", y_range=y_range))


def groups(root: etree._Element, kind: str) -> list[etree._Element]:
    return [group for group in root.iter(f"{SVG}g") if group.get("class") == kind]


def path_of(root: etree._Element) -> str:
    (group,) = groups(root, "series")
    path = group.find(f"{SVG}path")
    assert path is not None
    return path.get("d") or ""


@pytest.mark.parametrize(
    ("x", "y", "x_ticks", "y_ticks"),
    [
        ((0.0, 9.0), (0.0, 30.0), [0, 1, 2, 3, 4, 5, 6, 7, 8, 9], [0, 10, 20, 30]),
        ((0.0, 4.0), (0.0, 10.0), [0, 0.5, 1, 1.5, 2, 2.5, 3, 3.5, 4], [0, 2, 4, 6, 8, 10]),
    ],
)
def test_line_chart_ticks_are_round_numbers(
    x: tuple[float, float], y: tuple[float, float], x_ticks: list[float], y_ticks: list[float]
) -> None:
    texts = [text.text or "" for text in chart(ChartSeries("one", "#123456", x, y)).iter(f"{SVG}text")]
    assert [float(text) for text in texts if re.fullmatch(r"[\d.]+", text)] == x_ticks + y_ticks


def test_line_chart_of_full_range_spans_axes() -> None:
    path = path_of(chart(ChartSeries("one", "#123456", (0.0, 8.0), (0.0, 8.0))))
    left, right, top, bottom = (
        72 * WIDTH * LEFT,
        72 * WIDTH * RIGHT,
        72 * HEIGHT * (1 - TOP),
        72 * HEIGHT * (1 - BOTTOM),
    )
    assert [float(number) for number in re.findall(r"[\d.]+", path)] == pytest.approx(
        [left, bottom, right, top], abs=0.01
    )


def test_line_charts_and_maps_have_sizes_of_their_own() -> None:
    rates = {(0, 0): Proportion(1, 2, 0.01, 0.99, 0.95)}
    drawn = etree.fromstring(rate_map(MapAxis("a", (0.0,), ("0",)), MapAxis("b", (0.0,), ("0",)), rates))
    assert chart(ChartSeries("one", "#123456", (0.0, 8.0), (0.0, 8.0))).get("viewBox") == "0 0 792 216"
    assert drawn.get("viewBox") == "0 0 446.4 288"


def test_line_chart_interrupts_line_outside_range() -> None:
    line = ChartSeries("one", "#123456", (0.0, 1.0, 2.0, 3.0, 4.0), (1.0, 2.0, 99.0, 2.0, 1.0))
    assert path_of(chart(line, y_range=(0.0, 5.0))).count("M") == 2


def test_line_chart_names_are_separate_and_marks_are_dots() -> None:
    root = chart(*(ChartSeries(name, "#000000", (0.0, 1.0), (1.0, 1.0), mark=0) for name in ("a", "b", "c <&>")))
    texts = [group.find(f"{SVG}text") for group in groups(root, "name")]
    assert [text.text for text in texts if text is not None] == ["a", "b", "c <&>"]
    heights = [float(text.get("y") or "nan") for text in texts if text is not None]
    assert min(b - a for a, b in pairwise(heights)) >= NAME_SPACING - 0.01
    assert [len(list(group.iter(f"{SVG}use"))) for group in groups(root, "mark")] == [1, 1, 1]


def test_line_chart_uses_colors_and_fonts_of_page() -> None:
    text = etree.tostring(chart(ChartSeries("a", "#059669", (0.0, 1.0), (1.0, 1.0), mark=0))).decode()
    for color, variable in PAGE_COLORS.items():
        assert text.count(color) == text.count(f"var({variable}, {color})") > 0
    assert "font-family" not in text
    assert "<style" not in text
    assert not re.search(r'<g id="', text)


def test_axes_of_heat_map_have_the_measured_values() -> None:
    """Ticks are at the values themselves, 0.05 m apart, not at round numbers between them."""
    axes = Figure(figsize=(6.0, 4.0)).subplots()
    heat_cells(axes, (0.5, 0.55, 0.6), (7.0, 8.0556), np.zeros((2, 3)), colors="cividis", scale=Normalize(0.0, 1.0))
    assert [label.get_text() for label in axes.get_xticklabels()] == ["0.5", "0.55", "0.6"]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["7", "8.056"]
    assert axes.get_yticks().tolist() == [7.0, 8.0556]


def test_narrow_heat_map_omits_values_that_would_overlap() -> None:
    axes = Figure(figsize=(2.0, 4.0)).subplots()
    xs = [value / 1000.0 for value in range(1001, 1041)]
    heat_cells(axes, xs, (1.0,), np.zeros((1, 40)), colors="cividis", scale=Normalize(0.0, 1.0))
    labels = [label.get_text() for label in axes.get_xticklabels()]
    assert 2 <= len(labels) <= 4
    assert labels[0] == "1.001"

"""Line charts: nice ticks, points where the axes say, names that do not overlap."""

from __future__ import annotations

import re
from itertools import pairwise

import pytest
from lxml import etree

from eidrive_scenario.reporting.drawing.chart import (
    BOTTOM,
    HEIGHT,
    LEFT,
    RIGHT,
    TOP,
    WIDTH,
    ChartSeries,
    line_chart,
    ticks,
)

SVG = "{http://www.w3.org/2000/svg}"


@pytest.mark.parametrize(
    ("low", "high", "most", "expected"),
    [
        (0.0, 30.0, 5, [0, 10, 20, 30]),
        (0.0, 10.0, 5, [0, 2, 4, 6, 8, 10]),
        (1.3, 2.1, 5, [1.4, 1.6, 1.8, 2.0]),
        (0.0, 0.004, 4, [0.0, 0.001, 0.002, 0.003, 0.004]),
        (5.0, 5.0, 5, [5.0]),
    ],
)
def test_ticks_are_round_numbers(low: float, high: float, most: int, expected: list[float]) -> None:
    assert ticks(low, high, most) == pytest.approx(expected)


def test_a_line_spans_the_frame() -> None:
    svg = line_chart([ChartSeries("one", "#123456", (0.0, 4.0), (0.0, 8.0))], x_title="time [s]", y_title="gap [m]")
    path = next(p for p in etree.fromstring(svg).iter(f"{SVG}path") if p.get("stroke-width") == "2.2")
    numbers = [float(number) for number in re.findall(r"[\d.]+", path.get("d") or "")]
    assert numbers == pytest.approx([LEFT, HEIGHT - BOTTOM, WIDTH - RIGHT, TOP])


def test_a_line_that_leaves_the_range_is_interrupted() -> None:
    line = ChartSeries("one", "#123456", (0.0, 1.0, 2.0, 3.0, 4.0), (1.0, 2.0, 99.0, 2.0, 1.0))
    svg = line_chart([line], x_title="x", y_title="y", y_range=(0.0, 5.0))
    path = next(p for p in etree.fromstring(svg).iter(f"{SVG}path") if p.get("stroke-width") == "2.2")
    assert (path.get("d") or "").count("M") == 2


def test_names_stand_apart_and_a_mark_is_a_dot() -> None:
    lines = [ChartSeries(name, "#000000", (0.0, 1.0), (1.0, 1.0), mark=0) for name in ("a", "b", "c <&>")]
    root = etree.fromstring(line_chart(lines, x_title="x", y_title="y"))
    heights = [float(text.get("y") or "nan") for text in root.iter(f"{SVG}text") if text.get("font-weight") == "600"]
    assert len(heights) == 3
    assert min(b - a for a, b in pairwise(heights)) >= 16
    assert len(list(root.iter(f"{SVG}circle"))) == 3

"""Drawings of a straight and a curved road."""

from __future__ import annotations

import math

import numpy as np
import pytest
from opendrive_xml import lane_xml, map_xml, road_xml, section_xml

from eidrive_scenario.reporting.drawing.image_canvas import ImageCanvas
from eidrive_scenario.reporting.drawing.road_drawing import road_drawing, simplify_line
from eidrive_scenario.reporting.drawing.top_view import Window
from eidrive_scenario.roads.model.road_map import Road
from eidrive_scenario.roads.reading.document import parse_road_map

MARK = '<roadMark sOffset="{}" type="{}" width="0.12"/>'
LANES = section_xml(
    lane_xml(1, more=MARK.format(0, "solid")),
    lane_xml(-1) + lane_xml(-2, 2, kind="sidewalk"),
    center=MARK.format(0, "broken") + MARK.format(30, "none"),
)


def roads(curvature: float = 0.0) -> list[Road]:
    text = map_xml(road_xml(length=50.0, x=10.0, y=5.0, curvature=curvature, lanes=LANES))
    return list(parse_road_map(text.encode(), "street.xodr").roads.values())


def test_road_drawing_of_straight_lane_is_a_rectangle() -> None:
    drawing = road_drawing(roads())
    by_type = {kind: polygon for kind, polygon in drawing.lanes if kind == "sidewalk"}
    assert by_type["sidewalk"] == pytest.approx(np.array([[10, 1.5], [60, 1.5], [60, -0.5], [10, -0.5]]))


def test_road_drawing_orders_driving_lanes_after_sidewalks() -> None:
    assert [kind for kind, _ in road_drawing(roads()).lanes] == ["sidewalk", "driving", "driving"]


def test_road_drawing_of_marks_ends_at_their_length() -> None:
    markings = {kind: line for kind, _, line in road_drawing(roads()).markings}
    assert set(markings) == {"solid", "broken"}
    assert markings["broken"] == pytest.approx(np.array([[10, 5], [40, 5]]))
    assert markings["solid"] == pytest.approx(np.array([[10, 8.5], [60, 8.5]]))


def test_road_drawing_of_curved_edge_is_within_tolerance() -> None:
    """Curvature 0.02: the left lane's outer edge is a circle of radius 46.5 m about (10, 55)."""
    drawing = road_drawing(roads(0.02))
    solid = next(line for kind, _, line in drawing.markings if kind == "solid")
    ends = np.hypot(solid[:, 0] - 10.0, solid[:, 1] - 55.0)
    middles = np.hypot(*((solid[1:] + solid[:-1]) / 2 - (10.0, 55.0)).T)
    assert ends == pytest.approx(np.full(len(solid), 46.5))
    assert 46.5 - middles.min() < 0.03
    assert len(solid) < 40


def test_road_drawing_with_window_omits_lanes_outside() -> None:
    drawing = road_drawing(roads(), Window(0, 20, 6.0, 20))
    assert [kind for kind, _ in drawing.lanes] == ["driving"]
    assert not road_drawing(roads(), Window(100, 120, 0, 20)).lanes


def test_simplify_line_keeps_corners_only() -> None:
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 2.0]])
    assert simplify_line(corner) == pytest.approx(np.array([[0, 0], [2, 0], [2, 2]]))
    assert len(simplify_line(corner[:2])) == 2


def test_simplify_line_of_closed_line_keeps_farthest_point() -> None:
    loop = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]])
    assert simplify_line(loop) == pytest.approx(loop)


@pytest.mark.parametrize("turns", [1.5, 2.0])
def test_helical_ramp_is_filled_in_pictures(turns: float) -> None:
    """The lane of 4 m is right of a left-hand circle of 20 m, so that its middle is 22 m from the axis."""
    length = 2.0 * math.pi * 20.0 * turns
    lanes = section_xml("", lane_xml(-1, 4.0))
    text = map_xml(road_xml(length=length, y=-20.0, curvature=0.05, lanes=lanes))
    canvas = ImageCanvas(Window(-30.0, 30.0, -30.0, 30.0), (300, 300))
    canvas.roads(road_drawing(parse_road_map(text.encode(), "helix.xodr").roads.values()))
    for degrees in range(5, 360, 10):
        angle = math.radians(degrees)
        x, y = map(int, canvas.position((22.0 * math.cos(angle), 22.0 * math.sin(angle))))
        assert canvas.image[y, x].tolist() == [0xD1, 0xC7, 0xC1], degrees


def test_lane_beyond_the_center_of_a_curve_is_filled_in_pictures() -> None:
    """A sidewalk from 3 to 8 m inside a left-hand corner of 5 m, with straight parts of 20 m before and after it."""
    corner = 5.0 * math.pi / 2.0
    parts = (
        f'<geometry s="0" x="-20" y="-5" hdg="0" length="20"><line/></geometry>'
        f'<geometry s="20" x="0" y="-5" hdg="0" length="{corner}"><arc curvature="0.2"/></geometry>'
        f'<geometry s="{20 + corner}" x="5" y="0" hdg="{math.pi / 2}" length="20"><line/></geometry>'
    )
    lanes = section_xml(lane_xml(2, 5.0, kind="sidewalk") + lane_xml(1, 3.0), "")
    text = map_xml(road_xml(length=40.0 + corner, geometry=parts, lanes=lanes))
    canvas = ImageCanvas(Window(-20.0, 10.0, -10.0, 20.0), (300, 300))
    canvas.roads(road_drawing(parse_road_map(text.encode(), "corner.xodr").roads.values()))
    # Beside both straight parts, each 3 to 8 m from its reference line, where both overlap, and near the center
    straight = [(-10.0, y) for y in (-1.5, 1.5)] + [(x, 10.0) for x in (-2.5, 1.5)]
    inside = [(x, y) for x in (-2.5, -1.5, -0.5, 0.5, 1.0) for y in (-1.0, -0.5, 0.5, 1.5, 2.5)]
    for x, y in straight + inside:
        column, row = map(int, canvas.position((x, y)))
        assert canvas.image[row, column].tolist() == [0xD5, 0xE1, 0xE7], (x, y)

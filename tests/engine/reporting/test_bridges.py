"""Roads above other roads in drawings."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from opendrive_xml import lane_xml, map_xml, road_xml, section_xml

from eidrive_scenario.reporting.drawing.image_canvas import ImageCanvas
from eidrive_scenario.reporting.drawing.road_drawing import Strip, bridge_spans, road_drawing
from eidrive_scenario.reporting.drawing.top_view import RoadDrawing, Window
from eidrive_scenario.roads.reading.document import parse_road_map

PAVEMENT, MARK = [0xD1, 0xC7, 0xC1], [0xFF, 0xFF, 0xFF]
SOLID = '<roadMark sOffset="0" type="solid" width="0.12"/>'
LANES = section_xml(lane_xml(1, 4.0), lane_xml(-1, 4.0), center=SOLID)


def height(*levels: float) -> str:
    """Return the elevation profile of a road of 100 m that is level, or rises from the first to the second value."""
    low, high = levels[0], levels[-1]
    return f'<elevationProfile><elevation s="0" a="{low}" b="{(high - low) / 100.0}" c="0" d="0"/></elevationProfile>'


def street(number: str, heading: float, *levels: float, along: float = 0.0) -> str:
    """Return a road of 100 m with its middle at (`along`, 0)."""
    x, y = along - 50.0 * math.cos(heading), -50.0 * math.sin(heading)
    return road_xml(number, x=x, y=y, hdg=heading, profiles=height(*levels), lanes=LANES)


def drawing_of(*roads: str) -> RoadDrawing:
    return road_drawing(parse_road_map(map_xml(*roads).encode(), "crossing.xodr").roads.values())


def colors(drawing: RoadDrawing, *points: tuple[float, float]) -> list[list[int]]:
    canvas = ImageCanvas(Window(-20.0, 20.0, -20.0, 20.0), (800, 800))
    canvas.roads(drawing)
    return [canvas.image[y, x].tolist() for x, y in np.array([*map(canvas.position, points)]).astype(int)]


@pytest.mark.parametrize("bridge_first", [False, True])
def test_bridge_covers_the_road_below_it(bridge_first: bool) -> None:
    """The mark in the middle of the street along y ends at the sides of the bridge along x, which is 8 m wide."""
    roads = [street("below", math.pi / 2.0, 0.0), street("above", 0.0, 6.0)]
    drawing = drawing_of(*(reversed(roads) if bridge_first else roads))
    assert colors(drawing, (0.0, 6.0), (0.0, -6.0)) == [MARK, MARK]
    assert colors(drawing, (0.0, 2.0), (0.0, -2.0)) == [PAVEMENT, PAVEMENT]
    assert colors(drawing, (2.0, 0.0), (-2.0, 0.0), (12.0, 0.0)) == [MARK, MARK, MARK]


def test_junction_at_grade_has_the_marks_of_both_roads() -> None:
    drawing = drawing_of(street("a", 0.0, 0.0), street("b", math.pi / 2.0, 0.5))
    assert drawing.above == ()
    assert colors(drawing, (0.0, 2.0), (2.0, 0.0)) == [MARK, MARK]


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_three_levels_cover_each_other_in_the_order_of_heights(order: tuple[int, ...]) -> None:
    """Directions of 0, 60 and 120°. 3 m from the center each mark is beyond the marks of the others."""
    roads = [street(str(level), level * math.pi / 3.0, 5.0 * level) for level in range(3)]
    drawing = drawing_of(*(roads[number] for number in order))
    near = [(3.0 * math.cos(level * math.pi / 3.0), 3.0 * math.sin(level * math.pi / 3.0)) for level in range(3)]
    assert colors(drawing, *near) == [PAVEMENT, PAVEMENT, MARK]


def test_only_the_part_above_another_road_is_repeated() -> None:
    """The ramp rises by 10 m over 100 m, and is above 3 m where it crosses the street, 10 m after its middle."""
    drawing = drawing_of(street("ramp", 0.0, 0.0, 10.0), street("street", math.pi / 2.0, 0.0, along=10.0))
    (bridge,) = drawing.above
    left, right = (find(float(find(line[:, 0])) for _, _, line in bridge.markings) for find in (min, max))
    assert -10.0 < left < 6.0
    assert 14.0 < right < 30.0
    assert [kind for kind, _ in bridge.lanes] == ["driving", "driving"]


def test_window_limits_bridges() -> None:
    text = map_xml(street("below", math.pi / 2.0, 0.0), street("above", 0.0, 6.0))
    roads = parse_road_map(text.encode(), "crossing.xodr").roads.values()
    drawing = road_drawing(roads, Window(30.0, 50.0, -5.0, 5.0))
    assert not any(level.lanes or level.markings for level in drawing.above)


def test_helical_ramp_covers_its_lower_turn() -> None:
    """A lane of 4 m rises by 5 m per turn. The end of the lower turn crosses below the second one."""
    turn = 2.0 * math.pi * 20.0
    rise = f'<elevationProfile><elevation s="0" a="0" b="{5.0 / turn}" c="0" d="0"/></elevationProfile>'
    ramp = road_xml(length=1.9 * turn, y=-20.0, curvature=0.05, profiles=rise, lanes=section_xml("", lane_xml(-1, 4.0)))
    drawing = drawing_of(ramp)
    assert drawing.above
    # From the end of the first turn on; the part up to 0.9 turns is covered.
    middles = np.concatenate([polygon for level in drawing.above for _, polygon in level.lanes])
    assert np.hypot(middles[:, 0], middles[:, 1]).max() == pytest.approx(24.0, abs=0.1)


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e300])
def test_coordinates_and_heights_without_use_cover_nothing(value: float) -> None:
    line = np.array([[[0.0, 0.0], [10.0, 0.0]]])
    stations = np.array([0.0, 10.0])
    odd = [Strip(stations, np.array([value, 0.0]), line), Strip(stations, np.array([9.0, 9.0]), line + value)]
    usual = [Strip(stations, np.zeros(2), line), Strip(stations, np.full(2, 9.0), line)]
    assert [index for index, _, _ in bridge_spans([*odd[1:], *usual])] == [2]
    assert all(index != 0 or math.isfinite(value) for index, _, _ in bridge_spans([*odd[:1], *usual]))
    assert not list(bridge_spans([]))
    assert not list(bridge_spans([Strip(stations, np.zeros(2), np.empty((0, 2, 2)))]))

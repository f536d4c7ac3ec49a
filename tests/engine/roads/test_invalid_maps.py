"""Tests of invalid maps and tight bends: scalar and array poses are equal and finite."""

from __future__ import annotations

import math

import numpy as np
import pytest
from opendrive_xml import lane_xml, map_xml, road_xml, section_xml
from road_errors import road_diagnostics

from eidrive_scenario.errors import RoadError
from eidrive_scenario.roads import RoadNetwork, placed_objects, surface_meshes

LANE = '<lane id="{0}" type="driving"><width sOffset="0" a="4" b="{1}" c="0" d="0"/></lane>'


def section(narrowing: float = 0.0, before: str = "", *, s: float = 0, center: str = "") -> str:
    return before + section_xml(LANE.format(1, narrowing), LANE.format(-1, narrowing), s=s, center=center)


def geometry(s: float, x: float, length: float, shape: str = "<line/>", y: float = 0.0) -> str:
    return f'<geometry s="{s!r}" x="{x!r}" y="{y!r}" hdg="0" length="{length!r}">{shape}</geometry>'


def same_one_at_a_time(network: RoadNetwork, road: str) -> None:
    """Assert that array poses of lanes equal scalar poses."""
    length = network.roads[road].length
    s = np.linspace(0.0, length, 9)
    for lane in (1, -1):
        many = network.lane_pose(road, lane, s, 0.2)
        for number, place in enumerate(s.tolist()):
            one = network.lane_pose_at(road, lane, place, 0.2)
            assert all(map(math.isfinite, one))
            assert [float(part[number]) for part in many] == pytest.approx(one, abs=1e-9)


@pytest.mark.parametrize(
    "broken",
    [
        geometry(-30.0, -30.0, 130.0),
        geometry(0.0, 0.0, 500.0) + geometry(502.0, 0.0, 1.0, y=9.0),
        geometry(5.0, 5.0, 95.0),
        geometry(-30.0, -30.0, 50.0) + geometry(-20.0, 7.0, 120.0),
    ],
    ids=["before the road", "behind the road", "begins late", "two before the road"],
)
def test_geometry_outside_its_road_does_not_affect_other_roads(broken: str) -> None:
    network = RoadNetwork.parse(
        map_xml(
            road_xml("before", lanes=section(), y=50.0),
            road_xml("broken", lanes=section(), geometry=broken, length=500.0 if 'length="500.0"' in broken else 100.0),
            road_xml("behind", lanes=section(), y=-50.0),
        )
    )
    for number in network.roads:
        same_one_at_a_time(network, number)
    assert network.lane_pose("before", -1, [99.9]).y == pytest.approx([48.0])
    assert network.lane_pose("behind", -1, [0.1]).y == pytest.approx([-52.0])


def test_lane_offset_before_its_road_does_not_affect_other_roads() -> None:
    offset = '<laneOffset s="-4" a="1" b="0.1" c="0" d="0"/><laneOffset s="50" a="0" b="0" c="0" d="0"/>'
    network = RoadNetwork.parse(
        map_xml(road_xml("before", lanes=section(), y=50.0), road_xml("broken", lanes=section(before=offset)))
    )
    for number in network.roads:
        same_one_at_a_time(network, number)
    assert network.lane_pose_at("broken", -1, 0.0).y == pytest.approx(-2.0 + 1.0 + 0.4)


@pytest.mark.parametrize("narrowing", [0.0, -0.01])
def test_lane_inside_the_center_of_its_bend_keeps_its_heading(narrowing: float) -> None:
    """A half circle with a radius of 1.5 m, as at the ends of dead-end streets, contains lane 1."""
    turn = geometry(0.0, 0.0, 1.5 * math.pi, f'<arc curvature="{1 / 1.5!r}"/>')
    network = RoadNetwork.parse(map_xml(road_xml(length=1.5 * math.pi, lanes=section(narrowing), geometry=turn)))
    same_one_at_a_time(network, "1")
    for lane in (1, -1):
        turned = network.lane_pose_at("1", lane, 1.0).h - network.road_pose_at("1", 1.0).h
        assert abs(turned) < math.radians(15.0)


def test_implausible_number_is_an_error() -> None:
    with pytest.raises(RoadError) as caught:
        RoadNetwork.parse(map_xml(road_xml(geometry=geometry(0.0, 1e12, 100.0))), "town.xodr")
    assert [str(diagnostic) for diagnostic in caught.value.diagnostics] == [
        "town.xodr:1: <geometry> has x='1000000000000.0'; give a number of at most 1e+09"
    ]


PIECES = (
    '<{0} {1}="0" a="{2}" b="0.01" c="0" d="0"/><{0} {1}="40" a="{3}" b="0.01" c="-3e11" d="2e25"/>'
    '<{0} {1}="40.00000000000001" a="{3}" b="0" c="0" d="0"/>'
)
"""Pieces of a function that ascends by 0.4 to s = 40 m and is constant after it; the second one has no extent."""


def test_piece_without_extent_may_have_any_coefficients() -> None:
    """RoadRunner exports have pieces of 1e-14 m that are fitted to a few values."""
    profiles = (
        f"<elevationProfile>{PIECES.format('elevation', 's', 5.0, 5.4)}</elevationProfile>"
        f"<lateralProfile>{PIECES.format('superelevation', 's', 0.0, 0.4)}</lateralProfile>"
    )
    wide, bordered = PIECES.format("width", "sOffset", 3.0, 3.4), PIECES.format("border", "sOffset", 2.0, 2.4)
    lanes = PIECES.format("laneOffset", "s", 1.0, 1.4) + section_xml(
        f'<lane id="1" type="driving">{bordered}</lane>', f'<lane id="-1" type="driving">{wide}</lane>'
    )
    network = RoadNetwork.parse(map_xml(road_xml(profiles=profiles, lanes=lanes)))
    road = network.roads["1"]
    left, right = road.sections[0].lanes[1], road.sections[0].lanes[-1]
    # The left lane extends from the lane offset to its border.
    functions = (road.elevation, road.superelevation, road.lane_offset, right.width, left.width)
    for s, expected in ((20.0, (5.2, 0.2, 1.2, 3.2, 1.0)), (60.0, (5.4, 0.4, 1.4, 3.4, 1.0))):
        assert [function.value(s) for function in functions] == pytest.approx(expected)


def test_first_piece_without_extent_is_replaced_from_the_start() -> None:
    widths = "".join(f'<width sOffset="{s}" a="{a}" b="0" c="0" d="0"/>' for s, a in ((0, 9), (1e-14, 3)))
    network = RoadNetwork.parse(
        map_xml(road_xml(lanes=section_xml("", f'<lane id="-1" type="driving">{widths}</lane>')))
    )
    assert network.map_warnings == ()
    assert network.lane_pose_at("1", -1, 0.0).y == pytest.approx(-1.5)


def test_short_lane_section_may_have_large_coefficients() -> None:
    """RoadRunner widens lanes within sections of 2 µm: from 0 to 3 m by 9 u² - 6 u³ with u = ds / 2 µm."""
    width = '<width sOffset="0" a="{}" b="0" c="{}" d="{}"/>'
    sections = "".join(
        section_xml("", f'<lane id="-1" type="driving">{width.format(*coefficients)}</lane>', s=s)
        for s, coefficients in ((0.0, (3, 0, 0)), (99.999998, (0, 9 / 4e-12, -6 / 8e-18)))
    )
    last = RoadNetwork.parse(map_xml(road_xml(lanes=sections))).roads["1"].sections[-1]
    assert last.lanes[-1].width.value(2e-6) == pytest.approx(3.0)


def test_route_over_a_geometry_gap_adds_no_points() -> None:
    far = geometry(0.0, 0.0, 50.0) + geometry(50.0, 9e8, 50.0)
    network = RoadNetwork.parse(map_xml(road_xml(lanes=section(), geometry=far)))
    route = network.route(network.location("1", -1, 10.0), network.location("1", -1, 90.0))
    line = route.polyline(1.0)
    assert len(line) < 1000
    assert line[[0, -1], 0] == pytest.approx([10.0, 9e8 + 40.0])


@pytest.mark.parametrize("text", ["1_0", "\u0663", "nan", "1,5"])
def test_number_in_python_notation_is_an_error(text: str) -> None:
    lanes = section().replace('a="4"', f'a="{text}"', 1).replace('id="-1"', f'id="-{text}"', 1)
    found = road_diagnostics(map_xml(road_xml(lanes=lanes)))
    assert f"town.xodr:1: <width> has a={text!r}; give a finite number" in found
    assert f"town.xodr:1: <lane> has id={'-' + text!r}; give a whole number" in found


def test_object_with_too_many_repetitions_is_an_error() -> None:
    repeat = '<repeat s="0" length="50" distance="1e-9" tStart="3" tEnd="3"/>'
    objects = f'<objects><object id="1" type="pole" s="0" t="3" radius="0.1" height="1">{repeat}</object></objects>'
    assert road_diagnostics(map_xml(road_xml(extra=objects))) == [
        "town.xodr:1: <repeat> has length=50 and distance=1e-09: too many repetitions; "
        "at most 100000 repetitions are read"
    ]
    nowhere = objects.replace('length="50" distance="1e-9"', 'length="0" distance="0"')
    assert list(placed_objects(RoadNetwork.parse(map_xml(road_xml(extra=nowhere))))) == []


@pytest.mark.parametrize("line", ['length="3" space="6" sOffset="-1.4"', 'length="1e-9" space="1e-9" sOffset="0"'])
def test_dashes_start_and_end_on_their_road(line: str) -> None:
    mark = (
        f'<roadMark sOffset="0" type="broken"><type name="b"><line {line} tOffset="0" width="0.1"/></type></roadMark>'
    )
    network = RoadNetwork.parse(map_xml(road_xml(lanes=section(center=mark))))
    meshes = {mesh.kind: mesh for mesh in surface_meshes(network)}
    along = meshes["marking_white"].vertices[:, 0]
    assert along.min() >= 0.0
    assert 95.0 < along.max() <= 100.0


def test_crosswalk_has_a_bounded_number_of_stripes() -> None:
    corners = "".join(f'<cornerLocal u="{u}" v="{v}" z="0"/>' for u, v in ((0, 0), (4, 0), (4, 9e5), (0, 9e5)))
    crosswalk = f'<object id="1" type="crosswalk" s="50" t="0"><outline>{corners}</outline></object>'
    network = RoadNetwork.parse(map_xml(road_xml(lanes=section(), extra=f"<objects>{crosswalk}</objects>")))
    (paint,) = (mesh for mesh in surface_meshes(network) if mesh.kind == "marking_white")
    assert len(paint.faces) == 1000


def test_advance_passes_duplicate_geometry_in_both_directions() -> None:
    twice = geometry(0.0, 0.0, 60.0) + 2 * geometry(60.0, 60.0, 40.0)
    network = RoadNetwork.parse(map_xml(road_xml(lanes=section(), geometry=twice)))
    for lane, start, end in ((1, 80.0, 30.0), (-1, 30.0, 80.0)):
        moved = network.advance(network.location("1", lane, start), 50.0)
        assert moved is not None
        assert moved.s == pytest.approx(end)


def test_objects_beyond_their_road_are_moved_to_its_end() -> None:
    objects = "".join(f'<object id="{n}" type="tree" s="{s}" t="-5"/>' for n, s in enumerate((-3.0, 100.02, 140.0)))
    network = RoadNetwork.parse(map_xml(road_xml(lanes=section(), extra=f"<objects>{objects}</objects>")), "town.xodr")
    assert [placed.pose.x for placed in placed_objects(network)] == [0.0, 100.0, 100.0]
    (doubt,) = network.map_warnings
    assert doubt.rule == "object-off-road"
    assert str(doubt) == (
        "town.xodr:1: an object is at s = -3 m of road '1'; s = 0 m is used; "
        "1 more of objects beyond the ends of their roads: line 1; the road extends from 0 to 100 m"
    )


def test_signal_beyond_its_road_is_moved_to_its_end() -> None:
    signals = "".join(
        f'<signal id="{n}" s="{s}" t="-5" dynamic="yes" orientation="+" zOffset="2" type="1000001"/>'
        for n, s in enumerate((-3.0, 100.02, 140.0))
    )
    network = RoadNetwork.parse(map_xml(road_xml(lanes=section(), extra=f"<signals>{signals}</signals>")), "town.xodr")
    assert [network.signal_pose(signal).x for signal in network.signals.values()] == [0.0, 100.0, 100.0]
    (doubt,) = network.map_warnings
    assert doubt.rule == "signal-off-road"
    assert str(doubt) == (
        "town.xodr:1: a signal is at s = -3 m of road '1'; s = 0 m is used; "
        "1 more of signals beyond the ends of their roads: line 1; the road extends from 0 to 100 m"
    )


@pytest.mark.parametrize(("distance", "expected"), [(5.0, [(95.0, -4.0), (100.0, -5.0)]), (0.0, [(97.5, -4.5)])])
def test_repetition_beyond_its_road_ends_with_the_road(distance: float, expected: list[tuple[float, float]]) -> None:
    """t changes by 1 m over each 5 m of the stated length, also on the part that remains."""
    repeat = f'<repeat s="95" length="20" distance="{distance}" tStart="-4" tEnd="-8"/>'
    text = f'<objects><object id="1" type="barrier" s="95" t="-4" length="1" width="1">{repeat}</object></objects>'
    network = RoadNetwork.parse(map_xml(road_xml(lanes=section(), extra=text)), "town.xodr")
    assert [placed.pose[:2] for placed in placed_objects(network)] == [pytest.approx(place) for place in expected]
    message = "town.xodr:1: an object is repeated to s = 115 m of road '1'; the repetition ends with the road; "
    warned = [(f"{message}the road ends at 100 m", "object-off-road")] if distance else []
    assert [(str(doubt), doubt.rule) for doubt in network.map_warnings] == warned


@pytest.mark.parametrize(
    ("s", "distance", "expected"),
    [
        (-12.0, 5.0, [(3.0, -7.0), (8.0, -8.0)]),
        (-12.0, 0.0, [(2.0, -6.8), (6.0, -7.6)]),
        (-40.0, 5.0, []),
        (140.0, 5.0, []),
        (-40.0, 0.0, []),
        (100.0, 5.0, [(100.0, -4.0)]),
    ],
)
def test_repetition_is_on_its_road_only(s: float, distance: float, expected: list[tuple[float, float]]) -> None:
    """t changes by 1 m each 5 m of the stated length; gapless parts of 4 m have their centers from s = 0 to 8 m."""
    repeat = f'<repeat s="{s}" length="20" distance="{distance}" tStart="-4" tEnd="-8"/>'
    text = f'<objects><object id="1" type="barrier" s="5" t="-4" length="1" width="1">{repeat}</object></objects>'
    network = RoadNetwork.parse(map_xml(road_xml(lanes=section(), extra=text)))
    assert [placed.pose[:2] for placed in placed_objects(network)] == [pytest.approx(place) for place in expected]
    assert [doubt.rule for doubt in network.map_warnings] == ["object-off-road"] * (distance > 0.0)


@pytest.mark.parametrize("s", [10, 100_000])
def test_first_lane_section_starts_at_zero(s: int) -> None:
    network = RoadNetwork.parse(map_xml(road_xml(lanes=section(s=s))))
    (only,) = network.roads["1"].sections
    assert (only.s, only.end) == (0.0, 100.0)
    assert network.lane_width("1", -1, 1.0) == 4.0


def test_late_first_lane_section_extends_to_the_second() -> None:
    network = RoadNetwork.parse(map_xml(road_xml(lanes=section(s=10) + section(s=60))))
    assert [(part.s, part.end) for part in network.roads["1"].sections] == [(0.0, 60.0), (60.0, 100.0)]


def test_advance_exactly_to_the_end_of_a_lane() -> None:
    """The next section, which starts at the end position, has no such lane."""
    wide = section().replace("</right>", LANE.format(-2, 0.0) + "</right>")
    only_left = f'<laneSection s="50"><left>{LANE.format(1, 0.0)}</left><center><lane id="0"/></center></laneSection>'
    network = RoadNetwork.parse(map_xml(road_xml(lanes=wide + only_left)))
    place = network.advance(network.location("1", -2, 20.0), 30.0)
    assert place is not None
    assert place.lane == -2
    assert network.pose(place).x == pytest.approx(50.0)


def test_road_whose_only_lane_has_a_negative_width_is_located() -> None:
    """The middle of a right lane of -3.5 m is at t = 1.75 m."""
    network = RoadNetwork.parse(map_xml(road_xml(lanes=section_xml(right=lane_xml(-1, -3.5)))).encode(), "a.xodr")
    found = network.locate_at(10.0, 1.75)
    assert found is not None
    assert (found.road, found.lane) == ("1", -1)
    assert found.s == pytest.approx(10.0)


def test_cubic_with_negligible_coefficients_is_straight() -> None:
    """u vanishes and v = p²: a straight line to the left, which starts at rest."""
    tiny = " ".join(f'{name}="1e-308"' for name in ("bU", "cU", "dU", "bV"))
    shape = f'<paramPoly3 pRange="arcLength" aU="0" aV="0" {tiny} cV="1" dV="0"/>'
    network = RoadNetwork.parse(map_xml(road_xml(geometry=geometry(0.0, 0.0, 100.0, shape))).encode(), "a.xodr")
    same_one_at_a_time(network, "1")
    line = network.roads["1"].reference
    assert line.at(10.0)[:4] == pytest.approx((0.0, 100.0, math.pi / 2, 0.0))
    assert line.at(0.0).curvature == 0.0


def test_geometry_that_ends_before_its_road_is_an_error() -> None:
    (error,) = road_diagnostics(map_xml(road_xml(geometry=geometry(-1e9, 0.0, 100.0))))
    assert error.endswith("the geometry of road '1' ends at s = -1e+09 m; start it at s = 0")

"""Tests of road and lane coordinates to world coordinates and back."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from opendrive_xml import (
    elevation_xml,
    junction_xml,
    lane_links_xml,
    lane_xml,
    lanes_xml,
    map_xml,
    predecessor_xml,
    road_xml,
    section_xml,
    successor_xml,
)

from eidrive_scenario.roads import PositionError, RoadNetwork
from eidrive_scenario.roads.model import curves
from eidrive_scenario.roads.model.curves import Arc, Cubic, Curve, ReferenceLine
from eidrive_scenario.roads.model.polynomials import Polynomials, combine
from eidrive_scenario.roads.model.road_map import Header, Lane, LaneSection, Road, RoadMap

BANKED = '<superelevation s="0" a="0.1" b="0" c="0" d="0"/>'


@st.composite
def plan_views(draw: st.DrawFn) -> ReferenceLine:
    """Draw up to five connected curves."""
    pieces: list[Curve] = []
    x, y, h, s, curvature = draw(st.floats(-50, 50)), draw(st.floats(-50, 50)), draw(st.floats(-3, 3)), 0.0, 0.0
    for _ in range(draw(st.integers(1, 5))):
        length = draw(st.floats(5.0, 40.0))
        kind = draw(st.sampled_from(["line", "arc", "spiral", "cubic"]))
        bend = draw(st.floats(-0.03, 0.03))
        if kind == "line":
            pieces.append(Arc(s, x, y, h, length))
        elif kind == "arc":
            pieces.append(Arc(s, x, y, h, length, bend))
        elif kind == "spiral":
            pieces.append(curves.spiral(s, x, y, h, length, curvature, bend))
        else:
            pieces.append(Cubic(s, x, y, h, length, (0, 1, 0, 0), (0, 0, 0.1 * bend / length, 0)))
        x, y, h, curvature, _ = pieces[-1].at(length)
        s += length
    return ReferenceLine(pieces, s)


@st.composite
def lane_sections(draw: st.DrawFn, index: int, start: float, length: float) -> LaneSection:
    """Draw one to three lanes of changing width on each side."""
    lanes = {0: Lane(0, "none", Polynomials(), Polynomials(), Polynomials(), Polynomials())}
    for side in (1, -1):
        inner = Polynomials()
        for k in range(1, draw(st.integers(1, 3)) + 1):
            width = Polynomials([(0.0, draw(st.floats(2.0, 4.0)), draw(st.floats(-0.005, 0.005)), 0.0, 0.0)])
            outer = combine([(1.0, inner), (1.0, width)])
            lanes[side * k] = Lane(side * k, "driving", width, inner, outer, combine([(0.5, inner), (0.5, outer)]))
            inner = outer
    return LaneSection(index, start, length, {number: lanes[number] for number in sorted(lanes, reverse=True)})


@st.composite
def roads(draw: st.DrawFn, name: str) -> Road:
    """Draw a road with up to three lane sections, elevation and superelevation."""
    line = draw(plan_views())
    count = draw(st.integers(1, 3 if line.length > 12.0 else 1))
    starts = [line.length * part / count for part in range(count)]
    sections = tuple(draw(lane_sections(n, start, line.length / count)) for n, start in enumerate(starts))
    bank, twist = draw(st.floats(-0.1, 0.1)), draw(st.floats(-0.0005, 0.0005))
    return Road(
        id=name,
        name="",
        length=line.length,
        rule=draw(st.sampled_from(["RHT", "LHT"])),
        junction_id=None,
        reference=line,
        elevation=Polynomials([(0.0, draw(st.floats(-5, 5)), draw(st.floats(-0.1, 0.1)), 0.0, 0.0)]),
        superelevation=Polynomials([(0.0, bank, twist, 0.0, 0.0)]),
        lane_offset=Polynomials([(0.0, draw(st.floats(-1, 1)), draw(st.floats(-0.01, 0.01)), 0.0, 0.0)]),
        sections=sections,
        section_starts=tuple(starts),
    )


@st.composite
def networks(draw: st.DrawFn, most: int = 3) -> RoadNetwork:
    """Draw up to `most` roads that may intersect; the first has the id r."""
    drawn = [draw(roads(name)) for name in "rst"[: draw(st.integers(1, most))]]
    return RoadNetwork(RoadMap("drawn", Header(), {road.id: road for road in drawn}, {}, {}, {}, ()))


@pytest.mark.exhaustive
@settings(max_examples=150, deadline=None)
@given(networks(), st.data())
def test_locate_inverts_pose_on_random_roads(network: RoadNetwork, data: st.DataObject) -> None:
    """Scalar results with a hint are exact. Array results have the same position in plan view."""
    road = network.roads[data.draw(st.sampled_from(sorted(network.roads)))]
    section = data.draw(st.sampled_from(road.sections))
    lane = data.draw(st.sampled_from([number for number in section.lanes if number]))
    s = section.s + data.draw(st.floats(0.1, 0.9)) * section.length
    offset = data.draw(st.floats(-0.6, 0.6))
    there = network.location(road.id, lane, s, offset)
    pose = network.lane_pose_at(road.id, lane, s, offset)
    near = network.locate_at(pose.x, pose.y, there)
    assert near is not None
    assert (near.road, near.lane) == (road.id, lane)
    assert (near.s, near.offset, near.t) == pytest.approx((there.s, there.offset, there.t), abs=1e-3)
    assert math.dist(network.lane_pose_at(near.road, near.lane, near.s, near.offset)[:3], pose[:3]) < 0.01
    location = network.locate_at(pose.x, pose.y)
    assert location is not None
    assert (
        math.dist(network.lane_pose_at(location.road, location.lane, location.s, location.offset)[:2], pose[:2]) < 0.01
    )
    if len(network.roads) == 1 and road.length < 60.0:
        # A longer road may intersect itself; its other branch is then a valid result.
        assert (location.road, location.lane) == (road.id, lane)


@pytest.mark.exhaustive
@settings(max_examples=40, deadline=None)
@given(networks())
def test_array_poses_equal_scalar_poses(network: RoadNetwork) -> None:
    s = np.linspace(0.0, network.roads["r"].length, 23)
    for lane in (-1, 1):
        many = np.column_stack(network.lane_pose("r", lane, s, 0.3))
        assert many == pytest.approx(np.array([network.lane_pose_at("r", lane, v, 0.3) for v in s]), abs=1e-9)
    many = np.column_stack(network.road_pose("r", s, -2.0))
    assert many == pytest.approx(np.array([network.road_pose_at("r", v, -2.0) for v in s]), abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(networks(), st.data())
def test_lane_heading_equals_direction_of_its_points(network: RoadNetwork, data: st.DataObject) -> None:
    road = network.roads["r"]
    s = data.draw(st.floats(1.0, road.length - 1.0))
    if min(abs(s - start) for start in (*road.reference.starts, *road.section_starts, road.length)) < 0.01:
        return
    a, b = (network.lane_pose_at("r", 1, v) for v in (s - 1e-4, s + 1e-4))
    here = network.lane_pose_at("r", 1, s)
    step = (math.cos(here.h) * math.cos(here.p), math.sin(here.h) * math.cos(here.p), -math.sin(here.p))
    gone = np.subtract(b[:3], a[:3])
    assert gone / np.linalg.norm(gone) == pytest.approx(np.array(step), abs=1e-5)


def test_road_pose_with_superelevation_and_slope() -> None:
    rising = '<elevationProfile><elevation s="0" a="2" b="0.05" c="0" d="0"/></elevationProfile>'
    extra = f"{rising}<lateralProfile>{BANKED}</lateralProfile>"
    network = RoadNetwork.parse(map_xml(road_xml(extra=extra)))
    pose, slope = network.road_pose_at("1", 20.0, 3.0), math.atan(0.05)
    leans, rises = 3 * math.sin(0.1) * math.sin(slope), 3 * math.sin(0.1) * math.cos(slope)
    assert pose == pytest.approx((20.0 - leans, 3 * math.cos(0.1), 3.0 + rises, 0.0, -slope, 0.1))
    back = network.road_pose_at("1", 20.0, 3.0).turned(math.pi)
    assert (back.h, back.p, back.r) == pytest.approx((math.pi, math.atan(0.05), -0.1))
    aside = network.road_pose_at("1", 20.0, 0.0).turned(math.pi / 2)
    assert math.sin(aside.p) == pytest.approx(-math.cos(math.atan(0.05)) * math.sin(0.1))


@pytest.mark.parametrize(("inner", "outer"), [("inner", "outer"), ("heightInner", "heightOuter")])
def test_lane_height_raises_sidewalk(inner: str, outer: str) -> None:
    lanes = (
        '<laneSection s="0"><center><lane id="0"/></center><right>'
        '<lane id="-1" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>'
        '<lane id="-2" type="sidewalk"><width sOffset="0" a="2" b="0" c="0" d="0"/>'
        f'<height sOffset="0" {inner}="0.1" {outer}="0.14"/></lane></right></laneSection>'
    )
    network = RoadNetwork.parse(map_xml(road_xml(lanes=lanes)))
    assert network.lane_pose_at("1", -1, 10.0).z == 0.0
    assert [network.lane_pose_at("1", -2, 10.0, d).z for d in (1.0, 0.0, -1.0)] == pytest.approx([0.10, 0.12, 0.14])
    assert network.lane_pose("1", -2, [10.0], [0.0]).z == pytest.approx(0.12)


@pytest.mark.parametrize("order", [1, -1])
def test_heights_of_a_lane_apply_from_their_offsets_in_any_order(order: int) -> None:
    heights = [f'<height sOffset="{s}" inner="{z}" outer="{z}"/>' for s, z in ((0, 0.1), (50, 0.3))]
    lane = (
        f'<lane id="-1" type="sidewalk"><width sOffset="0" a="2" b="0" c="0" d="0"/>{"".join(heights[::order])}</lane>'
    )
    lanes = f'<laneSection s="0"><center><lane id="0"/></center><right>{lane}</right></laneSection>'
    network = RoadNetwork.parse(map_xml(road_xml(lanes=lanes)))
    assert [network.lane_pose_at("1", -1, s).z for s in (10.0, 60.0)] == pytest.approx([0.1, 0.3])


def test_pose_at_unknown_road_lane_or_s_is_an_error() -> None:
    network = RoadNetwork.parse(map_xml(road_xml("10"), road_xml("11", y=30.0)))
    with pytest.raises(PositionError, match=r"road '12' does not exist; known: 10, 11"):
        network.lane_pose_at("12", -1, 0.0)
    with pytest.raises(PositionError, match=r"road '10' has no lane -3 at s = 5 m; its lanes are 1, 0, -1"):
        network.lane_pose_at("10", -3, 5.0)
    with pytest.raises(PositionError, match=r"s = 120 m is not on road '10'; the road extends from 0 to 100 m"):
        network.road_pose_at("10", 120.0, 0.0)
    with pytest.raises(PositionError, match=r"s = 101 m is not on road '11'"):
        network.road_pose("11", [0.0, 101.0])
    with pytest.raises(PositionError, match=r"no lane 2"):
        network.lane_pose("11", [1, 2], 3.0)


def test_locate_points_outside_the_road() -> None:
    network = RoadNetwork.parse(map_xml(road_xml()))
    locations = network.locate([50.0, 50.0, 103.0, 50.0], [-1.0, 6.0, 1.0, 90.0])
    assert locations.found.tolist() == [True, True, True, False]
    assert locations.lane.tolist() == [-1, 1, 1, 0]
    assert locations.outside[:3] == pytest.approx([0.0, 2.5, 3.0])
    assert locations.outside[3] > 30.0
    assert network.locate(50.0, 90.0, reach=100.0).outside == pytest.approx([86.5])
    assert locations.offset[:2] == pytest.approx([0.75, 4.25])
    assert locations.location(3) is None
    beside = network.locate_at(50.0, 6.0)
    assert beside is not None
    assert not network.on_road(beside)


def test_locate_many_points_equals_single_points() -> None:
    """More than a thousand points are sorted. Points far from the road have no location in both cases."""
    network = RoadNetwork.parse(map_xml(road_xml(), road_xml("2", y=20.0, hdg=0.4)))
    rng = np.random.default_rng(7)
    x, y = rng.uniform(-80.0, 180.0, (2, 1500))
    many = network.locate(x, y)
    for n in range(0, 1500, 7):
        one, other = many.location(n), network.locate(x[n], y[n]).location(0)
        assert one == (None if other is None else pytest.approx(other))
    assert 0 < np.count_nonzero(many.found) < 1500


def test_locate_with_height_separates_bridge_from_road_below() -> None:
    bridge = elevation_xml(6)
    network = RoadNetwork.parse(
        map_xml(road_xml("low"), road_xml("high", x=50.0, y=-50.0, hdg=math.pi / 2, profiles=bridge))
    )
    locations = network.locate([51.0, 51.0], [-1.0, -1.0], [0.2, 6.3])
    assert [network.tables.ids[index] for index in locations.road] == ["low", "high"]
    high = network.locate_at(51.0, -1.0, z=6.0)
    assert high is not None
    assert high.road == "high"


def test_locate_with_hint_stays_on_the_same_road() -> None:
    network = RoadNetwork.parse(map_xml(road_xml("a"), road_xml("b", x=50.0, y=-50.0, hdg=math.pi / 2)))
    for name, s in (("a", 49.0), ("b", 48.0)):
        location = network.locate_at(51.0, -1.0, network.location(name, -1, s))
        assert location is not None
        assert location.road == name


def test_locate_with_hint_follows_the_lane_into_a_junction() -> None:
    """Lane -1 becomes -2 in the last section, which leads to road 2; road 3 overlaps it and continues the new -1."""
    lanes = section_xml(right=lane_xml(-1, link=lane_links_xml(after=-2)))
    lanes += section_xml(right=lane_xml(-1, 0.5) + lane_xml(-2, link=lane_links_xml(before=-1)), s=99)
    only = section_xml(right=lane_xml(-1, 5.0))
    before = predecessor_xml("1")
    junction = junction_xml("J", "1", {"3": -1, "2": -2})
    network = RoadNetwork.parse(
        map_xml(
            road_xml("1", lanes=lanes, link=successor_xml(junction="J")),
            road_xml("2", length=30.0, x=100.0, y=-0.5, lanes=only, junction="J", link=before),
            road_xml("3", length=30.0, x=100.0, curvature=0.05, lanes=only, junction="J", link=before),
            rest=junction,
        )
    )
    hint = network.location("1", -1, 98.5)
    there = network.advance(hint, 2.0)
    assert there is not None
    assert there.road == "2"
    pose = network.pose(there)
    location = network.locate_at(pose.x, pose.y, hint)
    assert location is not None
    assert location.road == "2"
    assert location.s == pytest.approx(there.s)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
@pytest.mark.parametrize("radius", [2.0, 3.0, 4.0, 5.0])
def test_locate_points_on_the_outer_side_of_a_tight_bend(radius: float, count: int) -> None:
    """A line, a right turn of 90° and a line: points on the left have one foot, which is known by geometry."""
    turn = radius * math.pi / 2
    arc = f'<arc curvature="{-1.0 / radius!r}"/>'
    parts = [(0.0, 0.0, 0.0, 0.0, 20.0, "<line/>"), (20.0, 20.0, 0.0, 0.0, turn, arc)]
    parts.append((20.0 + turn, 20.0 + radius, -radius, -math.pi / 2, 20.0, "<line/>"))
    geometry = "".join(
        f'<geometry s="{s!r}" x="{x!r}" y="{y!r}" hdg="{h!r}" length="{length!r}">{shape}</geometry>'
        for s, x, y, h, length, shape in parts
    )
    lanes = lanes_xml(count, 0)
    network = RoadNetwork.parse(map_xml(road_xml(length=40.0 + turn, geometry=geometry, lanes=lanes)))
    rng = np.random.default_rng(1)
    s, t = rng.uniform(14.0, 26.0 + turn, 400), rng.uniform(0.1, 3.5 * count - 0.1, 400)
    angle = np.clip((s - 20.0) / radius, 0.0, math.pi / 2)
    before, after = np.minimum(s - 20.0, 0.0), np.maximum(s - 20.0 - turn, 0.0)
    x = 20.0 + before + (radius + t) * np.sin(angle)
    y = -radius - after + (radius + t) * np.cos(angle)
    locations = network.locate(x, y)
    assert locations.s == pytest.approx(s, abs=1e-3)
    assert locations.t == pytest.approx(t, abs=1e-3)
    hints = np.clip(s + rng.uniform(-2.0, 2.0, 400), 0.0, 40.0 + turn)
    for n, hint in enumerate(hints):
        location = network.locate_at(x[n], y[n], network.location("1", 1, hint))
        assert location is not None
        assert (location.s, location.t) == pytest.approx((s[n], t[n]), abs=1e-3)

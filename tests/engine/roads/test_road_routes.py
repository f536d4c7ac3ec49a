"""Tests of routes over the lane graph."""

import math
from itertools import pairwise
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from opendrive_xml import (
    junction_xml,
    lane_links_xml,
    lane_xml,
    lanes_xml,
    map_xml,
    predecessor_xml,
    ring_xml,
    road_xml,
    section_xml,
    successor_xml,
)

from eidrive_scenario.export.geometry import center_line
from eidrive_scenario.roads import LaneKey, LaneLocation, RoadNetwork, RouteError
from eidrive_scenario.roads.routing.graph import Cost, cheapest_path


@pytest.fixture
def crossing(library: Path) -> RoadNetwork:
    return RoadNetwork.load(library / "coop_1.xodr")


def ring() -> RoadNetwork:
    """Return two consecutive half circles of radius 50 m with two lanes, both counter-clockwise."""
    lanes = section_xml(right="".join(lane_xml(n, 4, link=lane_links_xml(n, n)) for n in (-1, -2)))
    return RoadNetwork.parse(ring_xml(50.0, lanes))


def test_route_straight_over_the_crossing(crossing: RoadNetwork) -> None:
    route = crossing.route(crossing.location("1", -1, 80.0), crossing.location("2", -1, 40.0))
    assert [key.road for key in route.lanes] == ["1", "101", "2"]
    assert route.length == pytest.approx(94.5)
    line = route.polyline(10.0)
    assert line[:, 1:] == pytest.approx(np.zeros((len(line), 2)), abs=1e-9)
    assert line[0, 0] == pytest.approx(0.0)
    assert np.diff(line[:, 0]).max() <= 10.0 + 1e-9


def test_route_of_a_left_turn_has_continuous_heading(crossing: RoadNetwork) -> None:
    route = crossing.route(crossing.location("1", -1, 80.0), crossing.location("3", -1, 30.0))
    line = route.polyline(0.5)
    steps = np.diff(line[:, :2], axis=0)
    turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    assert np.abs(turns).max() < 0.5 / 8.0
    assert turns.sum() == pytest.approx(math.pi / 2, abs=1e-6)
    assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(route.length, rel=1e-3)


@pytest.mark.parametrize("kind", ["none", "driving"])
def test_route_changes_lanes_over_a_lane_without_width(kind: str) -> None:
    right = lane_xml(-1) + lane_xml(-2, 0, kind=kind) + lane_xml(-3)
    roads = RoadNetwork.parse(map_xml(road_xml(length=300.0, lanes=section_xml(right=right))))
    route = roads.route(roads.location("1", -1, 10.0), roads.location("1", -3, 250.0))
    assert [key.lane for key in route.lanes] == [-1, -3]


def test_route_prefers_lane_change_to_detour() -> None:
    network = ring()
    start, end = network.location("a", -1, 10.0), network.location("b", -2, 10.0)
    route = network.route(start, end)
    kinds = [network.graph.edges[a, b]["kind"] for a, b in zip(route.lanes, route.lanes[1:], strict=False)]
    assert kinds.count("change") == 1
    line = route.polyline(1.0)
    radius = np.hypot(line[:, 0], line[:, 1])
    assert (radius[0], radius[-1]) == pytest.approx((52.0, 56.0), abs=1e-6)
    assert np.all(np.diff(radius) > -1e-3)
    assert route.location_at(0.0).lane == -1
    assert route.location_at(route.length).lane == -2


@pytest.mark.parametrize(("start", "end"), [(20.0, 180.0), (180.0, 20.0)], ids=["along s", "against s"])
def test_locations_where_a_lane_section_ends_are_in_the_route_lane(start: float, end: float) -> None:
    """From 100 m on there is a further lane inside of that of the route, whose number is one higher."""
    side = -1 if start < end else 1
    first = lane_xml(side, 3.5, link=lane_links_xml(after=2 * side))
    second = [lane_xml(n * side, 3.5, link=lane_links_xml(before=side if n == 2 else None)) for n in (1, 2)]
    offset = f'<laneOffset s="0" a="0" b="0" c="0" d="0"/><laneOffset s="100" a="{-3.5 * side}" b="0" c="0" d="0"/>'
    sides = ("", first), ("", "".join(second))
    sections = [section_xml(*(pair if side < 0 else pair[::-1]), s=s) for pair, s in zip(sides, (0, 100), strict=True)]
    network = RoadNetwork.parse(map_xml(road_xml(length=200.0, lanes=offset + "".join(sections))))
    lanes = (side, 2 * side) if start < end else (2 * side, side)
    route = network.route(network.location("1", lanes[0], start), network.location("1", lanes[1], end))
    for place in (route.location_at(80.0), route.location_by_reference_line(80.0)):
        pose = network.pose(place)
        assert (pose.x, pose.y) == pytest.approx((100.0, side * 1.75), abs=1e-6)
    assert route.pose_at(80.0)[:2] == pytest.approx((100.0, side * 1.75), abs=1e-6)


def test_route_to_goal_behind_the_start_goes_round() -> None:
    network = ring()
    for lane in (-1, -2):
        route = network.route(network.location("a", -1, 20.0), network.location("a", lane, 10.0))
        assert [key.road for key in route.lanes if key.lane == lane][-1] == "a"
        assert route.length > 2 * math.pi * 52.0 - 15.0


def test_route_cost_equals_dijkstra(crossing: RoadNetwork) -> None:
    lanes = [key for key, drivable in crossing.graph.nodes(data="drivable") if drivable]
    roads = crossing.roads

    def middle(key: LaneKey) -> LaneLocation:
        return crossing.location(key.road, key.lane, 0.5 * roads[key.road].length)

    checked = 0
    for source in lanes:
        costs = nx.single_source_dijkstra_path_length(crossing.graph, source)
        for target, cost in costs.items():
            if target != source and target in lanes:
                found = crossing.route(middle(source), middle(target)).lanes
                assert nx.path_weight(crossing.graph, found, "weight") == pytest.approx(cost)
                checked += 1
    assert checked > 100


def through_junction(*, entry: bool = True, leave: bool = True) -> RoadNetwork:
    """Return road 1, a connecting road 10 and road 2; the arguments are whether the lane links of road 10 exist."""

    def lane(before: int | None = None, after: int | None = None) -> str:
        return lane_xml(-1, link=lane_links_xml(before, after))

    roads = (
        road_xml("1", lanes=section_xml(right=lane()), link=successor_xml(junction="100")),
        road_xml(
            "10",
            x=100.0,
            length=20.0,
            junction="100",
            link=predecessor_xml("1") + successor_xml("2"),
            lanes=section_xml(right=lane(-1 if entry else None, -1 if leave else None)),
        ),
        road_xml("2", x=120.0, link=predecessor_xml(junction="100"), lanes=section_xml(right=lane())),
    )
    return RoadNetwork.parse(map_xml(*roads, rest=junction_xml("100", "1", {"10": -1} if entry else {})))


@pytest.mark.parametrize(
    ("missing", "expected"),
    [
        ("entry", "lane -1 of road '1' (section at s = 0 m) has no successor although the road continues in junction"),
        ("leave", "lane -1 of road '10' (section at s = 0 m) has no successor although the road continues in road '2'"),
    ],
)
def test_route_error_names_missing_lane_link(missing: str, expected: str) -> None:
    """The links of the roads lead from road 1 over road 10 to road 2; one of its lanes lacks its own."""
    start, end = LaneLocation("1", -1, 10.0, 0.0, -1.75), LaneLocation("2", -1, 90.0, 0.0, -1.75)
    assert through_junction().route(start, end).lanes[-1].road == "2"
    with pytest.raises(RouteError) as caught:
        through_junction(**{missing: False}).route(start, end)
    (diagnostic,) = caught.value.diagnostics
    assert f"<memory>:1: {expected}" in diagnostic.message
    assert diagnostic.rule == "lane-link"


def test_route_error_names_no_link_that_does_not_help() -> None:
    """Road 2 leads away from road 1: no link of its lane makes a way back, although one is missing elsewhere."""
    start, end = LaneLocation("2", -1, 10.0, 0.0, -1.75), LaneLocation("1", -1, 10.0, 0.0, -1.75)
    with pytest.raises(RouteError) as caught:
        through_junction(leave=False).route(start, end)
    assert caught.value.diagnostics[0].rule == ""


def test_route_against_the_traffic_is_an_error(crossing: RoadNetwork) -> None:
    with pytest.raises(RouteError, match=r"no route over the lanes leads from road '2' lane -1 .* to road '1' lane -1"):
        crossing.route(crossing.location("2", -1, 5.0), crossing.location("1", -1, 5.0))


@pytest.mark.parametrize("is_two_way", [True, False])
def test_route_over_two_way_lanes_leads_in_both_directions(is_two_way: bool) -> None:
    """A ring of two half circles of 52 m radius in the lane, cut at one end: b leads to a."""
    kind = "bidirectional" if is_two_way else "driving"
    lanes = section_xml(right=lane_xml(-1, 4, kind=kind, link=lane_links_xml(-1, -1)))
    ring = ring_xml(50.0, lanes).replace(predecessor_xml("a"), "").replace(successor_xml("b"), "")
    network = RoadNetwork.parse(ring)
    a, b = network.location("a", -1, 100.0), network.location("b", -1, 50.0)
    forward = network.route(b, a)
    assert [key.road for key in forward.lanes] == ["b", "a"]
    if not is_two_way:
        with pytest.raises(RouteError, match=r"no route over the lanes leads from road 'a'"):
            network.route(a, b)
        return
    back = network.route(a, b, via=[network.location("a", -1, 20.0)])
    assert [key.road for key in back.lanes] == ["a", "b"]
    assert back.length == pytest.approx(forward.length)
    np.testing.assert_allclose(back.polyline(1.0)[::-1], forward.polyline(1.0), atol=0.02)


def test_route_passes_intermediate_locations() -> None:
    network = ring()
    a, b = network.location("a", -1, 10.0), network.location("a", -1, 60.0)
    once = network.route(a, b)
    round_ = network.route(a, b, via=[network.location("b", -1, 50.0)])
    assert once.length == pytest.approx(50.0 * 52.0 / 50.0, rel=1e-3)
    assert round_.length == pytest.approx(once.length + 2 * math.pi * 52.0, rel=1e-3)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(
    ("places", "changes"),
    [
        ([(1, 10.0), (2, 150.0), (1, 380.0)], [(10.0, 50.0), (150.0, 190.0)]),
        ([(1, 10.0), (1, 200.0), (2, 380.0)], [(200.0, 240.0)]),
        ([(1, 10.0), (2, 150.0), (2, 380.0)], [(10.0, 50.0)]),
        ([(1, 10.0), (2, 30.0), (2, 380.0)], [(10.0, 50.0)]),  # No lane change within 20 m
        ([(1, 10.0), (2, 10.0), (2, 380.0)], [(10.0, 50.0)]),
    ],
)
def test_route_is_in_the_lanes_of_intermediate_locations(
    side: int, places: list[tuple[int, float]], changes: list[tuple[float, float]]
) -> None:
    """A lane change is 40 m long and begins at the start or at a waypoint."""
    roads = RoadNetwork.parse(map_xml(road_xml(length=400.0, lanes=lanes_xml(2, 2))))
    start, *via, end = (roads.location("1", side * n, s if side < 0 else 400.0 - s) for n, s in places)
    route = roads.route(start, end, via)
    ends = [10.0, *(s for change in changes for s in change), 380.0]
    lane, centers = places[0][0], []
    for number, (first, last) in enumerate(pairwise(ends)):
        if number % 2 == 0:
            centers += [(s, lane) for s in np.linspace(first + 1.0, last, 5).tolist() if last > first]
            lane = 3 - lane
    on_path = [route.location_at(s - 10.0) for s, _ in centers]
    assert [place.t for place in on_path] == pytest.approx([side * (3.5 * n - 1.75) for _, n in centers], abs=1e-6)
    assert route.length == pytest.approx(370.0, abs=0.25 * len(changes))


def test_locations_along_a_route(crossing: RoadNetwork) -> None:
    route = crossing.route(crossing.location("3", 3, 25.0), crossing.location("4", 3, 30.0))
    assert route.s_along(crossing.location("3", 3, 5.0)) == pytest.approx(20.0)
    assert route.s_along(crossing.location("1", -1, 5.0)) is None
    assert route.project(28.5, 20.0) == pytest.approx((19.5, -1.0))
    assert route.project(30.0, 20.0, near=15.0) == pytest.approx((19.5, 0.5))
    pose = route.pose_at(30.0)
    assert (pose.x, pose.y) == pytest.approx((29.5, 9.5))
    assert math.sin(pose.h) == pytest.approx(-1.0)
    place = route.location_at(10.0)
    assert (place.road, place.lane, place.s) == pytest.approx(("3", 3, 15.0))


def test_route_from_start_at_destination_has_length_zero() -> None:
    network = ring()
    there, beyond = network.location("a", -1, 30.0), network.location("a", -1, 30.0 + 1e-13)
    assert network.route(beyond, there).length == pytest.approx(0.0, abs=1e-6)
    onward = network.route(beyond, network.location("b", -1, 10.0), via=[there])
    assert [key.road for key in onward.lanes] == ["a", "b"]
    # A meter behind the start is one lap ahead.
    assert network.route(network.location("a", -1, 31.0), there).length > 300.0


@pytest.mark.parametrize("lane", [1, -1])
@pytest.mark.parametrize(("first", "last"), [(-50.0, 0.0), (0.0, 50.0), (0.0, 0.0)])
def test_route_that_begins_or_ends_where_roads_meet_leads_ahead(lane: int, first: float, last: float) -> None:
    """Road a is before x = 0, b behind it: a part of the route on the road behind its start or before its end has no
    length, and still the direction of its lane, which is against s in lane 1."""
    lanes = section_xml(lane_xml(1, link=lane_links_xml(1, 1)), lane_xml(-1, link=lane_links_xml(-1, -1)))
    a, b = (
        road_xml("a", x=-100.0, link=successor_xml("b"), lanes=lanes),
        road_xml("b", link=predecessor_xml("a"), lanes=lanes),
    )
    roads = RoadNetwork.parse(map_xml(a, b))
    way = -lane

    def at(x: float, road: str) -> LaneLocation:
        return roads.location(road, lane, x + 100.0 if road == "a" else x)

    begins, ends = ("a", "b") if way > 0 else ("b", "a")
    start, end = at(first * way, begins), at(last * way, ends)
    for via in ([], [start], [end]):
        route = roads.route(start, end, via)
        assert [leg.direction for leg in route.legs] == [way, way]
        assert route.distance(start, end) == pytest.approx((last - first, 0.0))
        assert route.s_along(end) == pytest.approx(last - first)
        assert math.cos(route.pose_at(0.0).h) == pytest.approx(way)


def round_and_out() -> RoadNetwork:
    """Return road a, which ends at a junction: b leads round to the start of a, c leads out; each is 100 m long."""
    lane = (
        '<laneSection s="0"><center><lane id="0"/></center><right><lane id="-1" type="driving">'
        '<link><predecessor id="-1"/><successor id="-1"/></link>'
        '<width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right></laneSection>'
    )

    def link(tag: str, kind: str, number: str) -> str:
        contact = "" if kind == "junction" else f'contactPoint="{"end" if tag == "predecessor" else "start"}"'
        return f'<{tag} elementType="{kind}" elementId="{number}" {contact}/>'

    def one(number: str, before: str, after: str, junction: str = "-1") -> str:
        return road_xml(number, lanes=lane, link=before + after, junction=junction)

    ways = "".join(
        f'<connection id="{n}" incomingRoad="a" connectingRoad="to_{n}" contactPoint="start">'
        '<laneLink from="-1" to="-1"/></connection>'
        for n in ("c", "b")
    )
    return RoadNetwork.parse(
        map_xml(
            one("a", link("predecessor", "road", "b"), link("successor", "junction", "J")),
            one("to_b", link("predecessor", "road", "a"), link("successor", "road", "b"), "J"),
            one("to_c", link("predecessor", "road", "a"), link("successor", "road", "c"), "J"),
            one("b", link("predecessor", "junction", "J"), link("successor", "road", "a")),
            one("c", link("predecessor", "junction", "J"), ""),
            rest=f'<junction id="J" name="">{ways}</junction>',
        )
    )


def test_route_through_a_junction_twice_selects_the_branch_of_each_visit() -> None:
    network = round_and_out()
    start, end = network.location("a", -1, 10.0), network.location("c", -1, 50.0)
    route = network.route(start, end, via=[network.location("b", -1, 50.0)])
    assert [key.road for key in route.lanes] == ["a", "to_b", "b", "a", "to_c", "c"]
    arrived = network.advance(start, 530.0, route=route)
    assert arrived is not None
    assert arrived.road == "c"
    assert arrived.s == pytest.approx(40.0)
    # In small steps with the visit of the previous step.
    place: LaneLocation | None = start
    visit, passed = 0, ["a"]
    while place is not None and len(passed) < 6:
        place = network.advance(place, 7.0, route=route, visit=visit)
        assert place is not None
        if place.road != passed[-1]:
            visit = route.visit(place.road, visit)
            passed.append(place.road)
    assert passed == ["a", "to_b", "b", "a", "to_c", "c"]
    assert visit == 5


def test_route_that_turns_back_in_a_two_way_lane_passes_its_waypoint() -> None:
    """From 10 m to 100 m and back to 40 m."""
    roads = RoadNetwork.parse(
        map_xml(road_xml(length=200.0, lanes=section_xml(right=lane_xml(-1, kind="bidirectional"))))
    )
    start, waypoint, end = (roads.location("1", -1, s) for s in (10.0, 100.0, 40.0))
    route = roads.route(start, end, [waypoint])
    assert (route.length, route.reference_length) == pytest.approx((90.0 + 60.0, 90.0 + 60.0))
    assert [route.location_at(distance).s for distance in (90.0, 120.0)] == pytest.approx([100.0, 70.0])


@pytest.mark.parametrize("seed", range(20))
def test_cheapest_path_has_cost_of_networkx(seed: int) -> None:
    generator = np.random.default_rng(seed)
    keys = [LaneKey(str(number), 0, -1) for number in range(40)]
    edges = {
        key: {
            keys[other]: {"weight": float(generator.integers(1, 9))} for other in generator.integers(0, 40, 2).tolist()
        }
        for key in keys
    }
    graph: nx.DiGraph[LaneKey] = nx.DiGraph()
    graph.add_nodes_from(keys)
    graph.add_edges_from((one, other, data) for one, ways in edges.items() for other, data in ways.items())
    costs = nx.single_source_dijkstra_path_length(graph, keys[0])
    to_target = nx.single_source_dijkstra_path_length(graph.reverse(), keys[1])
    found = cheapest_path(edges, keys[0], keys[1])
    bounded = cheapest_path(edges, keys[0], keys[1], bound=lambda key: 0.9 * to_target.get(key, 1e9))
    squared = cheapest_path(edges, keys[0], keys[1], cost=lambda one, other, data: data["weight"] ** 2)
    if keys[1] not in costs:
        assert (found, bounded, squared) == (None, None, None)
        return
    assert found is not None
    assert bounded is not None
    assert nx.path_weight(graph, found, "weight") == nx.path_weight(graph, bounded, "weight") == costs[keys[1]]
    assert squared == nx.dijkstra_path(graph, keys[0], keys[1], weight=lambda one, other, data: data["weight"] ** 2)


@pytest.mark.parametrize("cost", [None, lambda lane, following, data: data["weight"]], ids=["A*", "Dijkstra"])
def test_route_of_equally_cheap_ones_is_independent_of_file_and_offset(cost: Cost | None) -> None:
    """Ways of 100 m lead left and right of the middle from `a` to `z`; their parts have different lengths."""
    lanes = '<laneOffset s="0" a="1.75" b="0" c="0" d="0"/>' + section_xml(
        right=lane_xml(-1, link=lane_links_xml(-1, -1))
    )
    generator = np.random.default_rng(5)
    selected = set()
    for _ in range(12):
        x, y = generator.uniform(-3000.0, 3000.0, 2).tolist()
        roads = [
            road_xml("a", x=x - 100.0, y=y, lanes=lanes, link=successor_xml(junction="9")),
            road_xml("z", x=x + 100.0 * math.sqrt(3.0) / 2.0, y=y, lanes=lanes, link=predecessor_xml(junction="8")),
        ]
        ways = [("b", 1, (0.3, 0.6, 49.1)), ("c", -1, (0.1, 0.2, 49.7))]
        generator.shuffle(ways)
        for name, side, lengths in ways:
            ahead, aside = x, y
            for number, (length, half) in enumerate([*((part, 1) for part in lengths), (50.0, -1)]):
                before, after = (f"{name}{number - 1}" if number else "a", f"{name}{number + 1}" if number < 3 else "z")
                heading = side * half * math.pi / 6.0
                link = predecessor_xml(before) + successor_xml(after)
                junction = {0: "9", 3: "8"}.get(number, "-1")
                roads.append(
                    road_xml(
                        f"{name}{number}",
                        x=ahead,
                        y=aside,
                        hdg=heading,
                        length=length,
                        lanes=lanes,
                        link=link,
                        junction=junction,
                    )
                )
                ahead, aside = ahead + length * math.cos(heading), aside + length * math.sin(heading)
        generator.shuffle(roads)
        network = RoadNetwork.parse(map_xml(*roads, rest=junction_xml("9", "a", {f"{way[0]}0": -1 for way in ways})))
        route = network.route(network.location("a", -1, 10.0), network.location("z", -1, 20.0), costs=[cost])
        selected.add(route.lanes[1].road)
    assert selected == {"b0"}


@pytest.mark.parametrize("step", [3.5, -3.5])
def test_route_is_straight_at_a_step_of_the_lane_offset(step: float) -> None:
    """At 60 m a lane is added on the left and the lane offset increases by its width, as in maps of CARLA; or the other
    way around. The lane that goes on stays where it is."""
    few = section_xml("", lane_xml(-1, link='<successor id="-2"/>' if step > 0.0 else '<predecessor id="-2"/>'), s=0)
    many_link = '<predecessor id="-1"/>' if step > 0.0 else '<successor id="-1"/>'
    many = section_xml("", lane_xml(-1, kind="none") + lane_xml(-2, link=many_link), s=0)
    first, second = (few, many) if step > 0.0 else (many, few)
    offsets = f'<laneOffset s="0" a="{max(-step, 0.0)}" b="0" c="0" d="0"/>'
    offsets += f'<laneOffset s="60" a="{max(step, 0.0)}" b="0" c="0" d="0"/>'
    lanes = offsets + first + second.replace('laneSection s="0"', 'laneSection s="60"')
    roads = RoadNetwork.parse(map_xml(road_xml(length=100.0, lanes=lanes)))
    start, end = (-1, -2) if step > 0.0 else (-2, -1)
    route = roads.route(roads.location("1", start, 10.0), roads.location("1", end, 90.0))
    np.testing.assert_allclose(route.polyline(1.0)[:, 1], -1.75, atol=1e-9)
    assert route.length == pytest.approx(80.0)
    section = roads.road("1").sections[0]
    line = center_line(roads, roads.road("1"), section, section.lanes[start], 5.0)
    np.testing.assert_allclose(np.array(line)[:, 1], -1.75, atol=1e-9)

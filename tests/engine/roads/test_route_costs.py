"""Tests of route costs: length, time, junctions or random factors."""

from __future__ import annotations

import math

import pytest
from opendrive_xml import lane_links_xml, lane_xml, map_xml, predecessor_xml, road_xml, section_xml, successor_xml

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.openscenario import model
from eidrive_scenario.roads import RoadNetwork, fastest, fewest_junctions, random_costs
from eidrive_scenario.storyboard.kinematics.motion_state import ResolvedPosition
from eidrive_scenario.storyboard.kinematics.route import build_route

LANE = section_xml(right=lane_xml(-1, 4, link=lane_links_xml(-1, -1)))
WAYS = {
    "a": (300.0, 10.0, ((20, 9), (140, None), (160, 8), (280, None), (300, 7))),
    "b": (360.0, 30.0, ((20, 9), (180, None), (200, 6), (340, None), (360, 7))),
    "c": (420.0, 10.0, ((20, 9), (210, None), (400, None), (420, 7))),
}
"""Length [m], speed limit [m/s], end point and junction of each road."""


@pytest.fixture
def three_ways() -> RoadNetwork:
    """Three routes from `start` to `end` 300 m further: a is the shortest, b the fastest, c has the fewest junctions.

    Route c has two junctions, the others three. Routes b and c have slopes up and down.
    """

    def to(other: str) -> dict[str, str]:
        return {"junction" if other.isdigit() else "road": other}

    roads = [
        road_xml("start", length=100.0, lanes=LANE, link=successor_xml(junction="9")),
        road_xml("end", length=100.0, x=400.0, lanes=LANE, link=predecessor_xml(junction="7")),
    ]
    connections: dict[int, str] = {}
    for way, (length, limit, pieces) in WAYS.items():
        slope = math.acos(300.0 / length)
        names = ["start", *(f"{way}{number}" for number in range(len(pieces))), "end"]
        owners = [None, *(junction for _, junction in pieces), None]
        begin = 0.0
        for number, (stop, junction) in enumerate(pieces, 1):
            up = begin < length / 2
            x = 100.0 + begin * math.cos(slope)
            y = (begin if up else length - begin) * math.sin(slope)
            before, after = (
                str(owners[n]) if junction is None and owners[n] else names[n] for n in (number - 1, number + 1)
            )
            links = predecessor_xml(**to(before)) + successor_xml(**to(after))
            speed = f'<type s="0" type="town"><speed max="{limit}" unit="m/s"/></type>'
            roads.append(
                road_xml(
                    names[number],
                    length=stop - begin,
                    x=x,
                    y=y,
                    hdg=slope if up else -slope,
                    link=links,
                    lanes=LANE,
                    extra=speed,
                    junction=str(junction or -1),
                )
            )
            if junction is not None:
                connections[junction] = connections.get(junction, "") + (
                    f'<connection id="{way}" incomingRoad="{names[number - 1]}" connectingRoad="{names[number]}" '
                    'contactPoint="start"><laneLink from="-1" to="-1"/></connection>'
                )
            begin = float(stop)
    junctions = "".join(f'<junction id="{one}" name="">{text}</junction>' for one, text in connections.items())
    return RoadNetwork.parse(map_xml(*roads, rest=junctions))


def test_each_cost_selects_its_route(three_ways: RoadNetwork) -> None:
    """a: 300 m in 30 s, b: 360 m in 12 s, c: 420 m in 42 s. All include 50 m of `start` and 50 m of `end`."""
    here, there = three_ways.location("start", -1, 50.0), three_ways.location("end", -1, 50.0)

    def way(cost: object) -> str:
        return three_ways.route(here, there, costs=[cost]).lanes[1].road[0]  # type: ignore[list-item]

    assert [way(cost) for cost in (None, fastest(three_ways), fewest_junctions(three_ways))] == ["a", "b", "c"]
    by_seed = [way(random_costs(three_ways, generator(seed, "route", "r"))) for seed in range(40)]
    assert set(by_seed) == {"a", "b", "c"}
    assert by_seed[7] == way(random_costs(three_ways, generator(7, "route", "r")))


def test_each_leg_uses_its_cost(three_ways: RoadNetwork) -> None:
    places = [three_ways.location(*place) for place in (("start", -1, 50.0), ("b1", -1, 50.0), ("end", -1, 50.0))]
    route = three_ways.route(places[0], places[2], [places[1]], [fewest_junctions(three_ways), None])
    assert [key.road for key in route.lanes] == ["start", "b0", "b1", "b2", "b3", "b4", "end"]


def test_route_strategy_of_a_waypoint_selects_the_route_to_it(three_ways: RoadNetwork) -> None:
    def place(position: model.Position) -> ResolvedPosition:
        assert position.lane_position is not None
        location = three_ways.location(position.lane_position.road_id, -1, position.lane_position.s)
        return ResolvedPosition(three_ways.pose(location), location)

    def waypoint(road: str, strategy: model.RouteStrategy) -> model.Waypoint:
        there = model.Position(lane_position=model.LanePosition(road_id=road, lane_id="-1", s=50.0))
        return model.Waypoint(route_strategy=strategy, position=there)

    def way(strategy: model.RouteStrategy, seed: int = 0, begun: bool = False) -> str:
        last = waypoint("end", strategy)
        points = (last, last) if begun else (waypoint("start", model.RouteStrategy.SHORTEST), last)
        route = model.Route(closed=False, name="way", waypoint=points)
        start = three_ways.location("start", -1, 10.0) if begun else None
        return build_route(route, three_ways, place, start, seed=seed).lanes[1].road[0]

    strategies = model.RouteStrategy
    for begun in (False, True):
        assert way(strategies.SHORTEST, begun=begun) == "a"
        assert way(strategies.FASTEST, begun=begun) == "b"
        assert way(strategies.LEAST_INTERSECTIONS, begun=begun) == "c"
    by_seed = [way(strategies.RANDOM, seed) for seed in range(30)]
    assert set(by_seed) == {"a", "b", "c"}
    assert by_seed == [way(strategies.RANDOM, seed) for seed in range(30)]


def test_distance_follows_the_routing_algorithm(three_ways: RoadNetwork) -> None:
    """From 50 m before the fork to 50 m after the merge. An assigned route leads along b although a is shorter."""
    here, there = three_ways.location("start", -1, 50.0), three_ways.location("end", -1, 50.0)
    assert three_ways.distance(here, there) == pytest.approx((400.0, 0.0))
    assert three_ways.distance(here, there, "fastest") == pytest.approx((460.0, 0.0))
    assert three_ways.distance(there, here, "leastIntersections") == pytest.approx((-520.0, 0.0))
    route = three_ways.route(here, there, costs=[fastest(three_ways)])
    assert three_ways.distance(here, there, route=route) == pytest.approx((460.0, 0.0))
    assert three_ways.distance(there, here, route=route) == pytest.approx((-460.0, 0.0))
    assert three_ways.distance(here, three_ways.location("a1", -1, 10.0), route=route) is None

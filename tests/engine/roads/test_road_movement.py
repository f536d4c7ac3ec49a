"""Tests of motion along lanes, through links and junctions."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest
from opendrive_xml import junction_xml, lane_links_xml, map_xml, predecessor_xml, road_xml, section_xml, successor_xml

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.routing.route import Branch


def lane(number: int, link: str = "", width: str = 'a="3" b="0" c="0" d="0"') -> str:
    return f'<lane id="{number}" type="driving"><link>{link}</link><width sOffset="0" {width}/></lane>'


def reversed_lane(number: int) -> str:
    return lane(number).replace("<lane ", '<lane direction="reversed" ')


def chained() -> RoadNetwork:
    """Return road a along x, and road b with opposite reference line: its lane +1 continues lane -1 of a."""
    a = road_xml(
        "a",
        lanes=section_xml(lane(1, '<successor id="-1"/>'), lane(-1, '<successor id="1"/>')),
        link=successor_xml("b", "end"),
    )
    b = road_xml(
        "b",
        x=200.0,
        hdg=math.pi,
        lanes=section_xml(lane(1, '<successor id="-1"/>'), lane(-1, '<successor id="1"/>')),
        link=successor_xml("a", "end"),
    )
    return RoadNetwork.parse(map_xml(a, b))


def test_advance_onto_reversed_road_keeps_lateral_position() -> None:
    network = chained()
    start = network.location("a", -1, 90.0, 0.4)
    end = network.advance(start, 30.0)
    assert end is not None
    assert (end.road, end.lane, end.s, end.offset) == pytest.approx(("b", 1, 80.0, -0.4))
    pose = network.pose(end)
    assert (pose.x, pose.y, math.cos(pose.h)) == pytest.approx((120.0, -1.1, 1.0))
    back = network.advance(end, -30.0)
    assert back is not None
    assert back == pytest.approx(start)


@pytest.mark.parametrize("kind", ["sidewalk", "shoulder"])
def test_reversed_lane_has_its_direction_behind_a_sidewalk_of_its_id(kind: str) -> None:
    """OpenDRIVE 1.8: traffic of a reversed lane drives against the usual direction; here at s = 100 to 200."""
    beside = lane(-2).replace("driving", kind)
    sections = section_xml("", lane(-1) + beside) + section_xml("", lane(-1) + reversed_lane(-2), s=100.0)
    network = RoadNetwork.parse(map_xml(road_xml("a", length=200.0, lanes=sections)))
    assert [network.driving_direction("a", number) for number in (-1, -2)] == [1, -1]
    end = network.advance(network.location("a", -2, 180.0), 30.0)
    assert end is not None
    assert end.s == pytest.approx(150.0)
    assert abs(network.pose(end).h) == pytest.approx(math.pi)


def test_advance_beyond_end_of_road_is_none() -> None:
    network = chained()
    assert network.advance(network.location("a", -1, 90.0), 110.5) is None
    assert network.advance(network.location("a", 1, 10.0), 10.5) is None
    left = network.advance(network.location("a", 1, 10.0), 10.0)
    assert left is not None
    assert left.s == pytest.approx(0.0)


def test_left_hand_traffic_advances_in_opposite_direction() -> None:
    network = RoadNetwork.parse(map_xml(road_xml("r", rule="LHT")))
    assert [network.driving_direction("r", n) for n in (1, -1)] == [1, -1]
    moved = network.advance(network.location("r", 1, 20.0), 5.0)
    assert moved is not None
    assert moved.s == pytest.approx(25.0)


def test_advance_measures_distance_on_the_lane() -> None:
    length = 20 * math.pi
    bend = f'<geometry s="0" x="0" y="0" hdg="0" length="{length!r}"><arc curvature="0.05"/></geometry>'
    network = RoadNetwork.parse(map_xml(road_xml("r", length=length, geometry=bend)))
    outer = network.advance(network.location("r", -1, 0.0), 10.0)
    inner = network.advance(network.location("r", 1, 30.0), 10.0)
    assert outer is not None
    assert inner is not None
    assert outer.s == pytest.approx(10.0 * 20.0 / 21.75)
    assert 30.0 - inner.s == pytest.approx(10.0 * 20.0 / 18.25)


@pytest.mark.parametrize(("start", "distance"), [(9.5, 2.0), (9.9, 5.0), (10.2, 0.6), (12.5, -2.0), (11.0, -1.2)])
def test_advance_over_a_short_spiral_covers_the_path_of_the_lane(start: float, distance: float) -> None:
    """The path at a constant t is shorter than the reference line by t times the change of heading.

    The midpoint rule has an error of up to 2 mm where a stride ends within the spiral.
    """
    parts = [("line", 10.0, ""), ("spiral", 1.0, 'curvStart="0" curvEnd="0.1"'), ("arc", 9.0, 'curvature="0.1"')]
    network = RoadNetwork.parse(map_xml(road_xml("r", length=20.0, geometry=consecutive(parts))))

    def heading(s: float) -> float:
        return 0.05 * min(max(s - 10.0, 0.0), 1.0) ** 2 + 0.1 * max(s - 11.0, 0.0)

    here = network.location("r", -1, start)
    there = network.advance(here, distance)
    assert there is not None
    assert (there.s - start) - here.t * (heading(there.s) - heading(start)) == pytest.approx(distance, abs=2e-3)


def consecutive(parts: Sequence[tuple[str, float, str]]) -> str:
    """Return the plan view of consecutive curves: kind, length and attributes of each."""
    x = y = heading = s = 0.0
    geometry = ""
    for kind, length, numbers in parts:
        record = f'<geometry s="{s!r}" x="{x!r}" y="{y!r}" hdg="{heading!r}" length="{length!r}">'
        geometry += f"{record}<{kind} {numbers}/></geometry>"
        s += length
        end = RoadNetwork.parse(map_xml(road_xml("r", length=s, geometry=geometry))).road_pose_at("r", s)
        x, y, heading = end.x, end.y, end.h
    return geometry


def test_advance_once_equals_advance_in_small_steps() -> None:
    """Line, arc, line, spiral, arc: on lanes, beside them, on a widening lane, forwards and backwards."""
    parts = [("line", 30.0, ""), ("arc", 25.0, 'curvature="0.04"'), ("line", 10.0, ""),
             ("spiral", 20.0, 'curvStart="0" curvEnd="-0.05"'), ("arc", 35.0, 'curvature="-0.05"')]  # fmt: skip
    lanes = section_xml(lane(1), lane(-1) + lane(-2, width='a="2" b="0.02" c="0" d="0"'))
    network = RoadNetwork.parse(map_xml(road_xml("r", length=120.0, geometry=consecutive(parts), lanes=lanes)))
    for number, start, offset in ((-1, 2.0, 0.0), (-1, 2.0, 1.1), (-2, 2.0, 0.0), (1, 118.0, -0.7)):
        here = network.location("r", number, start, offset)
        there = network.advance(here, 100.0)
        step = here
        for _ in range(2000):
            moved = network.advance(step, 0.05)
            assert moved is not None
            step = moved
        assert there is not None
        assert there.s == pytest.approx(step.s, abs=0.01), (
            "where lanes widen and curvature grows, strides are not exact"
        )
        back = network.advance(there, -100.0)
        assert back is not None
        assert back.s == pytest.approx(start, abs=0.01)


def test_advance_follows_links_between_sections() -> None:
    lanes = section_xml(right=lane(-1, '<successor id="-2"/>')) + section_xml(
        right=lane(-1) + lane(-2, '<predecessor id="-1"/>'), s=40.0
    )
    network = RoadNetwork.parse(map_xml(road_xml("r", lanes=lanes)))
    moved = network.advance(network.location("r", -1, 35.0), 10.0)
    assert moved is not None
    assert (moved.lane, moved.s, moved.offset) == pytest.approx((-2, 45.0, 0.0))
    exactly = network.advance(network.location("r", -1, 35.0), 5.0)
    assert exactly is not None
    assert (exactly.lane, exactly.s) == pytest.approx((-2, 40.0))
    back = network.advance(network.location("r", -2, 45.0), -10.0)
    assert back is not None
    assert (back.lane, back.s) == pytest.approx((-1, 35.0))


def test_advance_at_lane_end_continues_on_adjacent_lane() -> None:
    lanes = section_xml(right=lane(-1, '<successor id="-1"/>') + lane(-2)) + section_xml(
        right=lane(-1, '<predecessor id="-1"/>'), s=40.0
    )
    network = RoadNetwork.parse(map_xml(road_xml("r", lanes=lanes)))
    moved = network.advance(network.location("r", -2, 35.0), 10.0)
    assert moved is not None
    assert (moved.lane, moved.s, moved.offset, moved.t) == pytest.approx((-1, 45.0, -3.0, -4.5))


@pytest.mark.parametrize("head_on", [False, True])
def test_advance_at_lane_end_continues_on_nearest_lane_of_the_next_road(head_on: bool) -> None:
    """Lane -2 has no link, and its center is 4.5 m right of the axis; on road b the lanes of its direction end at 3 m.

    With opposite reference lines they are on the left of the axis of b.
    """
    contact, x, hdg = ("end", 200.0, math.pi) if head_on else ("start", 100.0, 0.0)
    a = road_xml("a", lanes=section_xml(lane(1), lane(-1) + lane(-2)), link=successor_xml("b", contact))
    b = road_xml("b", x=x, hdg=hdg, lanes=section_xml(lane(1), lane(-1)))
    network = RoadNetwork.parse(map_xml(a, b))
    beyond = network.advance(network.location("a", -2, 90.0, 0.25), 30.0)
    assert beyond is not None
    assert beyond == pytest.approx(("b", 1, 80.0, 2.75, 4.25) if head_on else ("b", -1, 20.0, -2.75, -4.25))
    assert network.pose(beyond)[:2] == pytest.approx((120.0, -4.25))


def test_advance_to_end_of_a_lane_inside_its_road_stays_on_it() -> None:
    """Lane -1 ends at s = 40 without a lane beside it. Lane 1 starts there, where its traffic leaves it."""
    both = section_xml(right=lane(-1)) + section_xml(lane(1), "", s=40.0)
    network = RoadNetwork.parse(map_xml(road_xml("r", lanes=both)))
    here, there = network.location("r", -1, 35.0), network.location("r", 1, 45.0)
    assert network.advance(here, 10.0) is None
    assert network.advance(there, 10.0) is None
    for start, number in ((here, -1), (there, 1)):
        last = network.advance(start, 10.0, to_end=True)
        assert last is not None
        assert (last.lane, last.s) == pytest.approx((number, 40.0))
        assert network.pose(last).x == pytest.approx(40.0)
    short = network.advance(here, 3.0, to_end=True)
    assert short is not None
    assert short.s == pytest.approx(38.0)


BENDS = {"left": 0.05, "ahead": -0.01}
"""Curvatures of a left turn and of a branch that bends slightly to the right [1/m]."""


def fork(bends: Mapping[str, float] = BENDS, rule: str = "RHT") -> RoadNetwork:
    """Return road `a` to a junction with a branch of 20 m for each curvature [1/m]."""
    number = -1 if rule == "RHT" else 1

    def lanes(link: str = "") -> str:
        only = lane(number, link)
        return section_xml(right=only) if number < 0 else section_xml(only)

    ways = [
        road_xml(
            name,
            length=20.0,
            x=100.0,
            curvature=bend,
            lanes=lanes(lane_links_xml(number)),
            link=predecessor_xml("a"),
            junction="9",
            rule=rule,
        )
        for name, bend in bends.items()
    ]
    a = road_xml("a", lanes=lanes(), link=successor_xml(junction="9"), rule=rule)
    junction = junction_xml("9", "a", dict.fromkeys(bends, number), to=number)
    return RoadNetwork.parse(map_xml(a, *ways, rest=junction))


def test_advance_at_junction_selects_straightest_or_chosen_branch() -> None:
    network = fork()
    start = network.location("a", -1, 95.0)
    default = network.advance(start, 10.0)
    assert default is not None
    assert default.road == "ahead"
    seen: list[Branch] = []

    def leftmost(branches: Sequence[Branch]) -> Branch:
        seen.extend(branches)
        return branches[int(branches[1].turn > branches[0].turn)]

    chosen = network.advance(start, 10.0, choose=leftmost)
    assert chosen is not None
    assert chosen.road == "left"
    assert {branch.lane.road: branch.turn for branch in seen} == pytest.approx({"left": 1.0, "ahead": -0.2})
    route = network.route(start, network.location("left", -1, 15.0))
    followed = network.advance(start, 10.0, route=route)
    assert followed is not None
    assert followed.road == "left"


@pytest.mark.parametrize(("rule", "expected"), [("RHT", "right"), ("LHT", "left")])
@pytest.mark.parametrize("order", [("left", "right"), ("right", "left")])
def test_advance_at_symmetric_fork_turns_to_the_side_of_the_traffic(
    rule: str, expected: str, order: tuple[str, str]
) -> None:
    """ASAM OpenSCENARIO XML 1.3.1, 6.8.1: right with right-hand traffic, left with left-hand traffic."""
    bends = {"left": 0.05, "right": -0.05}
    network = fork({name: bends[name] for name in order}, rule)
    moved = network.advance(network.location("a", -1 if rule == "RHT" else 1, 95.0), 10.0)
    assert moved is not None
    assert moved.road == expected


@pytest.mark.parametrize(("end", "lane"), [("2", -1), ("3", -1), ("4", 1)])
def test_advance_against_the_traffic_of_a_junction_follows_the_route(end: str, lane: int) -> None:
    """The route leads from lane -1 of road 1 into a lane; the way from lane 1, against the traffic, has other roads."""
    network = RoadNetwork.load(Path(__file__).parents[3] / "xosc/roads/four_way_junction.xodr")
    route = network.route(network.location("1", -1, 50.0), network.location(end, lane, 50.0))
    reached = network.advance(network.location("1", 1, 90.0), -100.0, route=route)
    assert reached is not None
    assert (reached.road, reached.lane) == (end, -lane)


def test_advance_backwards_leaves_a_junction() -> None:
    network = fork()
    back = network.advance(network.location("left", -1, 4.0), -20.0)
    assert back is not None
    assert back.road == "a"


def test_distance_along_connected_roads() -> None:
    network = chained()
    a = network.location("a", -1, 90.0)
    b = network.location("b", 1, 80.0, -0.4)
    assert network.distance(a, b) == pytest.approx((30.0, 0.4))
    assert network.distance(b, a) == pytest.approx((-30.0, -0.4))
    oncoming = network.location("a", 1, 90.0)
    assert network.distance(oncoming, b) == pytest.approx((-30.0, 2.6))
    assert network.distance(a, network.location("a", 1, 60.0)) == pytest.approx((-30.0, 3.0))


def test_distance_between_unconnected_roads_is_none() -> None:
    network = RoadNetwork.parse(map_xml(road_xml("a"), road_xml("b", y=50.0)))
    assert network.distance(network.location("a", -1, 1.0), network.location("b", -1, 1.0)) is None


@pytest.mark.parametrize(
    ("s", "expected", "orientation"), [(10.0, 70.0, 1), (127.0, 187.0, 1), (128.0, 187.0, -1), (190.0, 125.0, -1)]
)
def test_distance_enters_a_road_at_the_nearer_end(s: float, expected: float, orientation: int) -> None:
    """From the last 50 m of road a, 10 m lead to the start and 65 m to the end of road b of 200 m."""
    turns = {"start": 10.0, "end": 65.0}
    roads = [
        road_xml(end, length=length, x=100.0, junction="9", link=predecessor_xml("a") + successor_xml("b", end))
        for end, length in turns.items()
    ]
    both_ends = predecessor_xml(junction="9") + successor_xml(junction="9")
    network = RoadNetwork.parse(
        map_xml(
            road_xml("a", link=successor_xml(junction="9")),
            road_xml("b", length=200.0, x=110.0, link=both_ends),
            *roads,
            rest=junction_xml("9", "a", {"start": -1, "end": -1}),
        )
    )
    a, b = network.location("a", -1, 50.0), network.location("b", -1, s)
    ahead = network.distance(a, b)
    assert ahead is not None
    assert ahead[0] == pytest.approx(expected)
    assert network.orientation(a, b) == orientation


def test_distance_between_neighboring_roads_searches_no_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """A row of 100 roads: from 1 m before the end of road 50 to 1 m after the start of the next one."""
    links = [successor_xml("1"), *(predecessor_xml(f"{n - 1}") + successor_xml(f"{n + 1}") for n in range(1, 99))]
    roads = [road_xml(f"{n}", x=100.0 * n, link=link) for n, link in enumerate(links)]
    network = RoadNetwork.parse(map_xml(*roads, road_xml("99", x=9900.0, link=predecessor_xml("98"))))
    visited: list[str] = []
    beyond_road = network.links.beyond_road

    def counted(road: str, direction: int) -> Iterator[tuple[str, int]]:
        visited.append(road)
        return beyond_road(road, direction)

    monkeypatch.setattr(network.links, "beyond_road", counted)
    distance = network.distance(network.location("50", -1, 99.0), network.location("51", -1, 1.0))
    assert distance == pytest.approx((2.0, 0.0))
    assert len(visited) <= 4

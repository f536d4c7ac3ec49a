"""Routes of wrong-way drivers: three lanes merge into one, and Ego drives from there against the traffic."""

from __future__ import annotations

import math
from typing import Any

import pytest
from opendrive_xml import (
    junction_xml,
    lane_links_xml,
    lane_xml,
    map_xml,
    predecessor_xml,
    road_xml,
    section_xml,
    successor_xml,
)
from storyboard_xml import init_xml, lane_position_xml, private_xml, teleport_xml
from whole_run import Run

from eidrive_scenario.errors import ScenarioError

TURN, LENGTH = math.pi / 6, 40.0
"""Turning angle [rad] and length [m] of the connecting roads 11 and 13."""
TURNED = '<Orientation type="relative" h="3.141592653589793"/>'


def merge() -> str:
    """Return roads 2, 3 and 4, which lead in lane 1 by the connecting roads 11, 12 and 13 into road 1, towards -x."""

    def road(number: int, x: float, y: float, hdg: float, length: float, link: str, **more: Any) -> str:
        lanes = section_xml(lane_xml(1, 4, link=lane_links_xml(1, 1) if "junction" in more else ""))
        return road_xml(str(number), x=x, y=y, hdg=hdg, length=length, link=link, lanes=lanes, **more)

    roads = [road(1, 0.0, 0.0, 0.0, 50.0, successor_xml(junction="9"))]
    for number, curvature in ((11, TURN / LENGTH), (12, 0.0), (13, -TURN / LENGTH)):
        link = predecessor_xml("1") + successor_xml(str(number - 9))
        roads.append(road(number, 50.0, 0.0, 0.0, LENGTH, link, curvature=curvature, junction="9"))
        turn = curvature * LENGTH
        x, y = (math.sin(turn) / curvature, (1 - math.cos(turn)) / curvature) if curvature else (LENGTH, 0.0)
        roads.append(road(number - 9, 50.0 + x, y, turn, 200.0, predecessor_xml(junction="9")))
    return map_xml(*roads, rest=junction_xml("9", "1", {"11": 1, "12": 1, "13": 1}, to=1))


def assign(*places: tuple[int, float], inside: str = "") -> str:
    waypoints = "".join(
        f'<Waypoint routeStrategy="shortest"><Position>{lane_position_xml(1, s, road, inside)}</Position></Waypoint>'
        for road, s in places
    )
    route = f'<Route name="wrong way" closed="false">{waypoints}</Route>'
    return private_xml(f"<RoutingAction><AssignRouteAction>{route}</AssignRouteAction></RoutingAction>")


def acquire(road: int, s: float) -> str:
    position = f"<Position>{lane_position_xml(1, s, road)}</Position>"
    return private_xml(f"<RoutingAction><AcquirePositionAction>{position}</AcquirePositionAction></RoutingAction>")


@pytest.mark.element("AssignRouteAction", "AcquirePositionAction")
@pytest.mark.parametrize(("goal", "turn"), [(2, TURN), (3, 0.0), (4, -TURN)])
@pytest.mark.parametrize("kind", ["route", "position"])
@pytest.mark.parametrize("speed", [10.0, -10.0], ids=["facing against the traffic", "in reverse"])
def test_route_against_traffic_is_driven_with_a_warning(
    run: Run, goal: int, turn: float, kind: str, speed: float
) -> None:
    """From x = 20 in 10 s over 30 m, the connecting road and beyond; in reverse Ego faces along the traffic."""
    init = init_xml("Ego", teleport_xml(lane_position_xml(1, 20.0, 1, TURNED if speed > 0.0 else "")))
    action = assign((1, 25.0), (goal, 150.0)) if kind == "route" else acquire(goal, 150.0)
    played = run(10.0, ("Ego", action), street=merge(), ego=(1, 20.0, speed), driven=False, init=init)
    facing = 0.0 if speed > 0.0 else math.pi
    assert math.cos(played.of("Ego", "yaw")[-1] - turn - facing) == pytest.approx(1.0)
    assert played.of("Ego", "speed")[-1] == speed
    texts = [str(one) for one in played.result.warnings if "leads against the driving direction" in str(one)]
    assert len(texts) == 1


@pytest.mark.parametrize("inside", [TURNED, ""], ids=["turned waypoints", "plain waypoints"])
def test_route_against_traffic_of_an_actor_along_the_traffic_needs_turned_waypoints(run: Run, inside: str) -> None:
    action = assign((1, 25.0), (4, 150.0), inside=inside)
    init = init_xml("Ego", teleport_xml(lane_position_xml(1, 20.0, 1)))

    def play() -> None:
        run(1.0, ("Ego", action), street=merge(), ego=(1, 20.0, 10.0), driven=False, init=init)

    if inside:
        play()
    else:
        with pytest.raises(ScenarioError, match="route 'wrong way' is not drivable"):
            play()


def test_route_with_the_traffic_of_a_wrong_way_driver_is_unchanged(run: Run) -> None:
    """The waypoints lead from road 4 to road 1, and Ego drives the other way: the route is no reason for a warning."""
    init = init_xml("Ego", teleport_xml(lane_position_xml(1, 190.0, 4, TURNED)))
    played = run(
        1.0, ("Ego", assign((4, 180.0), (1, 10.0))), street=merge(), ego=(1, 20.0, 1.0), driven=False, init=init
    )
    assert not [str(one) for one in played.result.warnings if "against the driving direction" in str(one)]


def test_error_of_a_wrong_way_driver_leads_from_the_driver(run: Run) -> None:
    """No way leads from the oncoming lane, in which Ego overtakes, to its own lane."""
    init = init_xml("Ego", teleport_xml(lane_position_xml(1, 100.0, 1, TURNED)))
    action = acquire(1, 300.0).replace('laneId="1"', 'laneId="-1"')
    with pytest.raises(ScenarioError, match=r"from road '1' lane 1 s 100\.0 to road '1' lane -1 s 300\.0"):
        run(1.0, ("Ego", action), ego=(1, 100.0, 10.0), driven=False, init=init)

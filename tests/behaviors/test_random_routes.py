"""RandomRouteAction at a junction with three branches that diverge by 30°."""

from __future__ import annotations

import math

import pytest
from opendrive_xml import junction_xml, map_xml, predecessor_xml, successor_xml
from openscenario_xml import scenario_xml
from storyboard_xml import init_xml, private_xml
from street_scene import THROUGH, lane_road
from whole_run import Run

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.storyboard.storyboard import Storyboard

RANDOM = private_xml("<RoutingAction><RandomRouteAction/></RoutingAction>")
LONG, TURN = 40.0, math.pi / 6
"""Length of the connecting roads [m], and turning angle of the curved ones [rad]."""


def fork() -> str:
    """Return a junction: road 1 leads into connecting roads 11 (left), 12 (straight), 13 (right), those into roads 2,
    3, 4.
    """
    roads = [lane_road(1, 0.0, 0.0, 0.0, 50.0, successor_xml(junction="9"))]
    for number, curvature in ((11, TURN / LONG), (12, 0.0), (13, -TURN / LONG)):
        link = predecessor_xml("1") + successor_xml(str(number - 9))
        roads.append(lane_road(number, 50.0, 0.0, 0.0, LONG, link, THROUGH, curvature=curvature, junction="9"))
        turn = curvature * LONG
        x, y = (math.sin(turn) / curvature, (1 - math.cos(turn)) / curvature) if curvature else (LONG, 0.0)
        roads.append(lane_road(number - 9, 50.0 + x, y, turn, 200.0, predecessor_xml(junction="9")))
    return map_xml(*roads, rest=junction_xml("9", "1", {"11": -1, "12": -1, "13": -1}))


@pytest.mark.statistical
@pytest.mark.element("RandomRouteAction")
@pytest.mark.parametrize("driven", [False, True], ids=["scripted", "driven"])
def test_random_route_over_seeds_takes_all_branches_reproducibly(run: Run, driven: bool) -> None:
    def turn(seed: int) -> float:
        played = run(7.5, ("Ego", RANDOM), street=fork(), ego=(-1, 20.0, 15.0), seed=seed, driven=driven)
        return round(played.of("Ego", "yaw")[-1] / TURN, 1)

    taken = [turn(seed) for seed in range(10)]
    assert {abs(part) for part in taken} == {0.0, 1.0}
    assert set(taken) == {-1.0, 0.0, 1.0}
    assert turn(3) == taken[3]


@pytest.mark.element("AssignRouteAction")
def test_random_route_ends_with_an_assigned_route(run: Run) -> None:
    waypoint = '<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="{}" laneId="-1" s="{}"/></Position>'
    waypoints = "".join(waypoint.format(*place) + "</Waypoint>" for place in ((1, 25), (4, 150)))
    route = f'<Route name="to the right" closed="false">{waypoints}</Route>'
    assign = private_xml(f"<RoutingAction><AssignRouteAction>{route}</AssignRouteAction></RoutingAction>")
    for seed in range(6):
        played = run(
            7.5, ("Ego", RANDOM), ("Ego", assign), street=fork(), ego=(-1, 20.0, 15.0), seed=seed, driven=False
        )
        assert played.of("Ego", "yaw")[-1] == pytest.approx(-TURN)


def test_random_route_without_roads_is_rejected() -> None:
    scenario = load_scenario(scenario_xml(init=init_xml("Ego", RANDOM)))
    with pytest.raises(ScenarioError, match="RandomRouteAction: the scenario has no road network"):
        Storyboard(scenario, None, dt=0.1)

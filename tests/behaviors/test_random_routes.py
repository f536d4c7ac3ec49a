"""RandomRouteAction at a junction with three branches that diverge by 30°."""

from __future__ import annotations

import math

import pytest
from street_scene import CAR, GROUP, private
from whole_run import FILE, Run

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.storyboard.storyboard import Storyboard

RANDOM = private("<RoutingAction><RandomRouteAction/></RoutingAction>")
LONG, TURN = 40.0, math.pi / 6
"""Length of the connecting roads [m], and turning angle of the curved ones [rad]."""


def road(number: int, pose: tuple[float, float, float], length: float, shape: str, links: str, lane: str = "") -> str:
    junction = 9 if number > 10 else -1
    x, y, h = pose
    return f"""<road name="" length="{length}" id="{number}" junction="{junction}"><link>{links}</link>
      <planView><geometry s="0" x="{x}" y="{y}" hdg="{h}" length="{length}">{shape}</geometry></planView>
      <lanes><laneSection s="0"><center><lane id="0" type="none" level="false"/></center><right>
      <lane id="-1" type="driving" level="false"><link>{lane}</link><width sOffset="0" a="4" b="0" c="0" d="0"/></lane>
      </right></laneSection></lanes></road>"""


def fork() -> str:
    """Return a junction: road 1 leads into connecting roads 11 (left), 12 (straight), 13 (right), those into roads 2,
    3, 4.
    """
    roads = road(1, (0, 0, 0), 50, "<line/>", '<successor elementType="junction" elementId="9"/>')
    for number, curvature in ((11, TURN / LONG), (12, 0.0), (13, -TURN / LONG)):
        shape = f'<arc curvature="{curvature}"/>' if curvature else "<line/>"
        links = f"""<predecessor elementType="road" elementId="1" contactPoint="end"/>
          <successor elementType="road" elementId="{number - 9}" contactPoint="start"/>"""
        lane = '<predecessor id="-1"/><successor id="-1"/>'
        roads += road(number, (50, 0, 0), LONG, shape, links, lane)
        turn = curvature * LONG
        x, y = (math.sin(turn) / curvature, (1 - math.cos(turn)) / curvature) if curvature else (LONG, 0.0)
        links = '<predecessor elementType="junction" elementId="9"/>'
        roads += road(number - 9, (50 + x, y, turn), 200, "<line/>", links)
    connections = "".join(
        f'<connection id="{number}" incomingRoad="1" connectingRoad="{number}" contactPoint="start">'
        '<laneLink from="-1" to="-1"/></connection>'
        for number in (11, 12, 13)
    )
    return f"""<OpenDRIVE><header revMajor="1" revMinor="6"/>{roads}
      <junction id="9" name="">{connections}</junction></OpenDRIVE>"""


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
    assign = private(f"<RoutingAction><AssignRouteAction>{route}</AssignRouteAction></RoutingAction>")
    for seed in range(6):
        played = run(
            7.5, ("Ego", RANDOM), ("Ego", assign), street=fork(), ego=(-1, 20.0, 15.0), seed=seed, driven=False
        )
        assert played.of("Ego", "yaw")[-1] == pytest.approx(-TURN)


def test_random_route_without_roads_is_rejected() -> None:
    text = FILE.format(
        cars=CAR.format(name="Ego", controller=""),
        more="",
        everywhere="",
        start="",
        private=f'<Private entityRef="Ego">{RANDOM}</Private>',
        groups=GROUP.format(number=0, actor="Ego", action=RANDOM, trigger=""),
        end=1,
        signals="",
    ).replace('<LogicFile filepath="street.xodr"/>', "")
    with pytest.raises(ScenarioError, match="RandomRouteAction: the scenario has no road network"):
        Storyboard(load_scenario(text.encode()), None, dt=0.1)

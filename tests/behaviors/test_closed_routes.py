"""Closed routes: laps on a ring with an exit, which is the straightest branch at its junction."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from opendrive_xml import junction_xml, map_xml, predecessor_xml, successor_xml
from recorded_scene import RunScene
from storyboard_xml import private_xml, teleport_xml
from street_scene import NOTHING, THROUGH, after, lane_road
from whole_run import RecordedRun, Run

from eidrive_scenario.errors import ScenarioError

LAP = 200.0 + 2 * 22.0 * math.pi
"""Length of a lap along lane -1 [m]: two straights of 100 m, two half circles of 22 m radius, 2 m outside the reference
line.
"""


def ring() -> str:
    """Return a ring: road 1 east, connecting road 12 to the left, road 2 west, road 4 back to road 1; road 11 exits to
    road 3.
    """
    half = 20.0 * math.pi
    into, out_of = successor_xml(junction="9"), predecessor_xml(junction="9")
    roads = (
        lane_road(1, 0.0, 0.0, 0.0, 100.0, predecessor_xml("4") + into, THROUGH),
        lane_road(11, 100.0, 0.0, 0.0, half, predecessor_xml("1") + successor_xml("3"), THROUGH, junction="9"),
        lane_road(
            *(12, 100.0, 0.0, 0.0, half, predecessor_xml("1") + successor_xml("2"), THROUGH),
            curvature=0.05,
            junction="9",
        ),
        lane_road(2, 100.0, 40.0, math.pi, 100.0, out_of + successor_xml("4"), THROUGH),
        lane_road(3, 100.0 + half, 0.0, 0.0, 900.0, out_of, THROUGH),
        lane_road(4, 0.0, 40.0, math.pi, half, predecessor_xml("2") + successor_xml("1"), THROUGH, curvature=0.05),
    )
    return map_xml(*roads, rest=junction_xml("9", "1", {"11": -1, "12": -1}))


def assign(closed: str, *places: tuple[int, float]) -> str:
    position = '<Position><LanePosition roadId="{}" laneId="-1" s="{}"/></Position>'
    waypoint = f'<Waypoint routeStrategy="shortest">{position}</Waypoint>'
    waypoints = "".join(waypoint.format(*place) for place in places)
    route = f'<Route name="round" closed="{closed}">{waypoints}</Route>'
    return private_xml(f"<RoutingAction><AssignRouteAction>{route}</AssignRouteAction></RoutingAction>")


def played(run: Run, end: float, action: str, *steps: tuple[str, ...], **more: Any) -> RecordedRun:
    return run(end, ("Ego", action), *steps, street=ring(), ego=(-1, 50.0, 20.0), **more)


@pytest.mark.element("AssignRouteAction")
@pytest.mark.parametrize("start", [(1, 70.0), (2, 30.0)], ids=["a way to it", "past the fork"])
def test_closed_route_is_driven_in_laps(run: Run, start: tuple[int, float]) -> None:
    """After 35 s at 20 m/s: two laps from road 1, s 50, and the rest of 700 m."""
    action = assign("true", start, (4, 30.0))
    watched = played(run, 35.0, action, driven=False)
    rest = 35.0 * 20.0 - 2 * LAP
    position = watched.frames[-1].view.position[0]
    assert position[:2] == pytest.approx((50.0 + rest, -2.0), abs=0.1)


@pytest.mark.parametrize("driven", [False, True])
def test_route_takes_another_branch_on_its_second_pass(run: Run, driven: bool) -> None:
    """From road 1, s 50, by road 2 and out by road 3: after 35 s at 20 m/s a lap and the rest of 700 m.

    An active controller slows down in the half circles, and is on road 3 by then.
    """
    watched = played(run, 35.0, assign("false", (1, 60.0), (2, 30.0), (3, 800.0)), driven=driven)
    position = watched.frames[-1].view.position[0]
    if driven:
        assert position[1] == pytest.approx(-2.0, abs=0.5)
        assert position[0] > 100.0 + 20.0 * math.pi
        return
    assert position[:2] == pytest.approx((50.0 + 35.0 * 20.0 - LAP, -2.0), abs=0.1)


@pytest.mark.element("TeleportAction")
@pytest.mark.parametrize(
    ("passed", "laps"), [(None, 1), (20.0, 1), (50.0, 0)], ids=["on road 1", "before the waypoint", "after it"]
)
def test_teleported_vehicle_keeps_waypoints_ahead(scene: RunScene, passed: float | None, laps: int) -> None:
    """From a branch into road 1: by the waypoint on road 2, at x = 70 m, a lap before the exit, or straight to it."""
    branch = lane_road(5, -100.0, 0.0, 0.0, 100.0, successor_xml("1"), THROUGH)
    street = ring().replace("<junction", f"{branch}<junction", 1)
    position = '<LanePosition roadId="{}" laneId="-1" s="{}"/>'
    there = () if passed is None else (("Ego", teleport_xml(position.format(2, passed)), after(0.25)),)
    away = ("Ego", teleport_xml(position.format(5, 50.0)), after(0.45))
    actions = (("Ego", assign("false", (1, 60.0), (2, 30.0), (3, 800.0))), *there, away)
    played = scene(0.6, *actions, street=street, ego=(-1, 50.0, 20.0), other=(-1, 90.0, 0.0), driven=True)
    path = played.commands[-1].goals["Ego"].path
    assert path is not None
    assert path[0, :2] == pytest.approx((-50.0, -2.0))
    assert path[-1, :2] == pytest.approx((100.0 + 20.0 * math.pi + 800.0, -2.0))
    assert (np.hypot(*(path[:, :2] - (70.0, 42.0)).T).min() < 2.0) == bool(laps)
    length = np.hypot(*np.diff(path[:, :2], axis=0).T).sum()
    assert length == pytest.approx(950.0 + 20.0 * math.pi + laps * LAP, abs=0.1)


def test_open_route_ends_at_its_last_waypoint(run: Run) -> None:
    """From road 1, s 50, to s 70: at the junction the straightest branch is the exit."""
    watched = played(run, 10.0, assign("false", (1, 60.0), (1, 70.0)), driven=False)
    assert watched.frames[-1].view.position[0][:2] == pytest.approx((250.0, -2.0), abs=0.1)


def test_route_is_joined_between_its_first_waypoints(run: Run) -> None:
    """From road 1, s 50, past s 20: 200 m out by road 3, without a lap of 338 m back to s 20."""
    watched = played(run, 10.0, assign("false", (1, 20.0), (3, 800.0)), driven=False)
    assert watched.frames[-1].view.position[0][:2] == pytest.approx((250.0, -2.0), abs=0.1)


@pytest.mark.exhaustive
@pytest.mark.element("AssignRouteAction")
@pytest.mark.parametrize("relieved", [False, True], ids=["alone", "switched off for two seconds"])
def test_closed_route_of_driven_vehicle_is_driven_in_laps(run: Run, relieved: bool) -> None:
    """In the half circles sqrt(5 · 22) = 10.5 m/s at most: in 60 s it is once round and more, and never out."""
    switch = '<ControllerAction><ActivateControllerAction lateral="{0}" longitudinal="{0}"/></ControllerAction>'
    off, on = (private_xml(switch.format(word)) for word in ("false", "true"))
    steps = (("Ego", off, after(20.0)), ("Ego", on, after(22.0))) if relieved else ()
    watched = played(run, 60.0, assign("true", (1, 70.0), (4, 30.0)), *steps)
    x, y = (np.array([frame.view.position[0][axis] for frame in watched.frames]) for axis in (0, 1))
    beyond = np.hypot(x - np.clip(x, 0.0, 100.0), y - 20.0)
    assert beyond == pytest.approx(np.full(len(x), 22.0), abs=1.0)
    angle = np.unwrap(np.arctan2(y - 20.0, x - 50.0))
    assert angle[-1] - angle[0] > 2 * math.pi
    assert min(watched.of("Ego", "speed")) > 5.0


def test_closed_route_without_a_path_back_is_rejected(run: Run) -> None:
    with pytest.raises(ScenarioError, match="closed route 'round' is not drivable"):
        played(run, 1.0, assign("true", (1, 70.0), (3, 30.0)), driven=False)


@pytest.mark.element("DistanceCondition")
@pytest.mark.parametrize(("algorithm", "far"), [("assignedRoute", True), ("shortest", False), ("undefined", False)])
def test_distance_along_the_assigned_route_exceeds_the_shortest(run: Run, algorithm: str, far: bool) -> None:
    """The end of road 2 is 50 + 62.8 + 100 m ahead along the route, and 50 + 62.8 m behind by road 4."""
    position = '<Position><LanePosition roadId="2" laneId="-1" s="100"/></Position>'
    condition = f"""<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/>
      </TriggeringEntities><EntityCondition><DistanceCondition freespace="false" rule="greaterThan" value="200"
      coordinateSystem="road" relativeDistanceType="longitudinal" routingAlgorithm="{algorithm}">{position}
      </DistanceCondition></EntityCondition></ByEntityCondition>"""
    watched = played(run, 0.5, assign("false", (1, 70.0), (4, 30.0)), ("Ego", NOTHING, condition), driven=False)
    assert bool(watched.begun("event 1")) is far

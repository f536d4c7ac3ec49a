"""Criteria on routes: distance from the route, completed share, lanes, giving way to an emergency vehicle."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from criteria_scenario import write_scenario
from eidrive_criteria.in_route import InRoute, InRouteSettings
from eidrive_criteria.outside_route_lanes import OutsideRouteLanes, OutsideRouteLanesSettings
from eidrive_criteria.route_completion import RouteCompletion, RouteCompletionSettings
from eidrive_criteria.yield_to_emergency_vehicle import YieldToEmergencyVehicle, YieldToEmergencyVehicleSettings
from msgspec.structs import replace
from opendrive_xml import lane_xml, map_xml, road_xml, section_xml
from pydantic import ValidationError

from eidrive_scenario.api.common import RoadNetwork
from eidrive_scenario.api.criteria import Criterion, Verdict, evaluate_criteria
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.simulation import RunSettings, run_file

STRAIGHT = [(0.0, 0.0), (100.0, 0.0)]
Point = tuple[float, float]


def judge(criterion: Criterion, frames: list[Any], roads: Any = None) -> Verdict:
    (verdict,) = evaluate_criteria(frames, [criterion], roads)
    return verdict


def in_route(frames: list[Any], **settings: Any) -> Verdict:
    return judge(InRoute(InRouteSettings(of="Ego", **settings)), frames)


def completion(frames: list[Any], **settings: Any) -> Verdict:
    return judge(RouteCompletion(RouteCompletionSettings(of="Ego", **settings)), frames)


def outside(frames: list[Any], roads: Any, **settings: Any) -> Verdict:
    return judge(OutsideRouteLanes(OutsideRouteLanesSettings(of="Ego", **settings)), frames, roads)


def yields(frames: list[Any], roads: Any = None, **settings: Any) -> Verdict:
    return judge(YieldToEmergencyVehicle(YieldToEmergencyVehicleSettings(of="Ego", to="EV", **settings)), frames, roads)


def drive(frame: Any, car: Any, *points: Point, speed: float = 30.0) -> list[Any]:
    """Return one frame per second with the Ego at these points."""
    return [frame(float(second), {"Ego": car(x, y, speed=speed)}) for second, (x, y) in enumerate(points)]


def test_distance_from_the_route(frame: Any, car: Any) -> None:
    frames = drive(frame, car, (0, 0), (20, 8), (40, 12), (60, 0))
    verdict = in_route(frames, route=STRAIGHT)
    assert (verdict.passed, verdict.value) == (True, 12.0)
    verdict = in_route(frames, route=STRAIGHT, at_most=10, fatal=True)
    assert (verdict.passed, verdict.value, verdict.first_violation, verdict.fatal) == (False, 12.0, 2.0, True)


def test_long_departure_fails(frame: Any, car: Any) -> None:
    """From (20, 20) to (60, 20) the Ego drives 40 m at 20 m from a route of 100 m, after 28.3 m to get there."""
    frames = drive(frame, car, (0, 0), (20, 20), (40, 20), (60, 20), (80, 0))
    assert in_route(frames, route=STRAIGHT, share=0.69).passed
    verdict = in_route(frames, route=STRAIGHT, share=0.68)
    assert (verdict.passed, verdict.first_violation) == (False, 3.0)
    assert in_route(frames, route=STRAIGHT, beyond=20, share=0).passed
    frames = drive(frame, car, (0, 20), (10, 20), (20, 20))
    assert in_route(frames, route=STRAIGHT, share=0.2 - 9e-9).passed
    assert not in_route(frames, route=STRAIGHT, share=0.2 - 2e-8).passed


def test_shortcut_is_a_departure(frame: Any, car: Any) -> None:
    """The route goes 60 m to the left, 40 m ahead and back; the Ego drives straight ahead instead."""
    route = [(0.0, 0.0), (0.0, 60.0), (40.0, 60.0), (40.0, 0.0)]
    frames = drive(frame, car, (0, 0), (10, 0), (20, 0), (30, 0), (40, 0))
    verdict = in_route(frames, route=route)
    assert (verdict.passed, verdict.value) == (False, 40.0)
    assert completion(frames, route=route).value == 0.0


@pytest.mark.parametrize(("end", "share"), [(80.0, 0.8), (100.0, 1.0), (120.0, 1.0), (0.0, 0.0)])
def test_completed_share(frame: Any, car: Any, end: float, share: float) -> None:
    points = [(float(x), 1.0) for x in np.arange(0.0, end + 1.0, 20.0)]
    verdict = completion(drive(frame, car, *points), route=STRAIGHT)
    assert verdict.passed == (share == 1.0)
    assert verdict.value == pytest.approx(share)


def test_limits_of_completion(frame: Any, car: Any) -> None:
    frames = drive(frame, car, *((float(x), 0.0) for x in range(0, 81, 20)))
    assert completion(frames, route=STRAIGHT, at_least=0.8).passed
    assert not completion(frames, route=STRAIGHT, at_least=0.81).passed
    assert completion(frames, route=STRAIGHT, at_least=0.5, within=20).passed
    assert not completion(frames, route=STRAIGHT, at_least=0.5, within=19).passed


@pytest.mark.parametrize(
    ("end", "at_least", "margin"), [(80, 0.6, 0.5), (100, 0.6, 1.0), (100, 0.99, 1.0), (80, 0, None)]
)
def test_margin_of_completion_is_1_at_the_end(
    frame: Any, car: Any, end: int, at_least: float, margin: float | None
) -> None:
    criterion = RouteCompletion(RouteCompletionSettings(of="Ego", route=tuple(STRAIGHT), at_least=at_least))
    judge(criterion, drive(frame, car, *((float(x), 0.0) for x in range(0, end + 1, 20))))
    assert criterion.metrics().get("route_completion.margin") == (None if margin is None else pytest.approx(margin))


@pytest.mark.parametrize(
    ("points", "share"),
    [
        ([(60, 0), (80, 0), (100, 0)], 0.4),
        ([(10, 5), (30, 0), (50, 0)], 0.5),
        ([(-15, 0), (5, 0), (25, 0)], 0.25),
        ([(100, 0), (100, 0)], 0.0),
        ([(100, 500), (100, 500)], 0.0),
        ([(0, 31), (20, 31), (40, 31)], 0.0),
        ([(0, 29), (20, 29), (40, 29)], 0.4),
        ([(0, 0), (20, 0), (20, 31), (40, 31), (60, 31), (60, 0), (80, 0)], 0.4),
        ([(0, 500), (20, 31), (20, 0), (40, 0)], 0.2),
    ],
)
def test_completion_begins_where_the_actor_joins_the_route(
    frame: Any, car: Any, points: list[Point], share: float
) -> None:
    """The route of 100 m counts from its start up to 10 m after it, and places up to 30 m beside it count."""
    assert completion(drive(frame, car, *points), route=STRAIGHT).value == pytest.approx(share)


@pytest.mark.parametrize("length", [10.0, 500.0])
@pytest.mark.parametrize(("start", "step"), [(0.0, 40.0), (0.0, 31.0), (400.0, -12.5)])
def test_steps_longer_than_the_searched_part_of_the_route(
    frame: Any, car: Any, start: float, step: float, length: float
) -> None:
    """Ten steps along a route of straight lines of a length, in both directions."""
    frames = drive(frame, car, *((start + step * n, 0.0) for n in range(11)), speed=abs(step))
    route = [(x, 0.0) for x in np.arange(0.0, 500.0 + length, length).tolist()]
    assert in_route(frames, route=route).value == 0.0
    criterion = RouteCompletion(RouteCompletionSettings(of="Ego", route=tuple(route)))
    judge(criterion, frames)
    assert criterion.route is not None
    assert criterion.route.place(start + 10.0 * step, 0.0).along == start + 10.0 * step


def test_route_there_and_back(frame: Any, car: Any) -> None:
    route = [(0.0, 0.0), (60.0, 0.0), (0.0, 0.0)]
    there = [(0.0, 0.0), (20.0, 0.0), (40.0, 0.0), (60.0, 0.0)]
    assert completion(drive(frame, car, *there), route=route).value == pytest.approx(0.5)
    back = drive(frame, car, *there, *reversed(there[:-1]))
    assert completion(back, route=route).value == pytest.approx(1.0)


def test_teleport_and_backward_motion_complete_nothing(frame: Any, car: Any) -> None:
    """20 m, 10 m back, 10 m again, a teleport of 200 m, then 20 m more, of 400 m."""
    frames = drive(frame, car, (0, 0), (20, 0), (10, 0), (20, 0), (220, 0), (240, 0))
    assert completion(frames, route=[(0, 0), (400, 0)]).value == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("parts", "share"),
    [([(0, 200), (0, 100)], 0.5), ([(0, 200), (100, 240)], 0.6), ([(0, 100), (300, 340), (80, 320)], 0.85)],
)
def test_part_of_a_route_that_is_driven_twice_counts_once(
    frame: Any, car: Any, parts: list[tuple[int, int]], share: float
) -> None:
    """Between the parts of 400 m, the Ego is teleported."""
    points = [(float(x), 0.0) for begin, end in parts for x in range(begin, end + 1, 20)]
    assert completion(drive(frame, car, *points), route=[(0, 0), (400, 0)]).value == pytest.approx(share)


def test_last_requested_route_counts(frame: Any, car: Any) -> None:
    """The second route, of 40 m, starts at 20 m; the Ego completes half of it."""
    frames = drive(frame, car, (0, 0), (20, 0), (40, 0))
    assert "no route was requested" in completion(frames).reason
    first, second = np.array([[0.0, 0.0, 0.0], [300.0, 0.0, 0.0]]), np.array([[20.0, 0.0, 0.0], [60.0, 0.0, 0.0]])
    frames = [
        replace(frames[0], routes={"Ego": first, "Other": second}),
        replace(frames[1], routes={"Ego": second}),
        frames[2],
    ]
    assert completion(frames).value == pytest.approx(0.5)
    assert completion(frames[:2]).value == 0.0
    assert in_route(frames).value == 0.0


@pytest.mark.parametrize("end", [0.0, 1e-9])
def test_route_without_length(frame: Any, car: Any, end: float) -> None:
    """The scenario requests the place at which the actor is."""
    frames = drive(frame, car, (0, 0), (10, 0))
    frames[0] = replace(frames[0], routes={"Ego": np.array([[0.0, 0.0, 0.0], [end, 0.0, 0.0]])})
    assert completion(frames).value == 1.0
    assert in_route(frames).value is not None


def test_route_over_lanes(frame: Any, car: Any, roads: Any) -> None:
    """Along the left lane of road 1 the direction is against x: there is no route from -60 to 0, which is straight.

    On the right lane the route of 60 m passes through (-30, 0), although its ends are 1 m beside the center.
    """
    frames = drive(frame, car, (-60, 0), (-30, 0), (0, 0))
    right = RouteCompletion(RouteCompletionSettings(of="Ego", route=((-60, -1), (0, -1))))
    assert judge(right, frames, roads).value == pytest.approx(1.0)
    criterion = InRoute(InRouteSettings(of="Ego", route=((-60, 3.5), (0, 3.5))))
    assert judge(criterion, frames, roads).value == pytest.approx(3.5)


def test_share_outside_the_lanes(frame: Any, car: Any, roads: Any) -> None:
    """Parking lanes end at y = -5.25. The center is 0.45 m, then 0.75 m outside them."""
    points = [(-60, 0), (-50, 0), (-40, -5.7), (-30, -6.0), (-20, 0)]
    frames = drive(frame, car, *points)
    steps = [np.hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(points)]
    verdict = outside(frames, roads)
    assert verdict.value == pytest.approx(steps[2] / sum(steps))
    assert (verdict.passed, verdict.first_violation) == (False, 3.0)
    assert outside(frames, roads, margin=0.8).passed
    assert outside(frames, roads, margin=0).value == pytest.approx((steps[1] + steps[2]) / sum(steps))
    assert outside(frames, roads, at_most=0.3).passed


@pytest.mark.parametrize("heading", [0.0, math.pi / 8.0, 1.0, 2.0, 4.0])
@pytest.mark.parametrize(("margin", "passed"), [(0.0, False), (0.89, False), (0.9, True), (3.0, True), (10.0, True)])
def test_margin_of_the_lanes_in_any_direction(
    frame: Any, car: Any, heading: float, margin: float, passed: bool
) -> None:
    """The center is 0.9 m beside the only lane, of 2.5 m."""
    roads = RoadNetwork.parse(map_xml(road_xml(hdg=heading, lanes=section_xml(right=lane_xml(-1, 2.5)))))
    poses = [roads.road_pose_at("1", 10.0 + 10.0 * second, -3.4) for second in range(6)]
    frames = [frame(float(n), {"Ego": car(pose.x, pose.y, pose.h, 10.0)}) for n, pose in enumerate(poses)]
    assert outside(frames, roads, margin=margin).passed is passed


def test_lane_of_the_opposite_direction_is_outside(frame: Any, car: Any, roads: Any) -> None:
    frames = drive(frame, car, (-60, 0), (-40, 3.5), (-20, 3.5))
    assert outside(frames, roads).value == pytest.approx(1.0)
    verdict = outside(frames, roads, wrong_lanes=False)
    assert (verdict.passed, verdict.value) == (True, 0.0)
    stands = drive(frame, car, (-40, 3.5), (-40, 3.5), speed=0.0)
    assert outside(stands, roads).value == 0.0


def chase(frame: Any, car: Any, until: int, ego: float = 10.0) -> list[Any]:
    """Return one frame per second: an emergency vehicle at 20 m/s in the left lane starts 60 m behind the Ego."""
    return [
        frame(float(t), {"Ego": car(ego * t, speed=ego), "EV": car(20.0 * t - 60.0, 3.5, speed=20.0)})
        for t in range(until + 1)
    ]


def test_time_until_the_emergency_vehicle_is_past(frame: Any, car: Any) -> None:
    """The gap is 56 m - 10 m/s t: 46 m after 1 s. After 7 s the emergency vehicle is 10 m ahead."""
    verdict = yields(chase(frame, car, 9))
    assert (verdict.passed, verdict.value) == (True, 6.0)
    verdict = yields(chase(frame, car, 9), at_most=5.5, fatal=True)
    assert (verdict.passed, verdict.first_violation, verdict.fatal) == (False, 7.0, True)
    assert yields(chase(frame, car, 9), within=30).value == 4.0


def test_emergency_vehicle_that_stays_behind_fails(frame: Any, car: Any) -> None:
    verdict = yields(chase(frame, car, 4))
    assert (verdict.passed, verdict.value) == (False, 3.0)
    assert "still behind" in verdict.reason
    assert yields(chase(frame, car, 9, ego=30.0)).value is None, "it falls behind"
    oncoming = [frame(float(t), {"Ego": car(10 * t, speed=10), "EV": car(90 - 20 * t, 3.5, np.pi, 20)}) for t in (0, 1)]
    verdict = yields(oncoming)
    assert (verdict.passed, verdict.value) == (True, None)


def test_emergency_vehicle_that_is_removed_or_falls_back_is_not_past(frame: Any, car: Any) -> None:
    """From 1 s to 3 s the EV is behind, 26 m at the end. Then it is removed, or falls back by 20 m/s to 266 m."""
    removed = [*chase(frame, car, 3), *(frame(t, {"Ego": car(10.0 * t, speed=10.0)}) for t in (4.0, 5.0))]
    verdict = yields(removed, at_most=3.0)
    assert (verdict.passed, verdict.value, verdict.first_violation) == (False, 2.0, None)
    assert "still behind" in verdict.reason
    assert "removed" in verdict.reason
    ego = {t: 30.0 + 30.0 * (t - 3.0) for t in range(4, 16)}
    back = [
        frame(float(t), {"Ego": car(x, speed=30.0), "EV": car(10.0 * (t - 3.0), 3.5, speed=10.0)})
        for t, x in ego.items()
    ]
    verdict = yields([*chase(frame, car, 3), *back])
    assert not verdict.passed
    assert "still behind" in verdict.reason


def turn(roads: Any, route: str) -> list[tuple[float, float, float]]:
    """Return poses each meter along road 1 from x = -30 m on, a road of the junction and 40 m straight on."""
    poses = [(float(x), 0.0, 0.0) for x in range(-30, 20)]
    for s in range(int(roads.roads[route].length)):
        pose = roads.lane_pose_at(route, -1, float(s))
        poses.append((pose.x, pose.y, pose.h))
    x, y, h = poses[-1]
    return [*poses, *((x + s * np.cos(h), y + s * np.sin(h), h) for s in range(1, 41))]


@pytest.mark.parametrize("gap", [10, 30])
@pytest.mark.parametrize(("way", "other_way"), [("101", "101"), ("102", "102"), ("103", "103"), ("101", "103")])
def test_emergency_vehicle_follows_through_a_junction(
    frame: Any, car: Any, roads: Any, gap: int, way: str, other_way: str
) -> None:
    """Both drive 1 m per frame of 0.1 s, the EV `gap` and 4 m behind. It is still behind at the end or turns off."""
    ego, other = turn(roads, way), turn(roads, other_way)
    count = min(len(ego), len(other)) - gap - 4
    frames = [frame(0.1 * n, {"Ego": car(*ego[n + gap + 4], 10.0), "EV": car(*other[n], 10.0)}) for n in range(count)]
    verdict = yields(frames, roads)
    assert verdict.passed is (way != other_way)
    if way == other_way:
        assert verdict.value == pytest.approx(0.1 * (count - 1))
    else:
        assert "took another way" in verdict.reason


def test_emergency_vehicle_in_the_other_lane_counts_from_the_distance(frame: Any, car: Any, roads: Any) -> None:
    """From x = -70 m at 10 m/s the EV is 48 m behind the body at 0.2 s, and past the standing Ego at -16 m at 5.5 s."""
    frames = [frame(0.1 * n, {"Ego": car(-16.0, 0.0), "EV": car(-70.0 + n, 3.5, speed=10.0)}) for n in range(70)]
    verdict = yields(frames, roads, within=48.0)
    assert verdict.passed
    assert verdict.value == pytest.approx(5.3)


def test_missing_actors_fail(frame: Any, car: Any, roads: Any) -> None:
    others = [frame(0.0, {"Other": car(0)})]
    for verdict in (in_route(others), completion(others), outside(others, roads), yields(others)):
        assert (verdict.passed, verdict.value) == (False, None)
        assert "never present" in verdict.reason
    with pytest.raises(ValidationError, match="equal"):
        YieldToEmergencyVehicleSettings(of="Ego", to="Ego")


ROUTE = """<PrivateAction><RoutingAction><AcquirePositionAction><Position>
<WorldPosition x="{x}" y="0"/></Position></AcquirePositionAction></RoutingAction></PrivateAction></Private>"""


@pytest.mark.parametrize("drive", [None, "Ego"], ids=["scripted", "driven"])
@pytest.mark.parametrize(("x", "passed"), [(-35.0, True), (-10.0, False)])
def test_route_of_the_scenario(tmp_path: Path, drive: str | None, x: float, passed: bool) -> None:
    """In 4 s the Ego drives 40 m from -70 m. The recording contains the route, so that it gives the same verdict."""
    path = write_scenario(tmp_path, "route_completion: {of: Ego, at_least: 0.9}", {"Ego": (-70.0, 0.0, 0.0, 10.0)})
    text = path.read_text(encoding="utf-8").replace(
        "</PrivateAction></Private>", "</PrivateAction>" + ROUTE.format(x=x)
    )
    path.write_text(text, encoding="utf-8")
    recorder = Recorder(tmp_path / "recording.mcap", metadata={})
    settings = RunSettings(drive=drive, planner="route" if drive else None)
    (verdict,) = run_file(path, settings=settings, observers=[recorder]).criteria
    assert verdict.passed == passed
    criterion = RouteCompletion(RouteCompletionSettings(of="Ego", at_least=0.9))
    recorded = judge(criterion, list(read_recording(tmp_path / "recording.mcap").frames()))
    assert recorded == verdict

"""Criteria on stop lines, on road 1 of scenario 1: a stop sign with its line at x = 15.6 m; boxes 4 m by 2 m."""

import math
from collections.abc import Iterable, Sequence
from copy import deepcopy
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from eidrive_criteria.running_red_light import RunningRedLight, RunningRedLightSettings
from eidrive_criteria.running_stop_sign import RunningStopSign, RunningStopSignSettings
from lxml import etree
from msgspec.structs import replace

from eidrive_scenario.api.common import RoadNetwork, SettingError
from eidrive_scenario.api.criteria import Criterion, Frame, Verdict, evaluate_criteria

ROAD = Path(__file__).parents[2] / "xosc" / "roads" / "coop_1.xodr"
LINE = 15.6


def judge(criterion: Criterion, frames: list[Frame], roads: RoadNetwork) -> Verdict:
    (verdict,) = evaluate_criteria(frames, [criterion], roads)
    return verdict


def light(**settings: Any) -> RunningRedLight:
    return RunningRedLight(RunningRedLightSettings(of="Ego", **settings))


def sign(**settings: Any) -> RunningStopSign:
    return RunningStopSign(RunningStopSignSettings(of="Ego", **settings))


def lights(*connecting: str) -> RoadNetwork:
    """Return the roads with a traffic light `10` instead of the stop sign, or with `10`, `11`, … on connections."""
    root = etree.parse(ROAD).getroot()
    signal = next(element for element in root.iter("signal") if element.get("id") == "10")
    signal.set("dynamic", "yes")
    signal.set("type", "1000001")
    for number, road in enumerate(connecting, 10):
        target = next(element for element in root.iter("road") if element.get("id") == road)
        signal.set("s", "1.0")
        signal.set("id", str(number))
        for old in target.findall("signals"):
            target.remove(old)
        etree.SubElement(target, "signals").append(signal)
        signal = deepcopy(signal)
    return RoadNetwork.parse(etree.tostring(root))


def driving(frame: Any, car: Any, states: list[str], y: float = 0.0, start: float = 5.0) -> list[Frame]:
    """Return frames each 0.2 s, 2 m apart, with a state of light 10 in each; the front is 2 m ahead of the center."""
    return [
        frame(0.2 * n, {"Ego": car(start + 2.0 * n, y, speed=10.0)}, signals={"10": state} if state else {})
        for n, state in enumerate(states)
    ]


@pytest.mark.parametrize(
    ("states", "part", "time"),
    [
        (["red"] * 12, "front", 1.0),  # the front is at 15 m after 0.8 s and at 17 m after 1.0 s
        (["red"] * 12, "rear", 1.4),  # the rear is at 15 m after 1.2 s
        (["green"] * 12, "front", None),
        (["yellow"] * 12, "front", None),
        ([""] * 12, "front", None),
        (["green"] * 5 + ["red"] * 7, "front", None),  # changes at 1.0 s, behind the line
        (["green"] * 5 + ["red"] * 7, "rear", 1.4),
        (["red"] * 4 + ["green"] * 8, "front", None),  # changes before the line
        (["on;off;off"] * 12, "front", 1.0),
        (["red"] * 5, "front", None),  # ends before the line
    ],
)
def test_red_light_is_judged_at_the_stop_line(
    frame: Any, car: Any, states: list[str], part: str, time: float | None
) -> None:
    criterion = light(part=part)
    verdict = judge(criterion, driving(frame, car, states), lights())
    assert (verdict.passed, verdict.value) == (time is None, float(time is not None))
    assert verdict.first_violation == (None if time is None else pytest.approx(time))
    assert criterion.metrics()["running_red_light.count"] == float(time is not None)


@pytest.mark.parametrize("after", [1.0, 29.0, 35.9])
def test_red_light_is_judged_in_steps_longer_than_the_searched_area(frame: Any, car: Any, after: float) -> None:
    """Steps of 36 m; in the third frame the front, 2 m ahead of the center, is at a distance after the line."""
    positions = enumerate(LINE + after - 2.0 + 36.0 * step for step in (-2, -1, 0, 1))
    frames = [frame(float(n), {"Ego": car(x, speed=36.0)}, signals={"10": "red"}) for n, x in positions]
    verdict = judge(light(), frames, lights())
    assert (verdict.passed, verdict.value, verdict.first_violation) == (False, 1.0, 2.0)


@pytest.mark.parametrize("y", [3.5, -3.5], ids=["oncoming lane", "parking lane"])
def test_red_light_of_another_lane_is_no_violation(frame: Any, car: Any, y: float) -> None:
    assert judge(light(), driving(frame, car, ["red"] * 12, y=y), lights()).passed


def test_red_light_against_the_direction_and_teleport_are_no_violations(frame: Any, car: Any) -> None:
    back = [frame(0.2 * n, {"Ego": car(25.0 - 2 * n, 0.0, math.pi, 10.0)}, signals={"10": "red"}) for n in range(12)]
    assert judge(light(), back, lights()).passed
    jump = [frame(0.05 * n, {"Ego": car(x, speed=1.0)}, signals={"10": "red"}) for n, x in enumerate([5, 18, 18.1])]
    assert judge(light(), jump, lights()).passed


@pytest.mark.parametrize(("route", "passed"), [("101", False), ("103", True)], ids=["straight", "left"])
def test_light_on_a_connecting_road_is_valid_for_its_route(frame: Any, car: Any, route: str, passed: bool) -> None:
    """Both routes begin at the same stop line at x = 20 m; the light is on road 101."""
    roads = lights("101")
    poses = [(10.0 + s, 0.0, 0.0) for s in range(10)]
    for s in range(0, int(roads.roads[route].length)):
        pose = roads.lane_pose_at(route, -1, float(s))
        poses.append((pose.x, pose.y, pose.h))
    frames = [frame(0.1 * n, {"Ego": car(*pose, 10.0)}, signals={"10": "red"}) for n, pose in enumerate(poses)]
    verdict = judge(light(), frames, roads)
    assert (verdict.passed, verdict.value) == (passed, 0.0 if passed else 1.0)
    if not passed:
        assert verdict.first_violation == pytest.approx(0.9), "the front is at the line when the center is at 18 m"


def test_red_light_counts_for_a_route_that_is_certain_minutes_later(frame: Any, car: Any) -> None:
    """The actor crosses the line of the light on road 101 at red, and waits in the junction while it changes."""
    roads = lights("101")
    straight = [roads.lane_pose_at("101", -1, float(s)) for s in range(int(roads.roads["101"].length))]
    poses = [(10.0 + s, 0.0, 0.0) for s in range(11)]
    frames = [frame(0.1 * n, {"Ego": car(*pose, 10.0)}, signals={"10": "red"}) for n, pose in enumerate(poses)]
    for n in range(200):
        frames.append(frame(2.0 + n, {"Ego": car(*poses[-1])}, signals={"10": ("green", "red")[n // 20 % 2]}))
    for n, pose in enumerate(straight[1:]):
        frames.append(frame(202.0 + 0.1 * n, {"Ego": car(pose.x, pose.y, pose.h, 10.0)}, signals={"10": "green"}))
    verdict = judge(light(), frames, roads)
    assert (verdict.passed, verdict.value) == (False, 1.0)
    assert verdict.first_violation == pytest.approx(0.9), "the front is at the line when the center is at 18 m"


def entering(frame: Any, car: Any, places: Iterable[float], states: Sequence[str], route: str = "") -> list[Frame]:
    """Return frames each 0.1 s with the center at places x [m] of lane y = 0; the lights `10`, `11`, … have `states`.

    The stop line of lights on the roads 101 (straight), 102 (right) and 103 (left) is at x = 20 m.

    route  connecting road of the route that is requested in the first frame; empty for none
    """
    signals = dict(zip(("10", "11", "12"), states, strict=False))
    frames = [frame(0.1 * n, {"Ego": car(x, 0.0, speed=10.0)}, signals=signals) for n, x in enumerate(places)]
    if route:
        network = lights()
        start, end = network.location("1", -1, 50.0), network.location(route, -1, network.roads[route].length)
        frames[0] = replace(frames[0], routes={"Ego": network.route(start, end).polyline(2.0)})
    return frames


@pytest.mark.parametrize(
    ("states", "route", "is_violation"),
    [
        (["red"], "101", True),
        (["red"], "103", False),
        (["red"], "", False),  # 102 and 103 have no light
        (["red", "red"], "", False),  # 103 has none
        (["red", "red", "red"], "", True),
        (["red", "red", "red"], "102", True),
        (["red", "green", "red"], "", False),
        (["red", "green", "red"], "101", True),
        (["red", "green", "red"], "102", False),
        (["green", "red", "green"], "102", True),  # an arrow for the right turn only
        (["red", "off", "red"], "", False),
        (["red", "yellow", "red"], "", False),
        (["red", "flashing;off;off", "red"], "", True),
    ],
)
def test_red_light_at_the_line_depends_on_route_or_all_ways(
    frame: Any, car: Any, states: list[str], route: str, is_violation: bool
) -> None:
    """The front passes the line at 20 m after 0.8 s, when the center is at 18 m, and stays 2 m behind it."""
    roads = lights(*("101", "102", "103")[: len(states)])
    criterion = light()
    verdict = judge(criterion, entering(frame, car, [10.0 + n for n in range(11)], states, route), roads)
    assert (verdict.passed, verdict.value) == (not is_violation, float(is_violation))
    assert verdict.first_violation == (pytest.approx(0.9) if is_violation else None)
    assert criterion.metrics()["running_red_light.passed"] == float(is_violation), "other crossings are undecided"


@pytest.mark.parametrize(("part", "time"), [("front", 0.9), ("rear", 1.3)])
@pytest.mark.parametrize("route", ["", "101"])
def test_red_light_at_the_line_counts_each_crossing_once(
    frame: Any, car: Any, route: str, part: str, time: float
) -> None:
    """The actor enters, reverses to 10 m, and drives 40 m: past the middle of road 101 at 37.25 m."""
    places = [float(x) for x in (*range(10, 25), *range(23, 9, -1), *range(11, 51))]
    roads, states = lights("101", "102", "103"), ["red", "red", "red"]
    criterion = light(part=part)
    verdict = judge(criterion, entering(frame, car, places, states, route), roads)
    assert (verdict.passed, verdict.value) == (False, 2.0)
    assert verdict.first_violation == pytest.approx(time)
    assert criterion.metrics()["running_red_light.passed"] == 2.0
    assert judge(light(part=part), entering(frame, car, places[:15], states, route), roads).value == 1.0


def test_crossing_at_red_left_backwards_is_undecided(frame: Any, car: Any) -> None:
    """The first crossing is at red, 102 and 103 have no light; the second, 6 m later, is at green."""
    places = [float(x) for x in (*range(10, 21), *range(19, 14, -1), *range(16, 51))]
    frames = entering(frame, car, places, ["red"])
    frames[15:] = [replace(each, signals={"10": "green"}) for each in frames[15:]]
    verdict = judge(light(), frames, lights("101"))
    assert (verdict.passed, verdict.value) == (True, 0.0)
    assert verdict.reason == "Ego passed 1 stop lines, all legally"


@pytest.mark.parametrize("route", ["", "101"])
@pytest.mark.parametrize("places", [[25.0 + n for n in range(20)], [10.0, 21.0, 21.1]], ids=["inside", "teleport"])
def test_red_light_without_a_crossing_of_the_line(frame: Any, car: Any, places: list[float], route: str) -> None:
    frames = entering(frame, car, places, ["red", "red", "red"], route)
    frames = [replace(each, view=replace(each.view, speed=np.array([1.0]))) for each in frames]
    assert judge(light(), frames, lights("101", "102", "103")).value == 0.0


def test_red_light_while_the_front_is_over_the_line_is_no_violation(frame: Any, car: Any) -> None:
    """The front is over the line from 0.9 s on; the lights turn red in this frame."""
    frames = entering(frame, car, [10.0 + n for n in range(11)], ["green", "green", "green"], "101")
    red = dict.fromkeys(("10", "11", "12"), "red")
    for first, value in ((9, 0.0), (8, 1.0)):
        changed = [*frames[:first], *(replace(each, signals=red) for each in frames[first:])]
        assert judge(light(), changed, lights("101", "102", "103")).value == value


def test_route_counts_once_for_a_connecting_road(frame: Any, car: Any) -> None:
    """The route over 101 is driven at green; after a loop beside the road, the second entry at red is left open."""
    corners = [(10, 0), (60, 0), (60, 60), (10, 60), (10, 0), (22, 0)]
    loop = [corners[0]]
    for (x0, y0), (x1, y1) in pairwise(corners):
        steps = abs(x1 - x0) + abs(y1 - y0)
        loop += [(x0 + (x1 - x0) * n // steps, y0 + (y1 - y0) * n // steps) for n in range(1, steps + 1)]
    frames = entering(frame, car, [float(x) for x, _ in loop], ["green"], "101")
    for n, (x, y) in enumerate(loop):
        state = {"10": "green" if n < 100 else "red"}
        frames[n] = replace(frame(0.1 * n, {"Ego": car(x, y, speed=10.0)}, signals=state), routes=frames[n].routes)
    assert judge(light(), frames, lights("101")).value == 0.0
    again = replace(frames[100], routes=frames[0].routes)
    verdict = judge(light(), [*frames[:100], again, *frames[101:]], lights("101"))
    assert verdict.value == 1.0
    assert verdict.first_violation == pytest.approx(0.1 * (50 + 60 + 50 + 60 + 9))


def approach(frame: Any, car: Any, stop: float | None, ticks: int = 1, speed: float = 0.0) -> list[Frame]:
    """Return frames with the center from x = 0 to 24 m in steps of 2 m; with a stop of `ticks` s at `stop`."""
    places = [(2.0 * n, 10.0) for n in range(13)]
    if stop is not None:
        index = sum(x < stop for x, _ in places)
        places[index:index] = [(stop, speed)] * (ticks + 1)
    return [frame(float(n), {"Ego": car(x, 0.0, 0.0, v)}) for n, (x, v) in enumerate(places)]


@pytest.mark.parametrize(
    ("stop", "settings", "passed"),
    [
        (None, {}, False),
        (13.0, {}, True),  # front 0.6 m before the line
        (13.6, {}, True),  # on the line
        (13.61, {}, False),  # 0.01 m behind it
        (9.7, {}, True),  # 3.9 m
        (9.6, {}, True),  # 4 m
        (9.5, {}, False),  # 4.1 m
        (9.5, {"within": 5.0}, True),
        (14.0, {}, False),  # 0.4 m behind the line
        (13.0, {"duration": 2.0}, True),
        (13.0, {"duration": 3.0}, False),
    ],
)
def test_stop_sign_requires_a_stop_before_the_line(
    frame: Any, car: Any, roads: RoadNetwork, stop: float | None, settings: dict[str, Any], passed: bool
) -> None:
    verdict = judge(sign(**settings), approach(frame, car, stop, ticks=2), roads)
    assert (verdict.passed, verdict.value) == (passed, 0.0 if passed else 1.0)
    assert ("all legally" if passed else "did not stop at the stop sign 10") in verdict.reason


@pytest.mark.parametrize(("speed", "passed"), [(0.05, True), (0.2, False)])
def test_stop_sign_speed_of_a_stop(frame: Any, car: Any, roads: RoadNetwork, speed: float, passed: bool) -> None:
    assert judge(sign(), approach(frame, car, 13.0, speed=speed), roads).passed is passed


def test_stop_sign_below_a_bridge_is_not_passed_on_it(frame: Any, car: Any, roads: RoadNetwork) -> None:
    frames = approach(frame, car, None)
    above = [
        replace(each, view=replace(each.view, position=each.view.position + np.array([0.0, 0.0, 6.0])))
        for each in frames
    ]
    verdict = judge(sign(), above, roads)
    assert (verdict.passed, verdict.value) == (True, 0.0)


def test_stop_sign_requires_a_stop_in_each_lap(frame: Any, car: Any, roads: RoadNetwork) -> None:
    laps = [approach(frame, car, 13.0), approach(frame, car, None)]
    places = [(*each.view.position[0, :2], 0.0, each.view.speed[0]) for lap in laps for each in lap]
    frames = [frame(float(n), {"Ego": car(*place)}) for n, place in enumerate(places)]
    verdict = judge(sign(), frames, roads)
    assert (verdict.passed, verdict.value) == (False, 1.0)


@pytest.mark.parametrize("criterion", [light, sign])
def test_absent_actor_one_frame_and_missing_signals(frame: Any, car: Any, roads: RoadNetwork, criterion: Any) -> None:
    absent = judge(criterion(), [frame(0.0, {"Bus": car(0)})], roads)
    assert (absent.passed, absent.value, absent.reason) == (
        False,
        None,
        "Ego was never present, so nothing was measured",
    )
    assert judge(criterion(), [frame(0.0, {"Ego": car(14.0, speed=5.0)})], roads).passed
    with pytest.raises(SettingError, match="requires roads"):
        evaluate_criteria([], [criterion()])


def test_map_without_lights_passes(frame: Any, car: Any, roads: RoadNetwork) -> None:
    verdict = judge(light(), driving(frame, car, ["red"] * 12), roads)
    assert (verdict.passed, verdict.reason) == (True, "the map has no traffic light")

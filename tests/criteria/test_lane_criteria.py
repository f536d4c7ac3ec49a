"""Criteria on lanes, on road 1 of scenario 1 (see the fixture `roads`); boxes 4 m by 2 m."""

import math
from typing import Any

import pytest
from eidrive_criteria.end_of_road import EndOfRoad, EndOfRoadSettings
from eidrive_criteria.keep_lane import KeepLane, KeepLaneSettings
from eidrive_criteria.off_road import OffRoad, OffRoadSettings
from eidrive_criteria.on_sidewalk import OnSidewalk, OnSidewalkSettings
from eidrive_criteria.outside_route_lanes import OutsideRouteLanes, OutsideRouteLanesSettings
from eidrive_criteria.wrong_lane import WrongLane, WrongLaneSettings
from opendrive_xml import lane_xml, map_xml, predecessor_xml, road_xml, section_xml, successor_xml

from eidrive_scenario.api.common import RoadNetwork, SettingError
from eidrive_scenario.api.criteria import Criterion, Verdict, evaluate_criteria

STRAIGHT = """<road id="{id}" length="{length}" junction="-1"><link>{link}</link><planView>
<geometry s="0" x="{x}" y="1.75" hdg="0" length="{length}"><line/></geometry></planView><lanes><laneSection s="0">
<center><lane id="0" type="none"/></center><right><lane id="-1" type="driving"><link><predecessor id="-1"/>
<successor id="-1"/></link><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road>"""

ALL = [
    OffRoad(OffRoadSettings(of="Ego")),
    OnSidewalk(OnSidewalkSettings(of="Ego")),
    WrongLane(WrongLaneSettings(of="Ego")),
    KeepLane(KeepLaneSettings(of="Ego")),
    EndOfRoad(EndOfRoadSettings(of="Ego")),
]


def judge(criterion: Criterion, frames: list[Any], roads: RoadNetwork) -> Verdict:
    (verdict,) = evaluate_criteria(frames, [criterion], roads)
    return verdict


def chain(*lengths: float) -> RoadNetwork:
    """Return straight roads one after another from x = 0 on, with one lane at y = 0."""
    roads = [
        STRAIGHT.format(
            id=number,
            length=length,
            x=sum(lengths[:number]),
            link=(f'<predecessor elementType="road" elementId="{number - 1}" contactPoint="end"/>' if number else "")
            + (
                f'<successor elementType="road" elementId="{number + 1}" contactPoint="start"/>'
                if number + 1 < len(lengths)
                else ""
            ),
        )
        for number, length in enumerate(lengths)
    ]
    text = f'<OpenDRIVE><header revMajor="1" revMinor="6"/>{"".join(roads)}</OpenDRIVE>'
    return RoadNetwork.parse(text.encode())


def along(frame: Any, car: Any, *ys: float, x: float = -60.0, speed: float = 5.0, yaw: float = 0.0) -> list[Any]:
    """Return frames each 0.5 s with the center of the Ego at these y, while it drives along its heading."""
    step = speed * 0.5 * math.cos(yaw)
    return [frame(0.5 * n, {"Ego": car(x + n * step, y, yaw, speed)}) for n, y in enumerate(ys)]


@pytest.mark.parametrize(
    ("ys", "value"),
    [
        ((0.0, -3.5, -5.2), 0.0),
        ((0.0, -2.0, -4.0, -5.5, -5.5, -3.0), 1.0),
        ((0.0, 2.0, 3.5), 0.0),
        ((-7.0, -7.0, -7.0), 1.0),
    ],
)
def test_off_road_time(frame: Any, car: Any, roads: RoadNetwork, ys: tuple[float, ...], value: float) -> None:
    frames = along(frame, car, *ys)
    verdict = judge(OffRoad(OffRoadSettings(of="Ego")), frames, roads)
    assert verdict.passed is (value == 0.0)
    assert verdict.value == pytest.approx(value)
    assert judge(OffRoad(OffRoadSettings(of="Ego", at_most=1.0)), frames, roads).passed


def test_center_beyond_the_end_of_the_road_is_on_no_lane(frame: Any, car: Any, roads: RoadNetwork) -> None:
    """The road ends at x = -80 m, the center is at -84.5, -82, -79.5 and -77 m in the lane of the oncoming traffic."""
    frames = along(frame, car, 3.5, 3.5, 3.5, 3.5, x=-84.5)
    verdict = judge(OffRoad(OffRoadSettings(of="Ego")), frames, roads)
    assert (verdict.passed, verdict.value, verdict.first_violation) == (False, 0.5, 0.0)
    assert judge(WrongLane(WrongLaneSettings(of="Ego")), frames, roads).value == pytest.approx(5.0)
    assert judge(KeepLane(KeepLaneSettings(of="Ego")), frames, roads).value == 0.0


@pytest.mark.parametrize(
    ("ys", "value"),
    [
        ((0.0, -3.0, -5.0), 0.0),
        ((-3.0, -5.0, -7.0, -7.0, -5.0), 1.0),
        ((-3.0, -4.5, -5.5, -5.5), 1.0),  # the right corners at -6.5 m
    ],
)
def test_on_sidewalk_time(frame: Any, car: Any, roads: RoadNetwork, ys: tuple[float, ...], value: float) -> None:
    verdict = judge(OnSidewalk(OnSidewalkSettings(of="Ego")), along(frame, car, *ys), roads)
    assert verdict.passed is (value == 0.0)
    assert verdict.value == pytest.approx(value)


@pytest.mark.parametrize("criterion", [OffRoad(OffRoadSettings(of="Ego")), OnSidewalk(OnSidewalkSettings(of="Ego"))])
def test_single_frame_in_the_state_fails(frame: Any, car: Any, roads: RoadNetwork, criterion: Criterion) -> None:
    verdict = judge(criterion, along(frame, car, -7.0), roads)
    assert (verdict.passed, verdict.value, verdict.first_violation) == (False, 0.0, 0.0)


def test_wrong_lane_distance(frame: Any, car: Any, roads: RoadNetwork) -> None:
    """2.5 m per frame; three of them in the lane of the oncoming traffic."""
    frames = along(frame, car, 0.0, 1.5, 3.5, 3.5, 3.5, 0.0)
    verdict = judge(WrongLane(WrongLaneSettings(of="Ego")), frames, roads)
    assert (verdict.passed, verdict.first_violation) == (False, 1.0)
    assert verdict.value == pytest.approx(math.hypot(2.5, 2.0) + 5.0)
    assert judge(WrongLane(WrongLaneSettings(of="Ego", at_most=9.0)), frames, roads).passed


@pytest.mark.parametrize("step", [0.01, 0.05, 0.5])
@pytest.mark.parametrize(("speed", "distance"), [(0.01, 0.0), (0.03, 0.3), (0.3, 3.0), (1.0, 10.0)])
def test_distance_against_the_lane_does_not_depend_on_the_step(
    frame: Any, car: Any, roads: RoadNetwork, step: float, speed: float, distance: float
) -> None:
    """10 s in the left lane; up to 0.02 m/s the Ego stands."""
    frames = [
        frame(step * n, {"Ego": car(-60.0 + speed * step * n, 3.5, speed=speed)}) for n in range(round(10 / step) + 1)
    ]
    assert judge(WrongLane(WrongLaneSettings(of="Ego")), frames, roads).value == pytest.approx(distance)
    outside = OutsideRouteLanes(OutsideRouteLanesSettings(of="Ego"))
    assert judge(outside, frames, roads).value == float(distance > 0.0)
    assert outside.metrics()["outside_route_lanes.Ego.driven"] == pytest.approx(distance)


def test_wrong_lane_excludes_the_right_direction_reversing_and_junctions(
    frame: Any, car: Any, roads: RoadNetwork
) -> None:
    against = along(frame, car, 3.5, 3.5, 3.5, x=0.0, yaw=math.pi)
    reversing = along(frame, car, 0.0, 0.0, 0.0, x=0.0, speed=-5.0)
    junction = along(frame, car, 0.0, 0.0, 0.0, x=36.0, yaw=math.pi)
    for frames in (against, reversing, junction):
        verdict = judge(WrongLane(WrongLaneSettings(of="Ego")), frames, roads)
        assert (verdict.passed, verdict.value) == (True, 0.0)


@pytest.mark.parametrize(
    ("ys", "value"), [((0.0, 1.0, 2.5, 3.5, 1.0), 2.0), ((0.0, 1.5, -1.5), 0.0), ((0.0, -3.0), 1.0)]
)
def test_keep_lane_counts_crossings(
    frame: Any, car: Any, roads: RoadNetwork, ys: tuple[float, ...], value: float
) -> None:
    frames = along(frame, car, *ys)
    verdict = judge(KeepLane(KeepLaneSettings(of="Ego")), frames, roads)
    assert (verdict.passed, verdict.value) == (value == 0.0, value)
    assert judge(KeepLane(KeepLaneSettings(of="Ego", at_most=2)), frames, roads).passed


def test_keep_lane_excludes_junctions_and_teleports(frame: Any, car: Any, roads: RoadNetwork) -> None:
    straight = along(frame, car, *[0.0] * 60, x=-70.0)
    assert judge(KeepLane(KeepLaneSettings(of="Ego")), straight, roads).value == 0.0
    jump = [*along(frame, car, 0.0, 0.0), frame(1.0, {"Ego": car(0, 3.5, math.pi, 5.0)})]
    assert judge(KeepLane(KeepLaneSettings(of="Ego")), jump, roads).value == 0.0


def test_keep_lane_across_a_road_shorter_than_a_step(frame: Any, car: Any) -> None:
    """Steps of 2.5 m from 9 m to 11.5 m pass the road from 10 m to 11 m."""
    frames = along(frame, car, *[0.0] * 5, x=4.0)
    assert judge(KeepLane(KeepLaneSettings(of="Ego")), frames, chain(10.0, 1.0, 10.0)).value == 0.0


@pytest.mark.parametrize("last", [0.5, 1.5, 2.5, 10.0])
@pytest.mark.parametrize(("before", "value"), [(0.0, 1.0), (1.0, 1.0), (1.01, 0.0)])
def test_end_of_road_with_the_center_on_an_earlier_road(
    frame: Any, car: Any, last: float, before: float, value: float
) -> None:
    """The front is 2 m ahead of the center, and `before` [m] the end of the last road."""
    frames = along(frame, car, 0.0, 0.0, 0.0, x=20.0 + last - 2.0 - before, speed=0.0)
    assert judge(EndOfRoad(EndOfRoadSettings(of="Ego")), frames, chain(20.0, last)).value == value


@pytest.mark.parametrize("radius", [14.75, 18.25, 21.75, 25.25])
@pytest.mark.parametrize("length", [0.5, 40.0])
@pytest.mark.parametrize(("before", "value"), [(1.0, 1.0), (1.01, 0.0)])
def test_end_of_road_in_a_curve_is_measured_along_the_lane(
    frame: Any, car: Any, radius: float, length: float, before: float, value: float
) -> None:
    """Lanes around a reference line with a radius of 20 m, of 40 m and a last road; the front is at 2 m of the lane."""
    lanes = section_xml(
        "".join(lane_xml(n, link=f'<predecessor id="{n}"/><successor id="{n}"/>') for n in (2, 1)),
        "".join(lane_xml(n, link=f'<predecessor id="{n}"/><successor id="{n}"/>') for n in (-1, -2)),
    )
    x, y, end = 20.0 * math.sin(2.0), 20.0 - 20.0 * math.cos(2.0), 2.0 + length / 20.0
    roads = RoadNetwork.parse(
        map_xml(
            road_xml("a", length=40.0, curvature=0.05, link=successor_xml("b"), lanes=lanes),
            road_xml("b", length=length, x=x, y=y, hdg=2.0, curvature=0.05, link=predecessor_xml("a"), lanes=lanes),
        )
    )
    for angle, yaw in ((end - (2.0 + before) / radius, 0.0), ((2.0 + before) / radius, math.pi)):
        at = car(radius * math.sin(angle), 20.0 - radius * math.cos(angle), angle + yaw)
        frames = [frame(0.5 * n, {"Ego": at}) for n in range(3)]
        assert judge(EndOfRoad(EndOfRoadSettings(of="Ego")), frames, roads).value == value


def test_end_of_road_across_the_lane_refers_to_the_front(frame: Any, car: Any) -> None:
    """At 60° to the lane the front is 1 m ahead of the center along it: 1.5 m before the end of the road."""
    frames = along(frame, car, 0.0, 0.0, 0.0, x=17.5, speed=0.0, yaw=math.pi / 3)
    assert judge(EndOfRoad(EndOfRoadSettings(of="Ego")), frames, chain(20.0)).value == 0.0


@pytest.mark.parametrize(
    ("x", "yaw", "value"),
    [
        (-77.5, math.pi, 1.0),  # front 0.5 m before the end
        (-76.0, math.pi, 0.0),  # front 2 m before it
        (-77.5, 0.0, 0.0),  # with its back to the end
        (17.5, 0.0, 0.0),  # before the junction
    ],
)
def test_end_of_road_time(frame: Any, car: Any, roads: RoadNetwork, x: float, yaw: float, value: float) -> None:
    y = 3.5 if yaw else 0.0
    frames = along(frame, car, y, y, y, x=x, speed=0.0, yaw=yaw)
    verdict = judge(EndOfRoad(EndOfRoadSettings(of="Ego")), frames, roads)
    assert verdict.passed is (value == 0.0)
    assert verdict.value == pytest.approx(value)
    assert judge(EndOfRoad(EndOfRoadSettings(of="Ego", at_most=2.0)), frames, roads).passed


@pytest.mark.parametrize("criterion", ALL, ids=lambda each: each.name)
def test_absent_actor_fails_and_missing_roads_are_an_error(
    frame: Any, car: Any, roads: RoadNetwork, criterion: Criterion
) -> None:
    verdict = judge(criterion, [frame(0.0, {"Bus": car(0)})], roads)
    assert (verdict.passed, verdict.value) == (False, None)
    assert verdict.reason == "Ego was never present, so nothing was measured"
    with pytest.raises(SettingError, match="requires roads"):
        evaluate_criteria([], [criterion])


@pytest.mark.parametrize("criterion_type", [type(each) for each in ALL], ids=lambda each: each.name)
def test_absence_and_one_frame_on_the_lane_pass(
    frame: Any, car: Any, roads: RoadNetwork, criterion_type: type[Criterion]
) -> None:
    criterion = criterion_type(criterion_type.settings_type.model_validate({"of": "Ego"}))
    frames = [*along(frame, car, 0.0), frame(0.5, {"Bus": car(0)}), frame(1.0, {"Ego": car(-60, 0.0, 0.0, 5.0)})]
    verdict = judge(criterion, frames, roads)
    assert (verdict.passed, verdict.value) == (True, 0.0)
    assert verdict.reason.startswith("Ego never ")

"""Lane changes that the route requires: where they are possible, and which gap the vehicle takes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml
from planned_drive import FRONT, LANE, KnownBox, PlannedDrive, behavior
from signal_street import CAR

from eidrive_scenario.base.coverage import ViewSector
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.driving.planning.behavior.lane_changes import route_lanes
from eidrive_scenario.driving.planning.behavior.merging import TimeGap, TrafficBehind
from eidrive_scenario.driving.planning.behavior.prediction import Predictor
from eidrive_scenario.driving.planning.behavior.proposals import Body
from eidrive_scenario.driving.planning.behavior.reference import ReferenceLine
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings, surroundings
from eidrive_scenario.driving.planning.path import PlannedPath
from eidrive_scenario.roads import RoadNetwork

WIDTH = 3.5
Traffic = Callable[[float], Sequence[KnownBox]]


def road(lanes: int, length: float = 700.0, end: float | None = None, rule: str = "RHT") -> RoadNetwork:
    """Return a straight road with a number of lanes in each direction; from `end` on it has one less."""
    sections = lanes_xml(lanes, lanes)
    if end is not None:
        sections += lanes_xml(lanes - 1, lanes - 1, s=end)
    return RoadNetwork.parse(map_xml(road_xml(length=length, lanes=sections, rule=rule)))


def line_to(roads: RoadNetwork, start: tuple[float, float], end: tuple[float, float]) -> ReferenceLine:
    """Return the reference line of the route between two points."""
    places = [roads.locate_at(*point) for point in (start, end)]
    assert places[0] is not None
    assert places[1] is not None
    return ReferenceLine(PlannedPath(roads.route(places[0], places[1]).polyline(1.0)[:, :2], ends=True), roads)


def column(y: float, speed: float, first: float, spacing: float, count: int) -> Traffic:
    """Return cars of one speed that do not respond to others, the first one at x = `first`."""
    return lambda now: [KnownBox(first - spacing * k + speed * now, y, vx=speed) for k in range(count)]


def drive(
    roads: RoadNetwork, start: float, end: tuple[float, float], traffic: Traffic, seconds: float, speed: float = 14.0
) -> PlannedDrive:
    """Drive from x = 20 m in the lane with its center at y = `start` to a point."""
    run = PlannedDrive(behavior(roads, speed), roads, speed=speed, y=start)
    run.run(seconds, traffic, goal=Goal(waypoints=np.array([[*end, 0.0]])))
    run.world.close()
    return run


def without_objects() -> Surroundings:
    """Return the surroundings of a vehicle at x = 0 on a straight line without objects."""
    line = ReferenceLine(PlannedPath(np.array([[0.0, 0.0], [100.0, 0.0]]), ends=False), None)
    prediction = Predictor(None, np.arange(0.0, 8.01, 0.25)).predict([])
    return surroundings([], prediction, line, (0, 100), BehaviorSettings(), (0.0, 0.0, 2.25, 0.9), None)


def clearance(run: PlannedDrive, traffic: Traffic) -> float:
    """Return the minimum distance from others along or across the road [m], negative after a contact."""
    gaps = []
    for tick, (x, y, _) in enumerate(run.path):
        for box in traffic(tick * 0.05):
            along = abs(x + CAR.offset[0] - box.x) - (CAR.size[0] + box.size[0]) / 2.0
            gaps.append(max(along, abs(y - box.y) - (CAR.size[1] + box.size[1]) / 2.0))
    return min(gaps)


def changed_at(run: PlannedDrive, y: float) -> tuple[float, float]:
    """Return time and x at which the vehicle is within 0.3 m of a lane center."""
    tick = next(tick for tick, (_, place, _) in enumerate(run.path) if abs(place - y) < 0.3)
    return tick * 0.05, run.path[tick][0]


class TestLanesOfARoute:
    def test_path_in_one_lane_has_none(self) -> None:
        assert route_lanes(line_to(road(2), (20.0, LANE), (600.0, LANE))) == []

    def test_change_is_possible_until_the_lane_ends(self) -> None:
        line = line_to(road(2, end=300.0), (20.0, LANE - WIDTH), (600.0, LANE))
        before, after = route_lanes(line)
        assert line.along[before.begin] < 10.0
        assert line.along[before.end] == pytest.approx(280.0, abs=2.0)
        # Both lanes at all points: the one before stays beside the path, the path stays in the one after.
        assert before.offsets[100:] == pytest.approx(-WIDTH, abs=0.01)
        assert after.offsets[0] == pytest.approx(WIDTH, abs=0.01)
        assert after.offsets[60:] == pytest.approx(0.0, abs=0.01)

    def test_change_over_two_lanes_has_two_route_lanes(self) -> None:
        line = line_to(road(3), (20.0, LANE), (600.0, LANE - 2.0 * WIDTH))
        first, second, last = route_lanes(line)
        middle = 200
        offsets = [lane.offsets[middle] for lane in (first, second, last)]
        assert offsets == pytest.approx([2.0 * WIDTH, WIDTH, 0.0], abs=0.01)
        assert first.end is not None
        assert second.end is not None
        assert second.end - first.end == pytest.approx(50, abs=1)

    @pytest.mark.parametrize("curvature", [0.005, -0.005])
    def test_lanes_of_a_curve_are_parallel(self, curvature: float) -> None:
        roads = RoadNetwork.parse(map_xml(road_xml(length=300.0, curvature=curvature, lanes=lanes_xml(1, 2))))
        start, end = (roads.lane_pose_at("1", lane, s) for lane, s in ((-2, 10.0), (-1, 290.0)))
        before, after = route_lanes(line_to(roads, (start.x, start.y), (end.x, end.y)))
        assert before.offsets[100:] == pytest.approx(-WIDTH, abs=0.05)
        assert after.offsets[100:] == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize(
    ("name", "start", "end"),
    [
        ("four_way_junction", (-20.0, 0.0), (43.8, 60.0)),
        ("t_junction", (29.8, 60.0), (-20.0, 4.0)),
        ("roundabout", (-20.0, 0.0), (52.3, -72.3)),
    ],
)
def test_lanes_in_junctions_are_independent_of_the_order_of_requests(
    name: str, start: tuple[float, float], end: tuple[float, float]
) -> None:
    roads = RoadNetwork.load(Path(__file__).parents[4] / "xosc" / "roads" / f"{name}.xodr")
    first, second = (line_to(roads, start, end) for _ in range(2))
    forwards = [first.lanes_beside(s) for s in first.along.tolist()]
    backwards = [second.lanes_beside(s) for s in second.along.tolist()[::-1]]
    assert [repr(lanes) for lanes in forwards] == [repr(lanes) for lanes in backwards[::-1]]


@pytest.mark.parametrize("speed", [5.0, 14.0, 30.0])
def test_free_lane_is_entered_at_once_without_slowing_down(speed: float) -> None:
    run = drive(road(2, 1000.0), LANE - WIDTH, (900.0, LANE), lambda now: [], 10.0, speed)
    assert changed_at(run, LANE)[0] < 7.0
    assert run.hardest_braking < 0.5
    assert min(run.speeds) > 0.95 * speed


def test_vehicle_without_space_to_change_drives_on_beside_its_destination() -> None:
    """The lane of the destination begins 12 m before it. No lane ends, so that there is nothing to wait for."""
    roads = RoadNetwork.parse(map_xml(road_xml(length=200.0, lanes=lanes_xml(1, 1) + lanes_xml(2, 2, s=60.0))))
    run = drive(roads, LANE, (72.0, LANE - WIDTH), lambda now: [], 25.0, 8.0)
    assert run.path[-1][0] == pytest.approx(72.0, abs=2.0)
    assert run.hardest_braking < 5.0


def test_vehicle_merges_into_a_column_before_its_lane_ends() -> None:
    """The gaps are of 1.9 s: the vehicle takes one of those beside it."""
    traffic = column(LANE, 14.0, 108.0, 32.0, 8)
    run = drive(road(2, end=310.0), LANE - WIDTH, (650.0, LANE), traffic, 30.0, 15.0)
    time, place = changed_at(run, LANE)
    assert place < 310.0
    assert clearance(run, traffic) > 1.0
    assert run.hardest_braking < 3.0
    behind = sum(box.x < place for box in traffic(time))
    assert behind >= sum(box.x < 20.0 for box in traffic(0.0)) - 1, "at most one car has passed"


def test_vehicle_falls_back_for_a_car_beside_it() -> None:
    traffic: Traffic = lambda now: [KnownBox(20.0 + 12.0 * now, LANE, vx=12.0)]  # noqa: E731
    run = drive(road(2), LANE - WIDTH, (600.0, LANE), traffic, 45.0, 12.0)
    assert changed_at(run, LANE)[1] < 500.0
    assert clearance(run, traffic) > 1.0
    assert run.hardest_braking < 3.5


def test_vehicle_adapts_its_speed_to_a_slow_column() -> None:
    """It needs 12 m of the 15.5 m between two cars."""
    traffic = column(LANE, 6.0, 300.0, 20.0, 14)
    run = drive(road(2), LANE - WIDTH, (500.0, LANE), traffic, 40.0)
    time, place = changed_at(run, LANE)
    assert place < 450.0
    assert run.speeds[round(time / 0.05)] == pytest.approx(6.0, abs=1.0)
    assert clearance(run, traffic) > 1.0
    assert run.hardest_braking < 3.5


def test_faster_car_from_behind_passes_first() -> None:
    traffic: Traffic = lambda now: [KnownBox(-60.0 + 25.0 * now, LANE, vx=25.0)]  # noqa: E731
    run = drive(road(2), LANE - WIDTH, (600.0, LANE), traffic, 20.0, 10.0)
    time, place = changed_at(run, LANE)
    assert traffic(time)[0].x > place
    assert run.hardest_braking < 1.0


def test_vehicle_without_a_gap_waits_at_the_end_of_its_lane() -> None:
    queue = [KnownBox(-50.0 + 8.0 * number, LANE) for number in range(60)]
    run = drive(road(2, end=250.0), LANE - WIDTH, (600.0, LANE), lambda now: queue if now < 50.0 else [], 80.0)
    standing = run.path[round(49.0 / 0.05)]
    assert standing[2] < 0.1
    assert 220.0 < standing[0] + FRONT < 250.0
    assert standing[1] == pytest.approx(LANE - WIDTH, abs=0.1)
    assert "wait for a gap before the end of the lane" in run.reasons
    assert run.path[-1][1] == pytest.approx(LANE, abs=0.2)
    assert run.hardest_braking < 3.5


def test_vehicle_changes_over_two_lanes_with_traffic() -> None:
    middle, right = LANE - WIDTH, LANE - 2.0 * WIDTH

    def traffic(now: float) -> list[KnownBox]:
        return [*column(middle, 12.0, 200.0, 35.0, 8)(now), *column(right, 11.0, 190.0, 35.0, 8)(now)]

    run = drive(road(3, 800.0), LANE, (700.0, right), traffic, 40.0)
    assert changed_at(run, right)[1] < 450.0
    assert clearance(run, traffic) > 0.9
    assert run.hardest_braking < 3.5


def test_vehicle_merges_with_traffic_on_the_left() -> None:
    traffic = column(-LANE, 14.0, 108.0, 32.0, 8)
    run = drive(road(2, end=310.0, rule="LHT"), WIDTH - LANE, (650.0, -LANE), traffic, 30.0, 15.0)
    assert changed_at(run, -LANE)[1] < 310.0
    assert clearance(run, traffic) > 1.0
    assert run.hardest_braking < 3.0


def test_time_gap_increases_after_a_merge() -> None:
    """It tends to that of the settings, 1.2 s, with the time constant of LMRS, 25 s."""
    leader: Traffic = lambda now: [KnownBox(42.0 + 12.0 * now, LANE, vx=12.0)]  # noqa: E731
    run = drive(road(2, 1600.0), LANE - WIDTH, (1500.0, LANE), leader, 100.0, 14.0)
    gaps = [leader(time)[0].x - 2.25 - run.path[round(time / 0.05)][0] - FRONT for time in (15.0, 99.0)]
    assert gaps[0] < 2.0 + 1.0 * 12.0
    assert gaps[1] == pytest.approx(2.0 + 1.2 * 12.0, abs=1.5), "rolling resistance and drag add to it"


@pytest.mark.parametrize("step", [0.1, 0.25, 1.0])
def test_time_gap_increases_with_time_constant_independently_of_decision_times(step: float) -> None:
    """The difference to 1.2 s decreases as exp(-t / 25 s)."""
    time_gap, scene, body = TimeGap(BehaviorSettings()), without_objects(), Body.of(CAR)
    for tick in range(round(25.0 / step) + 1):
        time_gap.update(scene, (0.0, 0.0), body, step * tick, merges=tick == 0)
    assert time_gap.value == pytest.approx(1.2 - (1.2 - 0.56) * math.exp(-1.0), abs=0.01)


def test_slow_car_is_overtaken_before_a_later_lane_change() -> None:
    roads = road(2, 1200.0)
    run = PlannedDrive(behavior(roads, 14.0), roads, speed=14.0, y=LANE - WIDTH)
    way = np.array([[600.0, LANE - WIDTH, 0.0], [1100.0, LANE, 0.0]])
    run.run(35.0, lambda now: [KnownBox(80.0 + 5.0 * now, LANE - WIDTH, vx=5.0)], goal=Goal(waypoints=way))
    run.world.close()
    assert run.front > 80.0 + 5.0 * 35.0 + 50.0
    assert min(run.speeds) > 8.0


def test_moving_car_is_not_overtaken_on_the_right() -> None:
    roads = road(2)
    run = PlannedDrive(behavior(roads, 14.0), roads, speed=14.0)
    run.run(20.0, lambda now: [KnownBox(60.0 + 8.0 * now, LANE, vx=8.0)])
    run.world.close()
    assert max(abs(y - LANE) for _, y, _ in run.path) < 0.2
    assert run.speeds[-1] == pytest.approx(8.0, abs=0.3)


def test_lane_that_appears_is_observed_before_it_counts_as_quiet() -> None:
    """A car of 19 m/s needs 3 m + 19 m + 19² m / 9 to slow down for a standing vehicle; the view is 25 m."""
    behind, scene = TrafficBehind(25.0, Body.of(CAR), BehaviorSettings()), without_objects()
    gaps = []
    for now, lane in ((0.0, WIDTH), (12.5, WIDTH), (13.0, math.nan), (30.0, WIDTH), (42.5, WIDTH)):
        behind.observe(scene, lane, now)
        gaps.append(behind.leaves_gap(19.0, 0.0, now))
    assert gaps == [False, True, True, False, True], "12 s without traffic are quiet"


def fast_traffic_after(quiet: float, view: float) -> tuple[list[float], PlannedDrive]:
    """Drive behind a truck of 7 m/s, with sensors that show cars up to `view` [m], while cars of 19 m/s come every 4 s
    in the other lane, up to a time [s]. Return the times at which the car is in that lane, and the drive."""
    roads = road(2, 1600.0)
    planner = behavior(roads, 13.9)
    planner.view = (ViewSector(0.0, 0.0, 1.8, 0.0, math.pi, view),)
    run = PlannedDrive(planner, roads, speed=7.0, start=200.0, y=LANE - WIDTH)

    def in_view(now: float) -> list[KnownBox]:
        x = run.path[-1][0] if run.path else 200.0
        starts = (190.0 - 19.0 * 4.0 * number for number in range(int(quiet / 4.0)))
        cars = [KnownBox(start + 19.0 * now, LANE, vx=19.0) for start in starts]
        truck = KnownBox(220.0 + 7.0 * now, LANE - WIDTH, vx=7.0, kind="truck", size=(9.0, 2.5))
        return [truck, *(car for car in cars if abs(car.x - x) < view)]

    run.run(quiet + 28.0, in_view)
    run.world.close()
    return [0.05 * tick for tick, (_, y, _) in enumerate(run.path) if y > LANE - WIDTH / 2.0], run


def test_vehicle_changes_lanes_only_with_a_view_of_fast_traffic() -> None:
    """Cars of 19 m/s need 3 m + 12 m + 12² m / 9 = 31 m behind the rear to slow down to 7 m/s."""
    times, run = fast_traffic_after(20.0, view=25.0)
    assert run.speeds[round(18.0 / 0.05)] == pytest.approx(7.0, abs=0.5), "it follows the truck"
    # The last car leaves the view at (200 - (190 - 76 * 4) + 25) / 12 s. It is kept for 1 s, the change is the best
    # proposal for 0.5 s before it begins, and half of its about 4 s pass up to the border of the lane.
    assert 28.3 + 12.0 < times[0] < 28.3 + 12.0 + 1.0 + 0.5 + 2.5, "not between cars that it does not see in time"


def test_vehicle_with_a_view_of_fast_traffic_changes_lanes_in_a_gap() -> None:
    times, _ = fast_traffic_after(4.0, view=60.0)
    assert times[0] < 8.0


def test_vehicle_merges_from_standstill_only_after_fast_traffic_out_of_view() -> None:
    """It stands near the end of its lane, and its sensors show cars up to 25 m: those of 19 m/s need 62 m to stop."""
    roads = road(2, 800.0, end=320.0)
    planner = behavior(roads, 13.9)
    planner.view = (ViewSector(0.0, 0.0, 1.8, 0.0, math.pi, 25.0),)
    run = PlannedDrive(planner, roads, speed=0.0, start=300.0, y=LANE - WIDTH)
    traffic = column(LANE, 19.0, 295.0, 19.0 * 4.0, 8)

    def in_view(now: float) -> list[KnownBox]:
        x = run.path[-1][0] if run.path else 300.0
        return [car for car in traffic(now) if abs(car.x - x) < 25.0]

    run.run(60.0, in_view, goal=Goal(waypoints=np.array([[700.0, LANE, 0.0]])))
    run.world.close()
    assert clearance(run, traffic) > 0.9
    time, x = changed_at(run, LANE)
    assert time > 7 * 4.0, "the last car has passed"
    assert x < 320.0

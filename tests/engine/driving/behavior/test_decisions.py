"""Decisions of the planner in closed loop: what probability, covariance and age of an object change, and why."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from opendrive_xml import lane_xml, map_xml, road_xml, section_xml
from planned_drive import FRONT, LANE, KnownBox, PlannedDrive, behavior, detections, two_lane_road
from signal_street import CAR

from eidrive_scenario.base.requests import Goal
from eidrive_scenario.driving.control.pid_controller import PidController
from eidrive_scenario.driving.planning.behavior.decision import Decider
from eidrive_scenario.driving.planning.behavior.planner import BehaviorPlanner
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import EgoState

DEFAULTS = BehaviorSettings()
PEDESTRIAN = KnownBox(90.0, kind="pedestrian", size=(0.5, 0.5))


@pytest.fixture(scope="module")
def roads() -> RoadNetwork:
    return two_lane_road()


def drive(
    roads: RoadNetwork,
    objects: Callable[[float], Sequence[KnownBox]],
    seconds: float,
    *,
    age: float = 0.0,
    **settings: float | bool,
) -> PlannedDrive:
    run = PlannedDrive(behavior(roads, **settings), roads)
    run.run(seconds, objects, age=age)
    run.world.close()
    return run


def appears_ahead(gap: float, score: float = 1.0) -> Callable[[float], Sequence[KnownBox]]:
    """Return a standing car that appears after 1 s, `gap` [m] ahead of the front of the car, which drives 10 m/s."""
    car = KnownBox(20.0 + 10.0 + FRONT + gap + 2.25)._replace(score=score)
    return lambda now: [car] if now >= 1.0 else []


def emergency(run: PlannedDrive) -> bool:
    return any(plan.braking for plan in run.plans)


def test_free_road_is_driven_at_target_speed(roads: RoadNetwork) -> None:
    run = drive(roads, lambda now: [], 10.0)
    assert run.speeds[-1] == pytest.approx(10.0, abs=0.3)
    assert set(run.reasons) == {"keep speed"}


def test_ghost_of_low_score_causes_comfortable_braking_only(roads: RoadNetwork) -> None:
    # From 10 m/s within 12 m: 4.2 m/s². A certain object causes that much, a possible one 2 m/s² at most.
    ghost = drive(roads, appears_ahead(12.0, score=0.3), 8.0)
    assert not emergency(ghost)
    assert ghost.hardest_braking < DEFAULTS.comfortable_deceleration + 0.2
    assert min(ghost.speeds) < 9.0
    assert "slow down for a possible car" in ghost.reasons
    possible = [plan for plan in ghost.plans if plan.reason == "slow down for a possible car"]
    assert all(plan.objects == (0,) for plan in possible)
    real = drive(roads, appears_ahead(12.0, score=0.9), 8.0)
    assert real.front < 45.85, "behind it"
    assert real.hardest_braking > 4.0
    assert "emergency braking: collision course with car" in real.reasons


def test_ghost_below_possible_existence_changes_nothing(roads: RoadNetwork) -> None:
    run = drive(roads, appears_ahead(12.0, score=0.29), 4.0)
    assert set(run.reasons) == {"keep speed"}


def test_possible_existence_and_min_existence_are_settings(roads: RoadNetwork) -> None:
    ghost = appears_ahead(12.0, score=0.3)
    assert set(drive(roads, ghost, 4.0, possible_existence=0.4).reasons) == {"keep speed"}
    assert emergency(drive(roads, ghost, 4.0, min_existence=0.25))


def test_distant_ghost_is_approached_as_an_object(roads: RoadNetwork) -> None:
    """Comfortable braking is sufficient, so that the probability makes little difference."""
    ghost = drive(roads, lambda now: [PEDESTRIAN._replace(score=0.3)], 25.0, lane_changes=False)
    certain = drive(roads, lambda now: [PEDESTRIAN], 25.0, lane_changes=False)
    assert ghost.speeds[-1] < 0.1
    assert ghost.front == pytest.approx(certain.front, abs=0.5)


@pytest.mark.exhaustive
@pytest.mark.parametrize("deviation", [0.5, 1.0])
def test_doubled_covariance_increases_the_gap_by_its_growth(roads: RoadNetwork, deviation: float) -> None:
    fronts = [
        drive(roads, lambda now, d=d: [PEDESTRIAN._replace(deviation=d)], 14.0, lane_changes=False).front  # type: ignore[misc]
        for d in (deviation, deviation * math.sqrt(2.0))
    ]
    growth = DEFAULTS.uncertainty * deviation * (math.sqrt(2.0) - 1.0)
    assert fronts[0] - fronts[1] == pytest.approx(growth, abs=0.2)
    # With a known position the car stops where it could pass the pedestrian.
    expected = 90.0 - 0.25 - DEFAULTS.uncertainty * deviation - DEFAULTS.standstill_gap - DEFAULTS.passing_gap
    assert fronts[0] == pytest.approx(expected, abs=0.6)


def test_doubled_covariance_increases_the_clearance_of_a_passed_car(roads: RoadNetwork) -> None:
    parked = KnownBox(100.0, LANE - 1.3, deviation=0.2)
    clearance = []
    for deviation in (0.2, 0.2 * math.sqrt(2.0)):
        run = drive(roads, lambda now, d=deviation: [parked._replace(deviation=d)], 14.0)  # type: ignore[misc]
        assert run.front > 110.0, "the car passes"
        clearance.append(run.least_distance(parked))
    assert clearance[0] > DEFAULTS.lateral_margin
    growth = DEFAULTS.uncertainty * 0.2 * (math.sqrt(2.0) - 1.0)
    assert clearance[1] - clearance[0] == pytest.approx(growth, abs=0.05)


def test_message_of_half_a_second_ago_is_moved_to_the_present(roads: RoadNetwork) -> None:
    # At constant speed only the uncertainty grows, by 0.5 m/s · 0.5 s per deviation.
    def lead(now: float) -> list[KnownBox]:
        return [KnownBox(45.0 + 8.0 * now, vx=8.0)]

    fresh, old = drive(roads, lead, 25.0), drive(roads, lead, 25.0, age=0.5)
    assert fresh.front - old.front == pytest.approx(DEFAULTS.uncertainty * 0.25, abs=0.15)
    assert old.speeds[-1] == pytest.approx(8.0, abs=0.05)


def test_message_of_half_a_second_ago_delays_the_reaction_to_braking(roads: RoadNetwork) -> None:
    def lead(now: float) -> list[KnownBox]:
        slowing = min(max(now - 3.0, 0.0), 2.5)
        return [KnownBox(45.0 + 10.0 * now - 10.0 * max(now - 5.5, 0.0) - 2.0 * slowing**2, vx=10.0 - 4.0 * slowing)]

    starts = []
    for age in (0.0, 0.5):
        run = drive(roads, lead, 12.0, age=age, lane_changes=False)
        assert run.front < lead(12.0)[0].x - 2.25, "no contact"
        slow = np.array([speed < run.speeds[58] - 0.3 for speed in run.speeds])
        slow[:60] = False
        starts.append(int(np.argmax(slow)) * 0.05)
    assert starts[1] - starts[0] == pytest.approx(0.5, abs=0.15)


def test_standing_queue_is_not_passed(roads: RoadNetwork) -> None:
    run = drive(roads, lambda now: [KnownBox(100.0), KnownBox(107.0), KnownBox(114.0)], 18.0)
    assert run.front < 97.75
    assert run.speeds[-1] < 0.1


@pytest.mark.parametrize(("mark", "passes"), [("solid solid", False), ("solid broken", True)])
def test_jam_in_both_own_lanes_is_not_passed_over_a_solid_line(mark: str, passes: bool) -> None:
    """The first car of the own lane hides the others. The vehicle, which stands, takes them for a queue for 20 s."""
    lanes = section_xml(lane_xml(1), lane_xml(-1) + lane_xml(-2), center=f'<roadMark sOffset="0" type="{mark}"/>')
    planner = behavior(RoadNetwork.parse(map_xml(road_xml(length=400.0, lanes=lanes))), period=1.0)
    jam = [KnownBox(60.0), *(KnownBox(60.0 + 8.0 * number, LANE - 3.5) for number in range(3))]
    reasons = []
    for now in range(40):
        ego = EgoState(now, np.array([42.0, LANE, 0.0]), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        reasons.append(planner.plan(ego, detections(now, *jam), Goal(), now).reason)
    assert not any("pass" in reason for reason in reasons[:20])
    assert any("pass" in reason for reason in reasons) is passes


def test_oncoming_traffic_is_awaited_before_passing(roads: RoadNetwork) -> None:
    def traffic(now: float) -> list[KnownBox]:
        oncoming = [KnownBox(190.0 + 15.0 * k - 10.0 * now, 1.75, vx=-10.0, yaw=math.pi) for k in range(6)]
        return [KnownBox(100.0), *oncoming]

    run = drive(roads, traffic, 35.0)
    last_passed = (265.0 - 90.0) / 10.0
    beside = [number * 0.05 for number, (_, y, _) in enumerate(run.path) if y > 0.0]
    assert beside, "the car passes"
    assert min(beside) > last_passed
    assert run.front > 130.0


def test_lateral_margin_is_kept_in_a_narrow_gap(roads: RoadNetwork) -> None:
    """The road leaves 0.5 m in addition to the width of the car: 0.1 m more than the lateral margin."""
    width = CAR.size[1]
    left_side = 3.5 - 0.5 - width
    obstacle = KnownBox(100.0, left_side - 2.0, kind="misc", size=(2.0, 4.0), deviation=0.0)
    run = drive(roads, lambda now: [obstacle], 30.0)
    assert run.front > 130.0
    beside = [y for x, y, _ in run.path if 99.0 < x < 101.0]
    assert min(beside) - width / 2.0 - left_side > DEFAULTS.lateral_margin - 0.02
    assert max(beside) + width / 2.0 < 3.5 + 0.1, "on the road, within the error of the lateral control"


def test_lane_changes_can_be_switched_off(roads: RoadNetwork) -> None:
    run = drive(roads, lambda now: [KnownBox(100.0)], 25.0, lane_changes=False)
    assert run.front < 97.75
    assert max(y for _, y, _ in run.path) < LANE + 0.3


def test_crossing_pedestrian_is_given_way(roads: RoadNetwork) -> None:
    def walker(now: float) -> list[KnownBox]:
        return [KnownBox(80.0, -8.0 + 1.4 * now, vy=1.4, kind="pedestrian", size=(0.5, 0.5), yaw=math.pi / 2)]

    run = drive(roads, walker, 16.0)
    gaps = [
        math.hypot(max(abs(x + 1.4 - 80.0) - 2.446 - 0.25, 0.0), max(abs(y - walker(k * 0.05)[0].y) - 0.92 - 0.25, 0.0))
        for k, (x, y, _) in enumerate(run.path)
    ]
    assert min(gaps) > 0.5
    assert "give way to pedestrian" in run.reasons
    assert run.front > 100.0


def test_object_outside_of_the_way_changes_nothing(roads: RoadNetwork) -> None:
    run = drive(
        roads, lambda now: [KnownBox(100.0, 8.0), KnownBox(60.0, -9.0, kind="pedestrian", size=(0.5, 0.5))], 15.0
    )
    assert set(run.reasons) == {"keep speed"}


def test_decisions_have_the_period_of_the_settings(roads: RoadNetwork) -> None:
    planner = behavior(roads, period=0.2)
    changes = []
    before = None
    for tick in range(20):
        now = 0.05 * tick
        state = EgoState(now, np.array([20.0 + 10.0 * now, LANE, 0.0]), 0.0, 0.0, 0.0, 10.0, 0.0, 0.0)
        objects = [KnownBox(60.0)] if tick >= 5 else []
        reason = planner.plan(state, detections(now, *objects), Goal(), now).reason
        if before is not None and reason != before:
            changes.append(now)
        before = reason
    assert changes[0] == pytest.approx(0.4), "decisions at 0, 0.2 and 0.4 s; the object appears at 0.25 s"


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 0.75])
def test_vehicle_brakes_as_planned_between_two_points_of_the_path(roads: RoadNetwork, share: float) -> None:
    # A stop within 14 m needs 3.6 m/s², and one that keeps a gap all of the hard deceleration, 4 m/s².
    planner = behavior(roads)
    for now, x in ((0.0, 20.0), (1.0, 30.0 + share)):
        state = EgoState(now, np.array([x, LANE, 0.0]), 0.0, 0.0, 0.0, 10.0, 0.0, 0.0)
        objects = [KnownBox(x + FRONT + 14.0 + 2.25)] if now else []
        plan = planner.plan(state, detections(now, *objects), Goal(), now)
    assert plan.speeds[0] == pytest.approx(10.0)
    assert plan.acceleration == pytest.approx(-4.0)
    rolling = 0.012 * 9.81
    assert PidController(CAR, 0.05).control(state, plan).brake == pytest.approx((4.0 - rolling) / CAR.max_deceleration)


def test_places_move_by_the_way_driven_when_laps_are_added(monkeypatch: pytest.MonkeyPatch) -> None:
    """A new line begins 5 m behind the vehicle; the one before began at the vehicle, or 5 m behind it."""
    angles, radius, speed = np.linspace(0.0, 2.0 * math.pi, 181), 30.0, 10.0
    lap = np.column_stack([radius * np.sin(angles), radius * (1.0 - np.cos(angles)), 0.0 * angles])
    goal = Goal(path=lap, lap=lap)
    planner, shifts, now = behavior(None), list[tuple[float, float | None]](), 0.0
    monkeypatch.setattr(Decider, "line_changed", lambda _, shift, aside: shifts.append((now, shift)))
    while len(shifts) < 3:
        yaw = speed * now / radius
        x, y = radius * math.sin(yaw), radius * (1.0 - math.cos(yaw))
        ego = EgoState(now, np.array([x, y, 0.0]), yaw, 0.0, 0.0, speed, 0.0, 0.0)
        planner.plan(ego, detections(now), goal, now)
        now += 0.25
    (_, first), (second_time, second), (third_time, third) = shifts
    assert first is None
    assert second == pytest.approx(5.0 - speed * second_time, abs=2.0)
    assert third == pytest.approx(-speed * (third_time - second_time), abs=2.0)


@pytest.mark.parametrize(("able", "usable"), [(0.8, 0.8), (4.0, 1.5)])
def test_weak_vehicle_is_not_held_up_by_a_distant_object(able: float, usable: float) -> None:
    """A car stands 40 m beside the road; the vehicle accelerates with at most the default of 1.5 m/s²."""
    settings = AgentSettings.model_validate({"target_speed": 20.0, "planner": "behavior"})
    planner = BehaviorPlanner(settings, replace(CAR, max_acceleration=able), two_lane_road(400.0), dt=0.05, seed=0)
    ego = EgoState(0.0, np.array([20.0, LANE, 0.0]), 0.0, 0.0, 0.0, 2.0, 0.0, 0.0)
    plan = planner.plan(ego, detections(0.0, KnownBox(25.0, 40.0)), Goal(), 0.0)
    assert plan.acceleration == pytest.approx(usable, abs=0.01)
    assert not planner._decider._held_up


@pytest.mark.parametrize("start", [50.0, 58.0, 59.5])
def test_vehicle_that_passes_the_end_of_the_road_stops_there(start: float) -> None:
    roads = two_lane_road(60.0)
    drive = PlannedDrive(behavior(roads, 11.0), roads, speed=11.0, start=start)
    drive.run(5.0, lambda _: ())
    # From 11 m/s with 4 m/s² or more: 15 m, and the delay of the controller.
    assert drive.speeds[-1] == pytest.approx(0.0, abs=0.05)
    assert drive.path[-1][0] < start + 20.0


def test_vehicle_moved_from_the_end_of_the_road_follows_its_lane() -> None:
    planner = behavior(two_lane_road(400.0), 10.0)
    at_end, on_lane = (EgoState(0.0, np.array([x, LANE, 0.0]), 0.0, 0.0, 0.0, 10.0, 0.0, 0.0) for x in (398.0, 100.0))
    planner.plan(at_end, detections(0.0), Goal(), 0.0)
    plan = planner.plan(on_lane, detections(1.0), Goal(), 1.0)
    assert float(plan.points[-1, 0]) == pytest.approx(160.0, abs=3.0)
    assert float(plan.speeds[-1]) == pytest.approx(10.0, abs=0.1)

"""Paths and routes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from opendrive_xml import (
    elevation_xml,
    lane_links_xml,
    lane_xml,
    map_xml,
    predecessor_xml,
    road_xml,
    section_xml,
    successor_xml,
)
from scenariogeneration import xodr

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.driving.control.pid_controller import PidController
from eidrive_scenario.driving.planning.path import PlannedPath
from eidrive_scenario.driving.planning.route_planner import RoutePlanner
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.roads import RoadNetwork, RouteError
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.world.actor import ActorSpec

NOTHING = Detections(0.0)


def ego(x: float, y: float, yaw: float = 0.0, speed: float = 0.0) -> EgoState:
    return EgoState(0.0, np.array([x, y, 0.0]), yaw, 0.0, 0.0, speed, 0.0, 0.0)


def test_speed_limit_in_curve_is_root_of_five_radii() -> None:
    angles = np.linspace(0.0, math.pi, 200)
    path = PlannedPath(np.stack([20.0 * np.sin(angles), 20.0 * (1.0 - np.cos(angles))], axis=1), ends=False)
    np.testing.assert_allclose(path.limits[8:-8], math.sqrt(5.0 * 20.0), rtol=0.02)


def test_speed_limit_before_curve_has_approach_deceleration() -> None:
    angles = np.linspace(0.0, math.pi / 2, 100)[1:]
    straight = np.stack([np.linspace(-60.0, 0.0, 61), np.zeros(61)], axis=1)
    curve = np.stack([10.0 * np.sin(angles), 10.0 * (1.0 - np.cos(angles))], axis=1)
    path = PlannedPath(np.concatenate([straight, curve]), ends=False)
    square = path.limits[5:50] ** 2
    np.testing.assert_allclose(np.diff(square), -2 * 3.0 * 1.0, rtol=0.02)
    assert path.limits.min() == pytest.approx(math.sqrt(50.0), rel=0.05)


def test_speed_limit_is_zero_at_end_but_not_at_horizon() -> None:
    line = np.array([[0.0, 0.0], [50.0, 0.0]])
    assert PlannedPath(line, ends=True).limits[-1] == 0.0
    assert PlannedPath(line, ends=True).limits[-25] == pytest.approx(math.sqrt(2 * 3.0 * 24), rel=1e-6)
    assert PlannedPath(line, ends=False).limits.min() > 100.0


def test_path_points_are_spaced_by_one_meter_without_duplicates() -> None:
    path = PlannedPath(np.array([[0.0, 0.0], [0.0, 0.0], [4.0, 3.0], [4.0, 3.0], [8.0, 6.0]]), ends=True)
    np.testing.assert_allclose(np.hypot(*np.diff(path.points, axis=0).T), 1.0)
    assert len(path) == 11
    with pytest.raises(ValueError, match="two different points"):
        PlannedPath(np.zeros((3, 2)), ends=True)


def test_smoothing_moves_curve_by_less_than_a_decimeter() -> None:
    angles = np.linspace(0.0, math.pi, 200)
    path = PlannedPath(np.stack([10.0 * np.sin(angles), 10.0 * (1.0 - np.cos(angles))], axis=1), ends=False)
    radius = np.hypot(path.points[:, 0], path.points[:, 1] - 10.0)
    assert np.abs(radius - 10.0).max() < 0.11


@pytest.mark.parametrize(("start", "count", "points"), [(0, 60, 11), (3, 4, 4), (8, 60, 3), (9, 60, 2), (40, 60, 2)])
def test_part_of_a_path_has_at_least_one_segment(start: int, count: int, points: int) -> None:
    part = PlannedPath(np.array([[0.0, 0.0], [4.0, 3.0], [8.0, 6.0]]), ends=True).part(start, count)
    first = min(start, 9)
    assert (len(part.points), len(part.segments), len(part.along)) == (points, points - 1, points)
    assert part.along == pytest.approx([first + number for number in range(points)])
    assert part.points[0] == pytest.approx((0.8 * first, 0.6 * first))
    assert part.segments[0] == pytest.approx((0.8 * first, 0.6 * first, 0.8, 0.6, 1.0))


def test_projection_is_monotonic() -> None:
    """A path that crosses itself: the vehicle stays on the branch that it is on."""
    angles = np.linspace(0.0, 2 * math.pi, 300)
    eight = np.stack([30 * np.sin(angles), 20 * np.sin(2 * angles)], axis=1)
    path = PlannedPath(eight, ends=True)
    progress = 0
    for x, y in path.points[1:-1]:
        onward = path.project(float(x), float(y), progress)
        assert progress <= onward <= progress + 2
        progress = onward
    assert progress >= len(path) - 3


@pytest.fixture(scope="module")
def roads(tmp_path_factory: pytest.TempPathFactory) -> RoadNetwork:
    """100 m straight, a left quarter circle of radius 30 m, 100 m straight; one lane of 3.5 m each way."""
    road = xodr.create_road([xodr.Line(100), xodr.Arc(1 / 30, angle=math.pi / 2), xodr.Line(100)], id=1, lane_width=3.5)
    drive = xodr.OpenDrive("quarter")
    drive.add_road(road)
    drive.adjust_roads_and_lanes()
    path = tmp_path_factory.mktemp("roads") / "quarter.xodr"
    drive.write_xml(str(path))
    return RoadNetwork.load(path)


def planner(car: ActorSpec, roads: RoadNetwork | None, **settings: float) -> RoutePlanner:
    return RoutePlanner(AgentSettings.model_validate(settings), car, roads, dt=0.05, seed=0)


def distance_from_lane(points: np.ndarray) -> np.ndarray:
    """From the center of the right lane, 1.75 m right of the reference line."""
    x, y = points.T
    straight = np.abs(y + 1.75)
    arc = np.abs(np.hypot(x - 100.0, y - 30.0) - 31.75)
    after = np.abs(x - 131.75)
    return np.asarray(np.where(x < 100, straight, np.where(y < 30, arc, after)))


def test_route_without_goal_follows_lane_to_end_of_road(car: ActorSpec, roads: RoadNetwork) -> None:
    route = planner(car, roads, target_speed=20.0)
    plan = route.plan(ego(5.0, -1.7), NOTHING, None, 0.0)
    assert plan.points[0] == pytest.approx((5.0, -1.75), abs=1e-6)
    assert distance_from_lane(plan.points).max() < 0.06
    path = route._path
    assert path is not None
    assert path.ends
    assert path.points[-1] == pytest.approx((131.75, 130.0), abs=1.1)
    assert distance_from_lane(path.points).max() < 0.06


def test_vehicle_within_last_meter_of_road_plans_to_stop(car: ActorSpec) -> None:
    roads = RoadNetwork.parse(map_xml(road_xml(length=100.0, lanes=section_xml(right=lane_xml(-1, 3.5)))))
    plan = planner(car, roads, target_speed=10.0).plan(ego(99.5, -1.75), NOTHING, None, 0.0)
    assert (plan.points[-1][0] <= 100.0, plan.speeds[-1]) == (True, 0.0)


@pytest.mark.parametrize("radius", [3.5, 6.0, 20.0])
def test_route_on_ring_road_does_not_end(car: ActorSpec, radius: float) -> None:
    length = 2.0 * math.pi * radius
    lanes = section_xml(right=lane_xml(-1, 3, link=lane_links_xml(-1, -1)))
    itself = predecessor_xml("1") + successor_xml("1")
    ring = map_xml(road_xml(length=length, curvature=1 / radius, link=itself, lanes=lanes))
    route = planner(car, RoadNetwork.parse(ring), target_speed=3.0)
    start = RoadNetwork.parse(ring).lane_pose_at("1", -1, 0.75 * length)
    route.plan(ego(start.x, start.y, start.h), NOTHING, None, 0.0)
    assert route._path is not None
    points = route._path.points
    assert len(points) > 250
    np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 1] - radius), radius + 1.5, atol=0.3)
    angles = np.unwrap(np.arctan2(points[:, 1] - radius, points[:, 0]))
    assert np.diff(angles).min() > 0.0, "always forward"


def test_route_on_opposite_lane_follows_its_driving_direction(car: ActorSpec, roads: RoadNetwork) -> None:
    plan = planner(car, roads, target_speed=5.0).plan(ego(50.0, 1.75, math.pi), NOTHING, None, 0.0)
    assert plan.points[0] == pytest.approx((50.0, 1.75), abs=1e-6)
    assert plan.points[-1][0] < 5.0
    np.testing.assert_allclose(plan.points[:, 1], 1.75, atol=1e-6)


def test_vehicle_against_traffic_follows_the_lane_of_its_direction(car: ActorSpec, roads: RoadNetwork) -> None:
    plan = planner(car, roads).plan(ego(50.0, -1.75, math.pi), NOTHING, None, 0.0)
    assert plan.points[0] == pytest.approx((50.0, 1.75), abs=1e-6)
    assert plan.points[-1] == pytest.approx((0.0, 1.75), abs=1e-6)


def test_vehicle_against_one_way_road_plans_straight_ahead(car: ActorSpec) -> None:
    one_way = RoadNetwork.parse(map_xml(road_xml(lanes=section_xml(right=lane_xml(-1, 3.5)))))
    plan = planner(car, one_way).plan(ego(50.0, -1.75, math.pi), NOTHING, None, 0.0)
    assert plan.points[-1][0] < 0.0
    np.testing.assert_allclose(plan.points[:, 1], -1.75, atol=1e-6)


def single_track(kind: str) -> str:
    """Return the lane of a road with one lane of 4 m for both directions."""
    return (
        lane_xml(-1, 4).replace("<lane ", '<lane direction="both" ', 1)
        if kind == "both"
        else lane_xml(-1, 4, kind=kind)
    )


@pytest.mark.parametrize("kind", ["bidirectional", "both"])
@pytest.mark.parametrize("waypoints", [False, True])
def test_vehicle_against_the_usual_direction_follows_a_two_way_lane(car: ActorSpec, kind: str, waypoints: bool) -> None:
    """The lane is an arc of 102 m radius around (0, 100)."""
    lanes = section_xml(right=single_track(kind))
    road = RoadNetwork.parse(map_xml(road_xml(length=300.0, curvature=0.01, lanes=lanes)))
    start, end = road.lane_pose_at("1", -1, 250.0), road.lane_pose_at("1", -1, 150.0)
    goal = Goal(waypoints=np.array([end[:3]])) if waypoints else None
    route = planner(car, road, target_speed=10.0)
    plan = route.plan(ego(start.x, start.y, start.h + math.pi), NOTHING, goal, 0.0)
    np.testing.assert_allclose(np.hypot(plan.points[:, 0], plan.points[:, 1] - 100.0), 102.0, atol=0.05)
    angles = np.unwrap(np.arctan2(plan.points[:, 0], 100.0 - plan.points[:, 1]))
    assert angles[0] == pytest.approx(2.5, abs=0.02)
    assert np.diff(angles).max() < 0.0


def test_vehicle_behind_two_way_lane_is_in_lane_of_its_direction(car: ActorSpec) -> None:
    """Behind the single track at x = 100 m the road to x = 0 has a lane of 3.5 m in each direction."""
    linked = single_track("bidirectional").replace("<link>", f"<link>{lane_links_xml(-1)}", 1)
    lanes = section_xml(lane_xml(1), lane_xml(-1)) + section_xml(right=linked, s=100.0)
    road = RoadNetwork.parse(map_xml(road_xml(length=200.0, lanes=lanes)))
    route = planner(car, road, target_speed=10.0)
    plan = route.plan(ego(130.0, -2.0, math.pi), NOTHING, None, 0.0)
    x, y = plan.points.T
    np.testing.assert_allclose(y[x > 105.0], -2.0, atol=0.05)
    np.testing.assert_allclose(y[x < 95.0], 1.75, atol=0.05)
    assert x.min() < 75.0


def test_waypoints_on_roads_give_route_to_a_stop(car: ActorSpec, roads: RoadNetwork) -> None:
    goal = Goal(waypoints=np.array([[60.0, -1.7, 0.0], [131.8, 80.0, 0.0]]))
    route = planner(car, roads, target_speed=9.0)
    route.plan(ego(5.0, -1.75), NOTHING, goal, 0.0)
    path = route._path
    assert path is not None
    assert path.points[-1] == pytest.approx((131.75, 80.0), abs=0.05)
    assert distance_from_lane(path.points).max() < 0.06
    assert path.limits[-1] == 0.0
    assert route._path is not None
    route.plan(ego(6.0, -1.75), NOTHING, Goal(waypoints=goal.waypoints), 0.1)
    assert route._path is path, "the same goal is not planned again"
    route.plan(ego(6.0, -1.75), NOTHING, Goal(waypoints=np.array([[90.0, -1.75, 0.0]])), 0.1)
    assert route._path.points[-1] == pytest.approx((90.0, -1.75), abs=0.05)


def test_waypoints_outside_roads_are_connected_directly(car: ActorSpec, roads: RoadNetwork) -> None:
    for network in (roads, None):
        route = planner(car, network)
        route.plan(ego(0.0, -40.0), NOTHING, Goal(waypoints=np.array([[20.0, -40.0, 0.0], [40.0, -50.0, 0.0]])), 0.0)
        path = route._path
        assert path is not None
        assert path.points[0] == pytest.approx((0.0, -40.0))
        assert path.points[-1] == pytest.approx((40.0, -50.0))
        assert np.hypot(*(path.points - [20.0, -40.0]).T).min() < 1.0


@pytest.mark.parametrize("goal", [Goal(waypoints=np.zeros((1, 3))), Goal(path=np.zeros((2, 3)))])
def test_vehicle_at_destination_stays(car: ActorSpec, roads: RoadNetwork, goal: Goal) -> None:
    here = ego(0.0, 0.0, yaw=2.0)
    for network in (None, roads):
        plan = planner(car, network, target_speed=10.0).plan(here, NOTHING, goal, 0.0)
        control = PidController(car, 0.05).control(here, plan)
        assert (control.throttle, control.brake > 0.0) == (0.0, True)


def test_path_with_reversal_between_samples_has_finite_control(car: ActorSpec) -> None:
    """4.5 m ahead and back: the fifth meter's point lies where the fourth's does."""
    route = planner(car, None, target_speed=10.0)
    goal = Goal(path=np.array([[0.0, 0.0, 0.0], [4.5, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    for x in (0.0, 3.9, 4.2, 3.0):
        plan = route.plan(ego(x, 0.0, speed=2.0), NOTHING, goal, 0.0)
        assert np.hypot(*np.diff(plan.points, axis=0).T).min() > 0.1
        assert math.isfinite(PidController(car, 0.05).control(ego(x, 0.0, speed=2.0), plan).steering)


def test_target_speed_precedence_is_goal_setting_initial_speed(car: ActorSpec) -> None:
    route = planner(car, None, target_speed=7.0)
    assert route.plan(ego(0, 0), NOTHING, None, 0.0).speeds[0] == 7.0
    assert route.plan(ego(0, 0), NOTHING, Goal(speed=3.0), 0.0).speeds[0] == 3.0
    free = planner(car, None)
    assert free.plan(ego(0, 0, speed=4.5), NOTHING, None, 0.0).speeds[0] == 4.5
    assert free.plan(ego(0, 0, speed=2.0), NOTHING, None, 0.0).speeds[0] == 4.5


def test_speed_limit_is_that_of_the_level_of_the_vehicle(car: ActorSpec) -> None:
    """A bridge with a limit of 30 m/s above a road with 10 m/s; the vehicle is teleported from one to the other."""
    limits = (f'<type s="0" type="town"><speed max="{speed}" unit="m/s"/></type>' for speed in (10, 30))
    below = road_xml("below", length=500.0, profiles=next(limits))
    bridge = road_xml("bridge", length=500.0, y=0.3, profiles=next(limits) + elevation_xml(8.0))
    route = planner(car, RoadNetwork.parse(map_xml(bridge, below)), follow_speed_limit=True)
    for x, z, expected in ((50.0, 0.0, 10.0), (51.0, 8.0, 30.0), (52.0, 8.0, 30.0), (53.0, 0.0, 10.0)):
        here = EgoState(0.0, np.array([x, -1.75, z]), 0.0, 0.0, 0.0, 10.0, 0.0, 0.0)
        assert route.plan(here, NOTHING, None, 0.0).speeds[0] == pytest.approx(expected)


def test_straight_path_without_roads_does_not_end(car: ActorSpec) -> None:
    route = planner(car, None, target_speed=10.0)
    for x in range(0, 2000, 5):
        plan = route.plan(ego(float(x), 0.0), NOTHING, None, 0.0)
        assert plan.points[0][0] <= x <= plan.points[1][0] + 1e-9
        assert len(plan.points) == 60
        assert plan.speeds[0] == 10.0


@pytest.mark.parametrize("axis", ["path", "waypoints"])
def test_way_of_thousands_of_kilometers_is_an_error(car: ActorSpec, axis: str) -> None:
    far = np.array([[0.0, 0.0, 0.0], [1.38e8, 0.0, 0.0]])
    with pytest.raises(RouteError, match=r"the way to the destination .* has a length of 138,000 km"):
        planner(car, None).plan(ego(0.0, 0.0), NOTHING, Goal(path=far) if axis == "path" else Goal(waypoints=far), 0.0)


U_TURN = np.array([[x, 0.0, 0.0] for x in range(0, 102, 2)] + [[x, 20.0, 0.0] for x in range(100, -2, -2)])
"""Line of 100 m along x, and back 20 m beside it."""


def test_vehicle_that_resumes_a_route_far_along_it_continues_there(car: ActorSpec) -> None:
    """The vehicle is on the way back, nearer to its end than the planner searches from the start of the route."""
    plan = planner(car, None).plan(ego(30.0, 20.0, math.pi, 10.0), Detections(0.0), Goal(path=U_TURN, is_route=True), 0)
    assert math.dist(plan.points[0], (30.0, 20.0)) < 1.5
    assert plan.points[-1] == pytest.approx([0.0, 20.0], abs=0.1)


@pytest.mark.parametrize(("x", "y", "yaw"), [(10.0, 0.0, 0.0), (90.0, 20.0, math.pi), (20.0, 20.0, math.pi)])
def test_vehicle_that_is_teleported_along_its_route_continues_there(
    car: ActorSpec, x: float, y: float, yaw: float
) -> None:
    goal, on_route = Goal(path=U_TURN, is_route=True), planner(car, None)
    for start in range(0, 80, 2):
        on_route.plan(ego(float(start), 0.0, 0.0, 10.0), Detections(0.0), goal, 0.0)
    plan = on_route.plan(ego(x, y, yaw, 10.0), Detections(0.0), goal, 0.0)
    assert math.dist(plan.points[0], (x, y)) < 1.5
    assert (plan.points[1] - plan.points[0]) @ (math.cos(yaw), math.sin(yaw)) > 0.9


def test_vehicle_in_the_lane_of_the_way_back_keeps_its_progress(car: ActorSpec) -> None:
    """A way back 4 m beside the route is nearer to a vehicle that overtakes there."""
    goal, on_route = Goal(path=U_TURN * (1.0, 0.2, 1.0), is_route=True), planner(car, None)
    for x in range(0, 60, 2):
        on_route.plan(ego(float(x), 0.0, 0.0, 10.0), Detections(0.0), goal, 0.0)
    plan = on_route.plan(ego(60.0, 4.0, 0.0, 10.0), Detections(0.0), goal, 0.0)
    assert plan.points[0] == pytest.approx([60.0, 0.0], abs=1.5)

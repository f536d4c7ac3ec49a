"""Predicted motion against uniformly accelerated motion and the geometry of lanes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from opendrive_xml import map_xml, road_xml
from planned_drive import KnownBox, detections
from signal_street import stop_sign

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.driving.planning.behavior.memory import KnownObject, ObjectMemory
from eidrive_scenario.driving.planning.behavior.prediction import Predictor, longitudinal_motion, stopping_motion
from eidrive_scenario.driving.planning.behavior.right_of_way import Course
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.extensions.library import library_path
from eidrive_scenario.roads import RoadNetwork

TIMES = np.arange(0.0, 8.01, 0.25)


def known(*boxes: KnownBox) -> list[KnownObject]:
    return ObjectMemory(BehaviorSettings()).update(detections(0.0, *boxes), 0.0)


def test_braking_object_stops_after_its_braking_distance() -> None:
    way, speed = longitudinal_motion(10.0, -2.5, TIMES)
    assert way[-1] == pytest.approx(10.0**2 / (2.0 * 2.5))
    assert speed[-1] == 0.0
    np.testing.assert_allclose(way[TIMES <= 4.0], 10.0 * TIMES[TIMES <= 4.0] - 1.25 * TIMES[TIMES <= 4.0] ** 2)
    assert (np.diff(way) >= 0.0).all()


def test_acceleration_fades() -> None:
    way, speed = longitudinal_motion(5.0, 2.0, TIMES)
    assert speed[-1] == pytest.approx(5.0 + 2.0 * 1.5 * (1.0 - math.exp(-8.0 / 1.5)))
    np.testing.assert_allclose(np.gradient(way, TIMES)[1:-1], speed[1:-1], rtol=0.01)


@pytest.mark.parametrize(("speed", "acceleration"), [(0.0, 3.0), (0.2, -3.0), (0.29, 0.0)])
def test_slow_object_stands(speed: float, acceleration: float) -> None:
    way, speeds = longitudinal_motion(speed, acceleration, TIMES)
    assert not way.any()
    assert not speeds.any()


def test_small_acceleration_is_noise() -> None:
    way, _ = longitudinal_motion(10.0, 0.5, TIMES)
    np.testing.assert_allclose(way, 10.0 * TIMES)


def test_vehicle_follows_its_lane_around_a_curve() -> None:
    # A left curve of radius 50 m: the right lane is at a radius of 51.75 m.
    roads = RoadNetwork.parse(map_xml(road_xml(length=250.0, curvature=1.0 / 50.0)))
    pose = roads.lane_pose_at("1", -1, 10.0)
    box = KnownBox(pose.x, pose.y, 8.0 * math.cos(pose.h), 8.0 * math.sin(pose.h), yaw=pose.h)
    found = Predictor(roads, TIMES).predict(known(box))
    assert found.objects == (0,)
    radius = np.hypot(found.x[0], found.y[0] - 50.0)
    np.testing.assert_allclose(radius, 51.75, atol=0.15)
    steps = np.hypot(np.diff(found.x[0]), np.diff(found.y[0]))
    np.testing.assert_allclose(steps.sum(), 8.0 * 8.0, rtol=0.02)


def test_pedestrian_on_a_lane_keeps_its_velocity() -> None:
    roads = RoadNetwork.parse(map_xml(road_xml(length=250.0, curvature=1.0 / 50.0)))
    walker = KnownBox(10.0, -1.0, 1.0, 0.0, kind="pedestrian", size=(0.5, 0.5))
    found = Predictor(roads, TIMES).predict(known(walker))
    np.testing.assert_allclose(found.x[0], 10.0 + TIMES)
    np.testing.assert_allclose(found.y[0], -1.0)


def test_without_roads_velocity_is_constant() -> None:
    found = Predictor(None, TIMES).predict(known(KnownBox(0.0, 0.0, 3.0, 4.0, yaw=0.5)))
    np.testing.assert_allclose(found.x[0], 3.0 * TIMES)
    np.testing.assert_allclose(found.y[0], 4.0 * TIMES)
    np.testing.assert_allclose(found.speed[0], 5.0)


def test_no_objects_have_no_hypotheses() -> None:
    found = Predictor(None, TIMES).predict([])
    assert found.objects == ()
    assert found.x.shape == (0, len(TIMES))


def test_vehicle_across_its_lane_is_not_led_along_it() -> None:
    roads = RoadNetwork.parse(map_xml(road_xml(length=250.0)))
    found = Predictor(roads, TIMES).predict(known(KnownBox(100.0, -1.75, 0.0, 8.0, yaw=math.pi / 2)))
    np.testing.assert_allclose(found.x[0], 100.0)
    np.testing.assert_allclose(found.y[0], -1.75 + 8.0 * TIMES)


@pytest.mark.parametrize("speed", [-0.9, -0.5])
def test_vehicle_that_reverses_slowly_moves_back(speed: float) -> None:
    roads = RoadNetwork.parse(map_xml(road_xml(length=250.0)))
    prediction = Predictor(roads, TIMES).predict(known(KnownBox(100.0, -1.75, speed)))
    np.testing.assert_allclose(prediction.x[0], 100.0 + speed * TIMES)


def test_vehicle_that_changes_lanes_ends_on_the_next_one() -> None:
    roads = RoadNetwork.parse(map_xml(road_xml(length=400.0)))
    box = KnownBox(100.0, -1.75, 10.0, 1.0, yaw=0.1)
    found = Predictor(roads, TIMES).predict(known(box))
    assert found.y[0, -1] == pytest.approx(-1.75 + 3.5, abs=0.05)
    assert found.y[0, 4] == pytest.approx(-1.75 + 1.0, abs=0.05)


@pytest.mark.parametrize(("deviation", "leaves"), [(0.1, True), (0.5, False)])
def test_lateral_speed_counts_if_it_exceeds_the_noise(deviation: float, leaves: bool) -> None:
    roads = RoadNetwork.parse(map_xml(road_xml(length=400.0)))
    box = KnownBox(100.0, -1.75, 10.0, 1.0, yaw=0.1, deviation=deviation)
    found = Predictor(roads, TIMES).predict(known(box))
    assert found.y[0, -1] == pytest.approx(1.75 if leaves else -1.75, abs=0.05)


def test_room_is_the_distance_from_the_edge_of_the_lane() -> None:
    # Lanes of 3.5 m: 0.5 m off the center, 1.25 m are left.
    roads = RoadNetwork.parse(map_xml(road_xml(length=400.0)))
    on_lane, standing = KnownBox(100.0, -1.25, 10.0), KnownBox(150.0, -1.25)
    found = Predictor(roads, TIMES).predict(known(on_lane, standing))
    assert found.room == pytest.approx([1.25, math.inf])


def test_lost_vehicle_follows_the_curve_of_its_lane() -> None:
    roads = RoadNetwork.parse(map_xml(road_xml(length=250.0, curvature=1.0 / 50.0)))
    pose = roads.lane_pose_at("1", -1, 10.0)
    objects, predictor = ObjectMemory(BehaviorSettings()), Predictor(roads, TIMES)
    objects.update(detections(0.0, KnownBox(pose.x, pose.y, 8.0, 0.5, yaw=pose.h)), 0.0)
    for tick in range(1, 30):
        (lost,) = objects.update(Detections(0.1 * tick), 0.1 * tick, lambda lost: np.zeros(len(lost), dtype=bool))
        predictor.follow_lanes([lost], predictor.lanes([lost]))
    assert lost.speed == pytest.approx(math.hypot(8.0, 0.5), rel=0.05)
    assert math.hypot(lost.x, lost.y - 50.0) == pytest.approx(51.75, abs=0.4)


def test_slow_vehicle_with_an_uncertain_position_moves_along_its_lane() -> None:
    # 2 m/s against the lane, at a deviation of 2 m: it stands.  At 8 m/s it is a wrong-way driver.
    roads = RoadNetwork.parse(map_xml(road_xml(length=400.0)))
    slow, fast = KnownBox(200.0, -1.75, -2.0, deviation=2.0), KnownBox(200.0, -1.75, -8.0, deviation=2.0)
    np.testing.assert_allclose(Predictor(roads, TIMES).predict(known(slow)).x[0], 200.0)
    np.testing.assert_allclose(Predictor(roads, TIMES).predict(known(fast)).x[0], 200.0 - 8.0 * TIMES)


def test_slow_vehicle_of_unknown_direction_moves_equally_far_along_each_course() -> None:
    """At 60° to three alternatives along x, with 2 m/s and a deviation of 2 m."""
    roads = RoadNetwork.parse(map_xml(road_xml(length=400.0)))
    predictor = Predictor(roads, TIMES)
    objects = known(KnownBox(200.0, -1.75, 1.0, math.sqrt(3.0), deviation=2.0))
    (courses,) = predictor.lanes(objects)
    found = predictor.predict(objects, [courses[:1] * 3])
    np.testing.assert_allclose(found.x, np.tile(200.0 + 2.0 * 0.5 * TIMES, (3, 1)))
    np.testing.assert_allclose(found.speed, 1.0)


def test_vehicle_stops_at_its_stop_sign_if_it_can() -> None:
    # The front is 20 m before the sign: a stop from 8 m/s takes 16 m at 2 m/s², one from 12 m/s needs 3.6 m/s².
    sign = f"<signals>{stop_sign('stop', 100.0)}</signals>"
    roads = RoadNetwork.parse(map_xml(road_xml(length=400.0, extra=sign)))
    center = 100.0 - 20.0 - 4.5 / 2
    for speed, expected in ((8.0, center + 20.0), (12.0, center + 12.0 * 8.0)):
        found = Predictor(roads, TIMES).predict(known(KnownBox(center, -1.75, speed)))
        assert found.x[0, -1] == pytest.approx(expected, abs=0.05)
    away = Predictor(roads, TIMES).predict(known(KnownBox(center, 1.75, -8.0, yaw=math.pi)))
    assert away.x[0, -1] == pytest.approx(center - 64.0, abs=0.05)


def test_stopping_motion_ends_at_its_place() -> None:
    way, speed = stopping_motion(8.0, 30.0, TIMES)
    # 16 m of braking at 2 m/s² begin after 14 m: at 1.75 s.
    np.testing.assert_allclose(way[TIMES <= 1.75], 8.0 * TIMES[TIMES <= 1.75])
    assert speed[TIMES == 3.75] == pytest.approx(4.0)
    assert (way[-1], speed[-1]) == pytest.approx((30.0, 0.0))


def test_vehicle_is_expected_to_follow_curves_up_to_comfortable_accelerations() -> None:
    """In a curve of radius R up to √(4 R) m/s, and s meters before it up to √(4 R + 2 · 2 s) m/s."""
    radius, straight = 20.0, 40.0
    angle = np.linspace(0.0, math.pi / 2.0, 16)
    bend = np.column_stack([straight + radius * np.sin(angle), radius * (1.0 - np.cos(angle))])
    points = np.concatenate([np.column_stack([np.arange(0.0, straight, 2.0), np.zeros(20)]), bend])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    course = Course(points, along, 1.75)
    for place, limit in ((50.0, math.sqrt(4.0 * radius)), (20.0, math.sqrt(4.0 * radius + 2.0 * 2.0 * 20.0))):
        assert course.can_follow(place, 0.95 * limit)
        assert not course.can_follow(place, 1.08 * limit)
    assert course.can_follow(-5.0, 5.0)


@pytest.mark.parametrize(("speed", "turns"), [(5.0, True), (14.0, False)])
def test_fast_vehicle_in_a_junction_is_not_predicted_to_turn(speed: float, turns: bool) -> None:
    """The connecting lanes of the junction overlap at its entry; the right turn has a radius of about 9 m."""
    roads = RoadNetwork.load(library_path() / "roads" / "four_way_junction.xodr")
    pose = roads.lane_pose_at("101", -1, 1.0)
    box = KnownBox(pose.x, pose.y, speed * math.cos(pose.h), speed * math.sin(pose.h), yaw=pose.h)
    found = Predictor(roads, TIMES).predict(known(box))
    change = np.abs(np.angle(np.exp(1j * (found.yaw[:, -1] - pose.h))))
    assert (change < 0.1).any(), "straight on"
    assert bool((change > 1.0).any()) == turns


def test_vehicle_too_fast_for_its_only_lane_follows_it() -> None:
    roads = RoadNetwork.parse(map_xml(road_xml(length=250.0, curvature=1.0 / 50.0)))
    pose = roads.lane_pose_at("1", -1, 10.0)
    box = KnownBox(pose.x, pose.y, 30.0 * math.cos(pose.h), 30.0 * math.sin(pose.h), yaw=pose.h)
    found = Predictor(roads, TIMES).predict(known(box))
    assert found.objects == (0,)
    turned = np.unwrap(found.yaw[0])[-1] - pose.h
    assert turned == pytest.approx(30.0 * 8.0 / 51.75, rel=0.1), "along the curve, not straight on"


@pytest.mark.parametrize("x", np.arange(24.0, 56.0, 4.0).tolist())
def test_vehicle_that_passes_a_junction_straight_ahead_stays_in_its_lane(x: float) -> None:
    """At 12 m/s it does not turn, and the lanes of turns that it overlaps do not lead it out of that."""
    roads = RoadNetwork.load(library_path() / "roads" / "four_way_junction.xodr")
    prediction = Predictor(roads, TIMES).predict(known(KnownBox(x, 3.5, -12.0, yaw=math.pi)))
    np.testing.assert_allclose(prediction.y, 3.5, atol=0.1)
    np.testing.assert_allclose(prediction.x, np.tile(x - 12.0 * TIMES, (len(prediction.x), 1)), atol=0.2)


def test_turn_that_is_faster_than_usual_is_predicted_once_it_shows() -> None:
    """A car turns left across the opposite lanes at 8 m/s, with the heading of the lane 6 m behind its beginning."""
    roads = RoadNetwork.load(library_path() / "roads" / "four_way_junction.xodr")
    (entry,) = known(KnownBox(52.0, 3.5, -8.0, yaw=math.pi))
    predictor = Predictor(roads, TIMES)
    (courses,) = predictor.lanes([entry])
    turn = next(course for course in courses if course.points[-1, 1] < -50.0)
    x, y, heading = (float(values[0]) for values in turn.poses(np.array([turn.project(52.0, 3.5)[0] + 6.0]), 0.0))
    box = KnownBox(x, y, 8.0 * math.cos(heading), 8.0 * math.sin(heading), yaw=heading)
    prediction = predictor.predict(known(box))
    assert (prediction.y[:, -1] < -20.0).any()


@pytest.mark.parametrize("speed", [6.0, 8.0])
def test_turn_is_predicted_while_the_lane_ahead_is_hardly_left(speed: float) -> None:
    """A radius of 10 m is passed with 6.3 m/s comfortably (4 m/s²), and with 8.3 m/s at most (0.7 g).

    At 0.2 rad off the lane straight ahead, less than the 0.3 rad up to which it follows that, it moves along the turn.
    """
    roads = RoadNetwork.load(library_path() / "roads" / "four_way_junction.xodr")
    predictor = Predictor(roads, TIMES)
    (courses,) = predictor.lanes(known(KnownBox(52.0, 3.5, -speed, yaw=math.pi)))
    turn = next(course for course in courses if course.points[-1, 1] < -50.0)
    x, y, heading = turn.poses(np.arange(0.0, 12.0, 0.1), 0.0)
    index = int((np.unwrap(heading) - np.unwrap(heading)[0] > 0.2).argmax())
    velocity = speed * math.cos(heading[index]), speed * math.sin(heading[index])
    (entry,) = known(KnownBox(float(x[index]), float(y[index]), *velocity, yaw=float(heading[index])))
    (courses,) = predictor.lanes([entry])
    entry.followed = [course for course in courses if abs(course.points[-1, 1] - 3.5) < 1.0]
    assert (predictor.predict([entry]).y[:, -1] < -20.0).any()


@pytest.mark.parametrize(("turned", "expected"), [(0.0, False), (0.03, False), (0.1, True), (-0.1, False)])
def test_turn_that_gives_way_is_predicted_once_it_shows(turned: float, expected: bool) -> None:
    """At 6 m/s, 0.03 rad off the lane straight ahead is wandering (0.18 m/s), and 0.1 rad to the left is a turn."""
    roads = RoadNetwork.load(library_path() / "roads" / "four_way_junction.xodr")
    yaw = math.pi + turned
    box = KnownBox(53.0, 3.5, 6.0 * math.cos(yaw), 6.0 * math.sin(yaw), yaw=yaw)
    prediction = Predictor(roads, TIMES).predict(known(box), defers=lambda passage: passage.turn > 1.0)
    assert (prediction.y[:, -1] < -20.0).any() == expected
    assert (np.abs(prediction.y[:, -1] - 3.5) < 0.5).any()


@pytest.mark.parametrize(("acceleration", "may_turn"), [(-0.5, False), (-1.0, True)])
def test_vehicle_that_slows_down_may_turn_without_giving_way(acceleration: float, *, may_turn: bool) -> None:
    """From 0.8 m/s² on a deceleration is noticeable. The turn is then no reason for emergency braking."""
    roads = RoadNetwork.load(library_path() / "roads" / "four_way_junction.xodr")
    (entry,) = known(KnownBox(53.0, 3.5, -6.0, yaw=math.pi))
    entry.acceleration = acceleration
    prediction = Predictor(roads, TIMES).predict([entry], defers=lambda passage: passage.turn > 1.0)
    to_left = np.sin(prediction.yaw[:, -1] - prediction.yaw[:, 0]) > 0.5
    assert to_left.any() == may_turn
    assert not np.array(prediction.likely)[to_left].any()
    assert any(prediction.likely)


@pytest.mark.parametrize(("defers", "turns"), [(False, {-1, 0, 1}), (True, {0})])
def test_only_vehicle_with_the_right_of_way_may_turn_before_a_junction(defers: bool, turns: set[int]) -> None:
    """It comes from the south, 20 m before the junction; turns in units of 90 degrees."""
    roads = RoadNetwork.load(library_path() / "roads" / "four_way_junction.xodr")
    box = KnownBox(43.8, -32.0, vy=6.0, yaw=math.pi / 2.0)
    prediction = Predictor(roads, TIMES).predict(known(box), defers=lambda passage: defers)
    quarters = np.round((prediction.yaw[:, -1] - math.pi / 2.0) / (math.pi / 2.0))
    assert set(quarters.tolist()) == turns
    assert quarters[list(prediction.likely)].tolist() == [0.0]


def test_each_turn_of_a_vehicle_in_a_junction_is_likely() -> None:
    roads = RoadNetwork.load(library_path() / "roads" / "four_way_junction.xodr")
    box = KnownBox(43.8, -8.0, vy=6.0, yaw=math.pi / 2.0)
    prediction = Predictor(roads, TIMES).predict(known(box))
    assert len(prediction.likely) > 1
    assert all(prediction.likely)


@pytest.mark.parametrize(("moved", "turned", "likely"), [(1.0, 0.0, {0}), (1.0, 0.2, {1}), (6.0, 0.0, {-1, 0, 1})])
def test_vehicle_that_sets_off_in_a_junction_turns_once_it_shows(moved: float, turned: float, likely: set[int]) -> None:
    """At 2 m/s, 0.2 rad off the lane straight ahead are 0.4 m/s to the left. The car is 4.5 m long."""
    roads = RoadNetwork.load(library_path() / "roads" / "four_way_junction.xodr")
    yaw = math.pi / 2.0 + turned
    (entry,) = known(KnownBox(43.8, -8.0, 2.0 * math.cos(yaw), 2.0 * math.sin(yaw), yaw=yaw))
    entry.stands_at = (43.8, -8.0 - moved)
    prediction = Predictor(roads, TIMES).predict([entry])
    quarters = np.round((prediction.yaw[:, -1] - math.pi / 2.0) / (math.pi / 2.0))
    assert set(quarters[list(prediction.likely)].tolist()) == likely


@pytest.mark.parametrize(("acceleration", "turns"), [(0.0, True), (1.0, False)])
def test_vehicle_that_accelerates_beyond_the_speed_of_a_turn_does_not_turn(acceleration: float, turns: bool) -> None:
    """The left turn of a radius of 10 m, passed with 6.3 m/s (4 m/s²), is 8 m after the place of the oncoming car.

    The car turns with up to (6.3² + 2 · 2 · 8)^0.5 = 8.5 m/s there, since it brakes with 2 m/s².
    """
    roads = RoadNetwork.load(library_path() / "roads" / "four_way_junction.xodr")
    predictor, memory = Predictor(roads, TIMES), ObjectMemory(BehaviorSettings())
    for time in np.arange(-3.0, 0.01, 0.1).tolist():
        x = 52.0 - 8.4 * time - acceleration * time**2 / 2.0
        box = KnownBox(x, 3.5, -8.4 - acceleration * time, yaw=math.pi)
        prediction = predictor.predict(memory.update(detections(time, box), time))
    assert bool((prediction.y[:, -1] < -20.0).any()) == turns


@pytest.mark.parametrize(("speed", "late"), [(8.5, 0.0), (8.0, 1.0), (6.0, 2.0)])
def test_turn_stays_predicted_until_it_is_over(speed: float, late: float) -> None:
    """A car turns left at the speed at which it entered, with the curve of the lane some meters behind that."""
    roads = RoadNetwork.load(library_path() / "roads" / "four_way_junction.xodr")
    predictor, memory = Predictor(roads, TIMES), ObjectMemory(BehaviorSettings())
    (courses,) = predictor.lanes(known(KnownBox(52.0, 3.5, -speed, yaw=math.pi)))
    turn = next(course for course in courses if course.points[-1, 1] < -50.0)
    start, _, _ = turn.project(52.0, 3.5)
    for time in np.arange(0.0, 3.0, 0.1).tolist():
        x, y, heading = (float(values[0]) for values in turn.poses(np.array([start + speed * time - late]), 0.0))
        box = KnownBox(x - late, y, speed * math.cos(heading), speed * math.sin(heading), yaw=heading)
        prediction = predictor.predict(memory.update(detections(time, box), time))
        assert (prediction.y[:, -1] < -20.0).any(), time
        # It has left the lane straight ahead by then, and does not drift out of the others.
        assert time < 1.25 or (prediction.y[:, -1] < -20.0).all(), time


def test_vehicle_in_a_roundabout_may_take_the_next_exit() -> None:
    """Each exit doubles the number of alternatives; those at the next exit come first."""
    roads = RoadNetwork.load(library_path() / "roads" / "roundabout.xodr")
    pose = roads.lane_pose_at("8", -1, 4.0)
    box = KnownBox(pose.x, pose.y, 6.0 * math.cos(pose.h), 6.0 * math.sin(pose.h), yaw=pose.h)
    prediction = Predictor(roads, TIMES).predict(known(box))
    # The circle of 20 m around (54, 1.75); the next exit leads to the west.
    from_center = np.hypot(prediction.x[:, -1] - 54.0, prediction.y[:, -1] - 1.75)
    assert from_center.min() == pytest.approx(20.0, abs=0.5)
    assert prediction.x[from_center.argmax(), -1] < 20.0

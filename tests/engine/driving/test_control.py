"""Regulators, and the closed loop with the world's vehicle model."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.driving.control.pid_controller import PID, Gains, PidController
from eidrive_scenario.driving.planning.path import PlannedPath
from eidrive_scenario.driving.planning.route_planner import RoutePlanner
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.step import Plan
from eidrive_scenario.world.actor import ActorSpec

NOTHING = Detections(0.0)
STRAIGHT = np.column_stack([np.arange(3.0), np.zeros(3)])


def test_pid_output_equals_hand_calculation() -> None:
    pid = PID(Gains(2.0, 0.5, 0.1), low=-10.0, high=10.0, dt=0.1)
    assert pid.update(1.0) == pytest.approx(2.0 + 0.5 * 0.1)
    assert pid.update(2.0) == pytest.approx(4.0 + 0.5 * 0.3 + 0.1 * 10.0)
    assert pid.update(2.0, feed_forward=1.0) == pytest.approx(1.0 + 4.0 + 0.5 * 0.5)
    pid.reset()
    assert pid.update(1.0) == pytest.approx(2.05)


def test_pid_integral_at_output_limit_is_constant() -> None:
    """An error of 10 for 20 s would give an integral of 200; it stands still, so the output turns at once."""
    pid = PID(Gains(1.0, 1.0), low=-1.0, high=1.0, dt=0.1)
    assert {pid.update(10.0) for _ in range(200)} == {1.0}
    assert pid.update(-0.5) == pytest.approx(-0.55)


def test_pid_integral_outside_band_is_constant() -> None:
    pid = PID(Gains(1.0, 1.0), low=-10.0, high=10.0, dt=0.1, band=1.0)
    assert pid.update(5.0) == 5.0
    assert pid.update(5.0) == 5.0
    assert pid.update(1.0) == pytest.approx(1.1)
    assert pid.update(1.0) == pytest.approx(1.2)


def test_two_controllers_have_separate_state(car: ActorSpec) -> None:
    first, second = PidController(car, 0.05), PidController(car, 0.05)
    assert first._speed is not first._direction
    assert first._speed is not second._speed
    assert first._speed.gains != first._direction.gains


def planner(car: ActorSpec, **settings: Any) -> RoutePlanner:
    return RoutePlanner(AgentSettings(**settings), car, None, dt=0.05, seed=0)


def drive(vehicle: Any, route: RoutePlanner, goal: Goal | None, seconds: float) -> None:
    controller = PidController(vehicle.spec, 0.05)
    for _ in range(round(seconds / 0.05)):
        ego = vehicle.state()
        vehicle.drive(controller.control(ego, route.plan(ego, NOTHING, goal, vehicle.time)))


def test_target_speed_is_reached_within_limits_and_kept(car: ActorSpec, vehicle: Any) -> None:
    ego = vehicle()
    drive(ego, planner(car, target_speed=8.0), None, 12.0)
    speeds = np.array([speed for _, _, speed in ego.track])
    gain = np.diff(speeds) / 0.05
    assert gain.max() <= 3.5 + 1e-6
    assert speeds.max() < 1.02 * 8.0
    assert np.all(np.abs(speeds[100:] - 8.0) < 0.02 * 8.0), "8 / 3.5 s at the limit, then constants of 2/3 s"
    assert max(abs(y) for _, y, _ in ego.track) < 1e-6


def test_lower_target_speed_brakes_within_limits(car: ActorSpec, vehicle: Any) -> None:
    ego, route = vehicle(speed=15.0), planner(car)
    drive(ego, route, None, 2.0)
    assert ego.speed == pytest.approx(15.0, rel=0.01), "without a target the first speed is kept"
    drive(ego, route, Goal(speed=5.0), 6.0)
    loss = -np.diff([speed for _, _, speed in ego.track]) / 0.05
    assert loss.max() < 6.5 + 0.3, "the regulator's limit, and a little rolling resistance and drag"
    assert ego.speed == pytest.approx(5.0, rel=0.03)


def test_vehicle_stops_at_destination(car: ActorSpec, vehicle: Any) -> None:
    ego = vehicle(speed=10.0)
    drive(ego, planner(car, target_speed=10.0), Goal(waypoints=np.array([[60.0, 0.0, 0.0]])), 20.0)
    assert ego.x == pytest.approx(60.0, abs=0.6)
    assert max(x for x, _, _ in ego.track) < 60.6
    assert abs(ego.speed) < 0.01


@pytest.mark.parametrize("offset", [0.5, 1.5, -1.5])
def test_lateral_offset_decays_with_small_overshoot(car: ActorSpec, vehicle: Any, offset: float) -> None:
    ego = vehicle(y=offset, speed=10.0)
    goal = Goal(speed=10.0, path=np.array([[0.0, 0.0, 0.0], [300.0, 0.0, 0.0]]))
    route, controller = planner(car), PidController(car, 0.05)
    for _ in range(120):
        state = ego.state()
        ego.drive(controller.control(state, route.plan(state, NOTHING, goal, ego.time)))
    side = np.array([y for _, y, _ in ego.track]) / offset
    assert side.min() > -0.07
    assert abs(side[-1]) < 0.07


@pytest.mark.parametrize(
    ("offset", "yaw", "speed"),
    [(3.0, 1.0, 8.0), (0.0, 1.0, 8.0), (-6.0, -0.4, 12.0), (3.0, 0.4, 18.0), (3.0, 0.0, 28.0)],
)
def test_large_offset_or_heading_error_converges_to_path(
    car: ActorSpec, vehicle: Any, offset: float, yaw: float, speed: float
) -> None:
    """The vehicle converges to its path without oscillation, as after a tight turn or a collision."""
    ego, route, controller = vehicle(y=offset, yaw=yaw, speed=speed), planner(car), PidController(car, 0.05)
    goal = Goal(speed=speed, path=np.array([[-20.0, 0.0, 0.0], [900.0, 0.0, 0.0]]))
    for _ in range(300):
        state = ego.state()
        ego.drive(controller.control(state, route.plan(state, NOTHING, goal, ego.time)))
    assert max(abs(y) for _, y, _ in ego.track[-60:]) < 0.1
    assert ego.speed == pytest.approx(speed, rel=0.02)


@pytest.mark.parametrize(("radius", "speed"), [(12.0, 6.0), (40.0, 10.0), (-40.0, 12.0), (100.0, 20.0)])
def test_circular_path_is_followed(car: ActorSpec, vehicle: Any, radius: float, speed: float) -> None:
    """The front axle keeps to it; the rear one, inside, cuts it by R - sqrt(R² - L²). sqrt(5 R) allows these speeds.

    The curve begins at once, while the front axle is still on the tangent: judged from 3 s on.
    """
    angles = np.linspace(0.0, 1.5 * math.pi, 400)
    circle = np.stack([abs(radius) * np.sin(angles), radius * (1.0 - np.cos(angles))], axis=1)
    ego, route, controller = vehicle(speed=speed), planner(car, target_speed=speed), PidController(car, 0.05)
    route._path = PlannedPath(circle, ends=True)
    errors = []
    for _ in range(int(1.2 * math.pi * abs(radius) / speed / 0.05)):
        state = ego.state()
        ego.drive(controller.control(state, route.plan(state, NOTHING, None, ego.time)))
        front = ego.x + car.wheelbase * math.cos(ego.yaw), ego.y + car.wheelbase * math.sin(ego.yaw)
        errors.append(math.hypot(front[0], front[1] - radius) - abs(radius))
    late = np.abs(errors[60:])
    assert late.max() < 0.35
    assert late[-20:].max() < 0.11
    assert ego.speed == pytest.approx(speed, abs=0.3)


def test_braking_of_plan_sets_brake_and_keeps_steering(car: ActorSpec, vehicle: Any) -> None:
    ego = vehicle(y=1.0, speed=8.0)
    points = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [9.0, 0.0]])
    free, braked = (Plan(points, np.full(5, 8.0), "", braking=braking) for braking in (None, 5.0))
    first, second = (PidController(car, 0.05).control(ego.state(), plan) for plan in (free, braked))
    assert second.throttle == 0.0
    assert second.brake == pytest.approx(5.0 / 9.0)
    assert second.steering == first.steering < 0.0
    beyond = Plan(points, np.full(5, 8.0), "", braking=12.0)
    assert PidController(car, 0.05).control(ego.state(), beyond).brake == 1.0


def test_braking_to_standstill_has_time_and_distance_of_deceleration(car: ActorSpec, vehicle: Any) -> None:
    """From 8 m/s with 5 m/s²: 1.6 s and 6.4 m, a little less with rolling resistance and drag."""
    ego, controller = vehicle(speed=8.0), PidController(car, 0.05)
    points = np.stack([np.arange(60.0), np.zeros(60)], axis=1)
    while ego.speed > 0.01 and ego.time < 5.0:
        ego.drive(controller.control(ego.state(), Plan(points, np.full(60, 8.0), "", braking=5.0)))
    assert 1.5 <= ego.time < 1.61
    assert 6.0 < ego.x < 6.4


@pytest.mark.parametrize("grade", [-0.1, -0.02, 0.02, 0.06, 0.1])
def test_pedals_compensate_the_slope(car: ActorSpec, vehicle: Any, grade: float) -> None:
    """At the planned speed only the slope accelerates: g sin(atan(grade)); a positive pitch is downhill."""
    pitch = math.atan(grade)
    ego = msgspec.structs.replace(vehicle(speed=8.0).state(), pitch=pitch)
    control = PidController(car, 0.05).control(ego, Plan(STRAIGHT, np.full(3, 8.0), ""))
    along = 9.81 * math.sin(pitch)
    assert control.brake == pytest.approx(max(along, 0.0) / car.max_deceleration)
    assert control.throttle == pytest.approx(max(-along, 0.0) / car.max_acceleration)


def test_braking_of_plan_is_reached_on_a_slope(car: ActorSpec, vehicle: Any) -> None:
    ego = msgspec.structs.replace(vehicle(speed=8.0).state(), pitch=math.atan(0.06))
    control = PidController(car, 0.05).control(ego, Plan(STRAIGHT, np.full(3, 8.0), "", braking=5.0))
    assert control.brake == pytest.approx((5.0 + 9.81 * 0.06 / math.hypot(1.0, 0.06)) / car.max_deceleration)


@pytest.mark.parametrize(
    "plan", [Plan(STRAIGHT, np.zeros(3), "stop", braking=5.0), Plan(STRAIGHT, np.full(3, 9.0), "go")]
)
def test_vehicle_without_brakes_or_drive_has_finite_controls(car: ActorSpec, vehicle: Any, plan: Plan) -> None:
    weak = replace(car, max_acceleration=0.0, max_deceleration=0.0)
    control = PidController(weak, 0.05).control(vehicle(speed=5.0).state(), plan)
    assert max(control.throttle, control.brake) == 1.0


def test_wheels_of_a_standing_vehicle_keep_their_direction(car: ActorSpec, vehicle: Any) -> None:
    """Of the lateral law remains the proportional part, -atan(k e / v0), however long the vehicle stands."""
    ego, controller = vehicle(y=0.02).state(), PidController(car, 0.05)
    waits = Plan(STRAIGHT, np.zeros(3), "wait")
    steering = [controller.control(ego, waits).steering for _ in range(1200)]
    assert steering == pytest.approx([-math.atan(2.0 * 0.02)] * 1200)


def test_hold_standstill_applies_full_brake(car: ActorSpec) -> None:
    control = PidController(car, 0.05).hold_standstill()
    assert (control.throttle, control.brake, control.steering) == (0.0, 1.0, 0.0)

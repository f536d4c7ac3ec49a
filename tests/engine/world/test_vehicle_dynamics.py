"""Tests of the single-track model against closed forms, in the complete simulation with pybullet."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from sample_car import CarFactory, Resistances

from eidrive_scenario.errors import SettingError
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import ActorSpec, Control, Placement
from eidrive_scenario.world.physics.vehicle_parameters import GRAVITY, VehicleParameters
from eidrive_scenario.world.weather import Weather

LOSSLESS: Resistances = {"drag_area": 0, "rolling_resistance": 0}


def drive(
    spec: ActorSpec, control: Control, seconds: float, speed: float = 0.0, friction: float = 1.0
) -> list[tuple[float, ...]]:
    """Return (time, x, y, yaw, speed, yaw rate) of a car after each tick of 0.05 s."""
    rows = []
    with World(dt=0.05) as world:
        world.set_weather(Weather(friction=friction))
        world.add(spec, Placement(0.0, 0.0, speed=speed), driven=True)
        for _ in range(round(seconds / 0.05)):
            world.step({}, {spec.name: control})
            view = world.view()
            rows.append((view.time, *view.position[0, :2], view.yaw[0], view.speed[0], view.yaw_rate[0]))
    return rows


def steady_speed(spec: ActorSpec, speed: float, steering: float, seconds: float = 8.0) -> tuple[float, float]:
    """Return speed and yaw rate after constant steering with a pedal that keeps the speed."""
    with World(dt=0.05) as world:
        world.add(spec, Placement(0.0, 0.0, speed=speed), driven=True)
        for _ in range(round(seconds / 0.05)):
            view = world.view()
            missing = speed - float(view.speed[0])
            pedal = Control(throttle=max(missing, 0.0) + 0.05, brake=max(-missing, 0.0), steering=steering)
            world.step({}, {spec.name: pedal})
        view = world.view()
        return float(view.speed[0]), float(view.yaw_rate[0])


def test_low_speed_turn_has_geometric_radius(car: CarFactory) -> None:
    """At walking pace the rear axle moves on a circle of radius wheelbase / tan(steering)."""
    spec = car(steering_rate=10, **LOSSLESS)
    steering = 0.3
    rows = np.array(drive(spec, Control(steering=steering), 20.0, speed=1.5))[20:]
    points = rows[:, 1:3]
    # Least-squares circle: |p|² = 2 c·p + k.
    matrix = np.column_stack([2 * points, np.ones(len(points))])
    (cx, cy, k), *_ = np.linalg.lstsq(matrix, (points**2).sum(axis=1), rcond=None)
    radius = math.sqrt(k + cx**2 + cy**2)
    assert radius == pytest.approx(2.7 / math.tan(steering), rel=0.01)


def test_braking_distance_is_v_squared_over_2a(car: CarFactory) -> None:
    rows = np.array(drive(car(**LOSSLESS), Control(brake=1.0), 5.0, speed=20.0))
    assert abs(rows[-1, 4]) < 1e-12
    # Integration in steps of 5 ms omits half a physics step at the first speed.
    assert rows[-1, 1] == pytest.approx(20.0**2 / (2 * 8.0), abs=0.06)
    assert rows[-1, 2] == pytest.approx(0.0, abs=1e-6)
    halved = np.array(drive(car(**LOSSLESS), Control(brake=0.5), 8.0, speed=20.0))
    assert halved[-1, 1] == pytest.approx(20.0**2 / (2 * 4.0), abs=0.06)


def test_deceleration_is_bounded_by_grip(car: CarFactory) -> None:
    rows = np.array(drive(car(**LOSSLESS), Control(brake=1.0), 10.0, speed=15.0, friction=0.3))
    assert rows[-1, 1] == pytest.approx(15.0**2 / (2 * 0.95 * 0.3 * GRAVITY), rel=0.01)


def test_drive_force_is_bounded_by_force_then_power_then_speed(car: CarFactory) -> None:
    spec = replace(car(power=60_000, **LOSSLESS), max_speed=30.0)
    rows = np.array(drive(spec, Control(throttle=1.0), 20.0))
    # 4 m/s² up to the speed P / (m a) = 10 m/s, reached after 2.5 s; then dv²/dt = 2 P / m.
    assert rows[49, 4] == pytest.approx(10.0, rel=0.01)
    assert rows[99, 4] == pytest.approx(math.sqrt(10.0**2 + 2 * 60_000 / 1500 * 2.5), rel=0.01)
    assert rows[-1, 4] == pytest.approx(30.0, abs=1e-3)


def test_throttle_is_a_share_of_the_force_that_the_power_bounds(car: CarFactory) -> None:
    """Files of CARLA have 200 m/s². A throttle of 1 % is 2 m/s² up to the speed P / (m a) = 20 m/s, not a hundredth."""
    spec = replace(car(power=60_000, **LOSSLESS), max_acceleration=200.0)
    rows = np.array(drive(spec, Control(throttle=0.01), 8.0))
    assert rows[99, 4] == pytest.approx(2.0 * 5.0, rel=0.01)
    assert rows[159, 4] == pytest.approx(2.0 * 8.0, rel=0.01)


def test_top_speed_is_bounded_by_air_drag(car: CarFactory) -> None:
    """The power equals the drag at P = rho / 2 cA v³."""
    spec = car(power=40_000, drag_area=0.7, rolling_resistance=0)
    expected = (2 * 40_000 / (1.2041 * 0.7)) ** (1 / 3)
    rows = drive(spec, Control(throttle=1.0), 30.0, speed=expected - 1.0)
    assert expected < spec.max_speed
    assert rows[-1][4] == pytest.approx(expected, rel=0.01)


def test_lateral_acceleration_is_bounded_by_friction(car: CarFactory) -> None:
    for friction in (1.0, 0.4):
        rows = np.array(drive(car(tire_friction=0.9), Control(steering=0.5), 3.0, speed=20.0, friction=friction))
        velocity = rows[:, 4]
        # The acceleration of the center of gravity cannot exceed the grip at any steering angle.
        positions = rows[:, 1:3] + 2.7 * 0.55 * np.column_stack([np.cos(rows[:, 3]), np.sin(rows[:, 3])])
        acceleration = np.diff(positions, n=2, axis=0) / 0.05**2
        largest = np.linalg.norm(acceleration, axis=1).max()
        assert largest <= 0.9 * friction * GRAVITY * 1.06 + 0.2
        assert largest >= 0.8 * 0.9 * friction * GRAVITY
        assert velocity[-1] < 20.0


def test_understeer_grows_with_speed_by_the_gradient(car: CarFactory) -> None:
    """The yaw rate is v steering / (L + K v²) with K = m (b/Cf - a/Cr) / L (Rajamani, section 3.3)."""
    spec = car(cornering_stiffness_front=100_000, cornering_stiffness_rear=130_000, steering_rate=10, **LOSSLESS)
    front, rear = 0.45 * 2.7, 0.55 * 2.7
    gradient = 1500 * (rear / 100_000 - front / 130_000) / 2.7
    radii = []
    for speed in (5.0, 10.0, 15.0, 20.0):
        reached, yaw_rate = steady_speed(spec, speed, 0.01)
        radii.append(reached / yaw_rate)
        assert yaw_rate == pytest.approx(reached * 0.01 / (2.7 + gradient * reached**2), rel=0.04)
    assert radii == sorted(radii)


def test_steering_rate_is_bounded(car: CarFactory) -> None:
    spec = car(steering_rate=0.4, **LOSSLESS)
    with World(dt=0.05) as world:
        world.add(spec, Placement(0.0, 0.0, speed=2.0), driven=True)
        for _ in range(10):
            world.step({}, {"Ego": Control(steering=0.6)})
        speed, rate = float(world.view().speed[0]), float(world.view().yaw_rate[0])
    # After 0.5 s the angle of the wheels is 0.2 rad.
    assert rate == pytest.approx(speed * math.tan(0.2) / 2.7, rel=0.03)


def test_standstill_is_stable_until_throttle(car: CarFactory) -> None:
    with World(dt=0.05) as world:
        world.add(car(), Placement(0.0, 0.0, speed=3.0), driven=True)
        for _ in range(100):
            world.step({}, {"Ego": Control(brake=1.0, steering=0.4)})
        stopped = world.view()
        for _ in range(200):
            world.step({}, {"Ego": Control(brake=0.2, steering=-0.4)})
        later = world.view()
        assert abs(later.speed[0]) < 1e-12
        assert later.position[0] == pytest.approx(stopped.position[0], abs=1e-6)
        for _ in range(20):
            world.step({}, {"Ego": Control(throttle=0.5)})
        assert world.view().speed[0] == pytest.approx(2.0, rel=0.1)


def test_reverse_drive_is_bounded(car: CarFactory) -> None:
    rows = drive(car(), Control(throttle=0.2, reverse=True, steering=0.2), 2.0)
    assert rows[-1][4] < -1.0
    assert rows[-1][1] < 0.0
    assert rows[-1][5] < 0.0


def test_rolling_resistance_and_drag_slow_down(car: CarFactory) -> None:
    spec = car(rolling_resistance=0.02, drag_area=0.8)
    rows = drive(spec, Control(), 1.0, speed=20.0)
    expected = 0.02 * GRAVITY + 0.5 * 1.2041 * 0.8 * 20.0**2 / 1500
    assert 20.0 - rows[-1][4] == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(("name", "value"), [("power", "much"), ("tire_friction", "-1"), ("weight_front", "1.2")])
def test_invalid_vehicle_properties_are_errors(car: CarFactory, name: str, value: str) -> None:
    with pytest.raises(SettingError, match=name):
        VehicleParameters.of(car(**{name: value}))


def test_vehicle_without_axles_cannot_be_driven(car: CarFactory) -> None:
    with (
        World() as world,
        pytest.raises(SettingError, match="its wheelbase is not positive; give its Vehicle a FrontAxle"),
    ):
        world.add(replace(car(), wheelbase=0.0), Placement(0.0, 0.0), driven=True)

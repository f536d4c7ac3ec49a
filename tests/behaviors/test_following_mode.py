"""Following mode `follow`: a car within its limits (10 m/s², front wheels 0.5 rad, wheelbase 3 m).

Ego drives at 20 m/s from x = 100 in lane -1 (y = -2) by default.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import pytest
from eidrive_behaviors.actions.following import PathPursuit, RateLimitedValue, speed_limiter
from recorded_scene import RunScene
from storyboard_xml import private_xml
from trajectories import follow_points
from whole_run import Run

from eidrive_scenario.api.actions import TrajectoryCurve, model
from eidrive_scenario.api.common import Placement, Pose

LARGEST_CURVATURE = math.tan(0.5) / 3.0


def speed(target: float, shape: str, value: float, mode: str) -> str:
    return private_xml(f"""<LongitudinalAction><SpeedAction>
      <SpeedActionDynamics dynamicsShape="{shape}" dynamicsDimension="time" value="{value}" followingMode="{mode}"/>
      <SpeedActionTarget><AbsoluteTargetSpeed value="{target}"/></SpeedActionTarget></SpeedAction>
      </LongitudinalAction>""")


def change(shape: str, value: float, mode: str) -> str:
    return private_xml(f"""<LateralAction><LaneChangeAction>
      <LaneChangeActionDynamics dynamicsShape="{shape}" dynamicsDimension="time" value="{value}"
      followingMode="{mode}"/>
      <LaneChangeTarget><AbsoluteTargetLane value="-2"/></LaneChangeTarget></LaneChangeAction></LateralAction>""")


def motion(placement: Placement) -> tuple[float, ...]:
    return placement.x, placement.y, placement.yaw, placement.speed


@pytest.mark.element("SpeedAction")
def test_speed_step_in_follow_mode_takes_the_vehicle_time(scene: RunScene) -> None:
    played = scene(2, ("Ego", speed(25, "step", 0, "follow")))
    assert [played.at(t).speed for t in (0.1, 0.3, 0.5, 1.0)] == pytest.approx([21.0, 23.0, 25.0, 25.0])
    assert played.when("action 0", "completeState") == pytest.approx(0.5)
    assert scene(1, ("Ego", speed(25, "step", 0, "position"))).at(0.1).speed == 25.0


@pytest.mark.element("SpeedAction")
@pytest.mark.parametrize("dt", [0.01, 0.05])
@pytest.mark.parametrize(("shape", "time"), [("step", 0), ("linear", 5), ("cubic", 6), ("sinusoidal", 5)])
@pytest.mark.parametrize("target", [5.0, 35.0])
def test_speed_change_limited_by_its_jerk_does_not_overshoot(
    scene: RunScene, target: float, shape: str, time: float, dt: float
) -> None:
    """15 m/s at 1 m/s³ take at least 2 √(15 / 1) s = 7.75 s, longer than requested."""
    rates = 'maxAccelerationRate="1" maxDecelerationRate="1"'
    played = scene(10, ("Ego", speed(target, shape, time, "follow")), dt=dt, performance=rates)
    speeds = [row["Ego"].speed for row in played.rows]
    assert speeds == sorted(speeds, reverse=target < 20.0)
    accelerations = [(after - before) / dt for before, after in pairwise(speeds)]
    assert max(abs(after - before) for before, after in pairwise(accelerations)) <= dt + 1e-6
    assert speeds[-1] == pytest.approx(target)
    assert played.when("action 0", "completeState") == pytest.approx(2.0 * math.sqrt(15.0), abs=0.1)


@pytest.mark.parametrize("dt", [0.05, 0.3])
@pytest.mark.parametrize(("up", "down"), [(21.0, 0.4), (0.1, 1.5), (4.0, 21.0)])
@pytest.mark.parametrize(("start", "end", "time"), [(33.2, 34.5, 0.0), (30.0, 17.4, 20.0), (39.9, 18.8, 8.0)])
def test_limited_value_never_passes_its_target(
    start: float, end: float, time: float, up: float, down: float, dt: float
) -> None:
    limited, sign = RateLimitedValue(start, 0.0, up=up, down=down), math.copysign(1.0, end - start)
    for step in range(1, round(200.0 / dt)):
        wanted = start + (end - start) * min(step * dt / time, 1.0) if time > 0.0 else end
        assert sign * (limited.advance(wanted, dt, end) - end) < 1e-6
    assert limited.rests_at(end, dt)


@pytest.mark.element("SpeedAction")
@pytest.mark.parametrize(
    ("action", "rate", "warning"),
    [
        # 5 m/s at 1 m/s³ take at least 2 √5 s = 4.5 s
        (
            speed(25, "cubic", 4, "follow"),
            1,
            "takes longer than 4.00 s: the rates of the acceleration are limited to 1",
        ),
        # a cubic needs 6 · 5 / 6² m/s³ = 0.83 m/s³ in 6 s
        (speed(25, "cubic", 6, "follow"), 1, None),
        (speed(25, "cubic", 4, "position"), 1, None),
        (speed(25, "step", 0, "follow"), 1, None),
        (speed(40, "linear", 1, "follow"), 5, "takes at least 2.00 s instead of 1.00 s: maxAcceleration is 10 m/s²"),
    ],
)
def test_speed_change_delayed_by_its_jerk_warns_once(run: Run, action: str, rate: int, warning: str | None) -> None:
    limits = f'maxAccelerationRate="{rate}" maxDecelerationRate="{rate}"'
    played = run(8.0, ("Ego", action), driven=False, performance=limits)
    texts = [text for text in map(str, played.result.warnings) if "SpeedAction" in text]
    assert len(texts) == (warning is not None)
    assert warning is None or warning in texts[0]


def test_limited_speed_respects_the_jerk_of_the_performance() -> None:
    """By 10 m/s at most 2 m/s² and 4 m/s³: 0.5 s to build up, 0.5 s to reduce, 10 / 2 + 2 / 4 s in total."""
    car = model.Performance(
        max_speed=70, max_acceleration=2, max_deceleration=8, max_acceleration_rate=4, max_deceleration_rate=4
    )
    tracker = speed_limiter(vehicle(car), 20.0, backwards=False)
    dt = 0.01
    speeds, rates = [20.0], [0.0]
    while tracker.value != 30.0 or tracker.rate != 0.0:
        speeds.append(tracker.advance(30.0, dt))
        rates.append(tracker.rate)
    assert all(abs(after - before) <= 4.0 * dt + 1e-9 for before, after in pairwise(rates))
    assert max(rates) == pytest.approx(2.0)
    assert speeds == sorted(speeds)
    assert len(speeds) * dt == pytest.approx(5.5, abs=0.1)


def vehicle(performance: model.Performance) -> model.Vehicle:
    axle = model.Axle(max_steering=0.5, position_x=3.0, position_z=0.3, track_width=1.8, wheel_diameter=0.6)
    box = model.BoundingBox(
        center=model.Center(x=1.5, y=0.0, z=0.75), dimensions=model.Dimensions(width=2.0, length=5.0, height=1.5)
    )
    axles = model.Axles(front_axle=axle, rear_axle=axle)
    return model.Vehicle(
        name="car",
        vehicle_category=model.VehicleCategory.CAR,
        bounding_box=box,
        performance=performance,
        axles=axles,
    )


@pytest.mark.parametrize(("start", "rate"), [(-5.0, 3.0), (0.0, 0.0), (7.0, -2.0)])
def test_rate_limited_value_settles_on_a_moving_target(start: float, rate: float) -> None:
    tracker, dt = RateLimitedValue(start, rate, up=2.0, down=3.0), 0.02
    tracker.advance(0.0, dt)
    for tick in range(1, 800):
        before = tracker.rate
        value = tracker.advance(0.5 * tick * dt, dt)
        assert -3.0 * dt - 1e-9 <= tracker.rate - before <= 2.0 * dt + 1e-9
    assert (value, tracker.rate) == pytest.approx((0.5 * 799 * dt, 0.5))


@pytest.mark.element("LaneChangeAction")
def test_lane_step_in_follow_mode_takes_the_tire_time(scene: RunScene) -> None:
    """4 m at 10 m/s², half of it to gain lateral speed: 2 · √(4 / 10) s = 1.26 s."""
    played = scene(3, ("Ego", change("step", 0, "follow")), dt=0.01)
    y = [row["Ego"].y for row in played.rows]
    rates = [(after - before) / 0.01 for before, after in pairwise(y)]
    assert max(abs(after - before) for before, after in pairwise(rates)) <= 10.0 * 0.01 + 1e-6
    assert min(y) == pytest.approx(-6.0)
    assert played.when("action 0", "completeState") == pytest.approx(2.0 * math.sqrt(0.4), abs=0.05)


@pytest.mark.element("LaneChangeAction")
@pytest.mark.parametrize(("shape", "time"), [("cubic", 3), ("sinusoidal", 4), ("linear", 4), ("step", 0)])
@pytest.mark.parametrize("start", [3.0, 6.0])
def test_lane_change_in_follow_mode_while_the_speed_reverses(
    scene: RunScene, shape: str, time: float, start: float
) -> None:
    """The lateral acceleration is at most the square of the speed times the largest curvature: 1.6 and 6.6 m/s²."""
    steps = ("Ego", change(shape, time, "follow")), ("Ego", speed(-start, "linear", 2, "position"))
    y = [row["Ego"].y for row in scene(8, *steps, ego=(-1, 300.0, start), dt=0.05).rows]
    rates = [(after - before) / 0.05 for before, after in pairwise(y)]
    bound = LARGEST_CURVATURE * start * start
    assert max(abs(after - before) for before, after in pairwise(rates)) <= bound * 0.05 + 1e-6
    assert min(y) == y[-1] == pytest.approx(-6.0)


def test_request_within_the_limits_is_equal_in_both_modes(scene: RunScene) -> None:
    """A cubic lane change by 4 m in 4 s needs 6 · 4 / 16 m/s² = 1.5 m/s²; 5 m/s in 2 s need 2.5 m/s²."""
    actions: tuple[Callable[[str], str], ...] = (
        lambda mode: change("cubic", 4, mode),
        lambda mode: speed(25, "linear", 2, mode),
    )
    for action in actions:
        one, other = (scene(5, ("Ego", action(mode))) for mode in ("position", "follow"))
        for before, after in zip(one.rows, other.rows, strict=True):
            assert motion(before["Ego"]) == pytest.approx(motion(after["Ego"]), abs=1e-9)


@pytest.mark.element("FollowTrajectoryAction")
def test_corner_in_follow_mode_uses_the_maximum_steering_angle(scene: RunScene) -> None:
    corner = [(100.0, -2.0, None), (120.0, -2.0, None), (120.0, 38.0, None)]
    played = scene(10, ("Ego", follow_points(corner, "follow")), ego=(-1, 100.0, 5.0), dt=0.05)
    path = [row["Ego"] for row in played.rows]
    for before, after in pairwise(path):
        way = math.hypot(after.x - before.x, after.y - before.y)
        assert way == pytest.approx(0.25, abs=2e-3)
        assert abs(after.yaw - before.yaw) <= LARGEST_CURVATURE * 0.25 + 1e-6
    assert max(p.x for p in path) > 120.5
    late = [p for p in path if p.y > 25.0]
    assert [p.x for p in late] == pytest.approx([120.0] * len(late), abs=0.02)
    exact = scene(10, ("Ego", follow_points(corner, "position")), ego=(-1, 100.0, 5.0), dt=0.05)
    assert max(row["Ego"].x for row in exact.rows) == pytest.approx(120.0)


def test_trajectory_in_follow_mode_starts_from_the_actual_position(scene: RunScene) -> None:
    """It starts 4 m to the left of the trajectory, and reaches the end in time."""
    way = [(100.0, -6.0, 0.0), (200.0, -6.0, 5.0)]
    played = scene(6, ("Ego", follow_points(way, "follow")))
    assert (played.at(0.1).x, played.at(0.1).y) == pytest.approx((102.0, -2.0), abs=0.2)
    assert played.at(4.0).y == pytest.approx(-6.0, abs=0.05)
    assert played.at(5.0).x == pytest.approx(200.0, abs=0.2)
    assert scene(1, ("Ego", follow_points(way, "position"))).at(0.1).y == pytest.approx(-6.0)


@pytest.mark.parametrize(
    ("x", "y"), [(590.0, -2.0), (590.0, -60.0), (160.0, -150.0)], ids=["beyond", "beyond and beside", "far beside"]
)
def test_distant_vehicle_in_follow_mode_drives_to_the_trajectory_end(scene: RunScene, x: float, y: float) -> None:
    """Ego starts in lane -1 at `x`; the trajectory is 120 m long, ends at 220 m and lies at `y`.

    Within the preview of 0.5 s (10 m) or the turning circle (2 / 0.182 = 11.0 m) the vehicle has reached the end.
    """
    way = [(100.0, y, None), (220.0, y, None)]
    played = scene(45, ("Ego", follow_points(way, "follow")), ego=(-1, x, 20.0), dt=0.05)
    done = played.when("action 0", "completeState")
    assert done is not None
    there = played.at(done)
    assert math.hypot(there.x - 220.0, there.y - y) < 2.0 / LARGEST_CURVATURE


ABSOLUTE = '<Timing domainAbsoluteRelative="absolute" offset="{}" scale="1"/>'


def test_late_vehicle_on_its_trajectory_catches_up_within_its_performance(scene: RunScene) -> None:
    """At 0 s it should be at 160 m. It gains 10 m/s per second, then loses as much: 60 m in 2 √(60 / 10) = 4.9 s."""
    way = [(100.0, -2.0, 0.0), (400.0, -2.0, 15.0)]
    played = scene(6, ("Ego", follow_points(way, "follow", ABSOLUTE.format(-3))), dt=0.05)
    speeds = [row["Ego"].speed for row in played.rows]
    assert all(abs(after - before) < 10.0 * 0.05 + 1e-6 for before, after in pairwise(speeds))
    assert max(speeds) == pytest.approx(20.0 + 10.0 * math.sqrt(6.0), abs=0.5)
    assert played.at(4.5).x < 160.0 + 20.0 * 4.5 - 0.5
    assert played.at(5.5).x == pytest.approx(160.0 + 20.0 * 5.5, abs=0.1)


@pytest.mark.parametrize("dt", [0.01, 0.05])
@pytest.mark.parametrize("behind", [0.5, 10.0, 30.0])
def test_vehicle_behind_a_timed_trajectory_catches_up_within_its_performance(
    scene: RunScene, behind: float, dt: float
) -> None:
    """It gains 10 m/s per second until half of the distance, then loses as much: at most √(10 · distance) faster."""
    way = [(100.0 + behind, -2.0, 0.0), (400.0 + behind, -2.0, 15.0)]
    played = scene(6, ("Ego", follow_points(way, "follow")), dt=dt)
    speeds = [row["Ego"].speed for row in played.rows]
    assert all(abs(after - before) < 10.0 * dt + 1e-6 for before, after in pairwise(speeds))
    assert max(speeds) == pytest.approx(20.0 + math.sqrt(10.0 * behind), abs=0.5)
    assert played.at(5.5).x == pytest.approx(100.0 + behind + 20.0 * 5.5, abs=0.1)


def test_vehicle_beside_the_curve_ahead_of_its_start_does_not_turn_back(scene: RunScene) -> None:
    played = scene(4, ("Ego", follow_points([(60.0, -2.0, None), (400.0, -2.0, None)], "follow")), dt=0.05)
    assert {row["Ego"].y for row in played.rows} == {-2.0}
    assert played.at(4).x == pytest.approx(180.0)


@pytest.mark.parametrize("length", [100.0, 1e8])
def test_vehicle_beside_a_trajectory_of_any_length_begins_there(length: float) -> None:
    """It turns left by 90° 20 m before its end; the vehicle is 10 m before this corner, or 5 m before the end."""
    corner = length - 20.0
    points = ((0.0, 0.0, 0.0), (corner, 0.0, 0.5 * math.pi), (corner, 20.0, 0.5 * math.pi))
    poses = tuple(Pose(x, y, 0.0, h, 0.0, 0.0) for x, y, h in points)
    layout = TrajectoryCurve((0.0, corner, length), poses, None)
    for x, y, expected in ((corner - 10.0, -4.0, corner - 10.0), (corner + 4.0, 15.0, length - 5.0)):
        pursuit = PathPursuit(layout, 0.0, Pose(x, y, 0.0, 0.0, 0.0, 0.0), LARGEST_CURVATURE, 3.0)
        assert pursuit.s == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(("y", "heading"), [(0.0, 0.0), (4.0, 0.0), (4.0, math.pi)])
def test_vehicle_without_wheelbase_stands_and_then_joins_the_trajectory(y: float, heading: float) -> None:
    """Its turning circle is a point, so that it turns toward the trajectory in the first step."""
    ends = tuple(Pose(x, 0.0, 0.0, 0.0, 0.0, 0.0) for x in (0.0, 100.0))
    start = Pose(10.0, y, 0.0, heading, 0.0, 0.0)
    pursuit = PathPursuit(TrajectoryCurve((0.0, 100.0), ends, None), 10.0, start, math.inf, 0.0)
    assert pursuit.advance(0.0, 0.1) == start
    for _ in range(40):
        pose = pursuit.advance(1.0, 0.1)
    assert (pose.y, pose.h) == pytest.approx((0.0, 0.0), abs=1e-2)
    assert pursuit.advance(0.0, 0.1) == pose


@pytest.mark.parametrize("mode", ["position", "follow"])
def test_trajectory_whose_times_have_passed_ends_at_its_end(scene: RunScene, mode: str) -> None:
    """Its times end 14 s before the action starts. In the mode `position` the first step is 1 m beyond the end."""
    way = [(100.0, -2.0, 0.0), (220.0, -2.0, 6.0)]
    played = scene(10, ("Ego", follow_points(way, mode, ABSOLUTE.format(-20))), dt=0.05)
    done = played.when("action 0", "completeState")
    assert done is not None
    assert 219.9 <= played.at(done).x <= 222.5
    assert max(row["Ego"].speed for row in played.rows) < 70.0


def test_feasible_bend_is_equal_in_both_modes(scene: RunScene) -> None:
    """Corners of 0.1 rad, which a polyline rounds within 4 m: 0.025 1/m."""
    points, heading = [(100.0, -2.0)], 0.0
    for _ in range(6):
        points.append((points[-1][0] + 10.0 * math.cos(heading), points[-1][1] + 10.0 * math.sin(heading)))
        heading += 0.1
    timed = [(x, y, 0.5 * number) for number, (x, y) in enumerate(points)]
    one, other = (scene(4, ("Ego", follow_points(timed, mode))) for mode in ("position", "follow"))
    for before, after in zip(one.rows, other.rows, strict=True):
        assert motion(before["Ego"]) == pytest.approx(motion(after["Ego"]), abs=1e-9)

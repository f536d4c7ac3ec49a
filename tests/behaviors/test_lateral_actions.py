"""Lanes, offsets and trajectories, with numbers by hand. Ego drives 20 m/s from x = 100 in lane -1 (y = -2)."""

from __future__ import annotations

import math
from typing import Any

import pytest
from street_scene import after

from eidrive_scenario.errors import ScenarioError


def change(target: str, shape: str = "linear", dimension: str = "time", value: float = 4.0, offset: str = "") -> str:
    return f"""<PrivateAction><LateralAction><LaneChangeAction {offset}>
      <LaneChangeActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/>
      <LaneChangeTarget>{target}</LaneChangeTarget></LaneChangeAction></LateralAction></PrivateAction>"""


def lane(number: int) -> str:
    return f'<AbsoluteTargetLane value="{number}"/>'


def beside(count: int, entity: str = "Ego") -> str:
    return f'<RelativeTargetLane entityRef="{entity}" value="{count}"/>'


@pytest.mark.element("LaneChangeAction")
@pytest.mark.parametrize(
    ("shape", "quarter"),
    [
        ("linear", -3.0),
        ("cubic", -2.0 - 4.0 * (3 / 16 - 2 / 64)),
        ("sinusoidal", -2.0 - 2.0 * (1.0 - math.cos(math.pi / 4))),
    ],
)
def test_the_offset_goes_over_by_its_shape(scene: Any, shape: str, quarter: float) -> None:
    played = scene(5, ("Ego", change(lane(-2), shape)))
    assert played.at(1.0).y == pytest.approx(quarter)
    assert played.at(2.0).y == pytest.approx(-4.0)
    assert played.at(4.0).y == pytest.approx(-6.0)
    assert (played.at(4.1).y, played.at(4.1).yaw) == pytest.approx((-6.0, 0.0))
    assert played.when("action 0", "completeState") == pytest.approx(4.0)


def test_the_slanted_way_is_as_long_as_the_speed_says(scene: Any) -> None:
    """1 m/s to the side leaves √(20² - 1²) m/s along the road."""
    placement = scene(2, ("Ego", change(lane(-2)))).at(1.0)
    assert placement.x == pytest.approx(100.0 + math.sqrt(399.0))
    assert placement.yaw == pytest.approx(-math.asin(1 / 20))


@pytest.mark.parametrize("dimension", ["time", "distance"])
def test_the_heading_is_that_of_the_instant(scene: Any, dimension: str) -> None:
    """4 m sinusoidally in 4 s are π/2 · sin(πt/4) m/s sideways; over 80 m of it, π/40 · sin(πs/80) to the right."""
    played = scene(3, ("Ego", change(lane(-2), "sinusoidal", dimension, 4 if dimension == "time" else 80)))
    for time in (0.5, 1.0, 2.0, 2.5):
        row = played.at(time)
        if dimension == "time":
            assert row.yaw == pytest.approx(-math.asin(math.pi / 2.0 * math.sin(math.pi * time / 4.0) / 20.0))
        else:
            assert row.yaw == pytest.approx(
                -math.atan(math.pi / 40.0 * math.sin(math.pi * (row.x - 100.0) / 80.0)), abs=1e-5
            )
        assert not row.across


def test_a_distance_is_measured_along_the_lane(scene: Any) -> None:
    played = scene(4, ("Ego", change(lane(-2), "linear", "distance", 50)))
    row = next(p for tick in played.rows if (p := tick["Ego"]).x > 124.0)
    assert row.y == pytest.approx(-2.0 - 4.0 * (row.x - 100.0) / 50.0, abs=1e-4)


def test_a_rate_is_the_largest_speed_sideways(scene: Any) -> None:
    """Sinusoidal over 4 m at 2 m/s: π/2 · 4 / 2 = π seconds."""
    played = scene(5, ("Ego", change(lane(-2), "sinusoidal", "rate", 2)))
    assert played.when("action 0", "completeState") == pytest.approx(3.2)
    assert played.at(math.pi / 2).y == pytest.approx(-4.0, abs=0.1)


def test_a_step_changes_lane_at_once_and_an_offset_may_remain(scene: Any) -> None:
    played = scene(1, ("Ego", change(lane(-2), "step", "time", 0, 'targetLaneOffset="0.5"')))
    assert (played.at(0.1).x, played.at(0.1).y) == pytest.approx((102.0, -5.5))


@pytest.mark.element("LaneChangeAction")
@pytest.mark.parametrize(
    ("target", "ego", "y"),
    [
        (beside(-1), (-1, 100, 20), -6.0),
        (beside(1), (-2, 100, 20), -2.0),
        (beside(1), (-1, 100, 20), 2.0),
        (beside(0, "Other"), (-2, 100, 20), -2.0),
        (beside(1), (1, 300, 20), -2.0),
    ],
)
def test_relative_lanes_count_to_the_left_of_who_is_named(scene: Any, target: str, ego: Any, y: float) -> None:
    played = scene(3, ("Ego", change(target, "linear", "time", 1)), ego=ego)
    assert played.at(2.0).y == pytest.approx(y)
    assert (played.at(2.0).x - ego[1]) * (-1 if ego[0] > 0 else 1) == pytest.approx(40.0, abs=0.5)


@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_who_stands_waits_and_who_crawls_goes_sideways_no_faster_than_forwards(scene: Any, speed: float) -> None:
    assert scene(2, ("Ego", change(lane(-2))), ego=(-1, 100, 0)).at(2.0).y == -2.0
    played = scene(2, ("Ego", change(lane(-2), "linear", "time", 1)), ego=(-1, 100, speed))
    half = math.sqrt(0.5)
    found = played.at(1.0)
    assert (found.x, found.y) == pytest.approx((100.0 + math.copysign(half, speed), -2.0 - half))
    assert found.yaw == pytest.approx(math.copysign(math.pi / 4, -speed))


def test_a_lane_that_is_not_there_is_an_error(scene: Any) -> None:
    with pytest.raises(
        ScenarioError, match=r"LaneChangeAction: the target lane does not exist .*got -4; expected one of 1, -1, -2"
    ):
        scene(1, ("Ego", change(lane(-4))))


@pytest.mark.parametrize("number", ["--1", "left", "²", "-"])
def test_a_lane_whose_name_is_no_number_is_an_error(scene: Any, number: Any) -> None:
    with pytest.raises(ScenarioError, match=rf"the target lane is not a number \(got '{number}'"):
        scene(1, ("Ego", change(lane(number))))


def offset(target: str, continuous: str = "false", acceleration: str = 'maxLateralAcc="1.5"') -> str:
    return f"""<PrivateAction><LateralAction><LaneOffsetAction continuous="{continuous}">
      <LaneOffsetActionDynamics dynamicsShape="cubic" {acceleration}/>
      <LaneOffsetTarget>{target}</LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>"""


@pytest.mark.element("LaneOffsetAction")
def test_an_offset_is_reached_within_the_lateral_acceleration(scene: Any) -> None:
    """Cubic over 1 m at 1.5 m/s²: √(6 / 1.5) = 2 s."""
    played = scene(3, ("Ego", offset('<AbsoluteTargetLaneOffset value="1"/>')))
    assert played.at(1.0).y == pytest.approx(-1.5)
    assert played.at(2.0).y == pytest.approx(-1.0)
    assert played.when("action 0", "completeState") == pytest.approx(2.0)


@pytest.mark.element("LaneOffsetAction")
def test_an_offset_beside_somebody_follows_him_where_it_is_continuous(scene: Any) -> None:
    played = scene(
        6,
        ("Other", change(lane(-2), "linear", "time", 3)),
        ("Ego", offset('<RelativeTargetLaneOffset entityRef="Other" value="1"/>', "true", "")),
    )
    assert played.at(0.1).y == pytest.approx(-1.0)
    assert played.at(5.0).y == pytest.approx(-5.0)
    assert played.when("action 1", "completeState") is None


@pytest.mark.element("LateralDistanceAction")
def test_a_lateral_distance_is_kept_beside(scene: Any) -> None:
    action = """<PrivateAction><LateralAction><LateralDistanceAction entityRef="Other" distance="3" freespace="false"
      continuous="false" coordinateSystem="lane" displacement="leftToReferencedEntity">
      <DynamicConstraints maxSpeed="1"/></LateralDistanceAction></LateralAction></PrivateAction>"""
    played = scene(5, ("Ego", action))
    assert played.at(1.1).y == pytest.approx(-1.0)
    assert played.at(4.0).y == pytest.approx(1.0, abs=0.02)


@pytest.mark.element("LateralDistanceAction")
def test_free_space_beside_is_from_flank_to_flank(scene: Any) -> None:
    """Two cars of 2 m: their middles are 2.5 m apart; within a limit of acceleration the way there is a spring's."""
    action = """<PrivateAction><LateralAction><LateralDistanceAction entityRef="Other" distance="0.5" freespace="true"
      continuous="true" coordinateSystem="lane" displacement="rightToReferencedEntity">
      <DynamicConstraints maxAcceleration="4"/></LateralDistanceAction></LateralAction></PrivateAction>"""
    played = scene(12, ("Ego", action))
    assert min(row["Ego"].y for row in played.rows) > -4.5 - 1e-3
    assert played.at(12.0).y == pytest.approx(-4.5, abs=1e-3)
    assert played.at(12.0).yaw == pytest.approx(0.0, abs=1e-3)


@pytest.mark.element("TeleportAction")
def test_teleports_show_in_the_next_view(scene: Any) -> None:
    action = """<PrivateAction><TeleportAction><Position><LanePosition roadId="1" laneId="1" s="500"/></Position>
      </TeleportAction></PrivateAction>"""
    played = scene(1, ("Ego", action))
    assert (played.at(0.1).x, played.at(0.1).y) == pytest.approx((500.0, 2.0))
    assert played.at(0.2).x == pytest.approx(498.0)


def trajectory(points: list[tuple[float, float, float | None]], reference: str, mode: str = "position") -> str:
    vertices = "".join(
        f'<Vertex {"" if t is None else f"time={chr(34)}{t}{chr(34)}"}><Position><WorldPosition x="{x}" y="{y}"/>'
        "</Position></Vertex>"
        for x, y, t in points
    )
    return f"""<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>
      <Trajectory name="way" closed="false"><Shape><Polyline>{vertices}</Polyline></Shape></Trajectory></TrajectoryRef>
      <TimeReference>{reference}</TimeReference><TrajectoryFollowingMode followingMode="{mode}"/>
      </FollowTrajectoryAction></RoutingAction></PrivateAction>"""


CORNER = [(100.0, -2.0, None), (110.0, -2.0, None), (110.0, 18.0, None)]


@pytest.mark.element("FollowTrajectoryAction", "Polyline")
def test_a_trajectory_without_timing_is_driven_at_the_own_speed(scene: Any) -> None:
    played = scene(2, ("Ego", trajectory(CORNER, "<None/>")))
    assert (played.at(0.4).x, played.at(0.4).y) == pytest.approx((108.0, -2.0))
    assert (played.at(1.0).x, played.at(1.0).y, played.at(1.0).yaw) == pytest.approx((110.0, 8.0, math.pi / 2))
    assert played.when("action 0", "completeState") == pytest.approx(1.5)


@pytest.mark.element("FollowTrajectoryAction", "Timing")
@pytest.mark.parametrize(
    ("domain", "offset", "scale", "start"),
    [("relative", 0, 1, 0.5), ("absolute", 0.5, 1, 0.5), ("relative", 1, 2, 1.5)],
)
def test_times_say_when_a_vertex_is_passed(scene: Any, domain: str, offset: float, scale: float, start: float) -> None:
    """10 m in 2 s, begun at 0.5 s: at 5 m/s; at half that speed where times are stretched to twice."""
    timed = [(100.0, -2.0, 0.0), (110.0, -2.0, 2.0)]
    timing = f'<Timing domainAbsoluteRelative="{domain}" offset="{offset}" scale="{scale}"/>'
    later = '<ByValueCondition><SimulationTimeCondition value="0.45" rule="greaterThan"/></ByValueCondition>'
    played = scene(6, ("Ego", trajectory(timed, timing), later))
    assert played.at(start + scale).x == pytest.approx(105.0)
    assert played.at(start + scale).speed == pytest.approx(5.0 / scale)
    assert played.when("action 0", "completeState") == pytest.approx(start + 2 * scale)


def test_in_the_mode_follow_speeds_change_evenly(scene: Any) -> None:
    """From 20 m/s, 10 m in 1 s: brake to a stop."""
    timed = [(100.0, -2.0, 0.0), (110.0, -2.0, 1.0)]
    played = scene(
        2, ("Ego", trajectory(timed, '<Timing domainAbsoluteRelative="relative" offset="0" scale="1"/>', "follow"))
    )
    assert played.at(0.5).x == pytest.approx(107.5)


@pytest.mark.parametrize("later", [False, True])
def test_timing_over_trajectory_without_times_keeps_the_speed_and_warns(run: Any, later: bool) -> None:
    """At 20 m/s from x = 110 on, in an event as in Init: after 2 s, x = 150."""
    timing = '<Timing domainAbsoluteRelative="relative" offset="0" scale="1"/>'
    action = trajectory([(110.0, -2.0, None), (500.0, -2.0, None)], timing)
    warnings: list[str] = []

    def look(simulation: Any, frame: Any) -> None:
        warnings[:] = [str(diagnostic) for diagnostic in simulation.storyboard.context.warnings]

    if later:
        played = run(3, ("Ego", action, after(0.45)), driven=False, during=look)
    else:
        played = run(3, driven=False, init=f'<Private entityRef="Ego">{action}</Private>', during=look)
    start = 0.5 if later else 0.0
    for frame, x in zip(played.frames, played.x("Ego"), strict=True):
        if frame.view.time > start + 0.1:
            assert x == pytest.approx(110.0 + 20.0 * (frame.view.time - start), abs=1e-6)
    (warning,) = [text for text in warnings if "no times for Timing to scale" in text]
    assert "scene.xosc:" in warning
    assert warning.endswith("specify a time for each vertex, or <None/> as the TimeReference")


def test_a_trajectory_takes_the_lateral_domain_and_leaves_the_speed_to_others(scene: Any) -> None:
    step = """<PrivateAction><LongitudinalAction><SpeedAction>
      <SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
      <SpeedActionTarget><AbsoluteTargetSpeed value="5"/></SpeedActionTarget></SpeedAction></LongitudinalAction>
      </PrivateAction>"""
    later = '<ByValueCondition><SimulationTimeCondition value="0.15" rule="greaterThan"/></ByValueCondition>'
    played = scene(2, ("Ego", trajectory(CORNER, "<None/>")), ("Ego", step, later), ("Ego", change(lane(-2)), later))
    assert played.at(0.3).speed == 5.0
    assert played.when("action 0", "completeState") == pytest.approx(0.2)


@pytest.mark.element("LateralDistanceAction")
def test_a_distance_in_the_own_frame_does_not_make_the_actor_swing(scene: Any) -> None:
    """Both drive beside each other; 2.5 m between cars of 2 m: middles 4.5 m apart, at once and then for good.

    Other looks the other way, so that its left is to the right of Ego.
    """
    action = """<PrivateAction><LateralAction><LateralDistanceAction entityRef="Other" distance="2.5" freespace="true"
      continuous="true" coordinateSystem="entity" displacement="leftToReferencedEntity"/>
      </LateralAction></PrivateAction>"""
    played = scene(5, ("Ego", action), ego=(-1, 100.0, 20.0), other=(1, 100.0, -20.0))
    assert [row["Ego"].y for row in played.rows[1:]] == pytest.approx([played.at(0.0, "Other").y - 4.5] * 50)
    assert [row["Ego"].yaw for row in played.rows[2:]] == pytest.approx([0.0] * 49, abs=1e-6)


def test_an_action_of_init_that_a_younger_one_ends_leaves_its_trajectory(run: Any) -> None:
    """From then on there is none along which a condition could measure."""
    followed: dict[float, bool] = {}

    def look(simulation: Any, frame: Any) -> None:
        followed[round(frame.view.time, 3)] = simulation.storyboard.context.actors["Ego"].trajectory is not None

    aside = offset('<AbsoluteTargetLaneOffset value="1"/>')
    init = f'<Private entityRef="Ego">{trajectory(CORNER, "<None/>")}</Private>'
    run(1, ("Ego", aside, after(0.45)), driven=False, init=init, during=look)
    assert followed[0.4]
    assert not followed[0.6]

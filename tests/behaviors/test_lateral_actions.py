"""Lateral actions with values calculated by hand.

Ego drives at 20 m/s from x = 100 in lane -1 (y = -2).
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml
from openscenario_xml import round_car_xml
from recorded_scene import RunScene
from storyboard_xml import (
    element_state_xml,
    global_xml,
    init_xml,
    lane_position_xml,
    speed_xml,
    teleport_xml,
    world_position_xml,
)
from street_scene import NOTHING, OPENING, after
from trajectories import CORNER, follow_points
from whole_run import Run

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import Simulation


def change(target: str, shape: str = "linear", dimension: str = "time", value: float = 4.0, offset: str = "") -> str:
    return f"""<PrivateAction><LateralAction><LaneChangeAction {offset}>
      <LaneChangeActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/>
      <LaneChangeTarget>{target}</LaneChangeTarget></LaneChangeAction></LateralAction></PrivateAction>"""


def lane(number: int | str) -> str:
    return f'<AbsoluteTargetLane value="{number}"/>'


FOLLOW = ("dynamicsShape", 'followingMode="follow" dynamicsShape')


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
def test_lane_change_offset_follows_its_shape(scene: RunScene, shape: str, quarter: float) -> None:
    played = scene(5, ("Ego", change(lane(-2), shape)))
    assert played.at(1.0).y == pytest.approx(quarter)
    assert played.at(2.0).y == pytest.approx(-4.0)
    assert played.at(4.0).y == pytest.approx(-6.0)
    assert (played.at(4.1).y, played.at(4.1).yaw) == pytest.approx((-6.0, 0.0))
    assert played.when("action 0", "completeState") == pytest.approx(4.0)


@pytest.mark.parametrize("mode", ["position", "follow"])
@pytest.mark.parametrize(
    "trigger",
    [after(0.95), *(element_state_xml("event", "event 1", state) for state in ("startTransition", "completeState"))],
)
def test_lane_change_by_a_chain_ends_a_trajectory_in_its_lane(scene: RunScene, mode: str, trigger: str) -> None:
    """As if it started directly at 1 s: 4 m linearly in 4 s."""
    ahead = follow_points([(100.0, -2.0, None), (900.0, -2.0, None)], mode)
    played = scene(6, ("Ego", ahead), ("Ego", NOTHING, after(0.95)), ("Ego", change(lane(-2)), trigger))
    for time, y in ((1.0, -2.0), (1.1, -2.1), (3.0, -4.0), (5.0, -6.0), (6.0, -6.0)):
        assert played.at(time).y == pytest.approx(y)


def test_lane_change_path_length_is_that_of_the_speed(scene: RunScene) -> None:
    """A lateral speed of 1 m/s leaves √(20² - 1²) m/s along the road."""
    placement = scene(2, ("Ego", change(lane(-2)))).at(1.0)
    assert placement.x == pytest.approx(100.0 + math.sqrt(399.0))
    assert placement.yaw == pytest.approx(-math.asin(1 / 20))


@pytest.mark.parametrize("dimension", ["time", "distance"])
def test_lane_change_heading_is_that_of_the_instant(scene: RunScene, dimension: str) -> None:
    """4 m sinusoidally in 4 s are π/2 · sin(πt/4) m/s to the right; over 80 m the slope is π/40 · sin(πs/80)."""
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


def test_lane_change_over_a_distance_is_measured_along_the_lane(scene: RunScene) -> None:
    played = scene(4, ("Ego", change(lane(-2), "linear", "distance", 50)))
    row = next(p for tick in played.rows if (p := tick["Ego"]).x > 124.0)
    assert row.y == pytest.approx(-2.0 - 4.0 * (row.x - 100.0) / 50.0, abs=1e-4)


def test_lane_change_rate_is_the_maximum_lateral_speed(scene: RunScene) -> None:
    """Sinusoidal over 4 m at 2 m/s: π/2 · 4 / 2 = π seconds."""
    played = scene(5, ("Ego", change(lane(-2), "sinusoidal", "rate", 2)))
    assert played.when("action 0", "completeState") == pytest.approx(3.2)
    assert played.at(math.pi / 2).y == pytest.approx(-4.0, abs=0.1)


def test_lane_change_step_with_target_offset_is_immediate(scene: RunScene) -> None:
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
def test_lane_change_relative_lanes_count_to_the_left_of_the_reference(
    scene: RunScene, target: str, ego: tuple[int, float, float], y: float
) -> None:
    played = scene(3, ("Ego", change(target, "linear", "time", 1)), ego=ego)
    assert played.at(2.0).y == pytest.approx(y)
    assert (played.at(2.0).x - ego[1]) * (-1 if ego[0] > 0 else 1) == pytest.approx(40.0, abs=0.5)


@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_lane_change_at_low_speed_is_limited_to_forward_speed(scene: RunScene, speed: float) -> None:
    assert scene(2, ("Ego", change(lane(-2))), ego=(-1, 100, 0)).at(2.0).y == -2.0
    played = scene(2, ("Ego", change(lane(-2), "linear", "time", 1)), ego=(-1, 100, speed))
    half = math.sqrt(0.5)
    found = played.at(1.0)
    assert (found.x, found.y) == pytest.approx((100.0 + math.copysign(half, speed), -2.0 - half))
    assert found.yaw == pytest.approx(math.copysign(math.pi / 4, -speed))


def test_lane_change_to_missing_lane_is_rejected(scene: RunScene) -> None:
    with pytest.raises(
        ScenarioError, match=r"LaneChangeAction: the target lane does not exist .*got -4; expected one of 1, -1, -2"
    ):
        scene(1, ("Ego", change(lane(-4))))


def test_lane_change_to_the_oncoming_lane_before_a_new_lane(scene: RunScene) -> None:
    """Lane 1, in which Other drives, is linked; the new lane -1 between both cars has no counterpart."""
    change_lane = change(beside(0, "Other"), "linear", "time", 1)
    played = scene(2, ("Ego", change_lane), ego=(-1, 150, 20), other=(1, 300, 0), street=OPENING)
    assert played.at(2.0).y == pytest.approx(2.0)


@pytest.mark.parametrize(("ego", "other", "count"), [(-1, -1, 0), (-2, -1, 0), (-2, -2, 1)])
def test_lane_change_to_a_lane_that_begins_ahead_is_rejected(scene: RunScene, ego: int, other: int, count: int) -> None:
    """The target is the new lane -1, in the middle of the road, where lanes 1 and -1 meet at Ego."""
    with pytest.raises(ScenarioError, match=r"target lane does not exist on road '1' at s = 150\.0 m, as it begins"):
        scene(1, ("Ego", change(beside(count, "Other"))), ego=(ego, 150, 20), other=(other, 300, 0), street=OPENING)


@pytest.mark.parametrize("number", ["--1", "left", "²", "-"])
def test_lane_change_to_non_numeric_lane_is_rejected(scene: RunScene, number: str) -> None:
    with pytest.raises(ScenarioError, match=rf"the target lane is not a number \(got '{number}'"):
        scene(1, ("Ego", change(lane(number))))


def offset(target: str, continuous: str = "false", acceleration: str = 'maxLateralAcc="1.5"') -> str:
    return f"""<PrivateAction><LateralAction><LaneOffsetAction continuous="{continuous}">
      <LaneOffsetActionDynamics dynamicsShape="cubic" {acceleration}/>
      <LaneOffsetTarget>{target}</LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>"""


STEP_ASIDE = offset('<AbsoluteTargetLaneOffset value="1"/>', acceleration="")


@pytest.mark.parametrize("order_in_init", [None, 1, -1])
@pytest.mark.parametrize(
    ("first", "second", "middle", "end"),
    [
        (STEP_ASIDE, change(lane(-2)), -3.5, -6.0),
        (change(lane(-2), "step", value=0.0), change(lane(-1)), -4.0, -2.0),
        (teleport_xml(lane_position_xml(-2, 100.0)), STEP_ASIDE, -5.0, -5.0),
    ],
)
def test_later_lateral_action_starts_from_the_result_of_a_lateral_step(
    run: Run, order_in_init: int | None, first: str, second: str, middle: float, end: float
) -> None:
    """From y = -1 or -6 linearly in 4 s; a step after a teleport starts from its place. The order in Init is free."""
    steps = (("Ego", first), ("Ego", second)) if order_in_init is None else ()
    init = "" if order_in_init is None else init_xml("Ego", *(first, second)[::order_in_init])
    played = run(4.5, *steps, driven=False, init=init)
    for time, y in ((2.0, middle), (4.0, end)):
        view = played.frames[round(time / 0.05)].view
        assert view.position[view.rows["Ego"], 1] == pytest.approx(y, abs=1e-6)


def distance(axis: str, meters: float) -> str:
    """Return a distance to Other that is reached at once."""
    return f"""<PrivateAction><{axis}Action><{axis}DistanceAction entityRef="Other" distance="{meters}"
      freespace="false" continuous="false"/></{axis}Action></PrivateAction>"""


@pytest.mark.parametrize("in_init", [False, True])
def test_distances_without_limits_apply_in_the_step_of_a_teleport(run: Run, in_init: bool) -> None:
    """Other drives at 10 m/s from x = 150, y = -6: Ego is 20 m behind it and 3 m beside it after the first step."""
    actions = (teleport_xml(lane_position_xml(-1, 200.0)), distance("Longitudinal", 20), distance("Lateral", 3))
    steps = () if in_init else tuple(("Ego", action) for action in actions)
    init = init_xml("Ego", *actions) if in_init else ""
    view = run(0.1, *steps, driven=False, init=init, others={"Other": (-2, 150.0, 10.0)}).frames[1].view
    assert view.position[view.rows["Ego"], :2].tolist() == pytest.approx([130.5, -3.0])


def test_actions_of_init_keep_their_order_while_the_first_awaits_an_entity(run: Run) -> None:
    """Other is placed after Ego: the distance sets 10 m/s, from which the speed falls to 2 m/s in 4 s."""
    beside_it = distance("Lateral", 3).replace('continuous="false"', 'continuous="true"')
    actions = (distance("Longitudinal", 20), speed_xml(2, 4.0), beside_it, change(lane(-2)))
    played = run(4.5, driven=False, init=init_xml("Ego", *actions), others={"Other": (-2, 150.0, 10.0)})
    halfway, end = (played.frames[round(time / 0.05)].view for time in (2.0, 4.0))
    assert halfway.speed[halfway.rows["Ego"]] == pytest.approx(6.0)
    assert end.position[end.rows["Ego"], 1] == pytest.approx(-6.0, abs=1e-6)


def test_lateral_step_between_teleport_and_lane_change_starts_from_its_place(scene: RunScene) -> None:
    """The three actions start together: 1 m left of lane -2, from there linearly to lane -1."""
    steps = (teleport_xml(lane_position_xml(-2, 100.0)), STEP_ASIDE, change(lane(-1)))
    played = scene(4, *(("Ego", action) for action in steps))
    assert (played.at(0.1).y, played.at(4.0).y) == pytest.approx((-5.0, -2.0))


@pytest.mark.parametrize("order", [1, -1])
def test_teleport_delays_a_lane_change_by_distance_by_its_step(scene: RunScene, order: int) -> None:
    """2 m per step on the slope of 1 in 10; the step from 1.0 s on, onto the own place, covers no distance."""
    here = teleport_xml(world_position_xml(119.9, -3.99))
    steps = [("Ego", change(lane(-2), dimension="distance", value=40.0)), ("Ego", here, after(0.95))]
    played = scene(3, *steps[::order])
    for time, distance_on_slope in ((1.0, 20.0), (1.1, 20.0), (2.1, 40.0)):
        assert played.at(time).y == pytest.approx(-2.0 - distance_on_slope / math.hypot(1.0, 10.0), abs=1e-3)
    assert played.at(2.2).y == pytest.approx(-6.0)


def test_lane_change_by_rate_keeps_its_rate_after_a_teleport(scene: RunScene) -> None:
    """At 2.0 s the actor returns to y = -2, where the next view shows it: 4 m at 1 m/s from there."""
    steps = [("Ego", change(lane(-2), dimension="rate", value=1.0))]
    played = scene(7, *steps, ("Ego", teleport_xml(lane_position_xml(-1, 150.0)), after(1.95)))
    assert [played.at(time).y for time in (2.1, 4.1)] == pytest.approx([-2.0, -4.0])
    assert played.when("action 0", "completeState") == pytest.approx(6.1)


@pytest.mark.element("LaneOffsetAction")
def test_lane_offset_respects_the_lateral_acceleration(scene: RunScene) -> None:
    """Cubic over 1 m at 1.5 m/s²: √(6 / 1.5) = 2 s."""
    played = scene(3, ("Ego", offset('<AbsoluteTargetLaneOffset value="1"/>')))
    assert played.at(1.0).y == pytest.approx(-1.5)
    assert played.at(2.0).y == pytest.approx(-1.0)
    assert played.when("action 0", "completeState") == pytest.approx(2.0)


@pytest.mark.element("LaneOffsetAction")
@pytest.mark.parametrize(("stopped", "center"), [(1.0, -2.0), (3.0, -6.0)])
@pytest.mark.parametrize("number", ["-2", "1"])
def test_offset_after_a_stopped_lane_change_refers_to_the_current_lane(
    scene: RunScene, stopped: float, center: float, number: str
) -> None:
    """The change over 4 m takes 4 s: before its half the actor is in its old lane, after it in the new one."""
    to_center = offset('<AbsoluteTargetLaneOffset value="0"/>')
    played = scene(8, ("Ego", change(lane(number))), ("Ego", to_center, after(stopped - 0.05)))
    side = 1.0 if number == "-2" else -1.0
    assert played.at(8.0).y == pytest.approx(-2.0 + side * (center + 2.0))
    assert played.at(8.0).yaw == pytest.approx(0.0)


@pytest.mark.element("LaneOffsetAction")
def test_lane_offset_continuous_and_relative_follows_the_reference(scene: RunScene) -> None:
    played = scene(
        6,
        ("Other", change(lane(-2), "linear", "time", 3)),
        ("Ego", offset('<RelativeTargetLaneOffset entityRef="Other" value="1"/>', "true", "")),
    )
    assert played.at(0.1).y == pytest.approx(-1.0)
    assert played.at(5.0).y == pytest.approx(-5.0)
    assert played.when("action 1", "completeState") is None


@pytest.mark.element("LaneOffsetAction")
def test_lane_offset_is_kept_within_the_lateral_acceleration(scene: RunScene) -> None:
    """Other moves 4 m aside at once. At 1 m/s² the fastest motion to standstill takes 2 √(4 / 1) = 4 s, half of it 2 s.

    The limit applies "to initially reach and afterwards keep the lane offset" (1.3.1, LaneOffsetActionDynamics).
    """
    follow = offset('<RelativeTargetLaneOffset entityRef="Other" value="0"/>', "true", 'maxLateralAcc="1"')
    played = scene(7, ("Ego", follow), ("Other", teleport_xml(lane_position_xml(-2, 300)), after(0.95)))
    assert played.at(3.1).y == pytest.approx(-4.0, abs=0.2)
    assert played.at(5.3).y == pytest.approx(-6.0, abs=1e-6)
    y = [row["Ego"].y for row in played.rows]
    rates = [(last - first) / 0.1 for first, last in pairwise(y)]
    assert max(abs(last - first) / 0.1 for first, last in pairwise(rates)) < 1.0 + 1e-6


@pytest.mark.element("LaneOffsetAction")
@pytest.mark.parametrize(("shape", "time"), [("sinusoidal", 2.0), ("linear", 2.0), ("cubic", 6.0)])
@pytest.mark.parametrize("dt", [0.02, 0.1])
def test_lane_offset_relative_does_not_pass_its_reference(scene: RunScene, shape: str, time: float, dt: float) -> None:
    """Other moves 4 m aside, at up to 2 · (π / 2)² = 4.9 m/s² or at once: Ego is late by its limit of 3 m/s².

    A cubic in 6 s needs 6 · 4 / 6² = 0.67 m/s²: Ego has the offset of Other in the step before.
    """
    follow = offset('<RelativeTargetLaneOffset entityRef="Other" value="0"/>', "true", 'maxLateralAcc="3"')
    other = change(lane(-2), shape, "time", time)
    played = scene(9, ("Ego", follow), ("Other", other, after(0.5)), dt=dt)
    y = [row["Ego"].y for row in played.rows]
    rates = [(last - first) / dt for first, last in pairwise(y)]
    assert max(abs(last - first) / dt for first, last in pairwise(rates)) < 3.0 + 1e-6
    assert min(y) == y[-1] == pytest.approx(-6.0)
    if shape == "cubic":
        assert y[1:] == pytest.approx([row["Other"].y for row in played.rows[:-1]], abs=1e-6)


@pytest.mark.element("LateralDistanceAction")
def test_lateral_distance_is_reached_at_the_maximum_speed(scene: RunScene) -> None:
    action = """<PrivateAction><LateralAction><LateralDistanceAction entityRef="Other" distance="3" freespace="false"
      continuous="false" coordinateSystem="lane" displacement="leftToReferencedEntity">
      <DynamicConstraints maxSpeed="1"/></LateralDistanceAction></LateralAction></PrivateAction>"""
    played = scene(5, ("Ego", action))
    assert played.at(1.1).y == pytest.approx(-1.0)
    assert played.at(4.0).y == pytest.approx(1.0, abs=0.02)
    assert played.at(4.0).yaw == 0.0, "after the end, Ego drives along the lane"


@pytest.mark.parametrize("continuous", ["false", "true"])
def test_lateral_distance_without_limits_is_immediate(scene: RunScene, continuous: str) -> None:
    """The jump takes nothing of the distance along the lane, as a step of a lane change: x = 100 + 20 t."""
    action = f"""<PrivateAction><LateralAction><LateralDistanceAction entityRef="Other" distance="3" freespace="false"
      continuous="{continuous}" coordinateSystem="lane" displacement="leftToReferencedEntity"/></LateralAction>
      </PrivateAction>"""
    played = scene(1, ("Ego", action))
    assert (played.at(0.1).x, played.at(0.1).y, played.at(0.1).yaw) == pytest.approx((102.0, 1.0, 0.0))


@pytest.mark.element("LateralDistanceAction")
def test_lateral_distance_with_free_space_is_between_the_sides(scene: RunScene) -> None:
    """Two cars of 2 m width have centers 2.5 m apart. With an acceleration limit the motion is that of a spring."""
    action = """<PrivateAction><LateralAction><LateralDistanceAction entityRef="Other" distance="0.5" freespace="true"
      continuous="true" coordinateSystem="lane" displacement="rightToReferencedEntity">
      <DynamicConstraints maxAcceleration="4"/></LateralDistanceAction></LateralAction></PrivateAction>"""
    played = scene(12, ("Ego", action))
    assert min(row["Ego"].y for row in played.rows) > -4.5 - 1e-3
    assert played.at(12.0).y == pytest.approx(-4.5, abs=1e-3)
    assert played.at(12.0).yaw == pytest.approx(0.0, abs=1e-3)


@pytest.mark.element("TeleportAction")
def test_teleport_is_visible_in_the_next_view(scene: RunScene) -> None:
    action = """<PrivateAction><TeleportAction><Position><LanePosition roadId="1" laneId="1" s="500"/></Position>
      </TeleportAction></PrivateAction>"""
    played = scene(1, ("Ego", action))
    assert (played.at(0.1).x, played.at(0.1).y) == pytest.approx((500.0, 2.0))
    assert played.at(0.2).x == pytest.approx(498.0)


def test_trajectory_without_timing_holds_the_lateral_domain_only(scene: RunScene) -> None:
    step = speed_xml(5)
    later = after(0.15)
    played = scene(2, ("Ego", follow_points(CORNER)), ("Ego", step, later), ("Ego", change(lane(-2)), later))
    assert played.at(0.3).speed == 5.0
    assert played.when("action 0", "completeState") == pytest.approx(0.2)


@pytest.mark.element("LateralDistanceAction")
def test_lateral_distance_in_entity_frame_does_not_oscillate(scene: RunScene) -> None:
    """Both drive side by side; 2.5 m between cars of 2 m width: centers 4.5 m apart, at once and constantly.

    Other faces the other way, so that its left is to the right of Ego.
    """
    action = """<PrivateAction><LateralAction><LateralDistanceAction entityRef="Other" distance="2.5" freespace="true"
      continuous="true" coordinateSystem="entity" displacement="leftToReferencedEntity"/>
      </LateralAction></PrivateAction>"""
    played = scene(5, ("Ego", action), ego=(-1, 100.0, 20.0), other=(1, 100.0, -20.0))
    assert [row["Ego"].y for row in played.rows[1:]] == pytest.approx([played.at(0.0, "Other").y - 4.5] * 50)
    assert [row["Ego"].yaw for row in played.rows[2:]] == pytest.approx([0.0] * 49, abs=1e-6)


def test_preempted_init_trajectory_is_no_longer_followed(run: Run) -> None:
    """After the preemption no condition can measure along the trajectory."""
    followed: dict[float, bool] = {}

    def look(simulation: Simulation, frame: Frame) -> None:
        followed[round(frame.view.time, 3)] = simulation.storyboard.context.actors["Ego"].trajectory is not None

    aside = offset('<AbsoluteTargetLaneOffset value="1"/>')
    init = f'<Private entityRef="Ego">{follow_points(CORNER)}</Private>'
    run(1, ("Ego", aside, after(0.45)), driven=False, init=init, during=look)
    assert followed[0.4]
    assert not followed[0.6]


def test_lane_change_in_a_chain_after_a_deletion_replaces_a_trajectory(scene: RunScene) -> None:
    """The deletion at 0.3 s stops the action of Other, and the lane change starts: 4 m in 4 s."""
    delete = global_xml('<EntityAction entityRef="Other"><DeleteEntityAction/></EntityAction>')
    stopped = element_state_xml("action", "action 1", "stopTransition")
    way = follow_points([(100.0, -2.0, None), (400.0, -2.0, None)])
    chain = (("Ego", delete, after(0.25)), ("Ego", change(lane(-2)), stopped))
    played = scene(4.5, ("Ego", way), ("Other", speed_xml(15, 9)), *chain)
    assert [played.at(time).y for time in (0.4, 2.3, 4.3)] == pytest.approx([-2.1, -4.0, -6.0])


def test_lane_offset_relative_to_the_actor_itself_refers_to_its_start(scene: RunScene) -> None:
    """A continuous offset of 1 m from the own position at the start is y = -1 m."""
    offset = """<PrivateAction><LateralAction><LaneOffsetAction continuous="true">
      <LaneOffsetActionDynamics dynamicsShape="cubic" maxLateralAcc="1"/><LaneOffsetTarget>
      <RelativeTargetLaneOffset entityRef="Ego" value="1"/></LaneOffsetTarget></LaneOffsetAction></LateralAction>
      </PrivateAction>"""
    played = scene(8, ("Ego", offset))
    assert [played.at(time).y for time in (4.0, 6.0, 8.0)] == pytest.approx([-1.0] * 3)


@pytest.mark.parametrize("target", [lane(-2), beside(-1)], ids=["absolute", "relative"])
def test_lane_change_after_a_teleport_ends_in_its_target_lane(scene: RunScene, target: str) -> None:
    """After the teleport at 1 s to the center of lane -1, 4 m remain for the remaining 2.9 s of the transition."""
    teleport = (
        '<PrivateAction><TeleportAction><Position><LanePosition roadId="1" laneId="-1" s="500"/></Position>'
        "</TeleportAction></PrivateAction>"
    )
    played = scene(5, ("Ego", change(target)), ("Ego", teleport, after(0.95)))
    assert played.at(1.1).y == pytest.approx(-2.0)
    assert played.at(2.6).y == pytest.approx(-4.0, abs=0.1)
    assert played.when("action 0", "completeState") == pytest.approx(4.0)
    assert played.at(4.0).y == pytest.approx(-6.0)


@pytest.mark.parametrize("change", [False, True])
def test_lateral_transition_continues_from_the_place_of_a_teleport(scene: RunScene, change: bool) -> None:
    """After 1 s Ego is moved to 1 m on the right of the center of its lane, y = -2 m, and continues to the left."""
    offset = """<PrivateAction><LateralAction><LaneOffsetAction continuous="false">
      <LaneOffsetActionDynamics dynamicsShape="cubic" maxLateralAcc="0.5"/><LaneOffsetTarget>
      <AbsoluteTargetLaneOffset value="1.5"/></LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>"""
    lane = """<PrivateAction><LateralAction><LaneChangeAction>
      <LaneChangeActionDynamics dynamicsShape="cubic" dynamicsDimension="time" value="6"/>
      <LaneChangeTarget><AbsoluteTargetLane value="1"/></LaneChangeTarget></LaneChangeAction></LateralAction>
      </PrivateAction>"""
    teleport = """<PrivateAction><TeleportAction><Position><LanePosition roadId="1" laneId="{}" s="500" offset="{}"/>
      </Position></TeleportAction></PrivateAction>""".format(*((1, -5.0) if change else (-1, -1.0)))
    played = scene(10, ("Ego", lane if change else offset), ("Other", NOTHING), ("Ego", teleport, after(1.0)))
    rows = [row["Ego"] for row in played.rows]
    moved = next(index for index, (one, two) in enumerate(pairwise(rows)) if two.x - one.x > 100.0) + 1
    assert rows[moved].y == pytest.approx(-3.0)
    assert all(-1e-9 <= two.y - one.y < 0.2 for one, two in pairwise(rows[moved:]))
    assert rows[-1].y == pytest.approx(2.0 if change else -0.5, abs=1e-6)


@pytest.mark.element("LaneChangeAction")
@pytest.mark.parametrize(
    ("speed", "action", "warning"),
    [
        (1.0, change(lane(-2), value=2.0), "takes longer than requested: the lateral speed is at most the forward"),
        (0.0, change(lane(-2), value=2.0), "waits while the actor stands"),
        (20.0, change(lane(-2), "cubic", value=1.0).replace(*FOLLOW), "maxSteering and maxDeceleration limit"),
        (20.0, change(lane(-2), value=2.0), None),
        (0.0, change(lane(-2), dimension="distance", value=20.0), None),
        (20.0, change(lane(-2), "step", value=0.0).replace(*FOLLOW), None),
    ],
)
def test_lane_change_delayed_by_a_limit_warns(run: Run, speed: float, action: str, warning: str | None) -> None:
    played = run(4.0, ("Ego", action), driven=False, ego=(-1, 100.0, speed))
    texts = [str(one) for one in played.result.warnings if "LaneChangeAction" in str(one)]
    assert len(texts) == (warning is not None)
    assert warning is None or warning in texts[0]


THREE_METERS = 'freespace="false" distance="3"'


def keep_beside(distance: str, limits: str = "", frame: str = "road") -> str:
    return f"""<PrivateAction><LateralAction><LateralDistanceAction entityRef="Other" continuous="true" {distance}
      coordinateSystem="{frame}">{limits}</LateralDistanceAction></LateralAction></PrivateAction>"""


def keep_apart(displacement: str, frame: str = "road") -> str:
    return f"""<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="Other" continuous="true"
      freespace="false" distance="20" coordinateSystem="{frame}" displacement="{displacement}"/></LongitudinalAction>
      </PrivateAction>"""


@pytest.mark.element("LateralDistanceAction", "LongitudinalDistanceAction")
@pytest.mark.parametrize(
    ("action", "before", "behind"),
    [
        (
            keep_beside('freespace="false" distance="3" displacement="leftToReferencedEntity"'),
            (None, 1.0),
            (None, -5.0),
        ),
        (
            keep_beside('freespace="false" distance="3" displacement="rightToReferencedEntity"'),
            (None, -5.0),
            (None, 1.0),
        ),
        (keep_beside('freespace="false" distance="3"'), (None, 1.0), (None, 1.0)),
        (
            # 1 m between boxes of 2 m at up to 4 m/s
            keep_beside(
                'freespace="true" distance="1" displacement="leftToReferencedEntity"',
                '<DynamicConstraints maxSpeed="4"/>',
            ),
            (None, 1.0),
            (None, -5.0),
        ),
        (keep_apart("trailingReferencedEntity"), (130.0, None), (170.0, None)),
        (keep_apart("leadingReferencedEntity"), (170.0, None), (130.0, None)),
    ],
)
def test_displacement_follows_the_heading_of_the_reference_in_each_step(
    scene: RunScene, action: str, before: tuple[float | None, ...], behind: tuple[float | None, ...]
) -> None:
    """Other stands at (150, -2) and turns around at 3 s."""
    turned = lane_position_xml(-1, 150.0, inside='<Orientation type="relative" h="3.141592653589793"/>')
    steps = (("Ego", action), ("Other", teleport_xml(turned), after(2.95)))
    played = scene(6, *steps, ego=(-1, 100.0, 8.0), other=(-1, 150.0, 0.0))
    for time, expected in ((3.0, before), (6.0, behind)):
        place = played.at(time)
        for value, wanted in zip((place.x, place.y), expected, strict=True):
            assert wanted is None or value == pytest.approx(wanted, abs=1e-6)


@pytest.mark.element("LateralDistanceAction")
@pytest.mark.parametrize("frame", ["entity", "lane", "road"])
@pytest.mark.parametrize("limit", ["", "maxSpeed", "maxAcceleration"])
def test_lateral_distance_of_a_wrong_way_actor_is_reached(scene: RunScene, frame: str, limit: str) -> None:
    """Ego faces against lane -1, 4 m beside Other in lane -2 (y = -6): 3 m are y = -3."""
    turned = teleport_xml(lane_position_xml(-1, 500.0, inside=f'<Orientation type="relative" h="{math.pi}"/>'))
    limits = f'<DynamicConstraints {limit}="4"/>' if limit else ""
    action = keep_beside(THREE_METERS, limits, frame)
    played = scene(8, ("Ego", turned), ("Ego", action, after(0.35)), other=(-2, 300.0, 0.0))
    assert played.at(8.0).x == pytest.approx(342.0, abs=0.5)
    assert played.at(8.0).y == pytest.approx(-3.0, abs=0.01)


@pytest.mark.element("LateralDistanceAction")
@pytest.mark.parametrize(
    ("action", "lane", "y"),
    [
        (keep_beside(THREE_METERS), -1, 1.0),
        (keep_beside(THREE_METERS), 1, -1.0),
        (keep_beside('freespace="true" distance="1"'), -1, -4.5),
        (keep_beside('freespace="true" distance="1"'), 1, -1.5),
    ],
)
def test_lateral_distance_between_boxes_beside_their_reference_points(
    scene: RunScene, monkeypatch: pytest.MonkeyPatch, action: str, lane: int, y: float
) -> None:
    """The box of Other is centered 0.5 m to the left of its reference point: at y = -1.5, or at 1.5 in lane 1.

    With a gap of 1 m the centers of both boxes of 2 m are 3 m apart. Ego stays on the side of its center.
    """

    def car(name: str, controller: str = "", **limits: Any) -> str:
        xml = round_car_xml(name, controller, **limits)
        return xml.replace('<Center x="1.5" y="0"', '<Center x="1.5" y="0.5"') if name == "Other" else xml

    monkeypatch.setattr("recorded_scene.round_car_xml", car)
    assert scene(1, ("Ego", action), other=(lane, 300.0, 0.0)).at(1.0).y == pytest.approx(y)


@pytest.mark.element("LateralDistanceAction", "LongitudinalDistanceAction")
@pytest.mark.parametrize("lane", [-1, 1])
@pytest.mark.parametrize(
    ("action", "x", "y"),
    [
        (keep_beside(THREE_METERS, frame="world"), None, -3.0),
        (keep_beside(f'{THREE_METERS} displacement="rightToReferencedEntity"', frame="world"), None, -9.0),
        (keep_apart("trailingReferencedEntity", "world"), -20.0, None),
        (keep_apart("leadingReferencedEntity", "world"), 20.0, None),
    ],
)
def test_distances_along_world_axes_are_kept_in_both_directions(
    scene: RunScene, action: str, lane: int, x: float | None, y: float | None
) -> None:
    """Other stands in lane -2 (y = -6) and faces +x, Ego passes it to +x in lane -1 and to -x in lane 1."""
    played = scene(4, ("Ego", action), ego=(lane, 500.0, 10.0), other=(-2, 500.0, 0.0))
    assert x is None or played.at(4.0).x == pytest.approx(500.0 + x)
    assert y is None or played.at(4.0).y == pytest.approx(y)


@pytest.mark.element("LateralDistanceAction", "LongitudinalDistanceAction")
@pytest.mark.parametrize("degrees", [60.0, 120.0, -60.0])
def test_distances_along_world_axes_are_kept_on_oblique_roads(scene: RunScene, degrees: float) -> None:
    """At 60° to x, 20 m along x are 40 m of road, and 3 m along y are 6 m across it. Ego is beside and behind Other."""
    oblique = map_xml(road_xml(length=1000.0, hdg=math.radians(degrees), lanes=lanes_xml(1, 2, 4)))
    beside, apart = keep_beside(THREE_METERS, frame="world"), keep_apart("trailingReferencedEntity", "world")
    cars: dict[str, Any] = {"ego": (-1, 100.0, 10.0), "other": (-2, 150.0, 10.0), "street": oblique}
    scenes = [scene(1, ("Ego", action), **cars) for action in (beside, apart)]
    offsets = [(played.at(1.0), played.at(1.0, "Other")) for played in scenes]
    assert abs(offsets[0][1].y - offsets[0][0].y) == pytest.approx(3.0)
    assert offsets[1][1].x - offsets[1][0].x == pytest.approx(math.copysign(20.0, math.cos(math.radians(degrees))))


def test_distances_across_the_motion_have_no_effect(scene: RunScene) -> None:
    north = map_xml(road_xml(length=1000.0, hdg=0.5 * math.pi, lanes=lanes_xml(1, 2, 4)))
    steps = [("Ego", keep_beside(THREE_METERS, frame="world")), ("Ego", keep_apart("any", "world"))]
    ego = scene(2, *steps, street=north).at(2.0)
    assert (ego.x, ego.y) == pytest.approx((2.0, 140.0))


OFF_ROAD = [(-30, -2), (100, -90)]
"""Before the start of the road, and 82 m beside it."""


@pytest.mark.parametrize("action", [change(lane(-2)), offset('<AbsoluteTargetLaneOffset value="0.5"/>')])
@pytest.mark.parametrize(("x", "y"), OFF_ROAD)
def test_lateral_action_outside_the_road_is_an_error(scene: RunScene, action: str, x: float, y: float) -> None:
    with pytest.raises(ScenarioError, match="'Ego' is off the road at the start; place the actor on a lane first"):
        scene(2, ("Ego", teleport_xml(world_position_xml(x, y))), ("Ego", action, after(0.5)))


@pytest.mark.parametrize(("x", "y"), OFF_ROAD)
def test_lateral_distance_outside_the_road_is_a_warning(run: Run, x: float, y: float) -> None:
    action, beside = keep_beside('distance="1" freespace="true"'), {"Other": (-1, 150.0, 10.0)}
    steps = ("Ego", teleport_xml(world_position_xml(x, y))), ("Ego", action, after(0.5))
    played = run(2.0, *steps, driven=False, others=beside)
    assert any("no effect on 'Ego', which is off the road" in str(text) for text in played.result.warnings)

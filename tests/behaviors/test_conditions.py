"""Conditions with values calculated by hand.

Ego drives at 20 m/s from x = 100 in lane -1, Other at 10 m/s from x = 150 ahead of it.
"""

from __future__ import annotations

import pytest
from eidrive_behaviors.conditions.values import satisfies
from recorded_scene import RecordedScene, RunScene
from street_scene import after

from eidrive_scenario.api.actions import model, satisfies_rule

NOTHING = '<PrivateAction><VisibilityAction graphics="true" sensors="true" traffic="true"/></PrivateAction>'


def of(condition: str, entity: str = "Ego", rule: str = "any") -> str:
    names = "".join(f'<EntityRef entityRef="{name}"/>' for name in entity.split())
    return f"""<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="{rule}">{names}</TriggeringEntities>
      <EntityCondition>{condition}</EntityCondition></ByEntityCondition>"""


def first(played: RecordedScene) -> float | None:
    return played.when("event 0", "runningState")


def starts(played: RecordedScene) -> list[float]:
    return [one.time for one in played.changes if one.element == "event 0" and one.after.value == "runningState"]


def aside(offset: float) -> str:
    return f"""<PrivateAction><LateralAction><LaneOffsetAction continuous="false">
      <LaneOffsetActionDynamics dynamicsShape="step"/>
      <LaneOffsetTarget><AbsoluteTargetLaneOffset value="{offset}"/></LaneOffsetTarget></LaneOffsetAction>
      </LateralAction></PrivateAction>"""


def speed(value: float, seconds: float) -> str:
    return f"""<PrivateAction><LongitudinalAction><SpeedAction>
      <SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="time" value="{seconds}"/>
      <SpeedActionTarget><AbsoluteTargetSpeed value="{value}"/></SpeedActionTarget></SpeedAction></LongitudinalAction>
      </PrivateAction>"""


@pytest.mark.element(
    "CollisionCondition",
    "TimeHeadwayCondition",
    "TimeToCollisionCondition",
    "TraveledDistanceCondition",
    "ReachPositionCondition",
    "DistanceCondition",
    "RelativeDistanceCondition",
)
@pytest.mark.parametrize(
    ("condition", "time"),
    [
        # 50 m less 10 m/s · t; headways at 20 m/s; both reach 4 m ahead and 1 m behind
        ('<RelativeDistanceCondition entityRef="Other" freespace="false" relativeDistanceType="longitudinal" '
         'rule="lessThan" value="29.5"/>', 2.1),
        ('<RelativeDistanceCondition entityRef="Other" freespace="true" relativeDistanceType="longitudinal" '
         'coordinateSystem="lane" rule="lessThan" value="29.5"/>', 1.6),
        ('<RelativeDistanceCondition entityRef="Other" freespace="false" relativeDistanceType="euclidianDistance" '
         'rule="lessOrEqual" value="30"/>', 2.0),
        ('<TimeHeadwayCondition entityRef="Other" freespace="false" rule="lessThan" value="1.495" '
         'relativeDistanceType="longitudinal" coordinateSystem="road"/>', 2.1),
        ('<TimeToCollisionCondition freespace="true" rule="lessThan" value="2.45" coordinateSystem="lane" '
         'relativeDistanceType="longitudinal"><TimeToCollisionConditionTarget><EntityRef entityRef="Other"/>'
         "</TimeToCollisionConditionTarget></TimeToCollisionCondition>", 2.1),
        ('<DistanceCondition freespace="false" rule="lessThan" value="49" coordinateSystem="road" '
         'relativeDistanceType="longitudinal"><Position><LanePosition roadId="1" laneId="-1" s="200"/></Position>'
         "</DistanceCondition>", 2.6),
        ('<ReachPositionCondition tolerance="5"><Position><LanePosition roadId="1" laneId="-2" s="150"/></Position>'
         "</ReachPositionCondition>", 2.4),
        ('<TraveledDistanceCondition value="39.9"/>', 2.0),
        ('<CollisionCondition><EntityRef entityRef="Other"/></CollisionCondition>', 4.5),
        ('<CollisionCondition><ByType type="vehicle"/></CollisionCondition>', 4.5),
    ],
)  # fmt: skip
def test_distance_conditions_hold_at_the_calculated_times(scene: RunScene, condition: str, time: float) -> None:
    assert first(scene(6, ("Ego", NOTHING, of(condition)))) == pytest.approx(time)


TURN = """<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="turn" closed="false">
  <Shape><Polyline><Vertex><Position><WorldPosition x="100" y="-2"/></Position></Vertex>
  <Vertex><Position><WorldPosition x="110" y="-2"/></Position></Vertex>
  <Vertex><Position><WorldPosition x="110" y="28"/></Position></Vertex></Polyline></Shape></Trajectory></TrajectoryRef>
  <TimeReference><None/></TimeReference><TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction>
  </RoutingAction></PrivateAction>"""


@pytest.mark.parametrize(
    ("kind", "value", "time"),
    [("longitudinal", 11, 1.0), ("longitudinal", 1, 1.5), ("lateral", 3.5, 0.1), ("lateral", 2.5, None)],
)
def test_distance_in_trajectory_frame_is_measured_along_the_trajectory(
    scene: RunScene, kind: str, value: float, time: float | None
) -> None:
    """The position is 20 m behind the corner and 3 m to the left: 30 m at first, 2 m less in each step of 0.1 s.

    Before the action starts it is 7 m ahead and 20 m to the left.
    """
    condition = of(
        f'<DistanceCondition value="{value}" rule="lessThan" freespace="false" relativeDistanceType="{kind}" '
        'coordinateSystem="trajectory"><Position><WorldPosition x="107" y="18"/></Position></DistanceCondition>'
    )
    played = scene(1.9, ("Ego", NOTHING, condition), ("Ego", TURN), edge="rising")
    assert first(played) == (None if time is None else pytest.approx(time))


@pytest.mark.element("AccelerationCondition", "StandStillCondition", "SpeedCondition", "RelativeSpeedCondition")
@pytest.mark.parametrize(
    ("condition", "time"),
    [
        ('<SpeedCondition rule="lessThan" value="10.5"/>', 2.0),
        ('<SpeedCondition rule="lessThan" value="10.5" direction="longitudinal"/>', 2.0),
        ('<RelativeSpeedCondition entityRef="Other" rule="lessThan" value="0.5"/>', 2.0),
        ('<AccelerationCondition rule="greaterThan" value="4.9"/>', 0.1),
        ('<AccelerationCondition rule="lessThan" value="-4.9" direction="longitudinal"/>', 0.1),
        ('<StandStillCondition duration="0.95"/>', 5.0),
    ],
)
def test_motion_conditions_during_braking_hold_at_the_calculated_times(
    scene: RunScene, condition: str, time: float
) -> None:
    """The deceleration is 5 m/s²; Ego stands at 4 s."""
    played = scene(6, ("Ego", NOTHING, of(condition)), ("Ego", speed(0, 4)), other=(-2, 150, 10))
    assert first(played) == pytest.approx(time)


def test_speed_condition_with_direction_explains_the_direction(scene: RunScene) -> None:
    slow = '<SpeedCondition rule="lessThan" value="1" direction="lateral"/>'
    assert "lateral speed 0" in scene(1, ("Ego", NOTHING, of(slow))).why("event 0")


@pytest.mark.element("triggeringEntitiesRule")
def test_triggering_entities_rule_any_and_all(scene: RunScene) -> None:
    fast = '<SpeedCondition rule="greaterThan" value="15"/>'
    assert first(scene(1, ("Ego", NOTHING, of(fast, "Ego Other", "any")))) == 0.0
    assert first(scene(1, ("Ego", NOTHING, of(fast, "Ego Other", "all")))) is None


def test_conditions_on_absent_entity_are_false(scene: RunScene) -> None:
    gone = '<GlobalAction><EntityAction entityRef="Other"><DeleteEntityAction/></EntityAction></GlobalAction>'
    near = of(
        '<RelativeDistanceCondition entityRef="Other" freespace="false" relativeDistanceType="longitudinal" '
        'rule="lessThan" value="29.5"/>'
    )
    played = scene(
        4,
        ("Ego", gone),
        ("Ego", NOTHING, f"{near}"),
        ("Ego", NOTHING, of('<TraveledDistanceCondition value="5"/>', "Other")),
    )
    assert played.when("event 1", "runningState") is None
    assert played.when("event 2", "runningState") is None


@pytest.mark.element("TimeToCollisionCondition")
@pytest.mark.parametrize(
    ("frame", "kind"),
    [("world", "longitudinal"), ("world", "lateral"), ("entity", "longitudinal"), ("entity", "lateral")],
)
def test_time_to_collision_uses_the_axis_of_the_distance(scene: RunScene, frame: str, kind: str) -> None:
    """Ego is at 100 m towards +y at 20 m/s, Other at 50 m towards +x at 10 m/s: 5 s, of which 4 s remain after 1 s."""
    condition = of(
        f'<TimeToCollisionCondition freespace="false" rule="lessOrEqual" value="4" coordinateSystem="{frame}" '
        f'relativeDistanceType="{kind}"><TimeToCollisionConditionTarget><EntityRef entityRef="Other"/>'
        "</TimeToCollisionConditionTarget></TimeToCollisionCondition>"
    )
    across = """<PrivateAction><TeleportAction><Position><WorldPosition x="300" y="-102" h="1.5707963267948966"/>
      </Position></TeleportAction></PrivateAction>"""
    played = scene(3, ("Ego", NOTHING, condition), ("Ego", across), ego=(-1, 900, 20), other=(-1, 249, 10))
    assert first(played) == pytest.approx(1.1)


def test_time_headway_of_standing_entity_is_infinite(scene: RunScene) -> None:
    condition = '<TimeHeadwayCondition entityRef="Other" freespace="false" rule="greaterThan" value="1000"/>'
    assert first(scene(0.5, ("Ego", NOTHING, of(condition)), ego=(-1, 100, 0))) == 0.0


def test_time_to_collision_of_departing_entity_is_undefined(scene: RunScene) -> None:
    condition = (
        '<TimeToCollisionCondition freespace="false" rule="greaterThan" value="0"><TimeToCollisionConditionTarget>'
        '<EntityRef entityRef="Other"/></TimeToCollisionConditionTarget></TimeToCollisionCondition>'
    )
    assert first(scene(1, ("Ego", NOTHING, of(condition)), ego=(-1, 100, 5))) is None


@pytest.mark.element("EndOfRoadCondition", "OffroadCondition")
def test_end_of_road_and_offroad_hold_after_their_durations(scene: RunScene) -> None:
    """From 5 m before the end at 20 m/s Ego is there at 0.3 s. It is off the road from 4 m beside the road."""
    end = of('<EndOfRoadCondition duration="0.5"/>')
    assert first(scene(2, ("Ego", NOTHING, end), ego=(-1, 995, 20))) == pytest.approx(0.8)
    off = of('<OffroadCondition duration="0.35"/>')
    assert first(scene(2, ("Ego", NOTHING, off), ("Ego", aside(-7)))) == pytest.approx(0.5)


def test_offroad_duration_after_return_restarts_without_evaluation(scene: RunScene) -> None:
    """The event runs from 0.5 s to 1.5 s; Ego is off the road again at 1.3 s."""
    off = of('<OffroadCondition duration="0.35"/>')
    ways = (("Ego", aside(-7)), ("Ego", aside(0), after(0.65)), ("Ego", aside(-7), after(1.15)))
    played = scene(2.5, ("Ego", speed(20, 1), off), *ways, executions=2)
    assert starts(played) == pytest.approx([0.5, 1.7])


def test_standstill_duration_after_reentry_restarts(scene: RunScene) -> None:
    """Other is deleted at 0.5 s, added at 2.0 s and visible at 2.1 s."""
    entity = '<GlobalAction><EntityAction entityRef="Other">{}</EntityAction></GlobalAction>'
    back = """<AddEntityAction><Position><LanePosition roadId="1" laneId="-1" s="500"/></Position></AddEntityAction>"""
    away = ("Ego", entity.format("<DeleteEntityAction/>"), after(0.45))
    still = of('<StandStillCondition duration="0.95"/>', "Other")
    played = scene(4, ("Ego", NOTHING, still), away, ("Ego", entity.format(back), after(1.95)), other=(-2, 150.0, 0.0))
    assert first(played) == pytest.approx(3.1)


@pytest.mark.element("AngleCondition", "RelativeAngleCondition")
def test_angle_conditions_in_world_lane_and_relative_hold(scene: RunScene) -> None:
    turn = """<PrivateAction><TeleportAction><Position><WorldPosition x="300" y="-2" h="{}"/></Position>
      </TeleportAction></PrivateAction>"""
    world = of('<AngleCondition angleType="heading" angle="0.5" angleTolerance="0.1" coordinateSystem="world"/>')
    lane = of('<AngleCondition angleType="heading" angle="0.5" angleTolerance="0.1" coordinateSystem="lane"/>')
    other = of('<RelativeAngleCondition entityRef="Other" angleType="heading" angle="-2.64" angleTolerance="0.01"/>')
    for condition in (world, lane, other):
        played = scene(0.5, ("Ego", NOTHING, condition), ("Ego", turn.format(0.5)), other=(1, 150, 0))
        assert first(played) == pytest.approx(0.1)
        assert first(scene(0.5, ("Ego", NOTHING, condition), ("Ego", turn.format(0.9)), other=(1, 150, 0))) is None


@pytest.mark.element("AngleCondition")
@pytest.mark.parametrize(
    ("frame", "angle", "times"),
    [
        ("entity", 0.0, (0.0, 0.0)),
        ("entity", 1.571, (None, None)),
        ("trajectory", 0.0, (0.0, 0.0)),
        ("world", 1.571, (0.6, None)),
    ],
)
def test_angle_in_entity_and_trajectory_frame(
    scene: RunScene, frame: str, angle: float, times: tuple[float | None, float | None]
) -> None:
    """The trajectory has a corner at 0.5 s, rounded within 2 m; the second run has none."""
    condition = of(
        f'<AngleCondition angleType="heading" angle="{angle}" angleTolerance="0.001" coordinateSystem="{frame}"/>'
    )
    for actions, time in zip(((("Ego", TURN),), ()), times, strict=True):
        found = first(scene(1.5, ("Ego", NOTHING, condition), *actions))
        assert found == (None if time is None else pytest.approx(time))


@pytest.mark.element("RelativeClearanceCondition")
@pytest.mark.parametrize(
    ("other", "opposite", "clear"),
    [
        ((-2, 120, 20), "false", False),
        ((-2, 140, 20), "false", True),
        ((-2, 85, 20), "false", False),
        ((-2, 75, 20), "false", True),
        ((-1, 110, 20), "false", True),
        ((1, 110, 20), "true", True),
    ],
)
def test_clearance_in_the_right_lane_depends_on_the_range(
    scene: RunScene, other: tuple[int, float, float], opposite: str, clear: bool
) -> None:
    """The range is 30 m ahead and 20 m behind in the lane to the right."""
    condition = of(
        f'<RelativeClearanceCondition distanceForward="30" distanceBackward="20" freeSpace="false" '
        f'oppositeLanes="{opposite}"><RelativeLaneRange from="-1" to="-1"/></RelativeClearanceCondition>'
    )
    assert first(scene(0.2, ("Ego", NOTHING, condition), other=other)) == (0.0 if clear else None)


@pytest.mark.element("RelativeClearanceCondition")
@pytest.mark.parametrize(
    ("s", "free_space", "clear"),
    [(130.5, "false", True), (130.5, "true", False), (131.5, "true", True), (77, "true", False), (75, "true", True)],
)
def test_clearance_with_free_space_counts_the_whole_box(
    scene: RunScene, s: float, free_space: str, clear: bool
) -> None:
    """The box of Other extends from 1 m behind its reference point to 4 m ahead of it."""
    condition = of(
        f'<RelativeClearanceCondition distanceForward="30" distanceBackward="20" freeSpace="{free_space}" '
        f'oppositeLanes="false"><RelativeLaneRange from="-1" to="-1"/></RelativeClearanceCondition>'
    )
    assert first(scene(0.2, ("Ego", NOTHING, condition), other=(-2, s, 20))) == (0.0 if clear else None)


@pytest.mark.parametrize(("free_space", "time"), [("true", 0.1), ("false", None)])
def test_clearance_with_free_space_counts_a_side_in_the_lane(
    scene: RunScene, free_space: str, time: float | None
) -> None:
    """From 0.1 s Other is 1.5 m beside the center of a 4 m lane; its side is 0.5 m inside the lane to the right."""
    condition = of(
        f'<RelativeClearanceCondition distanceForward="30" distanceBackward="20" freeSpace="{free_space}" '
        f'oppositeLanes="false"><RelativeLaneRange from="-1" to="-1"/></RelativeClearanceCondition>'
    )
    aside = """<PrivateAction><LateralAction><LaneOffsetAction continuous="false">
      <LaneOffsetActionDynamics dynamicsShape="step"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="-1.5"/>
      </LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>"""
    played = scene(0.3, ("Ego", NOTHING, condition), ("Other", aside), other=(-1, 110, 20), edge="falling")
    assert first(played) == (None if time is None else pytest.approx(time))


def test_clearance_without_the_lane_is_false(scene: RunScene) -> None:
    condition = of(
        '<RelativeClearanceCondition distanceForward="30" distanceBackward="20" freeSpace="false" '
        'oppositeLanes="false"><RelativeLaneRange from="-1" to="-1"/></RelativeClearanceCondition>'
    )
    assert first(scene(0.2, ("Ego", NOTHING, condition), ego=(-2, 100, 20))) is None


@pytest.mark.element("StoryboardElementStateCondition")
def test_element_state_lasts_and_transition_is_instantaneous(scene: RunScene) -> None:
    """The braking ends at 1.0 s, which conditions observe."""
    state = (
        '<ByValueCondition><StoryboardElementStateCondition storyboardElementType="{}" storyboardElementRef="{}" '
        'state="{}"/></ByValueCondition>'
    )
    played = scene(
        3,
        ("Ego", speed(10, 1)),
        ("Ego", NOTHING, state.format("action", "action 0", "endTransition")),
        ("Ego", NOTHING, state.format("event", "maneuver 0::event 0", "completeState")),
        ("Ego", NOTHING, state.format("event", "event 0", "startTransition")),
        ("Ego", NOTHING, state.format("maneuver", "group 0::maneuver 0", "runningState")),
        ("Ego", NOTHING, state.format("event", "event 0", "skipTransition")),
    )
    times = [played.when(f"event {number}", "runningState") for number in range(1, 6)]
    assert times == [pytest.approx(1.0), pytest.approx(1.0), 0.0, 0.0, None]


@pytest.mark.element("ParameterCondition")
def test_parameter_and_user_defined_value_conditions(scene: RunScene) -> None:
    value = "<ByValueCondition>{}</ByValueCondition>"
    level = value.format('<ParameterCondition parameterRef="Level" rule="greaterThan" value="1.5"/>')
    outside = value.format('<UserDefinedValueCondition name="button" rule="equalTo" value="pressed"/>')
    assert first(scene(0.2, ("Ego", NOTHING, level))) == 0.0
    assert first(scene(0.2, ("Ego", NOTHING, outside))) is None


@pytest.mark.parametrize(
    ("text", "rule", "limit", "expected"),
    [
        ("10", "greaterThan", "9", True),
        ("b", "greaterThan", "a", True),
        ("true", "equalTo", "1", True),
        ("2.0", "equalTo", "2", True),
        ("two", "notEqualTo", "2", True),
        (" 1e1 ", "equalTo", "+10.", True),
        ("1_0", "equalTo", "10", False),
        ("nan", "equalTo", "nan", True),
        ("INF", "greaterThan", "1e300", True),
        ("a", "lessOrEqual", "a", True),
        (None, "notEqualTo", "a", False),
    ],
)
def test_satisfies_compares_numbers_if_both_texts_are_numbers(
    text: str | None, rule: str, limit: str, expected: bool
) -> None:
    assert satisfies(text, model.Rule(rule), limit) is expected


@pytest.mark.parametrize(
    ("rule", "below", "same", "above"),
    [
        ("greaterThan", False, False, True),
        ("greaterOrEqual", False, True, True),
        ("lessThan", True, False, False),
        ("lessOrEqual", True, True, False),
        ("equalTo", False, True, False),
        ("notEqualTo", True, False, True),
    ],
)
def test_satisfies_rule_has_a_small_tolerance(rule: str, below: bool, same: bool, above: bool) -> None:
    answers = [satisfies_rule(value, model.Rule(rule), 3.0) for value in (2.9, 3.0 + 1e-9, 3.1)]
    assert answers == [below, same, above]
    assert not satisfies_rule(float("nan"), model.Rule(rule), 3.0)

"""Conditions with numbers by hand. Ego drives 20 m/s from x = 100 in lane -1, Other 10 m/s ahead of it from x = 150."""

from __future__ import annotations

from typing import Any

import pytest
from eidrive_behaviors.conditions.values import satisfies
from street_scene import after

from eidrive_scenario.api.actions import model, satisfies_rule

NOTHING = '<PrivateAction><VisibilityAction graphics="true" sensors="true" traffic="true"/></PrivateAction>'


def of(condition: str, entity: str = "Ego", rule: str = "any") -> str:
    names = "".join(f'<EntityRef entityRef="{name}"/>' for name in entity.split())
    return f"""<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="{rule}">{names}</TriggeringEntities>
      <EntityCondition>{condition}</EntityCondition></ByEntityCondition>"""


def first(played: Any) -> float | None:
    return played.when("event 0", "runningState")  # type: ignore[no-any-return]


def starts(played: Any) -> list[float]:
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
def test_distances_and_what_comes_of_them(scene: Any, condition: str, time: float) -> None:
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
def test_distances_along_the_trajectory_that_is_followed(
    scene: Any, kind: str, value: float, time: float | None
) -> None:
    """To a place 20 m behind the corner and 3 m to the left: 30 m at first, by 2 m in each tenth of a second less.

    Before the action begins it lies 7 m ahead and 20 m to the left.
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
def test_speeds_while_ego_brakes_to_a_stop_in_four_seconds(scene: Any, condition: str, time: float) -> None:
    """At 5 m/s²; it stands at 4 s."""
    played = scene(6, ("Ego", NOTHING, of(condition)), ("Ego", speed(0, 4)), other=(-2, 150, 10))
    assert first(played) == pytest.approx(time)


def test_a_direction_is_named(scene: Any) -> None:
    slow = '<SpeedCondition rule="lessThan" value="1" direction="lateral"/>'
    assert "lateral speed 0" in scene(1, ("Ego", NOTHING, of(slow))).why("event 0")


@pytest.mark.element("triggeringEntitiesRule")
def test_any_and_all(scene: Any) -> None:
    fast = '<SpeedCondition rule="greaterThan" value="15"/>'
    assert first(scene(1, ("Ego", NOTHING, of(fast, "Ego Other", "any")))) == 0.0
    assert first(scene(1, ("Ego", NOTHING, of(fast, "Ego Other", "all")))) is None


def test_who_is_not_in_the_world_fulfils_nothing(scene: Any) -> None:
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
def test_the_speed_of_approach_is_along_the_axis_of_the_distance(scene: Any, frame: str, kind: str) -> None:
    """Ego has 100 m towards +y at 20 m/s, Other 50 m towards +x at 10 m/s: 5 s, of which 4 are left after 1."""
    condition = of(
        f'<TimeToCollisionCondition freespace="false" rule="lessOrEqual" value="4" coordinateSystem="{frame}" '
        f'relativeDistanceType="{kind}"><TimeToCollisionConditionTarget><EntityRef entityRef="Other"/>'
        "</TimeToCollisionConditionTarget></TimeToCollisionCondition>"
    )
    across = """<PrivateAction><TeleportAction><Position><WorldPosition x="300" y="-102" h="1.5707963267948966"/>
      </Position></TeleportAction></PrivateAction>"""
    played = scene(3, ("Ego", NOTHING, condition), ("Ego", across), ego=(-1, 900, 20), other=(-1, 249, 10))
    assert first(played) == pytest.approx(1.1)


def test_a_standing_entity_has_a_headway_without_end(scene: Any) -> None:
    condition = '<TimeHeadwayCondition entityRef="Other" freespace="false" rule="greaterThan" value="1000"/>'
    assert first(scene(0.5, ("Ego", NOTHING, of(condition)), ego=(-1, 100, 0))) == 0.0


def test_who_moves_away_has_no_time_to_collision(scene: Any) -> None:
    condition = (
        '<TimeToCollisionCondition freespace="false" rule="greaterThan" value="0"><TimeToCollisionConditionTarget>'
        '<EntityRef entityRef="Other"/></TimeToCollisionConditionTarget></TimeToCollisionCondition>'
    )
    assert first(scene(1, ("Ego", NOTHING, of(condition)), ego=(-1, 100, 5))) is None


@pytest.mark.element("EndOfRoadCondition", "OffroadCondition")
def test_the_end_of_the_road_and_off_the_road(scene: Any) -> None:
    """5 m before the end at 20 m/s: there at 0.3 s. Off the road from 4 m beside it on."""
    end = of('<EndOfRoadCondition duration="0.5"/>')
    assert first(scene(2, ("Ego", NOTHING, end), ego=(-1, 995, 20))) == pytest.approx(0.8)
    off = of('<OffroadCondition duration="0.35"/>')
    assert first(scene(2, ("Ego", NOTHING, off), ("Ego", aside(-7)))) == pytest.approx(0.5)


def test_off_the_road_again_counts_from_then_on_though_nobody_asked_in_between(scene: Any) -> None:
    """Its event runs from 0.5 s to 1.5 s; off the road again at 1.3 s."""
    off = of('<OffroadCondition duration="0.35"/>')
    ways = (("Ego", aside(-7)), ("Ego", aside(0), after(0.65)), ("Ego", aside(-7), after(1.15)))
    played = scene(2.5, ("Ego", speed(20, 1), off), *ways, executions=2)
    assert starts(played) == pytest.approx([0.5, 1.7])


def test_who_comes_back_has_not_stood_still_while_away(scene: Any) -> None:
    """Deleted at 0.5 s, back at 2.0 s, seen there at 2.1 s."""
    entity = '<GlobalAction><EntityAction entityRef="Other">{}</EntityAction></GlobalAction>'
    back = """<AddEntityAction><Position><LanePosition roadId="1" laneId="-1" s="500"/></Position></AddEntityAction>"""
    away = ("Ego", entity.format("<DeleteEntityAction/>"), after(0.45))
    still = of('<StandStillCondition duration="0.95"/>', "Other")
    played = scene(4, ("Ego", NOTHING, still), away, ("Ego", entity.format(back), after(1.95)), other=(-2, 150.0, 0.0))
    assert first(played) == pytest.approx(3.1)


@pytest.mark.element("AngleCondition", "RelativeAngleCondition")
def test_angles(scene: Any) -> None:
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
def test_angles_to_the_own_axes_and_to_the_trajectory(scene: Any, frame: str, angle: float, times: Any) -> None:
    """On a trajectory round a corner at 0.5 s, which is turned about within 2 m, and without one."""
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
def test_clearance_in_the_lane_to_the_right(scene: Any, other: Any, opposite: str, clear: bool) -> None:
    """30 m ahead and 20 m behind in the lane to the right."""
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
def test_with_free_space_whoever_reaches_in_is_in_the_way(scene: Any, s: float, free_space: str, clear: bool) -> None:
    """Other's box reaches from 1 m behind its reference point to 4 m ahead of it."""
    condition = of(
        f'<RelativeClearanceCondition distanceForward="30" distanceBackward="20" freeSpace="{free_space}" '
        f'oppositeLanes="false"><RelativeLaneRange from="-1" to="-1"/></RelativeClearanceCondition>'
    )
    assert first(scene(0.2, ("Ego", NOTHING, condition), other=(-2, s, 20))) == (0.0 if clear else None)


@pytest.mark.parametrize(("free_space", "time"), [("true", 0.1), ("false", None)])
def test_a_flank_in_the_next_lane_is_in_the_way_with_free_space(
    scene: Any, free_space: str, time: float | None
) -> None:
    """From 0.1 s on 1.5 m beside the middle of a lane of 4 m, Other's flank is 0.5 m in the lane to the right."""
    condition = of(
        f'<RelativeClearanceCondition distanceForward="30" distanceBackward="20" freeSpace="{free_space}" '
        f'oppositeLanes="false"><RelativeLaneRange from="-1" to="-1"/></RelativeClearanceCondition>'
    )
    aside = """<PrivateAction><LateralAction><LaneOffsetAction continuous="false">
      <LaneOffsetActionDynamics dynamicsShape="step"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="-1.5"/>
      </LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>"""
    played = scene(0.3, ("Ego", NOTHING, condition), ("Other", aside), other=(-1, 110, 20), edge="falling")
    assert first(played) == (None if time is None else pytest.approx(time))


def test_where_there_is_no_such_lane_there_is_no_clearance(scene: Any) -> None:
    condition = of(
        '<RelativeClearanceCondition distanceForward="30" distanceBackward="20" freeSpace="false" '
        'oppositeLanes="false"><RelativeLaneRange from="-1" to="-1"/></RelativeClearanceCondition>'
    )
    assert first(scene(0.2, ("Ego", NOTHING, condition), ego=(-2, 100, 20))) is None


@pytest.mark.element("StoryboardElementStateCondition")
def test_a_state_lasts_and_a_transition_passes(scene: Any) -> None:
    """The braking ends at 1.0 s, where conditions see that."""
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
def test_a_parameter_and_a_value_from_outside(scene: Any) -> None:
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
def test_texts_compare_as_numbers_where_both_are(text: str | None, rule: str, limit: str, expected: bool) -> None:
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
def test_rules_have_a_small_tolerance(rule: str, below: bool, same: bool, above: bool) -> None:
    answers = [satisfies_rule(value, model.Rule(rule), 3.0) for value in (2.9, 3.0 + 1e-9, 3.1)]
    assert answers == [below, same, above]
    assert not satisfies_rule(float("nan"), model.Rule(rule), 3.0)

"""Conditions with values calculated by hand.

Ego drives at 20 m/s from x = 100 in lane -1, Other at 10 m/s from x = 150 ahead of it.
"""

from __future__ import annotations

import pytest
from opendrive_xml import map_xml, road_xml
from recorded_scene import RecordedScene, RunScene, first_start
from storyboard_xml import by_entity_xml, element_state_xml, speed_xml, teleport_xml
from street_scene import LANES, NOTHING, after
from whole_run import Run

ORIENTATION = '<Orientation type="relative" h="0.1" p="0" r="0"/>'


def starts(played: RecordedScene) -> list[float]:
    return [one.time for one in played.changes if one.element == "event 0" and one.after.value == "runningState"]


def aside(offset: float) -> str:
    return f"""<PrivateAction><LateralAction><LaneOffsetAction continuous="false">
      <LaneOffsetActionDynamics dynamicsShape="step"/>
      <LaneOffsetTarget><AbsoluteTargetLaneOffset value="{offset}"/></LaneOffsetTarget></LaneOffsetAction>
      </LateralAction></PrivateAction>"""


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
    assert first_start(scene(6, ("Ego", NOTHING, by_entity_xml(condition)))) == pytest.approx(time)


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
    condition = by_entity_xml(
        f'<DistanceCondition value="{value}" rule="lessThan" freespace="false" relativeDistanceType="{kind}" '
        'coordinateSystem="trajectory"><Position><WorldPosition x="107" y="18"/></Position></DistanceCondition>'
    )
    played = scene(1.9, ("Ego", NOTHING, condition), ("Ego", TURN), edge="rising")
    assert first_start(played) == (None if time is None else pytest.approx(time))


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
    played = scene(6, ("Ego", NOTHING, by_entity_xml(condition)), ("Ego", speed_xml(0, 4)), other=(-2, 150, 10))
    assert first_start(played) == pytest.approx(time)


def test_speed_condition_with_direction_explains_the_direction(scene: RunScene) -> None:
    slow = '<SpeedCondition rule="lessThan" value="1" direction="lateral"/>'
    assert "lateral speed 0" in scene(1, ("Ego", NOTHING, by_entity_xml(slow))).why("event 0")


@pytest.mark.element("triggeringEntitiesRule")
def test_triggering_entities_rule_any_and_all(scene: RunScene) -> None:
    fast = '<SpeedCondition rule="greaterThan" value="15"/>'
    assert first_start(scene(1, ("Ego", NOTHING, by_entity_xml(fast, "Ego Other", "any")))) == 0.0
    assert first_start(scene(1, ("Ego", NOTHING, by_entity_xml(fast, "Ego Other", "all")))) is None


@pytest.mark.parametrize(
    "position",
    [
        '<RelativeLanePosition entityRef="Other" dLane="0" dsLane="100"/>',
        '<RelativeLanePosition entityRef="Other" dLane="0" ds="100"/>',
        '<RelativeRoadPosition entityRef="Other" ds="100" dt="0"/>',
    ],
)
def test_condition_is_false_while_its_moving_position_is_beyond_the_roads(run: Run, position: str) -> None:
    """The position is 100 m ahead of Other, which drives at 20 m/s from 882 m: after 0.9 s the road of 1000 m ends."""
    near = by_entity_xml(
        f'<DistanceCondition value="5000" rule="lessThan" freespace="false"><Position>{position}</Position>'
        "</DistanceCondition>"
    )
    others = {"Other": (-1, 882.0, 20.0)}
    played = run(2, ("Ego", NOTHING, near), driven=False, others=others, edge="falling")
    assert played.begun("event 0") == pytest.approx([0.95])
    assert sum("its condition is not fulfilled while" in text for text in played.result.warnings) == 1


def test_conditions_on_absent_entity_are_false(scene: RunScene) -> None:
    gone = '<GlobalAction><EntityAction entityRef="Other"><DeleteEntityAction/></EntityAction></GlobalAction>'
    near = by_entity_xml(
        '<RelativeDistanceCondition entityRef="Other" freespace="false" relativeDistanceType="longitudinal" '
        'rule="lessThan" value="29.5"/>'
    )
    played = scene(
        4,
        ("Ego", gone),
        ("Ego", NOTHING, f"{near}"),
        ("Ego", NOTHING, by_entity_xml('<TraveledDistanceCondition value="5"/>', "Other")),
    )
    assert played.when("event 1", "runningState") is None
    assert played.when("event 2", "runningState") is None


@pytest.mark.element("RelativeSpeedCondition")
@pytest.mark.parametrize(("direction", "speed"), [("longitudinal", 20.0), ("lateral", 10.0)])
def test_relative_speed_in_a_direction_refers_to_the_triggering_entity(
    scene: RunScene, direction: str, speed: float
) -> None:
    """From 0.1 s Ego drives towards +y at 20 m/s, Other towards +x at 10 m/s: 10 m/s to the left of Ego."""
    across = teleport_xml('<WorldPosition x="100" y="-2" h="1.5707963267948966"/>')
    condition = by_entity_xml(
        f'<RelativeSpeedCondition entityRef="Other" rule="equalTo" value="{speed}" direction="{direction}"/>'
    )
    assert first_start(scene(0.3, ("Ego", NOTHING, condition), ("Ego", across))) == pytest.approx(0.1)


@pytest.mark.element("TimeToCollisionCondition")
@pytest.mark.parametrize(
    ("frame", "kind"),
    [("world", "longitudinal"), ("world", "lateral"), ("entity", "longitudinal"), ("entity", "lateral")],
)
def test_time_to_collision_uses_the_axis_of_the_distance(scene: RunScene, frame: str, kind: str) -> None:
    """Ego is at 100 m towards +y at 20 m/s, Other at 50 m towards +x at 10 m/s: 5 s, of which 4 s remain after 1 s."""
    condition = by_entity_xml(
        f'<TimeToCollisionCondition freespace="false" rule="lessOrEqual" value="4" coordinateSystem="{frame}" '
        f'relativeDistanceType="{kind}"><TimeToCollisionConditionTarget><EntityRef entityRef="Other"/>'
        "</TimeToCollisionConditionTarget></TimeToCollisionCondition>"
    )
    across = """<PrivateAction><TeleportAction><Position><WorldPosition x="300" y="-102" h="1.5707963267948966"/>
      </Position></TeleportAction></PrivateAction>"""
    played = scene(3, ("Ego", NOTHING, condition), ("Ego", across), ego=(-1, 900, 20), other=(-1, 249, 10))
    assert first_start(played) == pytest.approx(1.1)


@pytest.mark.parametrize(
    ("specified", "is_near"),
    [("", True), ('relativeDistanceType="euclidianDistance"', False), ('coordinateSystem="lane"', False)],
)
def test_along_route_is_ignored_beside_a_distance_type_or_coordinate_system(
    scene: RunScene, specified: str, is_near: bool
) -> None:
    """Other is 3 m ahead in the next lane: 3 m along the road, 5 m straight; Ego drives 1 m/s."""
    condition = by_entity_xml(
        f'<TimeHeadwayCondition entityRef="Other" alongRoute="true" freespace="false" rule="lessThan" value="4" '
        f"{specified}/>"
    )
    played = scene(0.2, ("Ego", NOTHING, condition), ego=(-1, 100, 1), other=(-2, 103, 1))
    assert (first_start(played) == 0.0) == is_near


def test_time_headway_of_standing_entity_is_infinite(scene: RunScene) -> None:
    condition = '<TimeHeadwayCondition entityRef="Other" freespace="false" rule="greaterThan" value="1000"/>'
    assert first_start(scene(0.5, ("Ego", NOTHING, by_entity_xml(condition)), ego=(-1, 100, 0))) == 0.0


@pytest.mark.parametrize(
    "position",
    [
        '<RelativeLanePosition entityRef="Other" dLane="0" ds="0"/>',
        '<RelativeLanePosition entityRef="Other" dLane="0" dsLane="0"/>',
        '<RelativeRoadPosition entityRef="Other" ds="0" dt="0"/>',
        '<RelativeWorldPosition entityRef="Other" dx="0" dy="0"/>',
        '<RelativeObjectPosition entityRef="Other" dx="0" dy="0"/>',
    ],
)
@pytest.mark.parametrize("kind", ["longitudinal", "euclidianDistance"])
def test_time_to_collision_with_a_position_that_moves(scene: RunScene, position: str, kind: str) -> None:
    """50 m less 10 m/s · t at 20 - 10 m/s: 5 s - t."""
    condition = by_entity_xml(
        '<TimeToCollisionCondition freespace="false" rule="lessThan" value="4.45" coordinateSystem="road" '
        f'relativeDistanceType="{kind}"><TimeToCollisionConditionTarget><Position>{position}</Position>'
        "</TimeToCollisionConditionTarget></TimeToCollisionCondition>"
    )
    assert first_start(scene(2, ("Ego", NOTHING, condition))) == pytest.approx(0.6)


def test_time_to_collision_of_departing_entity_is_undefined(scene: RunScene) -> None:
    condition = (
        '<TimeToCollisionCondition freespace="false" rule="greaterThan" value="0"><TimeToCollisionConditionTarget>'
        '<EntityRef entityRef="Other"/></TimeToCollisionConditionTarget></TimeToCollisionCondition>'
    )
    assert first_start(scene(1, ("Ego", NOTHING, by_entity_xml(condition)), ego=(-1, 100, 5))) is None


@pytest.mark.element("EndOfRoadCondition", "OffroadCondition")
def test_end_of_road_and_offroad_hold_after_their_durations(scene: RunScene) -> None:
    """From 5 m before the end at 20 m/s Ego is there at 0.3 s. It is off the road from 4 m beside the road."""
    end = by_entity_xml('<EndOfRoadCondition duration="0.5"/>')
    assert first_start(scene(2, ("Ego", NOTHING, end), ego=(-1, 995, 20))) == pytest.approx(0.8)
    off = by_entity_xml('<OffroadCondition duration="0.35"/>')
    assert first_start(scene(2, ("Ego", NOTHING, off), ("Ego", aside(-7)))) == pytest.approx(0.5)


def test_offroad_duration_after_return_restarts_without_evaluation(scene: RunScene) -> None:
    """The event runs from 0.5 s to 1.5 s; Ego is off the road again at 1.3 s."""
    off = by_entity_xml('<OffroadCondition duration="0.35"/>')
    ways = (("Ego", aside(-7)), ("Ego", aside(0), after(0.65)), ("Ego", aside(-7), after(1.15)))
    played = scene(2.5, ("Ego", speed_xml(20, 1), off), *ways, executions=2)
    assert starts(played) == pytest.approx([0.5, 1.7])


def test_standstill_duration_after_reentry_restarts(scene: RunScene) -> None:
    """Other is deleted at 0.5 s, added at 2.0 s and visible at 2.1 s."""
    entity = '<GlobalAction><EntityAction entityRef="Other">{}</EntityAction></GlobalAction>'
    back = """<AddEntityAction><Position><LanePosition roadId="1" laneId="-1" s="500"/></Position></AddEntityAction>"""
    away = ("Ego", entity.format("<DeleteEntityAction/>"), after(0.45))
    still = by_entity_xml('<StandStillCondition duration="0.95"/>', "Other")
    played = scene(4, ("Ego", NOTHING, still), away, ("Ego", entity.format(back), after(1.95)), other=(-2, 150.0, 0.0))
    assert first_start(played) == pytest.approx(3.1)


@pytest.mark.element("AngleCondition", "RelativeAngleCondition")
def test_angle_conditions_in_world_lane_and_relative_hold(scene: RunScene) -> None:
    turn = """<PrivateAction><TeleportAction><Position><WorldPosition x="300" y="-2" h="{}"/></Position>
      </TeleportAction></PrivateAction>"""
    world = by_entity_xml(
        '<AngleCondition angleType="heading" angle="0.5" angleTolerance="0.1" coordinateSystem="world"/>'
    )
    lane = by_entity_xml(
        '<AngleCondition angleType="heading" angle="0.5" angleTolerance="0.1" coordinateSystem="lane"/>'
    )
    other = by_entity_xml(
        '<RelativeAngleCondition entityRef="Other" angleType="heading" angle="-2.64" angleTolerance="0.01"/>'
    )
    for condition in (world, lane, other):
        played = scene(0.5, ("Ego", NOTHING, condition), ("Ego", turn.format(0.5)), other=(1, 150, 0))
        assert first_start(played) == pytest.approx(0.1)
        assert (
            first_start(scene(0.5, ("Ego", NOTHING, condition), ("Ego", turn.format(0.9)), other=(1, 150, 0))) is None
        )


@pytest.mark.element("RelativeAngleCondition")
@pytest.mark.parametrize(
    ("system", "angle"),
    [("", -0.4), ('coordinateSystem="world"', -0.4), ('coordinateSystem="entity"', -0.4),
     ('coordinateSystem="lane"', 0.1), ('coordinateSystem="road"', 0.1)],
)  # fmt: skip
def test_relative_angle_on_a_bend_depends_on_the_coordinate_system(scene: RunScene, system: str, angle: float) -> None:
    """50 m apart on an arc of 100 m radius the lanes have directions 0.5 rad apart; Ego points 0.1 rad to the left."""
    bend = map_xml(road_xml(length=300.0, curvature=0.01, lanes=LANES))
    turned = f'<LanePosition roadId="1" laneId="-1" s="50">{ORIENTATION}</LanePosition>'
    for value, is_fulfilled in ((angle, True), (0.1 - 0.4 - angle, False)):
        condition = by_entity_xml(
            f'<RelativeAngleCondition entityRef="Other" angleType="heading" angle="{value}" angleTolerance="0.001" '
            f"{system}/>"
        )
        played = scene(
            0.5, ("Ego", teleport_xml(turned)), ("Ego", NOTHING, condition),
            ego=(-1, 50, 0), other=(-1, 100, 0), street=bend,
        )  # fmt: skip
        assert (played.when("event 1", "runningState") is not None) == is_fulfilled


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
    condition = by_entity_xml(
        f'<AngleCondition angleType="heading" angle="{angle}" angleTolerance="0.001" coordinateSystem="{frame}"/>'
    )
    for actions, time in zip(((("Ego", TURN),), ()), times, strict=True):
        found = first_start(scene(1.5, ("Ego", NOTHING, condition), *actions))
        assert found == (None if time is None else pytest.approx(time))


@pytest.mark.element("StoryboardElementStateCondition")
def test_element_state_lasts_and_transition_is_instantaneous(scene: RunScene) -> None:
    """The braking ends at 1.0 s, which conditions observe."""
    played = scene(
        3,
        ("Ego", speed_xml(10, 1)),
        ("Ego", NOTHING, element_state_xml("action", "action 0", "endTransition")),
        ("Ego", NOTHING, element_state_xml("event", "maneuver 0::event 0", "completeState")),
        ("Ego", NOTHING, element_state_xml("event", "event 0", "startTransition")),
        ("Ego", NOTHING, element_state_xml("maneuver", "group 0::maneuver 0", "runningState")),
        ("Ego", NOTHING, element_state_xml("event", "event 0", "skipTransition")),
    )
    times = [played.when(f"event {number}", "runningState") for number in range(1, 6)]
    assert times == [pytest.approx(1.0), pytest.approx(1.0), 0.0, 0.0, None]

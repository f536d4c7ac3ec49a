"""Entity selections and external objects in simulation runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from storyboard_xml import by_entity_xml, global_xml, private_xml, speed_xml
from street_scene import NOTHING, after, street
from whole_run import RecordedRun, Run

from eidrive_scenario.errors import InputError

CARS = {"Ego": (-1, 100.0, 20.0), "Second": (-2, 120.0, 10.0), "Third": (-2, 300.0, 10.0)}
MANY = """<EntitySelection name="all"><Members><ByType objectType="vehicle"/></Members></EntitySelection>
  <EntitySelection name="slow"><Members><EntityRef entityRef="Second"/><EntityRef entityRef="Third"/></Members>
  </EntitySelection>
  <EntitySelection name="nested"><Members><EntityRef entityRef="slow"/><EntityRef entityRef="Second"/></Members>
  </EntitySelection>"""
SPEED = speed_xml(5)


@pytest.fixture
def group(run: Run) -> Callable[..., RecordedRun]:
    """Return a function that runs three scripted cars; selections: `slow`, `nested` (two of them) and `all`."""
    others = {name: place for name, place in CARS.items() if name != "Ego"}

    def play(end: float, *steps: tuple[str, ...], more: str = "", **options: Any) -> RecordedRun:
        return run(end, *steps, driven=False, others=others, more=MANY + more, **options)

    return play


@pytest.mark.element("EntitySelection")
def test_selection_as_actor_acts_as_each_member(group: Run) -> None:
    for selection, expected in (("slow", [20, 5, 5]), ("nested", [20, 5, 5]), ("all", [5, 5, 5])):
        played = group(1, (selection, SPEED, after(0.5)))
        assert [played.of(name, "speed")[-1] for name in CARS] == expected


SLOW_DOWN = speed_xml(6, 2)


@pytest.mark.element("EntitySelection")
def test_selection_with_preempted_member_releases_all_members(group: Run) -> None:
    """A conflict of one entity is a conflict of all (7.5.1): from 10 to 6 m/s in 2 s, Third keeps 8 m/s of halfway."""
    played = group(3, ("slow", SLOW_DOWN), ("Second", SPEED, after(0.95)))
    assert [played.of(name, "speed")[-1] for name in CARS] == pytest.approx([20, 5, 8])


@pytest.mark.element("EntitySelection")
@pytest.mark.parametrize("actors", ["front slow", "slow front"])
def test_overlapping_selections_are_released_together_in_any_order(group: Run, actors: str) -> None:
    """A conflict of Ego is one of Second, which is in both selections, and so one of Third: all are at half time."""
    front = '<EntitySelection name="front"><Members><EntityRef entityRef="Ego"/><EntityRef entityRef="Second"/>'
    played = group(3, (actors, SLOW_DOWN), ("Ego", SPEED, after(0.95)), more=f"{front}</Members></EntitySelection>")
    assert [played.of(name, "speed")[-1] for name in CARS] == pytest.approx([5, 8, 8])


@pytest.mark.parametrize("reference", ["", "Ego", "alone"])
def test_selection_in_init_with_preempted_member_releases_all_members(group: Run, reference: str) -> None:
    """The target is 6 m/s, also as 14 m/s below the speed of Ego, which may be the only member of a selection."""
    target = (
        f'<RelativeTargetSpeed entityRef="{reference}" value="-14" speedTargetValueType="delta" continuous="false"/>'
    )
    slow_down = SLOW_DOWN.replace('<AbsoluteTargetSpeed value="6"/>', target) if reference else SLOW_DOWN
    init = f'<Private entityRef="slow">{slow_down}</Private>'
    alone = '<EntitySelection name="alone"><Members><EntityRef entityRef="Ego"/></Members></EntitySelection>'
    played = group(3, ("Second", SPEED, after(0.95)), init=init, more=alone)
    assert [played.of(name, "speed")[-1] for name in CARS] == pytest.approx([20, 5, 8])


def test_actors_listed_individually_are_preempted_individually(group: Run) -> None:
    named = "Second Third"
    played = group(3, (named, SLOW_DOWN), ("Second", SPEED, after(0.95)))
    assert [played.of(name, "speed")[-1] for name in CARS] == pytest.approx([20, 5, 6])


def test_selection_with_deleted_member_continues_with_the_others(group: Run) -> None:
    delete = global_xml('<EntityAction entityRef="Second"><DeleteEntityAction/></EntityAction>')
    played = group(3, ("slow", SLOW_DOWN), ("Ego", delete, after(0.95)))
    assert played.of("Third", "speed")[-1] == pytest.approx(6)


@pytest.mark.element("EntitySelection", "triggeringEntitiesRule")
def test_selection_triggers_by_any_or_all_members(group: Run) -> None:
    """The condition is 10 m: Ego covers it at 20 m/s in 0.5 s, the others at 10 m/s in 1.0 s."""
    gone = by_entity_xml('<TraveledDistanceCondition value="{}"/>', "all", "{}")
    assert group(3, ("Ego", NOTHING, gone.format("any", 10.0))).begun("event 0") == pytest.approx([0.5])
    assert group(3, ("Ego", NOTHING, gone.format("all", 10.0))).begun("event 0") == pytest.approx([1.0])


def test_condition_with_selection_as_target_holds_for_any_member(group: Run) -> None:
    """Ego is 20 m behind Second and 10 m/s faster: 10 m at 1 s. Third is 200 m ahead."""
    near = (
        '<RelativeDistanceCondition entityRef="slow" relativeDistanceType="longitudinal" value="10" freespace="false"'
    )
    near = by_entity_xml(f'{near} coordinateSystem="road" rule="lessOrEqual"/>')
    played = group(2, ("Ego", NOTHING, near))
    assert played.begun("event 0") == pytest.approx([1.0])
    why = next(
        change.why for frame in played.frames for change in frame.changes if change.element == "event 0" and change.why
    )
    assert "Second" in why
    assert "Third" not in why


def test_clearance_of_selection_requires_all_members_absent(group: Run) -> None:
    """Both members are in lane -2. Ego's own lane is free, and so are 5 m ahead in lane -2, but not 50 m."""
    free = """<RelativeClearanceCondition distanceForward="{}" distanceBackward="0" freeSpace="false"
      oppositeLanes="false"><RelativeLaneRange from="-1" to="-1"/><EntityRef entityRef="slow"/>
      </RelativeClearanceCondition>"""
    assert group(0.5, ("Ego", NOTHING, by_entity_xml(free.format(5)))).begun("event 0") == [0.0]
    assert group(0.5, ("Ego", NOTHING, by_entity_xml(free.format(50)))).begun("event 0") == []


@pytest.mark.element("selectTriggeringEntities")
def test_triggering_entities_of_the_act_are_added_to_actors(group: Run) -> None:
    """Second and Third are slower than 15 m/s, Ego is faster. Those of a single event have no effect (7.3.1)."""
    slower = by_entity_xml('<SpeedCondition value="15" rule="lessThan"/>', "all")
    faster = by_entity_xml('<SpeedCondition value="15" rule="greaterThan"/>', "all")
    for start, actor, speeds in (
        (slower, "Ego", [5, 5, 5]),
        (faster, "Second", [5, 5, 10]),
        (faster, "Ego", [5, 10, 10]),
    ):
        played = group(1, (actor, SPEED), start=start)
        assert [played.of(name, "speed")[-1] for name in CARS] == speeds
    played = group(1, ("Ego", SPEED, slower), start=faster)
    assert [played.of(name, "speed")[-1] for name in CARS] == [5, 10, 10]


@pytest.mark.element("selectTriggeringEntities")
def test_triggering_entities_of_all_fulfilled_groups_are_selected(group: Run) -> None:
    """Ego fulfils one of two condition groups, Third the other one; both act."""
    far = by_entity_xml('<TraveledDistanceCondition value="0"/>', "Third")
    fast = by_entity_xml('<SpeedCondition value="15" rule="greaterThan"/>')
    other = '</Condition></ConditionGroup><ConditionGroup><Condition name="d" delay="0" conditionEdge="none">'
    played = group(1, ("Second", SPEED), start=f"{fast}{other}{far}")
    assert [played.of(name, "speed")[-1] for name in CARS] == [5, 5, 5]


@pytest.mark.element("selectTriggeringEntities")
def test_triggering_entities_with_delay_or_falling_edge_are_those_of_then(group: Run) -> None:
    """Ego is within 5 m of its start until 0.25 s; no entity is when the trigger fires."""
    near = by_entity_xml(
        '<DistanceCondition value="5" rule="lessThan" freespace="false"><Position><LanePosition roadId="1" laneId="-1" '
        's="100"/></Position></DistanceCondition>',
        "all",
    )
    brighter = private_xml(
        '<AppearanceAction><LightStateAction><LightType><VehicleLight vehicleLightType="lowBeam"/></LightType>'
        '<LightState mode="on"/></LightStateAction></AppearanceAction>'
    )
    for options, time in (({"edge": "falling"}, 0.25), ({"delay": 0.8}, 0.8)):
        played = group(2, ("Third", brighter), start=near, **options)
        assert played.begun("event 0") == pytest.approx([time])
        assert set(played.frames[-1].appearances) == {"Ego", "Third"}


@pytest.mark.element("selectTriggeringEntities")
@pytest.mark.parametrize("actor", ["Third", ""])
def test_actions_of_triggering_entities_start_in_the_order_of_actors(group: Run, actor: str) -> None:
    """A step of speed takes effect first, whatever the order: from 6 m/s to 10 m/s in 2 s, 8 m/s after 1 s."""
    both = f'{speed_xml(10, 2)}</Action><Action name="step">{speed_xml(6)}'
    played = group(1, (actor, both), start=by_entity_xml('<TraveledDistanceCondition value="0"/>', "Third"))
    assert played.of("Third", "speed")[-1] == pytest.approx(8)


LANE_CHANGE = private_xml(
    '<LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="linear" dynamicsDimension="time" '
    'value="4"/><LaneChangeTarget><AbsoluteTargetLane value="left"/></LaneChangeTarget></LaneChangeAction>'
    "</LateralAction>"
)
CONNECTION = private_xml('<TrailerAction><ConnectTrailerAction trailerRef="Ego"/></TrailerAction>')


@pytest.mark.element("selectTriggeringEntities")
@pytest.mark.parametrize("actor", ["Ego", ""])
@pytest.mark.parametrize(
    ("action", "message"), [(LANE_CHANGE, "the target lane is not a number"), (CONNECTION, "is the actor itself")]
)
def test_invalid_action_of_triggering_entities_is_an_error_before_the_run(
    group: Run, actor: str, action: str, message: str
) -> None:
    never = by_entity_xml('<SpeedCondition value="90" rule="greaterThan"/>')
    with pytest.raises(InputError, match=message):
        group(1, (actor, action), start=never)


@pytest.mark.element("EntitySelection")
def test_empty_selection_is_never_near_and_always_clear(group: Run) -> None:
    empty = '<EntitySelection name="walkers"><Members><ByType objectType="pedestrian"/></Members></EntitySelection>'
    near = """<RelativeDistanceCondition entityRef="walkers" relativeDistanceType="longitudinal" value="1000"
      freespace="false" rule="lessThan"/>"""
    assert group(0.5, ("Ego", NOTHING, by_entity_xml(near)), more=empty).begun("event 0") == []
    free = """<RelativeClearanceCondition distanceForward="50" distanceBackward="0" freeSpace="false"
      oppositeLanes="false"><RelativeLaneRange from="-1" to="-1"/>{}</RelativeClearanceCondition>"""
    walkers = free.format('<EntityRef entityRef="walkers"/>')
    assert group(0.5, ("Ego", NOTHING, by_entity_xml(free.format(""))), more=empty).begun("event 0") == []
    assert group(0.5, ("Ego", NOTHING, by_entity_xml(walkers)), more=empty).begun("event 0") == [0.0]


def test_selection_as_reference_requires_a_single_member(group: Run) -> None:
    delete = global_xml('<EntityAction entityRef="slow"><DeleteEntityAction/></EntityAction>')
    played = group(1, ("Ego", delete, after(0.5)))
    assert played.frames[0].view.names == ("Ego", "Second", "Third")
    assert played.frames[-1].view.names == ("Ego",)
    follow = private_xml(
        '<LongitudinalAction><LongitudinalDistanceAction entityRef="{}" freespace="false" continuous="false" '
        'distance="30"/></LongitudinalAction>'
    )
    with pytest.raises(InputError, match="refers to selection 'slow'; got a selection of 2 entities"):
        group(1, ("Ego", follow.format("slow")))
    alone = '<EntitySelection name="one"><Members><EntityRef entityRef="Second"/></Members></EntitySelection>'
    assert group(8, ("Ego", follow.format("one")), more=alone).result.end_reason == "stop trigger"


def test_selection_with_itself_as_member_is_rejected(group: Run) -> None:
    ring = '<EntitySelection name="{}"><Members><EntityRef entityRef="{}"/></Members></EntitySelection>'
    with pytest.raises(InputError, match="is a member of itself"):
        group(1, ("a", SPEED), more=ring.format("a", "b") + ring.format("b", "a"))


OBJECT = """<objects><object id="77" name="hut" type="building" s="200" t="-9" zOffset="0" hdg="0.5" length="4"
  width="3" height="2.5"/></objects>"""


@pytest.mark.element("ExternalObjectReference")
def test_external_object_has_pose_and_size_of_the_road_object(run: Run) -> None:
    external = '<ScenarioObject name="Hut"><ExternalObjectReference name="{}"/></ScenarioObject>'
    for name in ("77", "hut"):
        played = run(0.2, more=external.format(name), street=street(extra=OBJECT))
        view = played.frames[0].view
        row = view.row("Hut")
        assert view.boxes[row].tolist() == pytest.approx([200.0, -9.0, 1.25, 4.0, 3.0, 2.5, 0.5])
        assert played.result.warnings[1:] == (), "after: not judged"


def test_unknown_external_object_is_a_box_with_a_warning(run: Run) -> None:
    external = '<ScenarioObject name="Thing"><ExternalObjectReference name="elsewhere"/></ScenarioObject>'
    add = global_xml(
        '<EntityAction entityRef="Thing"><AddEntityAction><Position><WorldPosition x="140" y="-2" h="0"/></Position>'
        "</AddEntityAction></EntityAction>"
    )
    played = run(1, ("Ego", add, after(0.5)), more=external)
    assert "Thing" not in played.frames[0].view
    view = played.frames[-1].view
    assert view.size[view.row("Thing")].tolist() == [0.5, 0.5, 0.5]
    assert "external object 'elsewhere' is unknown" in played.result.warnings[1], "after: not judged"


def test_selection_by_type_includes_external_objects(run: Run) -> None:
    external = '<ScenarioObject name="Thing"><ExternalObjectReference name="elsewhere"/></ScenarioObject>'
    chosen = '<EntitySelection name="outer"><Members><ByType objectType="external"/></Members></EntitySelection>'
    put = private_xml('<TeleportAction><Position><WorldPosition x="140" y="-2" h="0"/></Position></TeleportAction>')
    add = global_xml(
        '<EntityAction entityRef="outer"><AddEntityAction><Position><WorldPosition x="150" y="-2" h="0"/></Position>'
        "</AddEntityAction></EntityAction>"
    )
    played = run(1, ("outer", put, after(0.5)), more=external + chosen, globally=add)
    x = played.x("Thing")
    assert (x[0], x[-1]) == (150.0, 140.0)


@pytest.mark.parametrize(("kind", "collides"), [("external", True), ("vehicle", False), ("miscellaneous", False)])
def test_collision_by_type_distinguishes_external_objects(run: Run, kind: str, collides: bool) -> None:
    """The box of 0.5 m at x = 103 is within the body of Ego, which extends from 99 to 104."""
    external = '<ScenarioObject name="Thing"><ExternalObjectReference name="elsewhere"/></ScenarioObject>'
    add = global_xml(
        '<EntityAction entityRef="Thing"><AddEntityAction><Position><WorldPosition x="103" y="-2" h="0"/></Position>'
        "</AddEntityAction></EntityAction>"
    )
    touched = by_entity_xml(f'<CollisionCondition><ByType type="{kind}"/></CollisionCondition>')
    played = run(0.2, ("Ego", NOTHING, touched), driven=False, ego=(-1, 100.0, 0.0), more=external, globally=add)
    assert bool(played.begun("action 0")) is collides

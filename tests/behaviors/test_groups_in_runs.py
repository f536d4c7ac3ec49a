"""Groups of entities and entities that others define: through the simulation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from street_scene import NOTHING, STREET, after, everywhere, private
from whole_run import Watched

from eidrive_scenario.errors import InputError

CARS = {"Ego": (-1, 100.0, 20.0), "Second": (-2, 120.0, 10.0), "Third": (-2, 300.0, 10.0)}
MANY = """<EntitySelection name="all"><Members><ByType objectType="vehicle"/></Members></EntitySelection>
  <EntitySelection name="slow"><Members><EntityRef entityRef="Second"/><EntityRef entityRef="Third"/></Members>
  </EntitySelection>
  <EntitySelection name="nested"><Members><EntityRef entityRef="slow"/><EntityRef entityRef="Second"/></Members>
  </EntitySelection>"""
SPEED = private(
    '<LongitudinalAction><SpeedAction><SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>'
    '<SpeedActionTarget><AbsoluteTargetSpeed value="5"/></SpeedActionTarget></SpeedAction></LongitudinalAction>'
)


@pytest.fixture
def group(run: Any) -> Callable[..., Watched]:
    """Three scripted cars, two of which are the selections `slow` and `nested`; all are `all`."""
    others = {name: place for name, place in CARS.items() if name != "Ego"}

    def play(end: float, *steps: tuple[str, ...], more: str = "", **options: Any) -> Watched:
        return run(end, *steps, driven=False, others=others, more=MANY + more, **options)

    return play


def by(entities: str, condition: str, rule: str = "any") -> str:
    return f"""<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="{rule}">
      <EntityRef entityRef="{entities}"/></TriggeringEntities>
      <EntityCondition>{condition}</EntityCondition></ByEntityCondition>"""


@pytest.mark.element("EntitySelection")
def test_a_group_acts_as_each_of_its_members(group: Any) -> None:
    for selection, expected in (("slow", [20, 5, 5]), ("nested", [20, 5, 5]), ("all", [5, 5, 5])):
        played = group(1, (selection, SPEED, after(0.5)))
        assert [played.of(name, "speed")[-1] for name in CARS] == expected


SLOW_DOWN = private(
    '<LongitudinalAction><SpeedAction><SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="time" value="2"/>'
    '<SpeedActionTarget><AbsoluteTargetSpeed value="6"/></SpeedActionTarget></SpeedAction></LongitudinalAction>'
)


@pytest.mark.element("EntitySelection")
def test_who_of_a_selection_is_taken_over_frees_all_of_it(group: Any) -> None:
    """Conflict of one entity is conflict of all (7.5.1): from 10 to 6 m/s in 2 s, Third keeps the 8 m/s of half way."""
    played = group(3, ("slow", SLOW_DOWN), ("Second", SPEED, after(0.95)))
    assert [played.of(name, "speed")[-1] for name in CARS] == pytest.approx([20, 5, 8])


def test_so_it_is_with_actions_of_init(group: Any) -> None:
    init = f'<Private entityRef="slow">{SLOW_DOWN}</Private>'
    played = group(3, ("Second", SPEED, after(0.95)), init=init)
    assert [played.of(name, "speed")[-1] for name in CARS] == pytest.approx([20, 5, 8])


def test_actors_that_are_named_one_by_one_are_taken_over_one_by_one(group: Any) -> None:
    named = 'Second"/><EntityRef entityRef="Third'
    played = group(3, (named, SLOW_DOWN), ("Second", SPEED, after(0.95)))
    assert [played.of(name, "speed")[-1] for name in CARS] == pytest.approx([20, 5, 6])


def test_who_of_a_selection_is_deleted_leaves_the_others_to_it(group: Any) -> None:
    delete = everywhere('<EntityAction entityRef="Second"><DeleteEntityAction/></EntityAction>')
    played = group(3, ("slow", SLOW_DOWN), ("Ego", delete, after(0.95)))
    assert played.of("Third", "speed")[-1] == pytest.approx(6)


@pytest.mark.element("EntitySelection", "triggeringEntitiesRule")
def test_a_group_triggers_by_any_or_all_of_its_members(group: Any) -> None:
    """At 10 m/s from s = 120 m and 300 m the group's first member has gone 3 m after 0.3 s, and both have."""
    gone = by("all", '<TraveledDistanceCondition value="{}"/>', "{}")
    assert group(3, ("Ego", NOTHING, gone.format("any", 10.0))).begun("event 0") == pytest.approx([0.5])
    assert group(3, ("Ego", NOTHING, gone.format("all", 10.0))).begun("event 0") == pytest.approx([1.0])


def test_a_condition_towards_a_group_holds_towards_any_member(group: Any) -> None:
    """Ego is 20 m behind Second and 10 m/s faster: 10 m at 1 s; 200 m behind Third."""
    near = (
        '<RelativeDistanceCondition entityRef="slow" relativeDistanceType="longitudinal" value="10" freespace="false"'
    )
    near = by("Ego", f'{near} coordinateSystem="road" rule="lessOrEqual"/>')
    played = group(2, ("Ego", NOTHING, near))
    assert played.begun("event 0") == pytest.approx([1.0])
    why = next(
        change.why for frame in played.frames for change in frame.changes if change.element == "event 0" and change.why
    )
    assert "Second" in why
    assert "Third" not in why


def test_a_free_lane_is_free_of_all_members(group: Any) -> None:
    """Both of the group are in lane -2; Ego's own lane is free, and in front of it nobody drives there within 50 m."""
    free = """<RelativeClearanceCondition distanceForward="{}" distanceBackward="0" freeSpace="false"
      oppositeLanes="false"><RelativeLaneRange from="-1" to="-1"/><EntityRef entityRef="slow"/>
      </RelativeClearanceCondition>"""
    assert group(0.5, ("Ego", NOTHING, by("Ego", free.format(5)))).begun("event 0") == [0.0]
    assert group(0.5, ("Ego", NOTHING, by("Ego", free.format(50)))).begun("event 0") == []


@pytest.mark.element("selectTriggeringEntities")
def test_the_entities_that_triggered_the_act_act_beside_the_actors(group: Any) -> None:
    """Second and Third are slower than 15 m/s, Ego is faster; who triggers a single event does not matter (7.3.1)."""
    slower = by("all", '<SpeedCondition value="15" rule="lessThan"/>')
    faster = by("all", '<SpeedCondition value="15" rule="greaterThan"/>')
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
def test_all_groups_of_conditions_that_hold_select(group: Any) -> None:
    """Of two condition groups Ego fulfils one, and Third the other; both act."""
    far = by("Third", '<TraveledDistanceCondition value="0"/>')
    fast = by("Ego", '<SpeedCondition value="15" rule="greaterThan"/>')
    other = '</Condition></ConditionGroup><ConditionGroup><Condition name="d" delay="0" conditionEdge="none">'
    played = group(1, ("Second", SPEED), start=f"{fast}{other}{far}")
    assert [played.of(name, "speed")[-1] for name in CARS] == [5, 5, 5]


@pytest.mark.element("selectTriggeringEntities")
def test_who_triggers_late_or_by_an_end_is_who_did_it_then(group: Any) -> None:
    """Ego is nearer than 5 m to where it began until 0.25 s, and nobody is when the trigger fires."""
    near = by(
        "all",
        '<DistanceCondition value="5" rule="lessThan" freespace="false"><Position><LanePosition roadId="1" laneId="-1" '
        's="100"/></Position></DistanceCondition>',
    )
    brighter = private(
        '<AppearanceAction><LightStateAction><LightType><VehicleLight vehicleLightType="lowBeam"/></LightType>'
        '<LightState mode="on"/></LightStateAction></AppearanceAction>'
    )
    for options, time in (({"edge": "falling"}, 0.25), ({"delay": 0.8}, 0.8)):
        played = group(2, ("Third", brighter), start=near, **options)
        assert played.begun("event 0") == pytest.approx([time])
        assert set(played.frames[-1].appearances) == {"Ego", "Third"}


@pytest.mark.element("EntitySelection")
def test_a_group_without_members_is_near_nobody_and_in_nobody_s_way(group: Any) -> None:
    nobody = '<EntitySelection name="walkers"><Members><ByType objectType="pedestrian"/></Members></EntitySelection>'
    near = """<RelativeDistanceCondition entityRef="walkers" relativeDistanceType="longitudinal" value="1000"
      freespace="false" rule="lessThan"/>"""
    assert group(0.5, ("Ego", NOTHING, by("Ego", near)), more=nobody).begun("event 0") == []
    free = """<RelativeClearanceCondition distanceForward="50" distanceBackward="0" freeSpace="false"
      oppositeLanes="false"><RelativeLaneRange from="-1" to="-1"/>{}</RelativeClearanceCondition>"""
    walkers = free.format('<EntityRef entityRef="walkers"/>')
    assert group(0.5, ("Ego", NOTHING, by("Ego", free.format(""))), more=nobody).begun("event 0") == []
    assert group(0.5, ("Ego", NOTHING, by("Ego", walkers)), more=nobody).begun("event 0") == [0.0]


def test_a_group_is_deleted_and_one_car_is_meant_where_one_has_to_be(group: Any) -> None:
    delete = everywhere('<EntityAction entityRef="slow"><DeleteEntityAction/></EntityAction>')
    played = group(1, ("Ego", delete, after(0.5)))
    assert played.frames[0].view.names == ("Ego", "Second", "Third")
    assert played.frames[-1].view.names == ("Ego",)
    follow = private(
        '<LongitudinalAction><LongitudinalDistanceAction entityRef="{}" freespace="false" continuous="false" '
        'distance="30"/></LongitudinalAction>'
    )
    with pytest.raises(InputError, match="names the selection 'slow' of 2 entities"):
        group(1, ("Ego", follow.format("slow")))
    alone = '<EntitySelection name="one"><Members><EntityRef entityRef="Second"/></Members></EntitySelection>'
    assert group(8, ("Ego", follow.format("one")), more=alone).result.end_reason == "stop trigger"


def test_a_group_in_a_circle_is_an_error(group: Any) -> None:
    ring = '<EntitySelection name="{}"><Members><EntityRef entityRef="{}"/></Members></EntitySelection>'
    with pytest.raises(InputError, match="is a member of itself"):
        group(1, ("a", SPEED), more=ring.format("a", "b") + ring.format("b", "a"))


OBJECT = """<objects><object id="77" name="hut" type="building" s="200" t="-9" zOffset="0" hdg="0.5" length="4"
  width="3" height="2.5"/></objects>"""


@pytest.mark.element("ExternalObjectReference")
def test_an_external_object_is_where_and_what_the_road_network_says(run: Any) -> None:
    street = STREET.replace("</lanes>", f"</lanes>{OBJECT}")
    external = '<ScenarioObject name="Hut"><ExternalObjectReference name="{}"/></ScenarioObject>'
    for name in ("77", "hut"):
        played = run(0.2, more=external.format(name), street=street)
        view = played.frames[0].view
        row = view.row("Hut")
        assert view.boxes[row].tolist() == pytest.approx([200.0, -9.0, 1.25, 4.0, 3.0, 2.5, 0.5])
        assert played.result.warnings == ()


def test_an_unknown_external_object_is_a_box_where_the_scenario_puts_it(run: Any) -> None:
    external = '<ScenarioObject name="Thing"><ExternalObjectReference name="elsewhere"/></ScenarioObject>'
    add = everywhere(
        '<EntityAction entityRef="Thing"><AddEntityAction><Position><WorldPosition x="140" y="-2" h="0"/></Position>'
        "</AddEntityAction></EntityAction>"
    )
    played = run(1, ("Ego", add, after(0.5)), more=external)
    assert "Thing" not in played.frames[0].view
    view = played.frames[-1].view
    assert view.size[view.row("Thing")].tolist() == [0.5, 0.5, 0.5]
    assert "'elsewhere', of which nothing is known here" in played.result.warnings[0]


def test_a_selection_by_type_knows_external_objects(run: Any) -> None:
    external = '<ScenarioObject name="Thing"><ExternalObjectReference name="elsewhere"/></ScenarioObject>'
    chosen = '<EntitySelection name="outer"><Members><ByType objectType="external"/></Members></EntitySelection>'
    put = private('<TeleportAction><Position><WorldPosition x="140" y="-2" h="0"/></Position></TeleportAction>')
    add = everywhere(
        '<EntityAction entityRef="outer"><AddEntityAction><Position><WorldPosition x="150" y="-2" h="0"/></Position>'
        "</AddEntityAction></EntityAction>"
    )
    played = run(1, ("outer", put, after(0.5)), more=external + chosen, globally=add)
    x = played.x("Thing")
    assert (x[0], x[-1]) == (150.0, 140.0)

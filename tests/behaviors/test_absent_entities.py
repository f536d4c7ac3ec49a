"""Actions of deleted entities, and actions that refer to deleted entities."""

from __future__ import annotations

import pytest
from openscenario_xml import round_car_xml
from recorded_scene import RecordedScene, RunScene
from storyboard_xml import global_xml, private_xml, speed_xml
from street_scene import after
from whole_run import Run

from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.simulation import Simulation

DELETE = global_xml('<EntityAction entityRef="Other"><DeleteEntityAction/></EntityAction>')
TO_OTHER_S_LANE = private_xml(
    '<LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="linear" dynamicsDimension="time" '
    'value="1"/><LaneChangeTarget><RelativeTargetLane entityRef="Other" value="0"/></LaneChangeTarget>'
    "</LaneChangeAction></LateralAction>"
)
BESIDE_OTHER = private_xml(
    '<LateralAction><LaneOffsetAction continuous="true"><LaneOffsetActionDynamics dynamicsShape="step"/>'
    '<LaneOffsetTarget><RelativeTargetLaneOffset entityRef="Other" value="1"/></LaneOffsetTarget>'
    "</LaneOffsetAction></LateralAction>"
)
BEHIND_EGO = private_xml(
    '<LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" distance="20" continuous="false" '
    'freespace="false"/></LongitudinalAction>'
)
DRIVE_TO = private_xml(
    '<RoutingAction><AcquirePositionAction><Position><LanePosition roadId="1" laneId="-1" s="300"/></Position>'
    "</AcquirePositionAction></RoutingAction>"
)


def transitions(played: RecordedScene, element: str) -> list[tuple[float, str]]:
    return [
        (round(change.time, 3), change.transition.name)
        for change in played.changes
        if change.element == element and change.transition is not None
    ]


@pytest.mark.parametrize(
    ("actor", "action"),
    [("Ego", TO_OTHER_S_LANE), ("Ego", BESIDE_OTHER), ("Other", BEHIND_EGO), ("Other", DRIVE_TO)],
    ids=["lane of", "beside", "behind", "to"],
)
def test_action_with_deleted_entity_is_stopped_at_its_start(scene: RunScene, actor: str, action: str) -> None:
    played = scene(2, ("Ego", DELETE, after(0.45)), (actor, action, after(0.95)))
    assert transitions(played, "action 1") == [(1.0, "START"), (1.0, "STOP")]
    assert transitions(played, "event 1") == [(1.0, "START"), (1.0, "END")]
    assert played.at(2.0).x == pytest.approx(140.0)


@pytest.mark.element("DeleteEntityAction")
def test_action_stops_when_its_reference_entity_is_deleted(scene: RunScene) -> None:
    played = scene(2, ("Ego", BESIDE_OTHER), ("Ego", DELETE, after(0.95)))
    assert transitions(played, "action 0") == [(0.0, "START"), (1.1, "STOP")]
    assert next(c.why for c in played.changes if c.element == "action 0" and c.why) == "Other is absent"


LIMITS = '<DynamicConstraints maxAcceleration="1" maxDeceleration="1" maxSpeed="30"/>'
AS_FAST = private_xml(
    '<LongitudinalAction><SpeedAction><SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="rate" value="1"/>'
    '<SpeedActionTarget><RelativeTargetSpeed entityRef="Other" value="2" speedTargetValueType="delta" continuous="{}"/>'
    "</SpeedActionTarget></SpeedAction></LongitudinalAction>"
)
KEEP_BEHIND = private_xml(
    '<LongitudinalAction><LongitudinalDistanceAction entityRef="Other" distance="20" continuous="{}" '
    f'freespace="false">{LIMITS}</LongitudinalDistanceAction></LongitudinalAction>'
)
KEEP_ASIDE = private_xml(
    '<LateralAction><LateralDistanceAction entityRef="Other" distance="9" continuous="{}" freespace="false">'
    f"{LIMITS}</LateralDistanceAction></LateralAction>"
)
MEET = private_xml(
    '<SynchronizeAction masterEntityRef="Other"><TargetPositionMaster><LanePosition roadId="1" laneId="-1" s="400"/>'
    '</TargetPositionMaster><TargetPosition><LanePosition roadId="1" laneId="-1" s="400"/></TargetPosition>'
    "</SynchronizeAction>"
)


@pytest.mark.parametrize("continuous", ["true", "false"])
@pytest.mark.parametrize("action", [AS_FAST, KEEP_BEHIND, KEEP_ASIDE, MEET], ids=["speed", "behind", "aside", "meet"])
def test_action_relative_to_a_deleted_entity_stops(scene: RunScene, action: str, continuous: str) -> None:
    played = scene(3, ("Ego", action.format(continuous)), ("Ego", DELETE, after(0.95)))
    assert transitions(played, "action 0") == [(0.0, "START"), (1.1, "STOP")]
    assert played.at(3.0).speed == played.at(2.0).speed


@pytest.mark.element("SynchronizeAction")
@pytest.mark.parametrize(("deleted", "stopped"), [(0.475, 1.0), (1.475, 1.55)])
def test_synchronize_with_a_target_at_an_absent_entity_stops(run: Run, deleted: float, stopped: float) -> None:
    """It is stopped at its start at 1 s, or as soon as the entity is gone, with a warning."""
    at_other = '<RelativeLanePosition entityRef="Other" dLane="0" dsLane="0"/>'
    lane = '<LanePosition roadId="1" laneId="-1" s="400"/>'
    action = MEET.replace("Other", "Master").replace(f"<TargetPosition>{lane}", f"<TargetPosition>{at_other}")
    others = {"Other": (-1, 300.0, 10.0), "Master": (-2, 150.0, 10.0)}
    played = run(2, ("Ego", action, after(0.975)), ("Ego", DELETE, after(deleted)), others=others, driven=False)
    (stop,) = [
        change for frame in played.frames for change in frame.changes if change.element == "action 0" and change.why
    ]
    assert stop.time == pytest.approx(stopped)
    assert stop.why == "Other is absent"
    assert any("SynchronizeAction: not executed, as Other is absent" in text for text in played.result.warnings)


def test_speed_relative_to_an_absent_entity_is_stopped_at_its_start(scene: RunScene) -> None:
    played = scene(2, ("Ego", DELETE, after(0.45)), ("Ego", AS_FAST.format("false"), after(0.95)))
    assert transitions(played, "action 1") == [(1.0, "START"), (1.0, "STOP")]
    assert played.at(2.0).speed == 20.0


def test_action_with_absent_entity_warns_at_the_end(run: Run) -> None:
    others = {"Other": (-2, 150.0, 10.0)}
    played = run(2, ("Ego", DELETE, after(0.45)), ("Other", DRIVE_TO, after(0.95)), others=others, driven=False)
    (warning,) = [text for text in played.result.warnings if "AcquirePosition" in text]
    assert "not executed, as Other is absent" in warning


@pytest.mark.element("AddEntityAction", "DeleteEntityAction")
def test_entity_deleted_and_added_at_one_instant_is_moved(run: Run) -> None:
    """After deletion and addition in one event, Other stands at its new position from the next view on."""
    back = global_xml(
        '<EntityAction entityRef="Other"><AddEntityAction><Position><LanePosition roadId="1" laneId="-1" s="300"/>'
        "</Position></AddEntityAction></EntityAction>"
    )
    others = {"Other": (-2, 150.0, 10.0)}
    both = (("Ego", DELETE, after(0.475)), ("Ego", back, after(0.475)))
    x = run(1, *both, others=others, driven=False).x("Other")
    assert x[10:13] == pytest.approx([155.0, 300.0, 300.0])


@pytest.mark.element("AddEntityAction", "DeleteEntityAction")
def test_adding_a_present_or_deleting_an_absent_entity_warns_without_effect(run: Run) -> None:
    """Other goes on from x = 150 at 10 m/s; its deletion at 0.5 s leaves nothing to delete at 0.7 s."""
    back = global_xml(
        '<EntityAction entityRef="Other"><AddEntityAction><Position><LanePosition roadId="1" laneId="-1" s="300"/>'
        "</Position></AddEntityAction></EntityAction>"
    )
    steps = (("Ego", back, after(0.225)), ("Ego", DELETE, after(0.475)), ("Ego", DELETE, after(0.675)))
    seen: list[float] = []

    def watch(_: Simulation, frame: Frame) -> None:
        row = frame.view.rows.get("Other")
        if row is not None:
            seen.append(float(frame.view.position[row, 0]))

    played = run(1, *steps, others={"Other": (-2, 150.0, 10.0)}, driven=False, during=watch)
    assert seen == pytest.approx([150.0 + 0.5 * tick for tick in range(11)])
    texts = [str(one) for one in played.result.warnings]
    assert any("AddEntityAction: no effect: entity 'Other' is present" in text for text in texts)
    assert any("DeleteEntityAction: no effect: entity 'Other' is absent" in text for text in texts)


SPEED_UP = speed_xml(20, 1)
TO_THE_SIDE = private_xml(
    '<LateralAction><LaneOffsetAction continuous="false"><LaneOffsetActionDynamics maxLateralAcc="1" '
    'dynamicsShape="linear"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="1"/></LaneOffsetTarget>'
    "</LaneOffsetAction></LateralAction>"
)
PROFILE = private_xml(
    '<LongitudinalAction><SpeedProfileAction followingMode="position"><SpeedProfileEntry speed="20" time="1"/>'
    "</SpeedProfileAction></LongitudinalAction>"
)
TOGETHER = private_xml(
    '<SynchronizeAction masterEntityRef="Ego"><TargetPositionMaster><LanePosition roadId="1" laneId="-1" s="400"/>'
    '</TargetPositionMaster><TargetPosition><LanePosition roadId="1" laneId="-1" s="400"/></TargetPosition>'
    "</SynchronizeAction>"
)
BACK = global_xml(
    '<EntityAction entityRef="Other"><AddEntityAction><Position><LanePosition roadId="1" laneId="-1" s="300"/>'
    "</Position></AddEntityAction></EntityAction>"
)


@pytest.mark.parametrize(
    "action", [SPEED_UP, TO_THE_SIDE, PROFILE, TOGETHER], ids=["speed", "offset", "profile", "meet"]
)
def test_action_of_absent_entity_has_no_effect(scene: RunScene, action: str) -> None:
    played = scene(3, ("Ego", DELETE, after(0.45)), ("Other", action, after(0.95)), ("Ego", BACK, after(2.05)))
    assert transitions(played, "action 1") == [(1.0, "START"), (1.0, "STOP")]
    assert next(c.why for c in played.changes if c.element == "action 1" and c.why) == "Other is absent"
    assert (played.at(2.2, "Other").x, played.at(2.2, "Other").y) == (300.0, -2.0)
    assert played.at(3.0, "Other").speed == 0.0


@pytest.mark.parametrize(("entry", "speed"), [(0.0, 20.0), (0.5, 0.0)])
def test_action_of_init_is_performed_if_its_entity_enters_at_once(run: Run, entry: float, speed: float) -> None:
    """The entity has no position in Init. An action of Init does not wait for it beyond the start of the run."""
    absent = round_car_xml("Third")
    add = BACK.replace('"Other"', '"Third"')
    condition = (after(entry - 0.025),) if entry > 0.0 else ()
    init = f'<Private entityRef="Third">{SPEED_UP}</Private>'
    played = run(3, ("Ego", add, *condition), driven=False, more=absent, init=init)
    view = played.frames[-1].view
    assert view.speed[view.row("Third")] == pytest.approx(speed)
    warned = any("SpeedAction: not executed, as Third is absent" in text for text in played.result.warnings)
    assert warned is (speed == 0.0)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)], ids=["enters first", "acts first"])
@pytest.mark.parametrize("action", [SPEED_UP, TO_THE_SIDE], ids=["speed", "offset"])
def test_action_of_entity_added_at_the_same_instant_is_performed(
    scene: RunScene, order: tuple[int, int], action: str
) -> None:
    """Triggers that hold at one instant have no order, nor do their actions. An added entity stands, so that it moves
    sideways once it has a speed.
    """
    both = (("Ego", BACK, after(0.95)), ("Other", action, after(0.95)))
    more = (("Other", speed_xml(10), after(1.25)),) if action == TO_THE_SIDE else ()
    played = scene(4, ("Ego", DELETE, after(0.45)), *(both[number] for number in order), *more)
    ended = [name for _, name in transitions(played, f"action {1 + order.index(1)}")]
    assert ended == ["START", "END"]
    there = played.at(4.0, "Other")
    assert (there.speed, there.y) == ((20.0, -2.0) if action == SPEED_UP else (10.0, -1.0))


def test_entity_added_again_stands_at_its_position(scene: RunScene) -> None:
    """AddEntityAction has a position only: the speed is not that before the deletion."""
    played = scene(3, ("Other", DRIVE_TO), ("Ego", DELETE, after(0.95)), ("Ego", BACK, after(1.95)))
    assert {played.at(time, "Other").x for time in (2.1, 2.5, 3.0)} == {300.0}
    assert played.at(3.0, "Other").speed == 0.0


def test_driven_ego_is_deleted_and_added_again(run: Run) -> None:
    delete = global_xml('<EntityAction entityRef="Ego"><DeleteEntityAction/></EntityAction>')
    add = BACK.replace('"Other"', '"Ego"')
    played = run(2, ("Ego", delete, after(0.475)), ("Ego", add, after(0.975)), others={"Other": (-2, 150.0, 10.0)})
    present = ["Ego" in frame.view for frame in played.frames]
    assert present.index(False) == 11
    assert present[21:] == [True] * 20
    view = played.frames[21].view
    assert 300.0 <= view.position[view.rows["Ego"], 0] < 301.1, (
        "the engine already moves it in the step in which it is added"
    )

"""Routes, controllers, values, signals, environment and what is handed on."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from eidrive_scenario.api.actions import CustomCommand, LightState, Override, Visibility
from eidrive_scenario.errors import ScenarioError


def after(time: float) -> str:
    return f'<ByValueCondition><SimulationTimeCondition value="{time}" rule="greaterThan"/></ByValueCondition>'


def private(action: str) -> str:
    return f"<PrivateAction>{action}</PrivateAction>"


def everywhere(action: str) -> str:
    return f"<GlobalAction>{action}</GlobalAction>"


@pytest.mark.element("AssignRouteAction")
def test_a_route_becomes_the_path_of_who_drives_itself(scene: Any) -> None:
    position = '<Position><LanePosition roadId="1" laneId="-1" s="{}"/></Position>'
    waypoint = f'<Waypoint routeStrategy="shortest">{position}</Waypoint>'
    route = f'<Route name="way" closed="false">{waypoint.format(120)}{waypoint.format(400)}</Route>'
    action = private(f"<RoutingAction><AssignRouteAction>{route}</AssignRouteAction></RoutingAction>")
    path = scene(0.2, ("Ego", action), driven=True).commands[0].goals["Ego"].path
    assert np.allclose(path[[0, -1], :2], [[100.0, -2.0], [400.0, -2.0]])


@pytest.mark.element("AcquirePositionAction")
def test_a_position_to_acquire_is_a_route_from_here(scene: Any) -> None:
    position = '<Position><LanePosition roadId="1" laneId="-1" s="300"/></Position>'
    action = private(f"<RoutingAction><AcquirePositionAction>{position}</AcquirePositionAction></RoutingAction>")
    path = scene(0.2, ("Ego", action), driven=True).commands[0].goals["Ego"].path
    assert np.allclose(path[[0, -1], :2], [[100.0, -2.0], [300.0, -2.0]])


@pytest.mark.parametrize(
    "action",
    [
        "<AcquirePositionAction>{}</AcquirePositionAction>",
        '<AssignRouteAction><Route name="back" closed="false"><Waypoint routeStrategy="shortest">{}</Waypoint>'
        '<Waypoint routeStrategy="shortest">{}</Waypoint></Route></AssignRouteAction>',
    ],
)
def test_a_position_to_which_no_lanes_lead_is_told_with_its_line(scene: Any, action: str) -> None:
    """It lies behind, in a lane of the same direction."""
    behind, further = (f'<Position><LanePosition roadId="1" laneId="-2" s="{s}"/></Position>' for s in (50, 20))
    with pytest.raises(ScenarioError, match=r"scene\.xosc:\d+: .*no way over the lanes from road '1' lane -"):
        scene(0.2, ("Ego", private(f"<RoutingAction>{action.format(behind, further)}</RoutingAction>")))


@pytest.mark.element("ActivateControllerAction")
def test_a_controller_that_is_turned_off_leaves_the_actor_to_its_lane(scene: Any) -> None:
    off = private(
        '<ControllerAction><ActivateControllerAction lateral="false" longitudinal="false"/></ControllerAction>'
    )
    on = private('<ControllerAction><ActivateControllerAction lateral="true" longitudinal="true"/></ControllerAction>')
    played = scene(1.0, ("Ego", off, after(0.25)), ("Ego", on, after(0.65)), driven=True)
    assert [("Ego" in commands.driven) for commands in played.commands] == [True] * 3 + [False] * 4 + [True] * 4
    assert played.at(0.3).x == 100.0
    assert played.at(0.5).x == pytest.approx(104.0)


def test_who_drives_itself_starts_with_the_speed_that_init_gives_it(scene: Any) -> None:
    assert scene(0.1, driven=True).at(0.0).speed == 20.0


def test_one_domain_alone_is_not_driving(scene: Any) -> None:
    off = private('<ControllerAction><ActivateControllerAction lateral="false"/></ControllerAction>')
    assert scene(0.3, ("Ego", off), driven=True).commands[-1].driven == frozenset()


def test_a_controller_of_ours_is_not_given_during_the_run(scene: Any) -> None:
    action = private("""<ControllerAction><AssignControllerAction activateLateral="true"><ObjectController>
      <Controller name="late" controllerType="movement"><Properties>
      <Property name="module" value="eidrive"/></Properties></Controller></ObjectController></AssignControllerAction>
      </ControllerAction>""")
    with pytest.raises(ScenarioError, match="assign it in the entity's ObjectController"):
        scene(0.2, ("Ego", action))


def test_pedals_are_held_until_they_are_given_back(scene: Any) -> None:
    hold = private(
        '<ControllerAction><OverrideControllerValueAction><Brake active="{}"><BrakePercent value="0.5"/></Brake>'
        "</OverrideControllerValueAction></ControllerAction>"
    )
    played = scene(0.6, ("Ego", hold.format("true")), ("Ego", hold.format("false"), after(0.35)))
    assert played.commands[2].overrides == {"Ego": {"brake": Override("brake", 0.5)}}
    assert played.commands[4].overrides == {}


@pytest.mark.element("VariableSetAction", "VariableModifyAction", "VariableCondition", "VariableDeclaration")
def test_variables_and_parameters_are_set_and_calculated_with(scene: Any) -> None:
    triple = everywhere(
        '<VariableAction variableRef="Mood"><ModifyAction><Rule><MultiplyByValue value="3"/></Rule></ModifyAction>'
        "</VariableAction>"
    )
    number = everywhere('<VariableAction variableRef="Mood"><SetAction value="7"/></VariableAction>')
    seen = '<ByValueCondition><VariableCondition variableRef="Mood" rule="equalTo" value="{}"/></ByValueCondition>'
    nothing = private('<VisibilityAction graphics="true" sensors="true" traffic="true"/>')
    played = scene(
        1,
        ("Ego", number, after(0.15)),
        ("Ego", triple, after(0.35)),
        ("Ego", nothing, seen.format("calm")),
        ("Ego", nothing, seen.format(7)),
        ("Ego", nothing, seen.format("21.0")),
    )
    assert [played.when(f"event {n}", "runningState") for n in (2, 3, 4)] == pytest.approx([0.0, 0.2, 0.4])
    assert played.why("event 4") == "variable Mood = 21 = 21.0"


@pytest.mark.element("ParameterSetAction", "ParameterModifyAction", "ParameterCondition")
def test_a_parameter_that_is_set_and_modified_is_seen_by_conditions(scene: Any) -> None:
    """Level is declared as 2: set to 7 at 0.2 s, times 3 at 0.4 s, less 1 at 0.6 s."""
    action = '<ParameterAction parameterRef="Level">{}</ParameterAction>'
    rule = "<ModifyAction><Rule>{}</Rule></ModifyAction>"
    changes = (
        '<SetAction value="7"/>',
        rule.format('<MultiplyByValue value="3"/>'),
        rule.format('<AddValue value="-1"/>'),
    )
    seen = '<ByValueCondition><ParameterCondition parameterRef="Level" rule="equalTo" value="{}"/></ByValueCondition>'
    nothing = private('<VisibilityAction graphics="true" sensors="true" traffic="true"/>')
    played = scene(
        1,
        *(
            ("Ego", everywhere(action.format(change)), after(t))
            for change, t in zip(changes, (0.15, 0.35, 0.55), strict=True)
        ),
        *(("Ego", nothing, seen.format(value)) for value in (2, 7, 21, 20)),
    )
    assert [played.when(f"event {n}", "runningState") for n in (3, 4, 5, 6)] == pytest.approx([0.0, 0.2, 0.4, 0.6])


def test_to_calculate_with_a_word_is_an_error(scene: Any) -> None:
    rule = '<Rule><AddValue value="3"/></Rule>'
    add = f'<VariableAction variableRef="Mood"><ModifyAction>{rule}</ModifyAction></VariableAction>'
    with pytest.raises(ScenarioError, match=r"Mood is not a number \(got 'calm'; expected a number\)"):
        scene(0.2, ("Ego", everywhere(add)))


@pytest.mark.element("TrafficSignalStateAction", "TrafficSignalCondition")
def test_a_signal_changes_and_conditions_below_see_it_in_the_same_tick(scene: Any) -> None:
    change = everywhere(
        "<InfrastructureAction><TrafficSignalAction>"
        '<TrafficSignalStateAction name="17" state="green"/></TrafficSignalAction></InfrastructureAction>'
    )
    green = '<ByValueCondition><TrafficSignalCondition name="17" state="green"/></ByValueCondition>'
    nothing = private('<VisibilityAction graphics="true" sensors="false" traffic="true"/>')
    played = scene(0.5, ("Ego", change, after(0.15)), ("Ego", nothing, green))
    assert played.commands[2].signals == {"17": "green"}
    assert played.when("event 1", "runningState") == pytest.approx(0.2)
    assert played.commands[2].appearances["Ego"].visibility == Visibility(sensors=False)


@pytest.mark.element("TimeOfDayCondition")
def test_the_environment_and_its_clock(scene: Any) -> None:
    environment = everywhere(
        '<EnvironmentAction><Environment name="noon"><TimeOfDay animation="true" dateTime="2024-06-01T12:00:00"/>'
        "</Environment></EnvironmentAction>"
    )
    past = '<TimeOfDayCondition rule="greaterThan" dateTime="2024-06-01T12:00:00.45"/>'
    noon = f"<ByValueCondition>{past}</ByValueCondition>"
    nothing = private('<VisibilityAction graphics="true" sensors="true" traffic="true"/>')
    played = scene(1, ("Ego", environment, after(0.15)), ("Ego", nothing, noon))
    assert played.commands[2].environment.name == "noon"
    assert played.when("event 1", "runningState") == pytest.approx(0.7)


@pytest.mark.element("LightStateAction")
def test_lights_of_different_kinds_do_not_displace_each_other(scene: Any) -> None:
    light = private(
        '<AppearanceAction><LightStateAction transitionTime="{}"><LightType><VehicleLight vehicleLightType="{}"/>'
        '</LightType><LightState mode="{}"/></LightStateAction></AppearanceAction>'
    )
    played = scene(
        2,
        ("Ego", light.format(1, "lowBeam", "on")),
        ("Ego", light.format(1, "brakeLights", "on"), after(0.15)),
        ("Ego", light.format(1, "lowBeam", "off"), after(0.35)),
    )
    assert played.commands[0].appearances["Ego"].lights == {"lowBeam": LightState("lowBeam", "on", fade=1.0)}
    assert set(played.commands[3].appearances["Ego"].lights) == {"lowBeam", "brakeLights"}
    assert played.when("action 0", "completeState") == pytest.approx(0.4)
    assert played.when("action 1", "completeState") == pytest.approx(1.2)


@pytest.mark.element("CustomCommandAction")
def test_a_command_is_handed_on_once(scene: Any) -> None:
    command = (
        '<UserDefinedAction><CustomCommandAction type="eidrive.channel">ideal</CustomCommandAction></UserDefinedAction>'
    )
    played = scene(0.3, ("Ego", command))
    (found,) = played.commands[0].custom
    assert isinstance(found, CustomCommand)
    assert (found.type, found.content) == ("eidrive.channel", "ideal")
    assert found.line > 0
    assert played.commands[1].custom == []

"""Actions on routes, controllers, values, signals, environment and appearance, and custom commands."""

from __future__ import annotations

import numpy as np
import pytest
from recorded_scene import RunScene
from storyboard_xml import global_xml, lane_position_xml, private_xml, teleport_xml
from street_scene import NOTHING, after
from whole_run import Run

from eidrive_scenario.api.actions import CustomCommand, LightState, Override, Visibility
from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.simulation import RunSettings


@pytest.mark.element("AssignRouteAction")
def test_assigned_route_is_the_path_of_a_driven_vehicle(scene: RunScene) -> None:
    position = '<Position><LanePosition roadId="1" laneId="-1" s="{}"/></Position>'
    waypoint = f'<Waypoint routeStrategy="shortest">{position}</Waypoint>'
    route = f'<Route name="way" closed="false">{waypoint.format(120)}{waypoint.format(400)}</Route>'
    action = private_xml(f"<RoutingAction><AssignRouteAction>{route}</AssignRouteAction></RoutingAction>")
    path = scene(0.2, ("Ego", action), driven=True).commands[0].goals["Ego"].path
    assert path is not None
    assert np.allclose(path[[0, -1], :2], [[100.0, -2.0], [400.0, -2.0]])


@pytest.mark.element("AcquirePositionAction")
def test_acquire_position_assigns_a_route_from_the_actor(scene: RunScene) -> None:
    position = '<Position><LanePosition roadId="1" laneId="-1" s="300"/></Position>'
    action = private_xml(f"<RoutingAction><AcquirePositionAction>{position}</AcquirePositionAction></RoutingAction>")
    path = scene(0.2, ("Ego", action), driven=True).commands[0].goals["Ego"].path
    assert path is not None
    assert np.allclose(path[[0, -1], :2], [[100.0, -2.0], [300.0, -2.0]])


def acquire(s: float) -> str:
    position = f"<Position>{lane_position_xml(-1, s)}</Position>"
    return private_xml(f"<RoutingAction><AcquirePositionAction>{position}</AcquirePositionAction></RoutingAction>")


@pytest.mark.element("TeleportAction")
@pytest.mark.parametrize(
    ("lane", "s", "start"), [(-1, 200.0, 100.0), (-2, 200.0, 100.0), (-1, 20.0, 20.0), (1, 200.0, None)]
)
def test_route_of_a_teleported_vehicle_leads_from_there(
    scene: RunScene, lane: int, s: float, start: float | None
) -> None:
    """Beside the route it is unchanged, behind its start it is extended, and none leads from the opposite lane."""
    teleport = teleport_xml(lane_position_xml(lane, s))
    played = scene(0.6, ("Ego", acquire(300.0)), ("Ego", teleport, after(0.25)), driven=True)
    path = played.commands[-1].goals["Ego"].path
    assert (None if path is None else path[0, 0]) == start
    assert path is None or path[-1, 0] == pytest.approx(300.0)


@pytest.mark.element("TeleportAction")
@pytest.mark.parametrize("planner", ["route", "behavior"])
def test_vehicle_teleported_to_the_opposite_lane_follows_it_with_a_warning(run: Run, planner: str) -> None:
    """At 20 m/s the vehicle is on lane 1, whose center is at y = 2 m, from x = 300 m on to the start of the road."""
    teleport = teleport_xml(lane_position_xml(1, 300.0))
    settings = RunSettings(planner=planner)
    played = run(8.0, ("Ego", acquire(900.0)), ("Ego", teleport, after(2.0)), settings=settings)
    there = [frame.view.position[frame.view.rows["Ego"]] for frame in played.frames if frame.view.time > 2.1]
    assert [y for _, y, _ in there] == pytest.approx([2.0] * len(there), abs=0.3)
    assert there[-1][0] < 190.0
    (warning,) = [text for text in map(str, played.result.warnings) if "it follows its lane" in text]
    assert "TeleportAction: no way leads to the destination of the route of 'Ego'" in warning


@pytest.mark.parametrize(
    "action",
    [
        "<AcquirePositionAction>{}</AcquirePositionAction>",
        '<AssignRouteAction><Route name="back" closed="false"><Waypoint routeStrategy="shortest">{}</Waypoint>'
        '<Waypoint routeStrategy="shortest">{}</Waypoint></Route></AssignRouteAction>',
    ],
)
def test_route_to_unreachable_position_is_rejected_with_its_line(scene: RunScene, action: str) -> None:
    """The position is behind the actor, in a lane of the same direction."""
    behind, further = (f'<Position><LanePosition roadId="1" laneId="-2" s="{s}"/></Position>' for s in (50, 20))
    with pytest.raises(ScenarioError, match=r"scene\.xosc:\d+: .*no route over the lanes leads from road '1' lane -"):
        scene(0.2, ("Ego", private_xml(f"<RoutingAction>{action.format(behind, further)}</RoutingAction>")))


@pytest.mark.element("ActivateControllerAction")
def test_deactivated_controller_leaves_the_actor_in_its_lane(scene: RunScene) -> None:
    off = private_xml(
        '<ControllerAction><ActivateControllerAction lateral="false" longitudinal="false"/></ControllerAction>'
    )
    on = private_xml(
        '<ControllerAction><ActivateControllerAction lateral="true" longitudinal="true"/></ControllerAction>'
    )
    played = scene(1.0, ("Ego", off, after(0.25)), ("Ego", on, after(0.65)), driven=True)
    assert [("Ego" in commands.driven) for commands in played.commands] == [True] * 3 + [False] * 4 + [True] * 4
    assert played.at(0.3).x == 100.0
    assert played.at(0.5).x == pytest.approx(104.0)


def test_driven_vehicle_starts_with_the_speed_of_init(scene: RunScene) -> None:
    assert scene(0.1, driven=True).at(0.0).speed == 20.0


def test_controller_with_one_active_domain_is_not_driving(scene: RunScene) -> None:
    off = private_xml('<ControllerAction><ActivateControllerAction lateral="false"/></ControllerAction>')
    assert scene(0.3, ("Ego", off), driven=True).commands[-1].driven == frozenset()


def test_assignment_of_eidrive_controller_during_the_run_is_rejected(scene: RunScene) -> None:
    action = private_xml("""<ControllerAction><AssignControllerAction activateLateral="true"><ObjectController>
      <Controller name="late" controllerType="movement"><Properties>
      <Property name="module" value="eidrive"/></Properties></Controller></ObjectController></AssignControllerAction>
      </ControllerAction>""")
    with pytest.raises(ScenarioError, match="assign it in the entity's ObjectController"):
        scene(0.2, ("Ego", action))


def test_pedal_override_lasts_until_its_release(scene: RunScene) -> None:
    hold = private_xml(
        '<ControllerAction><OverrideControllerValueAction><Brake active="{}"><BrakePercent value="50"/></Brake>'
        "</OverrideControllerValueAction></ControllerAction>"
    )
    played = scene(0.6, ("Ego", hold.format("true")), ("Ego", hold.format("false"), after(0.35)))
    assert played.commands[2].overrides == {"Ego": {"brake": Override("brake", 0.5)}}
    assert played.commands[4].overrides == {}


@pytest.mark.element("VariableSetAction", "VariableModifyAction", "VariableCondition", "VariableDeclaration")
def test_variable_set_and_modify_apply_to_conditions(scene: RunScene) -> None:
    triple = global_xml(
        '<VariableAction variableRef="Mood"><ModifyAction><Rule><MultiplyByValue value="3"/></Rule></ModifyAction>'
        "</VariableAction>"
    )
    number = global_xml('<VariableAction variableRef="Mood"><SetAction value="7"/></VariableAction>')
    seen = '<ByValueCondition><VariableCondition variableRef="Mood" rule="equalTo" value="{}"/></ByValueCondition>'
    nothing = private_xml('<VisibilityAction graphics="true" sensors="true" traffic="true"/>')
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
def test_parameter_set_and_modify_apply_to_conditions(scene: RunScene) -> None:
    """Level is declared as 2: set to 7 at 0.2 s, times 3 at 0.4 s, minus 1 at 0.6 s."""
    action = '<ParameterAction parameterRef="Level">{}</ParameterAction>'
    rule = "<ModifyAction><Rule>{}</Rule></ModifyAction>"
    changes = (
        '<SetAction value="7"/>',
        rule.format('<MultiplyByValue value="3"/>'),
        rule.format('<AddValue value="-1"/>'),
    )
    seen = '<ByValueCondition><ParameterCondition parameterRef="Level" rule="equalTo" value="{}"/></ByValueCondition>'
    nothing = private_xml('<VisibilityAction graphics="true" sensors="true" traffic="true"/>')
    played = scene(
        1,
        *(
            ("Ego", global_xml(action.format(change)), after(t))
            for change, t in zip(changes, (0.15, 0.35, 0.55), strict=True)
        ),
        *(("Ego", nothing, seen.format(value)) for value in (2, 7, 21, 20)),
    )
    assert [played.when(f"event {n}", "runningState") for n in (3, 4, 5, 6)] == pytest.approx([0.0, 0.2, 0.4, 0.6])


def test_variable_beyond_all_numbers_remains_a_number(scene: RunScene) -> None:
    """In the notation of XML infinity is INF; as a text it would be below "a"."""
    change = '<VariableAction variableRef="Mood">{}</VariableAction>'
    rule = '<ModifyAction><Rule><MultiplyByValue value="-1e9"/></Rule></ModifyAction>'
    seen = '<ByValueCondition><VariableCondition variableRef="Mood" rule="lessThan" value="-1e300"/></ByValueCondition>'
    steps = [("Ego", global_xml(change.format('<SetAction value="1e305"/>')), after(0.15))]
    steps += [("Ego", global_xml(change.format(rule)), after(0.35))]
    played = scene(1, *steps, ("Ego", NOTHING, seen))
    assert played.when("event 2", "runningState") == pytest.approx(0.4)
    assert "variable Mood = -INF" in played.why("event 2")


@pytest.mark.parametrize(
    ("start", "rule", "expected"),
    [
        ("4503599627370496", '<AddValue value="1"/>', "4503599627370497"),
        ("0.1", '<AddValue value="0.2"/>', "0.3"),
        ("INF", '<MultiplyByValue value="0"/>', "NaN"),
    ],
)
def test_modified_variable_is_exact_in_xml_notation(scene: RunScene, start: str, rule: str, expected: str) -> None:
    """2**52 + 1 is a double, 0.1 + 0.2 is 0.3 to 15 digits, and infinity times 0 is not a number."""
    change = '<VariableAction variableRef="Mood">{}</VariableAction>'
    modify = f"<ModifyAction><Rule>{rule}</Rule></ModifyAction>"
    seen = f'<VariableCondition variableRef="Mood" rule="equalTo" value="{expected}"/>'
    by_value = f"<ByValueCondition>{seen}</ByValueCondition>"
    steps = [("Ego", global_xml(change.format(f'<SetAction value="{start}"/>')), after(0.15))]
    played = scene(1, *steps, ("Ego", global_xml(change.format(modify)), after(0.35)), ("Ego", NOTHING, by_value))
    assert played.when("event 2", "runningState") == pytest.approx(0.4)
    assert played.why("event 2") == f"variable Mood = {expected} = {expected}"


def test_variable_modify_of_text_is_rejected(scene: RunScene) -> None:
    rule = '<Rule><AddValue value="3"/></Rule>'
    add = f'<VariableAction variableRef="Mood"><ModifyAction>{rule}</ModifyAction></VariableAction>'
    with pytest.raises(ScenarioError, match=r"Mood is not a number \(got 'calm'; expected a number\)"):
        scene(0.2, ("Ego", global_xml(add)))


@pytest.mark.parametrize("text", ["1_0", "infinity", "true"])
def test_variable_modify_of_other_than_xml_numbers_is_rejected(scene: RunScene, text: str) -> None:
    """XML Schema, double: digits without separators, and INF; Python reads the first two as numbers."""
    change = '<VariableAction variableRef="Mood">{}</VariableAction>'
    add = "<ModifyAction><Rule><AddValue value='3'/></Rule></ModifyAction>"
    steps = [(change.format(f'<SetAction value="{text}"/>'), 0.15), (change.format(add), 0.35)]
    with pytest.raises(ScenarioError, match=rf"Mood is not a number \(got '{text}'; expected a number\)"):
        scene(1, *(("Ego", global_xml(action), after(time)) for action, time in steps))


@pytest.mark.element("TrafficSignalStateAction", "TrafficSignalCondition")
def test_signal_state_applies_to_conditions_in_the_same_tick(scene: RunScene) -> None:
    change = global_xml(
        "<InfrastructureAction><TrafficSignalAction>"
        '<TrafficSignalStateAction name="17" state="green"/></TrafficSignalAction></InfrastructureAction>'
    )
    green = '<ByValueCondition><TrafficSignalCondition name="17" state="green"/></ByValueCondition>'
    nothing = private_xml('<VisibilityAction graphics="true" sensors="false" traffic="true"/>')
    played = scene(0.5, ("Ego", change, after(0.15)), ("Ego", nothing, green))
    assert played.commands[2].signals == {"17": "green"}
    assert played.when("event 1", "runningState") == pytest.approx(0.2)
    assert played.commands[2].appearances["Ego"].visibility == Visibility(sensors=False)


@pytest.mark.element("TimeOfDayCondition")
def test_time_of_day_condition_follows_the_environment_clock(scene: RunScene) -> None:
    environment = global_xml(
        '<EnvironmentAction><Environment name="noon"><TimeOfDay animation="true" dateTime="2024-06-01T12:00:00"/>'
        "</Environment></EnvironmentAction>"
    )
    past = '<TimeOfDayCondition rule="greaterThan" dateTime="2024-06-01T12:00:00.45"/>'
    noon = f"<ByValueCondition>{past}</ByValueCondition>"
    nothing = private_xml('<VisibilityAction graphics="true" sensors="true" traffic="true"/>')
    played = scene(1, ("Ego", environment, after(0.15)), ("Ego", nothing, noon))
    noon_environment = played.commands[2].environment
    assert noon_environment is not None
    assert noon_environment.name == "noon"
    assert played.when("event 1", "runningState") == pytest.approx(0.7)


LIGHT = private_xml(
    '<AppearanceAction><LightStateAction transitionTime="{}"><LightType><VehicleLight vehicleLightType="{}"/>'
    '</LightType><LightState mode="{}"/></LightStateAction></AppearanceAction>'
)


@pytest.mark.element("LightStateAction")
def test_light_actions_on_different_lights_do_not_preempt(scene: RunScene) -> None:
    played = scene(
        2,
        ("Ego", LIGHT.format(1, "lowBeam", "on")),
        ("Ego", LIGHT.format(1, "brakeLights", "on"), after(0.15)),
        ("Ego", LIGHT.format(1, "lowBeam", "off"), after(0.35)),
    )
    assert played.commands[0].appearances["Ego"].lights == {"lowBeam": LightState("lowBeam", "on", fade=1.0)}
    assert set(played.commands[3].appearances["Ego"].lights) == {"lowBeam", "brakeLights"}
    assert played.when("action 0", "completeState") == pytest.approx(0.4)
    assert played.when("action 1", "completeState") == pytest.approx(1.2)


@pytest.mark.element("LightStateAction")
def test_fog_lights_are_those_at_the_front_and_rear(scene: RunScene) -> None:
    """The light types `fogLightsFront` and `fogLightsRear` (1.2) are parts of `fogLights`."""
    played = scene(
        1,
        ("Ego", LIGHT.format(0, "fogLightsRear", "off")),
        ("Ego", LIGHT.format(0, "fogLights", "on"), after(0.15)),
        ("Ego", LIGHT.format(0, "fogLightsFront", "off"), after(0.35)),
    )
    lights = [commands.appearances["Ego"].lights for commands in played.commands]
    assert {name: light.mode for name, light in lights[3].items()} == {"fogLightsFront": "on", "fogLightsRear": "on"}
    assert {name: light.mode for name, light in lights[5].items()} == {"fogLightsFront": "off", "fogLightsRear": "on"}


@pytest.mark.element("LightStateAction")
@pytest.mark.parametrize(("first", "second"), [("fogLightsFront", "fogLights"), ("fogLights", "fogLightsRear")])
def test_flashing_fog_light_is_preempted_by_a_light_that_shares_a_part(
    scene: RunScene, first: str, second: str
) -> None:
    """A flashing light lasts until a later action acquires its control domain (7.5.1)."""
    played = scene(1, ("Ego", LIGHT.format(0, first, "flashing")), ("Ego", LIGHT.format(0, second, "on"), after(0.15)))
    assert played.when("action 0", "completeState") == pytest.approx(0.2)


@pytest.mark.element("CustomCommandAction")
def test_custom_command_is_emitted_once(scene: RunScene) -> None:
    command = (
        '<UserDefinedAction><CustomCommandAction type="eidrive.channel">ideal</CustomCommandAction></UserDefinedAction>'
    )
    played = scene(0.3, ("Ego", command))
    (found,) = played.commands[0].custom
    assert isinstance(found, CustomCommand)
    assert (found.type, found.content) == ("eidrive.channel", "ideal")
    assert found.line > 0
    assert played.commands[1].custom == []

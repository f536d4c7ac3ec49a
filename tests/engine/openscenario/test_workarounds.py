"""Workarounds for schema deviations of authoring tools, which are read with a warning."""

import math
from pathlib import Path
from typing import TypeVar

import pytest
from lxml import etree
from openscenario_xml import catalog_xml, scenario_xml
from storyboard_xml import init_xml, story_xml, teleport_xml

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import Scenario, load_scenario
from eidrive_scenario.openscenario.model import (
    Action,
    LaneOffsetActionDynamics,
    LightMode,
    LightStateAction,
    ManeuverGroup,
    MiscObject,
    MiscObjectCategory,
    Orientation,
    Phase,
    Sun,
)

Kind = TypeVar("Kind")

LIGHT = """<Private entityRef="Ego"><PrivateAction><AppearanceAction><LightStateAction transitionTime="0">
<LightState mode="on"/>
<LightType><VehicleLight vehicleLightType="brakeLights"/></LightType></LightStateAction></AppearanceAction>
</PrivateAction></Private>"""
CONTROLLER = """<TrafficSignals><TrafficSignalController name="C"><Phase name="go" duration="2">
<TrafficeSignalGroupState state="green"/></Phase></TrafficSignalController></TrafficSignals>"""
ENVIRONMENT = """<Environment name="e"><Weather>
<Sun azimuth="0" elevation="1" {word}="1000"/></Weather></Environment>"""
SUNNY = f"<GlobalAction><EnvironmentAction>{ENVIRONMENT}</EnvironmentAction></GlobalAction>"
OFFSET = """<Private entityRef="Ego"><PrivateAction><LateralAction><LaneOffsetAction continuous="{continuous}">
<LaneOffsetActionDynamics maxLateralAcc="None" dynamicsShape="{shape}"/>
<LaneOffsetTarget><AbsoluteTargetLaneOffset value="1"/></LaneOffsetTarget></LaneOffsetAction></LateralAction>
</PrivateAction></Private>"""
MIXED = """<Story name="s"><Act name="a"><ManeuverGroup name="g" maximumExecutionCount="1">
<Actors selectTriggeringEntities="false"/><Maneuver name="m"><Event name="e" priority="parallel">
<Action name="x"><UserDefinedAction><CustomCommandAction type="x"/></UserDefinedAction></Action></Event></Maneuver>
<CatalogReference catalogName="ways" entryName="from the shelf"/></ManeuverGroup></Act></Story>"""
SHELF = """<Maneuver name="from the shelf"><Event name="e2" priority="parallel"><Action name="x">
<UserDefinedAction><CustomCommandAction type="x"/></UserDefinedAction></Action></Event></Maneuver>"""
BARE = """<GlobalAction><Environment name="e"/></GlobalAction>"""


def only(scenario: Scenario, kind: type[Kind]) -> Kind:
    return next(one for one in scenario.document.walk() if isinstance(one, kind))


def test_light_type_after_light_state_is_a_warning() -> None:
    scenario = load_scenario(scenario_xml(init=LIGHT))
    action = only(scenario, LightStateAction)
    assert action.light_state.mode is LightMode.ON
    assert action.light_type.vehicle_light is not None
    (warning,) = scenario.warnings
    assert "LightStateAction has LightState before LightType; put LightType first" in str(warning)
    assert action.line == warning.line


def test_workarounds_do_not_change_the_given_tree() -> None:
    root = etree.fromstring(scenario_xml(init=LIGHT))
    before = etree.tostring(root)
    load_scenario(root)
    assert etree.tostring(root) == before


def test_misspelled_signal_group_state_is_a_warning() -> None:
    scenario = load_scenario(scenario_xml(road=CONTROLLER))
    assert only(scenario, Phase).traffic_signal_group_state is not None
    assert "write TrafficSignalGroupState" in str(scenario.warnings[0])
    assert load_scenario(scenario_xml(minor=2, road=CONTROLLER)).warnings == ()


def test_illuminance_before_1_2_is_a_warning() -> None:
    scenario = load_scenario(scenario_xml(minor=1, init=SUNNY.format(word="illuminance"), story=story_xml()))
    assert only(scenario, Sun).intensity == 1000.0
    assert "increase revMinor to 2" in str(scenario.warnings[0])
    both = SUNNY.format(word='intensity="1" illuminance')
    with pytest.raises(ScenarioError, match="Sun has no attribute 'illuminance'; part of OpenSCENARIO"):
        load_scenario(scenario_xml(minor=1, init=both, story=story_xml()))


def test_workarounds_apply_to_catalogs(tmp_path: Path) -> None:
    (tmp_path / "skies.xosc").write_bytes(catalog_xml("skies", ENVIRONMENT.format(word="illuminance"), minor=1))
    place = f'<EnvironmentCatalog><Directory path="{tmp_path}"/></EnvironmentCatalog>'
    reference = '<CatalogReference catalogName="skies" entryName="e"/>'
    action = f"<GlobalAction><EnvironmentAction>{reference}</EnvironmentAction></GlobalAction>"
    scenario = load_scenario(scenario_xml(catalogs=place, init=action))
    (entry,) = scenario.entries.values()
    assert next(one.intensity for one in entry.walk() if isinstance(one, Sun)) == 1000.0
    (warning,) = [one for one in scenario.warnings if "illuminance" in one.message]
    assert (warning.source, warning.line) == (str(tmp_path / "skies.xosc"), 4)


def test_maneuver_before_catalog_reference_is_a_warning(tmp_path: Path) -> None:
    (tmp_path / "ways.xosc").write_bytes(catalog_xml("ways", SHELF))
    place = f'<ManeuverCatalog><Directory path="{tmp_path}"/></ManeuverCatalog>'
    scenario = load_scenario(scenario_xml(catalogs=place, story=MIXED))
    group = only(scenario, ManeuverGroup)
    assert (len(group.catalog_reference), len(group.maneuver)) == (1, 1)
    assert "put CatalogReferences first" in str(scenario.warnings[0])


def test_command_without_user_defined_action_is_a_warning() -> None:
    """scenariogeneration writes user-defined actions of Init in this form, and accepts them in events."""
    command = '<CustomCommandAction type="eidrive.channel">none</CustomCommandAction>'
    event = MIXED.replace("<UserDefinedAction>", "").replace("</UserDefinedAction>", "")
    story = event.replace('<CatalogReference catalogName="ways" entryName="from the shelf"/>', "")
    scenario = load_scenario(scenario_xml(init=command, story=story))
    assert [one.custom_command_action.type for one in scenario.storyboard.init.actions.user_defined_action] == [
        "eidrive.channel"
    ]
    action = only(scenario, Action)
    assert action.user_defined_action is not None
    assert action.user_defined_action.line == action.line
    assert [str(one).count("put it into a UserDefinedAction") for one in scenario.warnings] == [1, 1]


def test_misspelled_traffic_island_is_a_warning() -> None:
    island = """<ScenarioObject name="Island"><MiscObject name="i" mass="1" miscObjectCategory="grafficIsland">
    <BoundingBox><Center x="0" y="0" z="0"/><Dimensions length="1" width="1" height="1"/></BoundingBox>
    <Properties/></MiscObject></ScenarioObject>"""
    scenario = load_scenario(scenario_xml(entities=island))
    assert only(scenario, MiscObject).misc_object_category is MiscObjectCategory.TRAFFIC_ISLAND
    assert "write trafficIsland" in str(scenario.warnings[0])


def test_python_infinity_is_a_warning() -> None:
    scenario = load_scenario(scenario_xml(init=OFFSET.format(continuous="true", shape="step").replace("None", "inf")))
    assert only(scenario, LaneOffsetActionDynamics).max_lateral_acc == math.inf
    assert "is 'inf', which is read as infinity; write INF" in str(scenario.warnings[0])


def test_empty_orientation_is_a_warning() -> None:
    """Until 1.2 the type is absolute and the heading 0; scenariogeneration writes it by default."""
    relative = '<RelativeObjectPosition entityRef="Ego" dx="1" dy="0"><Orientation {}/></RelativeObjectPosition>'
    action = '<Private entityRef="Ego"><PrivateAction><TeleportAction><Position>{}</Position></TeleportAction>{}'
    end = "</PrivateAction></Private>"
    (warning,) = load_scenario(scenario_xml(minor=2, init=action.format(relative.format(""), end))).warnings
    assert "heading 0 of the world frame" in str(warning)
    assert load_scenario(scenario_xml(minor=3, init=action.format(relative.format(""), end))).warnings == ()
    assert load_scenario(scenario_xml(init=action.format(relative.format('type="relative"'), end))).warnings == ()


@pytest.mark.parametrize(("minor", "expected"), [(0, None), (2, None), (3, "relative"), (4, "relative")])
def test_missing_orientation_type_is_relative_since_version_1_3(minor: int, expected: str | None) -> None:
    """Without a type the orientation was absolute before."""
    position = '<RelativeObjectPosition entityRef="Ego" dx="1" dy="0"><Orientation h="0.2"/></RelativeObjectPosition>'
    init = init_xml("Ego", teleport_xml(position))
    oriented = only(load_scenario(scenario_xml(minor=minor, init=init, story=story_xml())), Orientation)
    assert (oriented.h, oriented.type and oriented.type.value) == (0.2, expected)


def test_none_in_optional_attribute_is_a_warning() -> None:
    scenario = load_scenario(scenario_xml(init=OFFSET.format(continuous="true", shape="linear")))
    (warning,) = scenario.warnings
    assert warning.message == (
        "maxLateralAcc of LaneOffsetActionDynamics is 'None', which is read as a missing attribute"
    )
    with pytest.raises(ScenarioError, match="continuous of LaneOffsetAction is 'None', which is not"):
        load_scenario(scenario_xml(init=OFFSET.format(continuous="None", shape="linear")))


def test_element_one_level_too_high_error_has_correct_parent() -> None:
    with pytest.raises(ScenarioError, match="Environment in GlobalAction; Environment belongs into EnvironmentAction"):
        load_scenario(scenario_xml(init=BARE))

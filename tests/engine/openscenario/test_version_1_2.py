"""Version 1.2: names of its final schema, and those of an early schema with the same version."""

from __future__ import annotations

from typing import TypeVar

import pytest
from openscenario_xml import object_xml, scenario_xml
from storyboard_xml import story_xml

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import Scenario, load_scenario, model

Kind = TypeVar("Kind")

LIGHT = """<AppearanceAction><LightStateAction transitionTime="0">
<LightType><VehicleLight vehicleLightType="brakeLights"/></LightType>
<LightState mode="on" luminousIntensity="80"><Color colorType="red"><ColorRgb red="1" green="0" blue="0"/></Color>
</LightState></LightStateAction></AppearanceAction>"""
ANIMATION = """<AppearanceAction><AnimationAction animationDuration="2"><AnimationType>
<ComponentAnimation><VehicleComponent vehicleComponentType="trunk"/></ComponentAnimation></AnimationType>
<AnimationState state="1"/></AnimationAction></AppearanceAction>"""
PROFILE = """<LongitudinalAction><SpeedProfileAction followingMode="position"{attribute}>{child}
<SpeedProfileEntry speed="3" time="1"/></SpeedProfileAction></LongitudinalAction>"""
ENVIRONMENT = """<GlobalAction><EnvironmentAction><Environment name="e">
<Weather><Sun azimuth="0" elevation="1" {name}="1000"/></Weather></Environment></EnvironmentAction></GlobalAction>"""
SWARM = """<GlobalAction><TrafficAction><TrafficSwarmAction innerRadius="5" numberOfVehicles="3" offset="0"
semiMajorAxis="50" semiMinorAxis="50"><CentralObject entityRef="Ego"/>
<TrafficDefinition name="t">
<VehicleCategoryDistribution><VehicleCategoryDistributionEntry category="car" weight="1"/></VehicleCategoryDistribution>
<ControllerDistribution><ControllerDistributionEntry weight="1"><Controller name="c"><Properties/></Controller>
</ControllerDistributionEntry></ControllerDistribution></TrafficDefinition>
<{name} lowerLimit="3" upperLimit="5"/></TrafficSwarmAction></TrafficAction></GlobalAction>"""


def only(scenario: Scenario, kind: type[Kind]) -> Kind:
    return next(one for one in scenario.document.walk() if isinstance(one, kind))


def load(action: str = "", **parts: str) -> Scenario:
    return load_scenario(scenario_xml(minor=2, story=story_xml(action=action), **parts))


@pytest.mark.parametrize("action", [LIGHT, ANIMATION], ids=["light", "animation"])
def test_appearance_actions_are_part_of_1_2(action: str) -> None:
    """The final schema of 1.2 has AppearanceAction in PrivateAction, with the names of 1.3."""
    assert load(action).warnings == ()
    with pytest.raises(ScenarioError, match=r"AppearanceAction in PrivateAction; part of OpenSCENARIO since 1\.2"):
        load_scenario(scenario_xml(minor=1, story=story_xml(action=action)))


def test_entity_of_a_speed_profile_is_an_attribute() -> None:
    assert load(PROFILE.format(attribute=' entityRef="Ego"', child="")).warnings == ()
    early = load(PROFILE.format(attribute="", child='<EntityRef entityRef="Ego"/>'))
    assert [one.message for one in early.warnings] == [
        "EntityRef in SpeedProfileAction is deprecated since OpenSCENARIO 1.2"
    ]


def test_illuminance_precedes_intensity() -> None:
    assert only(load(init=ENVIRONMENT.format(name="illuminance")), model.Sun).illuminance == 1000.0
    assert [one.message for one in load(init=ENVIRONMENT.format(name="intensity")).warnings] == [
        "the attribute 'intensity' of Sun is deprecated since OpenSCENARIO 1.2"
    ]


def test_role_of_a_vehicle() -> None:
    vehicle = object_xml("Ego").replace('vehicleCategory="car"', 'vehicleCategory="car" {name}="fire"')
    assert only(load(entities=vehicle.format(name="role")), model.Vehicle).role is model.Role.FIRE
    early = load(entities=vehicle.format(name="vehicleRole"))
    assert only(early, model.Vehicle).vehicle_role is model.Role.FIRE
    assert [one.message for one in early.warnings] == [
        "the attribute 'vehicleRole' of Vehicle is deprecated since OpenSCENARIO 1.2"
    ]


@pytest.mark.parametrize(("name", "warnings"), [("InitialSpeedRange", 0), ("SpeedRange", 1)])
def test_initial_speeds_of_a_swarm(name: str, warnings: int) -> None:
    scenario = load(init=SWARM.format(name=name))
    swarm = only(scenario, model.TrafficSwarmAction)
    between = swarm.initial_speed_range or swarm.speed_range
    assert between is not None
    assert (between.lower_limit, between.upper_limit) == (3.0, 5.0)
    assert len(scenario.warnings) == warnings

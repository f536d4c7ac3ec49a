"""Scenario texts for tests: a complete scenario, a story and parameter declarations from their parts."""

from __future__ import annotations

from collections.abc import Callable

import pytest

VEHICLE = """<Vehicle name="car" vehicleCategory="car">
  <BoundingBox><Center x="1.4" y="0" z="0.75"/><Dimensions length="4.5" width="1.8" height="1.5"/></BoundingBox>
  <Performance maxSpeed="60" maxAcceleration="5" maxDeceleration="9"/>
  <Axles>
    <FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="2.8" positionZ="0.3"/>
    <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="0" positionZ="0.3"/>
  </Axles>
  <Properties/>
</Vehicle>"""

SCENARIO = """<OpenSCENARIO>
<FileHeader revMajor="1" revMinor="{minor}" date="2026-01-31T12:00:00" description="a test" author="test"/>
{declarations}
<CatalogLocations>{catalogs}</CatalogLocations>
<RoadNetwork>{road}</RoadNetwork>
<Entities>{entities}</Entities>
<Storyboard><Init><Actions>{init}</Actions></Init>{story}<StopTrigger>{stop}</StopTrigger></Storyboard>
</OpenSCENARIO>"""

EGO = f'<ScenarioObject name="Ego">{VEHICLE}</ScenarioObject>'

STORY = """<Story name="story"><Act name="act"><ManeuverGroup name="group" maximumExecutionCount="1">
<Actors selectTriggeringEntities="false"><EntityRef entityRef="Ego"/></Actors>
<Maneuver name="maneuver"><Event name="event" priority="parallel">
<Action name="action"><PrivateAction>{action}</PrivateAction></Action>
<StartTrigger><ConditionGroup>{condition}</ConditionGroup></StartTrigger>
</Event></Maneuver></ManeuverGroup><StartTrigger/></Act></Story>"""

SPEED_ACTION = """<LongitudinalAction><SpeedAction>
<SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="time" value="2"/>
<SpeedActionTarget><AbsoluteTargetSpeed value="{speed}"/></SpeedActionTarget>
</SpeedAction></LongitudinalAction>"""

CONDITION = """<Condition name="{name}" delay="0" conditionEdge="none"><ByValueCondition>{value}</ByValueCondition>
</Condition>"""

TIME = '<SimulationTimeCondition rule="greaterThan" value="1"/>'


@pytest.fixture
def scenario_xml() -> Callable[..., bytes]:
    """Return a function that builds a complete scenario from the parts of a test."""

    def build(
        *,
        minor: int = 3,
        declarations: str = "",
        catalogs: str = "",
        road: str = "",
        entities: str = EGO,
        init: str = "",
        story: str = "",
        stop: str = "",
    ) -> bytes:
        return SCENARIO.format(
            minor=minor,
            declarations=declarations,
            catalogs=catalogs,
            road=road,
            entities=entities,
            init=init,
            story=story,
            stop=stop,
        ).encode()

    return build


@pytest.fixture
def story_xml() -> Callable[..., str]:
    """Return a function that builds a story with one event, with an optional action and condition."""

    def build(*, action: str = "", speed: str = "10", condition: str = TIME) -> str:
        return STORY.format(
            action=action or SPEED_ACTION.format(speed=speed), condition=CONDITION.format(name="go", value=condition)
        )

    return build


@pytest.fixture
def parameters_xml() -> Callable[..., str]:
    """Return a function that builds parameter declarations from `name=(type, value)`."""

    def build(**declared: tuple[str, str]) -> str:
        one = '<ParameterDeclaration name="{}" parameterType="{}" value="{}"/>'
        inside = "".join(one.format(name, *given) for name, given in declared.items())
        return f"<ParameterDeclarations>{inside}</ParameterDeclarations>"

    return build

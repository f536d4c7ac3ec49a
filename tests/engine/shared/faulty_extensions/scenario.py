"""A scenario of two stations on a plane, whose extensions are chosen."""

from __future__ import annotations

from pathlib import Path

SCENARIO = """<?xml version="1.0"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="2" date="2026-01-01T00:00:00" description="two stations on a plane" author=""/>
  <CatalogLocations/>
  <RoadNetwork/>
  <Entities>
    <ScenarioObject name="Ego">{vehicle}
      <ObjectController><Controller name="EgoStation"><Properties>
        <Property name="module" value="eidrive"/>
        <Property name="detector" value="{detector}"/>
        <Property name="fusion" value="{fusion}"/>
        <Property name="planner" value="{planner}"/>
        <Property name="tracker" value="{tracker}"/>
        <Property name="vehicle_controller" value="{controller}"/>
        <Property name="obey_signals" value="{signals}"/>
        <Property name="sensors" value="{sensors}"/>
      </Properties></Controller></ObjectController>
    </ScenarioObject>
    <ScenarioObject name="Other">{vehicle}
      <ObjectController><Controller name="OtherStation"><Properties>
        <Property name="module" value="eidrive"/>
        <Property name="detector" value="oracle"/>
      </Properties></Controller></ObjectController>
    </ScenarioObject>
  </Entities>
  <Storyboard>
    <Init><Actions>
      <UserDefinedAction>
        <CustomCommandAction type="eidrive.criterion">{criterion}</CustomCommandAction></UserDefinedAction>
      <Private entityRef="Ego">{start_0}</Private>
      <Private entityRef="Other">{start_20}</Private>
    </Actions></Init>
    <Story name="story"><Act name="act">
      <ManeuverGroup name="group" maximumExecutionCount="1"><Actors selectTriggeringEntities="false">
        <EntityRef entityRef="Ego"/></Actors>
        <Maneuver name="maneuver"><Event name="event" priority="parallel">
          <Action name="action"><UserDefinedAction>
            <CustomCommandAction type="faulty.action">{action}</CustomCommandAction></UserDefinedAction></Action>
          <StartTrigger><ConditionGroup><Condition name="later" delay="0" conditionEdge="none"><ByValueCondition>
            <SimulationTimeCondition value="0.5" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup>
          </StartTrigger></Event></Maneuver>
      </ManeuverGroup>
      <StartTrigger><ConditionGroup><Condition name="at once" delay="0" conditionEdge="none"><ByValueCondition>
        <SimulationTimeCondition value="0" rule="greaterOrEqual"/></ByValueCondition></Condition></ConditionGroup>
      </StartTrigger></Act></Story>
    <StopTrigger>
      <ConditionGroup><Condition name="faulty" delay="0" conditionEdge="none"><ByValueCondition>
        <UserDefinedValueCondition name="faulty.condition" value="{condition}" rule="equalTo"/></ByValueCondition>
      </Condition></ConditionGroup>
      <ConditionGroup><Condition name="end" delay="0" conditionEdge="none"><ByValueCondition>
        <SimulationTimeCondition value="{end}" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup>
    </StopTrigger>
  </Storyboard>
</OpenSCENARIO>
"""
_VEHICLE = """<Vehicle name="car" vehicleCategory="car"><BoundingBox>
      <Center x="1.4" y="0" z="0.75"/><Dimensions width="1.8" length="4.5" height="1.5"/></BoundingBox>
      <Performance maxSpeed="60" maxAcceleration="5" maxDeceleration="9"/><Axles>
      <FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="2.8" positionZ="0.3"/>
      <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="0" positionZ="0.3"/></Axles>
      <Properties/></Vehicle>"""
_START = """<PrivateAction><TeleportAction><Position><WorldPosition x="{0}" y="{0}" h="0"/></Position></TeleportAction>
      </PrivateAction><PrivateAction><LongitudinalAction><SpeedAction>
      <SpeedActionDynamics dynamicsShape="step" value="0" dynamicsDimension="time"/>
      <SpeedActionTarget><AbsoluteTargetSpeed value="5"/></SpeedActionTarget></SpeedAction></LongitudinalAction>
      </PrivateAction><PrivateAction><ControllerAction><ActivateControllerAction lateral="true" longitudinal="true"/>
      </ControllerAction></PrivateAction>"""


def write_scenario(
    path: Path,
    *,
    detector: str = "oracle",
    fusion: str = "average",
    planner: str = "route",
    tracker: str = "",
    controller: str = "pid",
    criterion: str = "collision: {of: Ego}",
    action: str = "sound",
    condition: str = "sound",
    signals: bool = False,
    sensors: str = "{truth: {}}",
    end: float = 1.0,
) -> Path:
    """Write a scenario of `end` seconds with the extensions of the ego, a criterion and an event after 0.5 s."""
    blocks = {
        "vehicle": _VEHICLE,
        "start_0": _START.format(0),
        "start_20": _START.format(20),
        "detector": detector,
        "fusion": fusion,
        "planner": planner,
        "tracker": tracker,
        "controller": controller,
        "criterion": criterion,
        "action": action,
        "condition": condition,
        "signals": str(signals).lower(),
        "sensors": sensors,
        "end": str(end),
    }
    text = SCENARIO
    for name, block in blocks.items():
        text = text.replace(f"{{{name}}}", block)
    path.write_text(text)
    return path

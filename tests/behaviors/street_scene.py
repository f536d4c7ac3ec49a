"""Parts of scenarios: cars on a straight street, their actions and triggers."""

from __future__ import annotations

CAR = """<ScenarioObject name="{name}"><Vehicle name="{name}" vehicleCategory="car">
  <BoundingBox><Center x="1.5" y="0" z="0.75"/><Dimensions width="2" length="5" height="1.5"/></BoundingBox>
  <Performance maxSpeed="70" maxAcceleration="10" maxDeceleration="10"/>
  <Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="3" positionZ="0.3"/>
  <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.8" positionX="0" positionZ="0.3"/></Axles></Vehicle>
  {controller}</ScenarioObject>"""
OURS = """<ObjectController><Controller name="c" controllerType="movement"><Properties>
  <Property name="module" value="eidrive"/></Properties></Controller></ObjectController>"""

GROUP = """<ManeuverGroup name="group {number}" maximumExecutionCount="1">
  <Actors selectTriggeringEntities="false"><EntityRef entityRef="{actor}"/></Actors>
  <Maneuver name="maneuver {number}"><Event name="event {number}" priority="parallel">
  <Action name="action {number}">{action}</Action>{trigger}</Event></Maneuver></ManeuverGroup>"""
TRIGGER = """<StartTrigger><ConditionGroup><Condition name="c" delay="0" conditionEdge="{edge}">{condition}</Condition>
  </ConditionGroup></StartTrigger>"""

STREET = """<OpenDRIVE><header revMajor="1" revMinor="6"/>
  <road name="street" length="1000" id="1" junction="-1"><link/>
    <planView><geometry s="0" x="0" y="0" hdg="0" length="1000"><line/></geometry></planView>
    <lanes><laneSection s="0">
      <left><lane id="1" type="driving" level="false"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></left>
      <center><lane id="0" type="none" level="false"/></center>
      <right>
        <lane id="-1" type="driving" level="false"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane>
        <lane id="-2" type="driving" level="false"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane>
      </right></laneSection></lanes></road></OpenDRIVE>"""


def at(lane: int, s: float, speed: float) -> str:
    """Return Init actions: position in a lane (-1: y = -2, -2: y = -6, 1: y = 2 towards -x) and speed."""
    return f"""<PrivateAction><TeleportAction><Position><LanePosition roadId="1" laneId="{lane}" s="{s}"/></Position>
      </TeleportAction></PrivateAction><PrivateAction><LongitudinalAction><SpeedAction>
      <SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
      <SpeedActionTarget><AbsoluteTargetSpeed value="{speed}"/></SpeedActionTarget></SpeedAction></LongitudinalAction>
      </PrivateAction>"""


def after(time: float) -> str:
    """Return a condition on the simulation time: later than `time` [s]."""
    return f'<ByValueCondition><SimulationTimeCondition value="{time}" rule="greaterThan"/></ByValueCondition>'


def private(action: str) -> str:
    """Return an action of an actor."""
    return f"<PrivateAction>{action}</PrivateAction>"


def everywhere(action: str) -> str:
    """Return an action without an actor."""
    return f"<GlobalAction>{action}</GlobalAction>"


NOTHING = private('<VisibilityAction graphics="true" sensors="true" traffic="true"/>')
"""Action without effect."""

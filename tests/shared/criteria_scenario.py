"""Scenario with criteria: cars on the road of scenario 1, for 4 s."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

Actors = Mapping[str, tuple[float, float, float, float]]

ROAD = Path(__file__).parents[2] / "xosc" / "roads" / "coop_1.xodr"

CAR = """<ScenarioObject name="{name}"><Vehicle name="car" vehicleCategory="car">
<BoundingBox><Center x="0" y="0" z="0.75"/><Dimensions width="2" length="4" height="1.5"/></BoundingBox>
<Performance maxSpeed="60" maxAcceleration="9" maxDeceleration="9"/>
<Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="1.4" positionZ="0.3"/>
<RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="-1.4" positionZ="0.3"/></Axles>
<Properties/></Vehicle></ScenarioObject>"""

START = """<Private entityRef="{name}"><PrivateAction><TeleportAction><Position>
<WorldPosition x="{x}" y="{y}" h="{h}"/></Position></TeleportAction></PrivateAction>
<PrivateAction><LongitudinalAction><SpeedAction>
<SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
<SpeedActionTarget><AbsoluteTargetSpeed value="{speed}"/></SpeedActionTarget></SpeedAction></LongitudinalAction>
</PrivateAction></Private>"""

FILE = """<OpenSCENARIO>
<FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" description="criteria" author="test"/>
<CatalogLocations/><RoadNetwork><LogicFile filepath="{road}"/></RoadNetwork><Entities>{cars}</Entities>
<Storyboard><Init><Actions>{init}
<UserDefinedAction><CustomCommandAction type="eidrive.criterion">[{criteria}]</CustomCommandAction></UserDefinedAction>
{starts}</Actions></Init>{story}
<StopTrigger><ConditionGroup><Condition name="end" delay="0" conditionEdge="none"><ByValueCondition>
<SimulationTimeCondition value="4" rule="greaterOrEqual"/></ByValueCondition></Condition></ConditionGroup></StopTrigger>
</Storyboard></OpenSCENARIO>"""

STORY = """<Story name="story"><Act name="act"><ManeuverGroup name="group" maximumExecutionCount="1">
<Actors selectTriggeringEntities="false"><EntityRef entityRef="Changer"/></Actors><Maneuver name="maneuver">
<Event name="event" priority="parallel"><Action name="change"><PrivateAction><LateralAction><LaneChangeAction>
<LaneChangeActionDynamics dynamicsShape="sinusoidal" dynamicsDimension="time" value="2"/>
<LaneChangeTarget><RelativeTargetLane entityRef="Changer" value="1"/></LaneChangeTarget>
</LaneChangeAction></LateralAction></PrivateAction></Action>
<Action name="brake"><PrivateAction><LongitudinalAction><SpeedAction>
<SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="rate" value="6"/>
<SpeedActionTarget><AbsoluteTargetSpeed value="2"/></SpeedActionTarget></SpeedAction></LongitudinalAction>
</PrivateAction></Action>
<StartTrigger><ConditionGroup><Condition name="start" delay="0" conditionEdge="none"><ByValueCondition>
<SimulationTimeCondition value="1" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup></StartTrigger>
</Event></Maneuver></ManeuverGroup><StartTrigger/></Act></Story>"""
"""A change to the lane of the oncoming traffic, from 8 to 2 m/s at 6 m/s²."""


def write_scenario(folder: Path, criteria: str, actors: Actors, road: Path = ROAD, init: str = "") -> Path:
    starts = "".join(START.format(name=name, x=x, y=y, h=h, speed=speed) for name, (x, y, h, speed) in actors.items())
    path = folder / "criteria.xosc"
    cars = "".join(CAR.format(name=name) for name in actors)
    story = STORY if "Changer" in actors else ""
    text = FILE.format(road=road, cars=cars, starts=starts, init=init, criteria=criteria, story=story)
    path.write_text(text, encoding="utf-8")
    return path

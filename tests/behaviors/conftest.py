"""Scenes: a straight street, two cars, and what a test makes them do; played without a physics engine."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from reference_player import KinematicWorld

from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.commands import Commands
from eidrive_scenario.storyboard.states import StateChange
from eidrive_scenario.storyboard.storyboard import Storyboard
from eidrive_scenario.world.actor import Placement

CAR = """<ScenarioObject name="{name}"><Vehicle name="{name}" vehicleCategory="car">
  <BoundingBox><Center x="1.5" y="0" z="0.75"/><Dimensions width="2" length="5" height="1.5"/></BoundingBox>
  <Performance maxSpeed="70" maxAcceleration="10" maxDeceleration="10"/>
  <Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="3" positionZ="0.3"/>
  <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.8" positionX="0" positionZ="0.3"/></Axles></Vehicle>
  {controller}</ScenarioObject>"""
OURS = """<ObjectController><Controller name="c" controllerType="movement"><Properties>
  <Property name="module" value="eidrive"/></Properties></Controller></ObjectController>"""

SCENARIO = """<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" date="2024-01-01T00:00:00" description="scene" author="test"/>
  <ParameterDeclarations><ParameterDeclaration name="Level" parameterType="double" value="2"/></ParameterDeclarations>
  <VariableDeclarations><VariableDeclaration name="Mood" variableType="string" value="calm"/></VariableDeclarations>
  <CatalogLocations/><RoadNetwork><LogicFile filepath="street.xodr"/></RoadNetwork>
  <Entities>{cars}</Entities>
  <Storyboard><Init><Actions>{everywhere}
    <Private entityRef="Ego">{ego}</Private><Private entityRef="Other">{other}</Private></Actions></Init>
    {story}</Storyboard></OpenSCENARIO>"""

STORY = """<Story name="story"><Act name="act">{groups}</Act></Story>"""
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
    """Init actions: in a lane (-1: y = -2, -2: y = -6, 1: y = 2 towards -x), at a speed."""
    return f"""<PrivateAction><TeleportAction><Position><LanePosition roadId="1" laneId="{lane}" s="{s}"/></Position>
      </TeleportAction></PrivateAction><PrivateAction><LongitudinalAction><SpeedAction>
      <SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
      <SpeedActionTarget><AbsoluteTargetSpeed value="{speed}"/></SpeedActionTarget></SpeedAction></LongitudinalAction>
      </PrivateAction>"""


@dataclass
class Played:
    """A played scene: placements by tick and name, state changes, commands."""

    dt: float
    rows: list[dict[str, Placement]] = field(default_factory=list)
    changes: list[StateChange] = field(default_factory=list)
    commands: list[Commands] = field(default_factory=list)

    def at(self, time: float, name: str = "Ego") -> Placement:
        return self.rows[round(time / self.dt)][name]

    def when(self, element: str, state: str) -> float | None:
        """When an element first came to a state [s]."""
        times = [c.time for c in self.changes if c.element == element and c.after.value == state]
        return times[0] if times else None

    def why(self, element: str) -> str:
        return next(c.why for c in self.changes if c.element == element and c.transition is not None)


@pytest.fixture
def scene(tmp_path: Path) -> Callable[..., Played]:
    """Plays actions: `play(seconds, (actor, action, condition), …, ego=(lane, s, speed), other=…)`.

    Actions start at once without a condition. `driven` gives Ego an eidrive controller; nothing then moves it.
    """
    (tmp_path / "street.xodr").write_text(STREET)

    def play(
        seconds: float,
        *steps: tuple[str, ...],
        ego: tuple[int, float, float] = (-1, 100.0, 20.0),
        other: tuple[int, float, float] = (-1, 150.0, 10.0),
        dt: float = 0.1,
        driven: bool = False,
        everywhere: str = "",
        edge: str = "none",
    ) -> Played:
        groups = ""
        for number, (actor, action, *condition) in enumerate(steps):
            trigger = TRIGGER.format(edge=edge, condition=condition[0]) if condition else ""
            groups += GROUP.format(number=number, actor=actor, action=action, trigger=trigger)
        cars = CAR.format(name="Ego", controller=OURS if driven else "") + CAR.format(name="Other", controller="")
        story = STORY.format(groups=groups) if groups else ""
        text = SCENARIO.format(cars=cars, ego=at(*ego), other=at(*other), story=story, everywhere=everywhere)
        path = tmp_path / "scene.xosc"
        path.write_text(text)
        scenario = load_scenario(path)
        assert scenario.road_file is not None
        storyboard = Storyboard(scenario, RoadNetwork.load(scenario.road_file), dt=dt)
        world, played = KinematicWorld(scenario, dt), Played(dt)
        first = storyboard.initial()
        world.add(first.additions)
        for _ in range(round(seconds / dt) + 1):
            played.rows.append(dict(world.placements))
            commands = storyboard.tick(world.view())
            played.changes += storyboard.changes
            played.commands.append(commands)
            world.add(commands.additions)
            world.remove(commands.removals)
            world.move(commands.placements)
        return played

    return play

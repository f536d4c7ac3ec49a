"""Fixtures: scenes on a straight street with two cars, run without a physics engine."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from kinematic_world import KinematicWorld
from recorded_scene import RecordedScene, RunScene
from street_scene import CAR, GROUP, OURS, STREET, TRIGGER, at
from whole_run import run as run

from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.storyboard import Storyboard

SCENARIO = """<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" date="2024-01-01T00:00:00" description="scene" author="test"/>
  <ParameterDeclarations><ParameterDeclaration name="Level" parameterType="double" value="2"/></ParameterDeclarations>
  <VariableDeclarations><VariableDeclaration name="Mood" variableType="string" value="calm"/></VariableDeclarations>
  <CatalogLocations/><RoadNetwork><LogicFile filepath="street.xodr"/></RoadNetwork>
  <Entities>{cars}</Entities>
  <Storyboard><Init><Actions>{everywhere}
    <Private entityRef="Ego">{ego}</Private><Private entityRef="Other">{other}</Private></Actions></Init>
    {story}</Storyboard></OpenSCENARIO>"""

CRUISE = """<ObjectController><Controller name="cruise" controllerType="movement"><Properties>{properties}</Properties>
  </Controller></ObjectController>"""
STORY = """<Story name="story"><Act name="act">{groups}</Act></Story>"""


@pytest.fixture
def scene(tmp_path: Path) -> RunScene:
    """Return a function that runs actions: `play(seconds, (actor, action, condition), …, ego=(lane, s, speed),
    other=…)`.

    Actions without a condition start at once. `driven` assigns an eidrive controller to Ego, which nothing moves here.
    `cruise` assigns a controller of another tool with these properties, executed by `controller_model`. `brakes` is the
    maximum deceleration of the vehicles [m/s²], `performance` contains further limits. `executions` is the maximum
    execution count of each action.
    """
    (tmp_path / "street.xodr").write_text(STREET)

    def play(
        seconds: float,
        *steps: tuple[str, ...],
        ego: tuple[int, float, float] = (-1, 100.0, 20.0),
        other: tuple[int, float, float] = (-1, 150.0, 10.0),
        dt: float = 0.1,
        driven: bool = False,
        cruise: str | None = None,
        controller_model: str = "adaptive_cruise",
        everywhere: str = "",
        edge: str = "none",
        performance: str = "",
        brakes: float = 10.0,
        executions: int = 1,
    ) -> RecordedScene:
        groups = ""
        for number, (actor, action, *condition) in enumerate(steps):
            trigger = TRIGGER.format(edge=edge, condition=condition[0]) if condition else ""
            groups += GROUP.format(number=number, actor=actor, action=action, trigger=trigger)
        groups = groups.replace('priority="parallel"', f'priority="parallel" maximumExecutionCount="{executions}"')
        controller = OURS if driven else "" if cruise is None else CRUISE.format(properties=cruise)
        cars = CAR.format(name="Ego", controller=controller) + CAR.format(name="Other", controller="")
        cars = cars.replace('maxDeceleration="10"/>', f'maxDeceleration="{brakes:g}" {performance}/>')
        story = STORY.format(groups=groups) if groups else ""
        text = SCENARIO.format(cars=cars, ego=at(*ego), other=at(*other), story=story, everywhere=everywhere)
        path = tmp_path / "scene.xosc"
        path.write_text(text)
        scenario = load_scenario(path)
        assert scenario.road_file is not None
        storyboard = Storyboard(
            scenario, RoadNetwork.load(scenario.road_file), dt=dt, controllers={"cruise": controller_model}
        )
        world, record = KinematicWorld(scenario, dt), RecordedScene(dt)
        first = storyboard.initial()
        world.add(first.spawns)
        for _ in range(round(seconds / dt) + 1):
            record.rows.append(dict(world.placements))
            commands = storyboard.tick(world.view())
            record.changes += storyboard.changes
            record.commands.append(commands)
            world.remove(commands.removals)
            world.add(commands.spawns)
            world.move(commands.placements)
        return record

    return play

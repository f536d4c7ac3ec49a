"""Scenes: a straight street, two cars, and what a test makes them do; played without a physics engine."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from kinematic_world import KinematicWorld
from street_scene import CAR, GROUP, OURS, STREET, TRIGGER, at
from whole_run import run as run

from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.state.commands import Commands
from eidrive_scenario.storyboard.state.states import StateChange
from eidrive_scenario.storyboard.storyboard import Storyboard
from eidrive_scenario.world.actor import Placement

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

    Actions start at once without a condition. `driven` gives Ego an eidrive controller; nothing then moves it. `cruise`
    gives it one of another tool, with these properties, which adaptive cruise control or `controller_model` executes.
    `brakes` is the largest deceleration of the vehicles [m/s²], `performance` are further limits of theirs. Each action
    may start so many times as `executions` says.
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
    ) -> Played:
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
        world, played = KinematicWorld(scenario, dt), Played(dt)
        first = storyboard.initial()
        world.add(first.spawns)
        for _ in range(round(seconds / dt) + 1):
            played.rows.append(dict(world.placements))
            commands = storyboard.tick(world.view())
            played.changes += storyboard.changes
            played.commands.append(commands)
            world.remove(commands.removals)
            world.add(commands.spawns)
            world.move(commands.placements)
        return played

    return play

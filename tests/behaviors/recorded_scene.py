"""Scenes on a straight street with two cars, run without a physics engine, and their records."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from kinematic_world import KinematicWorld
from street_scene import CAR, GROUP, OURS, STREET, TRIGGER, at

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
class RecordedScene:
    """Record of a scene: placements by tick and name, state changes, commands."""

    dt: float
    rows: list[dict[str, Placement]] = field(default_factory=list)
    changes: list[StateChange] = field(default_factory=list)
    commands: list[Commands] = field(default_factory=list)

    def at(self, time: float, name: str = "Ego") -> Placement:
        return self.rows[round(time / self.dt)][name]

    def when(self, element: str, state: str) -> float | None:
        """Return the time at which an element first reached a state [s]."""
        times = [c.time for c in self.changes if c.element == element and c.after.value == state]
        return times[0] if times else None

    def why(self, element: str) -> str:
        return next(c.why for c in self.changes if c.element == element and c.transition is not None)


class RunScene:
    """Run of actions without a physics engine: `scene(seconds, (actor, action, condition), …, ego=(lane, s, speed),
    other=…)`.

    Actions without a condition start at once. `driven` assigns an eidrive controller to Ego, which nothing moves here.
    `cruise` assigns a controller of another tool with these properties, executed by `controller_model`. `brakes` is the
    maximum deceleration of the vehicles [m/s²], `performance` contains further limits. `executions` is the maximum
    execution count of each action.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        (folder / "street.xodr").write_text(STREET)

    def __call__(
        self,
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
        path = self._folder / "scene.xosc"
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

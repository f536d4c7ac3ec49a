"""Scenes on a straight street with two cars, run without a physics engine, and their records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from kinematic_world import KinematicWorld
from openscenario_xml import controller_xml, parameters_xml, road_file_xml, round_car_xml, scenario_xml, variables_xml
from storyboard_xml import act_xml, acts_xml, init_xml
from street_scene import AGENT, STREET, at, groups_of

from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.storyboard.state.commands import Commands
from eidrive_scenario.storyboard.state.element_states import StateChange
from eidrive_scenario.storyboard.storyboard import Storyboard
from eidrive_scenario.world.actor import Placement

DECLARATIONS = parameters_xml(Level=("double", "2")) + variables_xml(Mood=("string", "calm"))


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


def first_start(played: RecordedScene) -> float | None:
    """Return the first start of "event 0" [s]."""
    return played.when("event 0", "runningState")


class RunScene:
    """Runner of actions without a physics engine: `scene(seconds, (actor, action[, condition]), …, ego=(lane, s,
    speed), other=…)`.

    Actions without a condition start at once. `driven` assigns an eidrive controller to Ego, which nothing moves here.
    `cruise` assigns a controller of another tool with these properties, executed by `controller_model`. `brakes` is the
    maximum deceleration of the vehicles [m/s²], `performance` contains further limits. `executions` is the maximum
    execution count of each action.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __call__(
        self,
        seconds: float,
        *steps: tuple[str, ...],
        ego: tuple[int, float, float] = (-1, 100.0, 20.0),
        other: tuple[int, float, float] = (-1, 150.0, 10.0),
        dt: float = 0.1,
        driven: bool = False,
        cruise: Mapping[str, object] | None = None,
        controller_model: str = "adaptive_cruise",
        globally: str = "",
        edge: str = "none",
        performance: str = "",
        brakes: float = 10.0,
        executions: int = 1,
        street: str = STREET,
    ) -> RecordedScene:
        (self.folder / "street.xodr").write_text(street)
        controller = AGENT if driven else ""
        if cruise is not None:
            controller = controller_xml(cruise, name="cruise", attributes='controllerType="movement"')
        cars = "".join(
            round_car_xml(name, of_car, max_deceleration=brakes, limits=performance)
            for name, of_car in (("Ego", controller), ("Other", ""))
        )
        path = self.folder / "scene.xosc"
        path.write_bytes(
            scenario_xml(
                declarations=DECLARATIONS,
                road=road_file_xml("street.xodr"),
                entities=cars,
                init=globally + init_xml("Ego", at(*ego)) + init_xml("Other", at(*other)),
                story=acts_xml(act_xml(groups_of(steps, edge=edge, count=executions))) if steps else "",
            )
        )
        scenario = load_scenario(path)
        assert scenario.road_file is not None
        roads = RoadNetwork.load(scenario.road_file)
        storyboard = Storyboard(scenario, roads, dt=dt, controllers={"cruise": controller_model})
        return _record(storyboard, KinematicWorld(scenario, dt), round(seconds / dt) + 1)


def _record(storyboard: Storyboard, world: KinematicWorld, ticks: int) -> RecordedScene:
    record = RecordedScene(world.dt)
    world.add(storyboard.initial().spawns)
    for _ in range(ticks):
        record.rows.append(dict(world.placements))
        commands = storyboard.tick(world.view())
        record.changes += storyboard.changes
        record.commands.append(commands)
        world.remove(commands.removals)
        world.add(commands.spawns)
        world.move(commands.placements, commands.driven)
    return record

"""Overtaking by the planner `behavior` on a road with two directions: accepted gaps, and random drives.

python -m eidrive_reports.overtaking --out reports --figures docs/figures

Behind each kind of obstacle the ego meets oncoming traffic: two cars, a gap, and a column. The share of the gaps that
it accepts is drawn over their duration. Random drives vary the obstacle, all speeds and gaps, and the range of the
sensors; they are repeated with other detectors. The output is overtaking.md and overtaking.png.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from eidrive_reports.driven_runs import CONTACT, HARD, STANDING, DrivenMotion
from eidrive_reports.paper import EGO
from eidrive_reports.studies import command, group_by, markdown_table, publish, study_options
from eidrive_scenario.api.common import generator, write_atomically
from eidrive_scenario.api.experiments import Job, run_jobs
from eidrive_scenario.api.pages import write_figure
from eidrive_scenario.api.run import RunSettings, Simulation

ROAD = 1800.0
"""Length of the road [m]."""
ROAD_FILE = "overtaking.xodr"
LANE = 3.5
"""Width of its lanes [m]."""
GAPS = tuple(range(4, 21))
"""Durations of the gaps [s]."""
START, BEHIND = 20.0, 40.0
"""Place of the ego at the start, and its distance behind the obstacle when the first oncoming car passes that [m]."""
HEADWAY = 2.0
"""Time between the cars of a column [s]."""
SIGHT = 300.0
"""Range of the sensors, so that the ego sees the whole gap [m]."""
COLUMN = 8
"""Number of cars after the gap."""
CRITICAL_GAPS = (4.1, 7.1)
"""Least and greatest critical gap of the Highway Capacity Manual (2010, chapter 19) at a road of two lanes: left turn
from it, and left turn into it [s]. It has none for overtaking."""
AFTERWARDS = 6.0
"""Time that a run goes on after the ego has overtaken [s]."""
TIME = 90.0
"""Duration of a random drive [s]."""
OVER_BORDER = 0.3
"""Distance of the body beyond the middle of the road that counts as standing in the oncoming lane [m]."""
SPACE = 1.0
"""Distance along the road from an obstacle at which there is space in the own lane [m]."""


class Obstacle(NamedTuple):
    """Vehicles that hold the ego up: entry of the catalog, their number and spacing [m], offset from the middle of the
    lane to the right [m], and speed [m/s]."""

    entry: str
    number: int
    spacing: float
    right: float
    speed: float


OBSTACLES: Mapping[str, Obstacle] = {
    "bicycle": Obstacle("bicycle", 1, 0.0, 0.65, 4.5),
    "tractor": Obstacle("truck", 1, 0.0, 0.0, 6.0),
    "bus at a stop": Obstacle("bus", 1, 0.0, 0.6, 0.0),
    "parked cars": Obstacle("lincoln_mkz", 4, 8.0, 0.8, 0.0),
}


class Car(NamedTuple):
    """Oncoming car: place along the road [m] and speed [m/s]."""

    x: float
    speed: float


@dataclass(frozen=True)
class OvertakingScene:
    """Ego with its wanted speed [m/s] and range of its sensors [m], an obstacle from `obstacle_x` on [m], oncoming
    cars, and the duration [s]."""

    speed: float
    range: float
    obstacle: Obstacle
    obstacle_x: float
    oncoming: tuple[Car, ...]
    duration: float


def gap_scene(kind: str, gap: float, seed: int) -> OvertakingScene:
    """Return the scene of a gap [s] behind an obstacle; speeds and places vary with the seed."""
    draws = generator(seed, "overtaking gap", kind)
    obstacle, obstacle_x = OBSTACLES[kind], draws.uniform(140.0, 160.0)
    speed, other = draws.uniform(12.0, 14.0), draws.uniform(11.0, 13.0)
    meeting = (obstacle_x - START - BEHIND) / (speed - obstacle.speed)
    first = obstacle_x + (obstacle.speed + other) * meeting
    times = [0.0, HEADWAY, *(HEADWAY + gap + HEADWAY * number for number in range(COLUMN))]
    cars = tuple(Car(first + other * time, other) for time in times)
    return OvertakingScene(speed, SIGHT, obstacle, obstacle_x, cars, meeting + times[-1])


def random_scene(seed: int) -> OvertakingScene:
    """Return a scene with random obstacle, speeds, gaps of 4 to 20 s, and range of the sensors."""
    draws = generator(seed, "overtaking drive")
    obstacle = tuple(OBSTACLES.values())[int(draws.integers(len(OBSTACLES)))]
    obstacle = obstacle._replace(
        speed=obstacle.speed * draws.uniform(0.8, 1.3),
        right=obstacle.right * draws.uniform(0.5, 1.2),
        number=1 if obstacle.number == 1 else int(draws.integers(2, 7)),
    )
    other, x = draws.uniform(8.0, 15.0), draws.uniform(100.0, 300.0)
    cars = []
    while x < ROAD - 20.0:
        cars.append(Car(x, other))
        x += other * draws.uniform(GAPS[0], GAPS[-1])
    return OvertakingScene(
        draws.uniform(9.0, 14.0), float(draws.choice([80.0, 120.0, 150.0])), obstacle, 130.0, tuple(cars), TIME
    )


_ROAD = f"""<?xml version="1.0" encoding="UTF-8"?>
<OpenDRIVE>
  <header revMajor="1" revMinor="6" name="overtaking"/>
  <road name="overtaking" length="{ROAD:g}" id="1" junction="-1" rule="RHT">
    <type s="0" type="rural"><speed max="70" unit="km/h"/></type>
    <planView><geometry s="0" x="0" y="0" hdg="0" length="{ROAD:g}"><line/></geometry></planView>
    <lanes>
      <laneSection s="0">
        <left>
          <lane id="1" type="driving"><width sOffset="0" a="{LANE:g}" b="0" c="0" d="0"/></lane>
        </left>
        <center>
          <lane id="0" type="none"><roadMark sOffset="0" type="broken" color="white" width="0.13"/></lane>
        </center>
        <right>
          <lane id="-1" type="driving"><width sOffset="0" a="{LANE:g}" b="0" c="0" d="0"/></lane>
        </right>
      </laneSection>
    </lanes>
  </road>
</OpenDRIVE>
"""
_SCENARIO = """<?xml version="1.0" encoding="UTF-8"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" date="2026-11-26T00:00:00" author="eidrive-scenario" description="overtaking"/>
  <CatalogLocations>
    <VehicleCatalog><Directory path="eidrive_library/catalogs"/></VehicleCatalog>
  </CatalogLocations>
  <RoadNetwork><LogicFile filepath="{road}"/></RoadNetwork>
  <Entities>
    <ScenarioObject name="{ego}">
      <CatalogReference catalogName="vehicles" entryName="lincoln_mkz"/>
      <ObjectController><Controller name="EgoStack"><Properties>
        <Property name="module" value="eidrive"/>
        <Property name="detector" value="oracle"/>
        <Property name="mount" value="roof"/>
        <Property name="range" value="{range:g}"/>
        <Property name="target_speed" value="{speed:.3f}"/>
      </Properties></Controller></ObjectController>
    </ScenarioObject>
{entities}
  </Entities>
  <Storyboard>
    <Init><Actions>
{actions}
    </Actions></Init>
    <StopTrigger><ConditionGroup><Condition name="End" delay="0" conditionEdge="none"><ByValueCondition>
      <SimulationTimeCondition rule="greaterOrEqual" value="{duration:g}"/>
    </ByValueCondition></Condition></ConditionGroup></StopTrigger>
  </Storyboard>
</OpenSCENARIO>
"""


def write_road(folder: Path) -> None:
    """Write the road of all scenes."""
    with write_atomically(folder / ROAD_FILE) as stream:
        stream.write(_ROAD.encode())


def write(scene: OvertakingScene, path: Path) -> None:
    """Write the scenario of a scene; its folder has to contain the road."""
    actors = [(EGO, "", START, -LANE / 2.0, scene.speed)]
    obstacle = scene.obstacle
    for index in range(obstacle.number):
        x, y = scene.obstacle_x + index * obstacle.spacing, -LANE / 2.0 - obstacle.right
        actors.append((f"Obstacle{index + 1}", obstacle.entry, x, y, obstacle.speed))
    for index, car in enumerate(scene.oncoming):
        actors.append((f"Oncoming{index + 1}", "lincoln_mkz", car.x, LANE / 2.0, car.speed))
    text = _SCENARIO.format(
        road=ROAD_FILE,
        ego=EGO,
        range=scene.range,
        speed=scene.speed,
        duration=scene.duration,
        entities="\n".join(
            f'    <ScenarioObject name="{name}"><CatalogReference catalogName="vehicles" entryName="{entry}"/>'
            "</ScenarioObject>"
            for name, entry, *_ in actors[1:]
        ),
        actions="\n".join(_start(name, x, y, speed) for name, _, x, y, speed in actors),
    )
    with write_atomically(path) as stream:
        stream.write(text.encode())


def _start(name: str, x: float, y: float, speed: float) -> str:
    heading = ' h="3.141592653589793"' if y > 0.0 else ""
    return f"""      <Private entityRef="{name}">
        <PrivateAction><TeleportAction><Position>
          <WorldPosition x="{x:.3f}" y="{y:.3f}"{heading}/>
        </Position></TeleportAction></PrivateAction>
        <PrivateAction><LongitudinalAction><SpeedAction>
          <SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
          <SpeedActionTarget><AbsoluteTargetSpeed value="{speed:.3f}"/></SpeedActionTarget>
        </SpeedAction></LongitudinalAction></PrivateAction>
      </Private>"""


@dataclass(frozen=True)
class OvertakingRun:
    """Outcome of a drive.

    overtook  time at which the ego was past the obstacle [s], inf if never
    met       time at which it met the first car after the gap, the third one [s], inf if never
    stood     time for which it stood in the oncoming lane [s];  idle  of this, with space beside it in its own lane
    braking   maximum mean deceleration over 0.5 s before a contact [m/s²]
    """

    arm: str
    seed: int
    collided: bool
    at_fault: bool
    overtook: float
    met: float
    stood: float
    idle: float
    braking: float

    @property
    def accepted(self) -> bool:
        """Whether the ego was past the obstacle before it met the first car after the gap."""
        return self.overtook < self.met


def run_of(job: Job) -> OvertakingRun:
    """Run a job and return its outcome."""
    motion = DrivenMotion(EGO)
    overtook = met = np.inf
    before = stood = idle = 0.0
    with Simulation(job.scenario, seed=job.seed, settings=job.settings) as simulation:
        end = None
        while end is None and before < overtook + AFTERWARDS:
            frame, end = simulation.tick()
            motion.observe(frame, simulation.criteria)
            view = frame.view
            obstacles = view.boxes[[row for name, row in view.rows.items() if name.startswith("Obstacle")]]
            row = view.row(EGO)
            x, y, _, length, width, _, yaw = view.boxes[row]
            apart = np.abs(obstacles[:, 0] - x) - (obstacles[:, 3] + length) / 2.0
            if np.all((obstacles[:, 0] < x) & (apart > 0.0)):
                overtook = min(overtook, view.time)
            third = view.rows.get("Oncoming3")
            if third is not None and view.boxes[third, 0] < x:
                met = min(met, view.time)
            left = y + 0.5 * (width * abs(np.cos(yaw)) + length * abs(np.sin(yaw)))
            if left > OVER_BORDER and abs(view.speed[row]) < STANDING:
                stood += view.time - before
                idle += (view.time - before) * bool(np.all(apart > SPACE))
            before = view.time
    motion.finish()
    outcome = (motion.collided, motion.at_fault, overtook, met, stood, idle, motion.hardest_braking)
    return OvertakingRun(job.arm, job.seed, *outcome)


def gap_table(runs: Sequence[OvertakingRun]) -> str:
    """Return the number of accepted gaps as a Markdown table; the arm of a run is its obstacle and gap."""
    lines = []
    for kind in OBSTACLES:
        mine = [run for run in runs if run.arm.startswith(f"{kind}, ")]
        shares = [f"{accepted} of {count}" for accepted, count in _accepted(mine, kind)]
        hardest = max((run.braking for run in mine), default=0.0)
        lines.append((kind, *shares, sum(run.collided for run in mine), f"{hardest:.1f}"))
    return markdown_table(("obstacle", *(f"{gap} s" for gap in GAPS), "collisions", "hardest braking [m/s²]"), lines)


def _accepted(runs: Sequence[OvertakingRun], kind: str) -> list[tuple[int, int]]:
    """Return the number of accepted gaps and that of all runs for each duration."""
    of_gap = [[run for run in runs if run.arm == _arm(kind, gap)] for gap in GAPS]
    return [(sum(run.accepted for run in some), len(some)) for some in of_gap]


def _arm(kind: str, gap: int) -> str:
    return f"{kind}, {gap} s"


def drive_table(runs: Sequence[OvertakingRun]) -> str:
    """Return the random drives as a Markdown table, a line for each detector."""
    titles = (
        "detector",
        "drives",
        "collisions",
        "by own fault",
        "obstacle overtaken",
        "stood in the oncoming lane",
        "of these with space to return",
        f"braking over {HARD:g} m/s²",
        "hardest braking [m/s²]",
    )
    lines = []
    for detector, mine in group_by(runs, attrgetter("arm")).items():
        cells = (
            f"`{detector}`",
            len(mine),
            sum(run.collided for run in mine),
            sum(run.at_fault for run in mine),
            f"{100.0 * np.mean([np.isfinite(run.overtook) for run in mine]):.1f} %",
            sum(run.stood > 0.0 for run in mine),
            sum(run.idle > 0.0 for run in mine),
            sum(run.braking > HARD for run in mine),
            f"{max(run.braking for run in mine):.1f}",
        )
        lines.append(cells)
    return markdown_table(titles, lines)


def draw(runs: Sequence[OvertakingRun], path: Path) -> None:
    """Draw the shares of accepted gaps over their duration."""
    figure = Figure(figsize=(7.0, 3.5), layout="constrained")
    axes = figure.add_subplot()
    axes.axvspan(*CRITICAL_GAPS, color="0.88", label="critical gaps of turns (HCM)")
    for kind, marker in zip(OBSTACLES, "osD^", strict=True):
        shares = [accepted / max(count, 1) for accepted, count in _accepted(runs, kind)]
        axes.plot(GAPS, shares, marker=marker, label=kind)
    axes.set_xlabel("gap in oncoming traffic [s]")
    axes.set_ylabel("share of accepted gaps")
    axes.set_xticks(GAPS)
    figure.legend(loc="outside upper center", ncols=3, fontsize="small")
    write_figure(figure, path, 150)


@command
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figures", type=Path, default=None, help="folder of the figure (default: --out)")
    parser.add_argument("--drives", type=int, default=1000, help="number of random drives with the oracle")
    parser.add_argument("--detector", action="append", default=None, metavar="NAME", help="for random drives, too")
    parser.add_argument("--detector-drives", type=int, default=100, help="number of random drives of each detector")
    options = study_options(parser, arguments, seeds=5)
    folder = options.out / "overtaking"
    write_road(folder)
    gaps, drives = [], []
    for kind in OBSTACLES:
        for gap in GAPS:
            for seed in range(1, options.seeds + 1):
                path = folder / f"{kind.replace(' ', '_')}_{gap}_{seed}.xosc"
                write(gap_scene(kind, gap, seed), path)
                gaps.append(Job(str(path), _arm(kind, gap), seed, _settings("oracle")))
    for detector in ("oracle", *(options.detector or ())):
        count = options.drives if detector == "oracle" else options.detector_drives
        for seed in range(1, count + 1):
            path = folder / f"random_{seed}.xosc"
            write(random_scene(seed), path)
            drives.append(Job(str(path), detector, seed, _settings(detector)))
    runs = run_jobs([*gaps, *drives], run_of, workers=options.workers, console=Console(stderr=True), title="overtaking")
    accepted, random = runs[: len(gaps)], runs[len(gaps) :]
    draw(accepted, (options.figures or options.out) / "overtaking.png")
    tables = [gap_table(accepted), *([drive_table(random)] if drives else [])]
    publish("\n".join(tables), options.out / "overtaking.md")


def _settings(detector: str) -> RunSettings:
    return RunSettings(detector=detector, criteria={"collision": {"of": EGO, "name": CONTACT}}, time_limit=2.0 * TIME)


if __name__ == "__main__":
    sys.exit(main())

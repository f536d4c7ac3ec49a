"""The main job: the paper's scenarios 1 and 2 in all arms, the tables on the terminal, and a page with pictures.

python -m eidrive_scenario.reporting.demo --out reports/demo.html
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.text import Text

from eidrive_scenario.arrays import Array
from eidrive_scenario.driving.settings import agent_settings, is_agent_controller
from eidrive_scenario.errors import EidriveError, InputError
from eidrive_scenario.experiments.paper import (
    EGO,
    HIDDEN,
    LINKS,
    OWN,
    SCENARIOS,
    Table,
    difference,
    evaluate_claims,
    run_settings,
    tabulate,
)
from eidrive_scenario.experiments.repetitions import Job, jobs_of, run_jobs
from eidrive_scenario.experiments.single_run import as_json_text
from eidrive_scenario.experiments.tables import render
from eidrive_scenario.files.atomic import create
from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.reporting.demo_page import CameraPicture, DemoSite, write_demo
from eidrive_scenario.reporting.drawing.key_frames import KeyFrames, Story
from eidrive_scenario.reporting.drawing.road_drawing import road_drawing
from eidrive_scenario.reporting.drawing.street_view import driver_view, helper_view, street_picture
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation import RunResult, RunSettings, load_for_seed, run_file
from eidrive_scenario.world.specs import actor_spec

StoryResult = tuple[RunResult, Story | None]


def run_story(job: Job, watched: int) -> StoryResult:
    """Run a job; the runs of the seed `watched` also tell their story."""
    path = resolve_scenario(job.scenario)
    if job.seed != watched:
        return run_file(path, seed=job.seed, settings=job.settings), None
    observer = KeyFrames(EGO, HIDDEN, conflict_areas(load_for_seed(path, job.seed, job.settings.parameters)))
    result = run_file(path, seed=job.seed, settings=job.settings, observers=(observer,))
    return result, observer.story()


def conflict_areas(scenario: Scenario) -> tuple[Array, ...]:
    """The areas for which the ego brakes, polygons (M, 2) [m]."""
    return tuple(
        np.array(polygon)
        for controller in scenario.controllers.get(EGO, ())
        if is_agent_controller(controller)
        for polygon in agent_settings(controller).planner_settings.areas
    )


def place_of(name: str, seed: int, story: Story) -> DemoSite:
    """What the pictures of a scenario share, and camera pictures out of one of its runs."""
    scenario = load_for_seed(resolve_scenario(name), seed, RunSettings().parameters)
    roads = RoadNetwork.load(scenario.road_file) if scenario.road_file else None
    drawing = road_drawing(roads.roads.values() if roads is not None else ())
    return DemoSite(drawing, conflict_areas(scenario), _views(scenario, roads, story))


def _views(scenario: Scenario, roads: RoadNetwork | None, story: Story) -> tuple[CameraPicture, ...]:
    """The street at the instant in which the ego brakes, as it and its helper see it."""
    snapshot = next((moment.snapshot for moment in story.moments if moment.kind == "braked"), None)
    if snapshot is None:
        return ()
    view, pictures = snapshot.view, []
    bodies = {name: actor_spec(name, scenario.entities[name]) for name in view.names}
    pose = driver_view(view, EGO)
    pictures.append(
        CameraPicture(
            f"What {EGO} sees",
            f"at {view.time:.2f} s, as it begins to brake",
            street_picture(bodies, roads, view, pose, without=EGO),
        )
    )
    for sender in dict.fromkeys(heard.message.sender for heard in snapshot.heard):
        pose = helper_view(view, sender, HIDDEN)
        png = street_picture(bodies, roads, view, pose, without=sender)
        pictures.append(CameraPicture(f"What {sender} sees", f"at {view.time:.2f} s, looking at {HIDDEN}", png))
    return tuple(pictures[:2])


def write_results(out: Path, runs: Sequence[tuple[Job, RunResult]]) -> Path:
    """All results as JSON, one object a run as `--json` prints it, one line each. Returns `out`."""
    lines = (as_json_text(replace(result, scenario=job.scenario)) for job, result in runs)
    with create(out) as stream:
        stream.write(("[\n" + ",\n".join(lines) + "\n]\n").encode())
    return out


def demo(out: Path, seeds: Sequence[int], workers: int | None, console: Console) -> tuple[Table, Table]:
    """Run everything, print the tables, write the page and its numbers (`.json` beside it)."""
    settings = run_settings(detector="oracle")
    jobs = [job for scenario in SCENARIOS for job in jobs_of(scenario, settings, seeds)]
    console.print(f"{len(SCENARIOS)} scenarios, {len(settings)} channels, {len(seeds)} seeds: {len(jobs)} runs")
    answers = run_jobs(jobs, partial(run_story, watched=seeds[0]), workers=workers, console=console, title="demo")
    runs = [(job, result) for job, (result, _) in zip(jobs, answers, strict=True)]
    stories: Mapping[tuple[str, str], Story] = {
        (job.scenario, job.arm): story for job, (_, story) in zip(jobs, answers, strict=True) if story is not None
    }
    links, own = tabulate(runs, LINKS), tabulate(runs, OWN)
    console.print()
    for table in (links, own):
        console.print(render(table, evaluate_claims(table)))
    console.print(Text(difference(links, own)))
    places = {name: place_of(name, seeds[0], stories[name, "ideal"]) for name in SCENARIOS}
    footer = f"eidrive-scenario {version('eidrive-scenario')}, seeds {seeds[0]} to {seeds[-1]}"
    page = write_demo(out, links, own, stories, places, watched=seeds[0], footer=footer)
    numbers = write_results(out.with_suffix(".json"), runs)
    console.print(f"\nwritten: {page}, {numbers}")
    return links, own


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; exit codes as those of `eidrive run`: 0 done, 2 wrong input, 3 broken."""
    parser = argparse.ArgumentParser(prog="python -m eidrive_scenario.reporting.demo", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("reports/demo.html"), help="the page")
    parser.add_argument("--seeds", type=int, default=20, help="runs of each arm, with seeds from 1 on")
    parser.add_argument("--workers", type=int, default=None, help="processes; all cores by default")
    given = parser.parse_args(arguments)
    if given.seeds < 1 or (given.workers is not None and given.workers < 1):
        parser.error("--seeds and --workers need at least 1")
    if given.out.is_dir() or any(above.exists() and not above.is_dir() for above in given.out.parents):
        parser.error(f"--out {given.out} is no place for a page; name a file, such as reports/demo.html")
    if given.out.suffix == ".json":
        parser.error(f"--out: the page would be overwritten by its numbers (got {given.out}; expected a .html file)")
    try:
        demo(given.out, range(1, given.seeds + 1), given.workers, Console())
    except EidriveError as error:
        Console(stderr=True).print(Text(str(error), style="red"))
        return 2 if isinstance(error, InputError) else 3
    return 0


if __name__ == "__main__":
    sys.exit(main())

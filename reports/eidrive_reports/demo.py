"""Demo: scenarios 1 and 2 of the paper in all arms, with tables on the terminal and an HTML page.

python -m eidrive_reports.demo --out reports/demo.html
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from rich.text import Text

from eidrive_reports.demo_page import DemoSite, PageImage, render, write_demo
from eidrive_reports.key_frames import KeyFrames, Story
from eidrive_reports.paper import (
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
from eidrive_reports.street_view import driver_view, helper_view, street_image
from eidrive_reports.studies import command, positive
from eidrive_scenario.api.actions import is_agent_controller
from eidrive_scenario.api.common import Array, RoadNetwork, Scenario, write_atomically
from eidrive_scenario.api.driving import agent_settings
from eidrive_scenario.api.experiments import Job, as_json_text, jobs_of, resolve_scenario, run_jobs
from eidrive_scenario.api.pages import road_drawing, run_of_result, write_replays
from eidrive_scenario.api.run import RunResult, RunSettings, actor_spec, load_for_seed, run_and_save

StoryResult = tuple[RunResult, Story | None]


def run_story(job: Job, watched: int, below: Path) -> StoryResult:
    """Run a job; runs of the seed `watched` also return their story and are recorded below a folder."""
    path = resolve_scenario(job.scenario)
    if job.seed != watched:
        return run_and_save(path, seed=job.seed, settings=job.settings), None
    observer = KeyFrames(EGO, HIDDEN, conflict_areas(load_for_seed(path, job.seed, job.settings.parameters)))
    result = run_and_save(path, seed=job.seed, settings=job.settings, below=below, observers=(observer,))
    return result, observer.story()


def conflict_areas(scenario: Scenario) -> tuple[Array, ...]:
    """Return the conflict areas of the ego, polygons (M, 2) [m]."""
    return tuple(
        np.array(polygon)
        for controller in scenario.controllers.get(EGO, ())
        if is_agent_controller(controller)
        for polygon in agent_settings(controller).planner_settings.areas
    )


def demo_site(name: str, seed: int, story: Story) -> DemoSite:
    """Return roads, conflict areas and camera images of a scenario, which the figures of all arms share."""
    scenario = load_for_seed(resolve_scenario(name), seed, RunSettings().parameters)
    roads = RoadNetwork.load(scenario.road_file) if scenario.road_file else None
    drawing = road_drawing(roads.roads.values() if roads is not None else ())
    return DemoSite(drawing, conflict_areas(scenario), _views(scenario, roads, story))


def _views(scenario: Scenario, roads: RoadNetwork | None, story: Story) -> tuple[PageImage, ...]:
    """Return images from the ego and from its helper at the time of braking."""
    snapshot = next((moment.snapshot for moment in story.moments if moment.kind == "braked"), None)
    if snapshot is None:
        return ()
    view = snapshot.view
    bodies = {name: actor_spec(name, scenario.entities[name]) for name in view.names}
    cameras = {EGO: (driver_view(view, EGO), "start of braking")}
    for report in snapshot.received[:1]:
        sender = report.message.sender
        cameras[sender] = (helper_view(view, sender, HIDDEN), f"towards {HIDDEN}")
    return tuple(
        PageImage(
            f"View of {name}",
            f"at {view.time:.2f} s, {subject}",
            street_image(bodies, roads, view, pose, without=name),
        )
        for name, (pose, subject) in cameras.items()
    )


def write_results(out: Path, runs: Sequence[tuple[Job, RunResult]]) -> Path:
    """Write all results as a JSON list with one line per run, in the format of `--json`. Return `out`."""
    lines = (as_json_text(replace(result, scenario=job.scenario)) for job, result in runs)
    with write_atomically(out) as stream:
        stream.write(("[\n" + ",\n".join(lines) + "\n]\n").encode())
    return out


def demo(out: Path, seeds: Sequence[int], workers: int | None, console: Console) -> tuple[Table, Table]:
    """Execute all runs, print the tables, and write page, replays and numbers (`.json` in the same folder)."""
    settings = run_settings(detector="oracle")
    jobs = [job for scenario in SCENARIOS for job in jobs_of(scenario, settings, seeds)]
    console.print(f"{len(SCENARIOS)} scenarios, {len(settings)} channels, {len(seeds)} seeds: {len(jobs)} runs")
    with TemporaryDirectory() as recordings:
        task = partial(run_story, watched=seeds[0], below=Path(recordings))
        results = run_jobs(jobs, task, workers=workers, console=console, title="demo")
        runs = [(job, result) for job, (result, _) in zip(jobs, results, strict=True)]
        reported, without = write_replays([run_of_result(result, job.scenario) for job, result in runs], out.parent)
    for line in without:
        console.print(Text(line, style="yellow"))
    stories: Mapping[tuple[str, str], Story] = {
        (job.scenario, job.arm): story for job, (_, story) in zip(jobs, results, strict=True) if story is not None
    }
    links, own = tabulate(runs, LINKS), tabulate(runs, OWN)
    console.print()
    for table in (links, own):
        console.print(render(table, evaluate_claims(table)))
    console.print(Text(difference(links, own)))
    sites = {name: demo_site(name, seeds[0], stories[name, "ideal"]) for name in SCENARIOS}
    footer = f"eidrive-scenario {version('eidrive-scenario')}, seeds {seeds[0]} to {seeds[-1]}"
    page = write_demo(out, reported, links, own, stories, sites, watched=seeds[0], footer=footer)
    numbers = write_results(out.with_suffix(".json"), runs)
    console.print(f"\nwritten: {page}, {numbers}")
    return links, own


@command
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m eidrive_reports.demo", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("reports/demo.html"), help="file of the page")
    parser.add_argument("--seeds", type=positive, default=20, help="runs of each arm, with seeds from 1")
    parser.add_argument("--workers", type=positive, default=None, help="processes; all cores by default")
    given = parser.parse_args(arguments)
    if given.out.is_dir() or any(above.exists() and not above.is_dir() for above in given.out.parents):
        parser.error(f"--out: not a path of a file (got {given.out}; expected, for example, reports/demo.html)")
    if given.out.suffix == ".json":
        parser.error(f"--out: the page would be overwritten by its numbers (got {given.out}; expected a .html file)")
    demo(given.out, range(1, given.seeds + 1), given.workers, Console())


if __name__ == "__main__":
    sys.exit(main())

"""Planners in the scenes `driving/*` and `ei/*` of the library: outcomes, time lost and comfort.

python -m eidrive_reports.planner_scenes --out reports

The output is planner_scenes.md, the table of docs/planners.md.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import Console

from eidrive_reports.driven_runs import CONTACT, decelerations
from eidrive_reports.paper import EGO
from eidrive_reports.studies import command, markdown_table, publish, study_options
from eidrive_scenario.api.experiments import Job, describe_scenarios, jobs_of, resolve_scenario, run_jobs
from eidrive_scenario.api.run import RunResult, RunSettings, Simulation

PLANNERS = ("route", "behavior")
FAMILIES = ("driving", "ei")


@dataclass(frozen=True)
class SceneRun:
    """One run of a scene with one planner.

    collided  whether the ego had a contact;  at_fault  whether one was by its own fault
    arrived   whether it reached its goal
    lost      time in addition to the same distance at the target speed [s]
    braking   maximum deceleration [m/s²]; that of a collision is included
    detected  time of the criterion `first_detection` [s]; None without one, and if the actor is never known
    """

    scenario: str
    planner: str
    seed: int
    collided: bool
    at_fault: bool
    arrived: bool
    lost: float
    braking: float
    detected: float | None = None


def run_of(job: Job) -> SceneRun:
    """Run a job, whose arm is the planner, and return its outcome."""
    times: list[float] = []
    speeds: list[float] = []
    target = 0.0
    with Simulation(resolve_scenario(job.scenario), seed=job.seed, settings=job.settings) as simulation:
        end = None
        while end is None:
            frame, end = simulation.tick()
            times.append(frame.view.time)
            speeds.append(float(frame.view.speed[frame.view.row(EGO)]))
            plan = frame.steps[EGO].plan
            target = max(target, float(plan.speeds.max()) if plan is not None else 0.0)
        result = simulation.result()
    return SceneRun(
        job.scenario,
        job.arm,
        job.seed,
        collided=result.metrics.get(f"{CONTACT}.count", 0.0) > 0.0,
        at_fault=result.metrics.get(f"{CONTACT}.at_fault", 0.0) > 0.0,
        arrived=_passed(result, "reach_position"),
        lost=time_lost(times, speeds, max(target, 1.0)),
        braking=float(decelerations(times, speeds).max(initial=0.0)),
        detected=next((verdict.value for verdict in result.criteria if verdict.name == "first_detection"), None),
    )


def time_lost(times: Sequence[float], speeds: Sequence[float], target: float) -> float:
    """Return the time in addition to the same distance at the target speed [s], from speeds at times [m/s, s]."""
    return times[-1] - times[0] - float(np.trapezoid(speeds, times)) / target


def _passed(result: RunResult, name: str) -> bool:
    """Whether the run has a criterion of this name, and it passed."""
    return [verdict.passed for verdict in result.criteria if verdict.name == name] == [True]


def table(runs: Sequence[SceneRun]) -> str:
    """Return the runs as a Markdown table, one line per scenario in order of appearance."""
    outcomes = (title for planner in PLANNERS for title in (f"`{planner}`: collisions, by own fault", "arrived"))
    lines = []
    for scenario in dict.fromkeys(run.scenario for run in runs):
        cells = [scenario]
        for planner in PLANNERS:
            mine = [run for run in runs if (run.scenario, run.planner) == (scenario, planner)]
            cells.append(f"{sum(run.collided for run in mine)}, {sum(run.at_fault for run in mine)} of {len(mine)}")
            cells.append(f"{sum(run.arrived for run in mine)} of {len(mine)}")
        cells.append(f"{sum(run.lost for run in mine) / max(len(mine), 1):.1f}")
        cells.append(f"{max((run.braking for run in mine), default=0.0):.1f}")
        lines.append(cells)
    return markdown_table(("scene", *outcomes, "time lost [s]", "hardest braking [m/s²]"), lines)


def scenes() -> list[str]:
    """Return the names of all scenes."""
    return [entry.name for entry in describe_scenarios() if entry.name.split("/")[0] in FAMILIES]


@command
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    options = study_options(parser, arguments, seeds=10)
    contact = {"collision": {"of": EGO, "name": CONTACT}}
    arms = {planner: RunSettings(parameters={"Planner": planner}, criteria=contact) for planner in PLANNERS}
    seeds = range(1, options.seeds + 1)
    jobs = [job for scene in scenes() for job in jobs_of(scene, arms, seeds)]
    runs = run_jobs(jobs, run_of, workers=options.workers, console=Console(stderr=True), title="scenes")
    publish(table(runs), options.out / "planner_scenes.md")


if __name__ == "__main__":
    sys.exit(main())

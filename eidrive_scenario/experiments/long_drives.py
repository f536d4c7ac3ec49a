"""Long drives of the planner `behavior` through background traffic: stops, contacts and completed routes.

python -m eidrive_scenario.experiments.long_drives MAP.xodr… --vehicles 30 --minutes 10 --seeds 1

For each map and seed a scenario is written to `--out`/long_drives and run: a random route, background traffic on the
whole map, and traffic lights if the map has controllers for them. The output is the table long_drives.md, with all
stops of at least 20 s.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from eidrive_scenario.errors import EidriveError
from eidrive_scenario.experiments.driven_motion import CONTACT, Stop, observed_run
from eidrive_scenario.experiments.repetitions import Job, run_jobs
from eidrive_scenario.experiments.town_drives import EGO, write_town_drive
from eidrive_scenario.files.atomic import write_atomically
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation import RunSettings

LONGEST = 600.0
"""Maximum duration of a drive [min]."""
LONG = 20.0
"""Minimum duration of a stop that the table lists [s]."""


@dataclass(frozen=True)
class LongDrive:
    """Outcome of a drive: simulated time [s], distance [m], contacts, completed share of the route, and stops."""

    scenario: str
    seed: int
    duration: float
    distance: float
    collided: bool
    at_fault: bool
    completed: float
    red_lights: int
    stops: tuple[Stop, ...]


def run_of(job: Job) -> LongDrive:
    """Run a job and return its outcome."""
    result, motion = observed_run(job.scenario, EGO, seed=job.seed, settings=job.settings)
    return LongDrive(
        Path(job.scenario).stem,
        job.seed,
        duration=result.simulated_s,
        distance=motion.distance,
        collided=motion.collided,
        at_fault=motion.at_fault,
        completed=result.metrics.get(f"route_completion.{EGO}", 0.0),
        red_lights=int(result.metrics.get("running_red_light.count", 0.0)),
        stops=tuple(motion.stops),
    )


def table(drives: Sequence[LongDrive]) -> str:
    """Return the drives as a Markdown table, and a list of their long stops with the reason of the plan."""
    columns = (
        "drive",
        "simulated time [s]",
        "distance [m]",
        "collisions",
        "by own fault",
        "red lights passed",
        "stops",
        "longest stop [s]",
        "completed route",
    )
    lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    for drive in drives:
        longest = max((stop.duration for stop in drive.stops), default=0.0)
        cells = (
            drive.scenario,
            f"{drive.duration:.0f}",
            f"{drive.distance:.0f}",
            int(drive.collided),
            int(drive.at_fault),
            drive.red_lights,
            len(drive.stops),
            f"{longest:.0f}",
            f"{100.0 * drive.completed:.1f} %",
        )
        lines.append(f"| {' | '.join(map(str, cells))} |")
    text = "\n".join(lines) + "\n"
    listed = [
        f"- {drive.scenario}, {stop.time:.0f} s at ({stop.x:.0f}, {stop.y:.0f}) m: {stop.duration:.0f} s, {stop.reason}"
        for drive in drives
        for stop in drive.stops
        if stop.duration >= LONG
    ]
    return text + ("\n" + "\n".join([f"Stops of at least {LONG:g} s:", "", *listed]) + "\n" if listed else "")


def minutes(text: str) -> float:
    """Return a duration of a drive from a text [min]. Raise ValueError if it is not positive, or too long."""
    value = float(text)
    if not 0.0 < value <= LONGEST:
        raise ValueError(text)
    return value


def _jobs(options: argparse.Namespace, folder: Path, settings: RunSettings) -> list[Job]:
    """Write the scenario of each map and seed and return its run."""
    jobs = []
    for road_map in options.maps:
        roads = RoadNetwork.load(road_map)
        for seed in range(1, options.seeds + 1):
            path = folder / f"{road_map.stem}_{seed}.xosc"
            size = {"vehicles": options.vehicles, "minutes": options.minutes}
            write_town_drive(roads, path, road_map=road_map, seed=seed, **size)
            jobs.append(Job(str(path), options.planner, seed, settings))
    return jobs


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("maps", type=Path, nargs="+", help="OpenDRIVE files with closed ways")
    parser.add_argument("--vehicles", type=int, default=30, help="number of vehicles of background traffic")
    parser.add_argument("--minutes", type=minutes, default=10.0, help="approximate duration of a drive")
    parser.add_argument("--seeds", type=int, default=1, help="number of seeds, from 1")
    parser.add_argument("--planner", default="behavior")
    parser.add_argument("--out", type=Path, default=Path("reports"))
    parser.add_argument("--workers", type=int, default=None, help="processes; all cores by default")
    options = parser.parse_args(arguments)
    folder = options.out / "long_drives"
    folder.mkdir(parents=True, exist_ok=True)
    settings = RunSettings(
        parameters={"Planner": options.planner},
        criteria={"collision": {"of": EGO, "name": CONTACT}},
        time_limit=max(180.0 * options.minutes, 60.0),
    )
    try:
        jobs = _jobs(options, folder, settings)
        drives = run_jobs(jobs, run_of, workers=options.workers, console=Console(stderr=True), title="long drives")
    except EidriveError as error:
        parser.error(str(error))
    result = table(drives)
    with write_atomically(options.out / "long_drives.md") as stream:
        stream.write(result.encode())
    sys.stdout.write(result)


if __name__ == "__main__":
    main()

"""Scenarios of the paper with learned detectors in closed loop: collisions, false tracks, brakings without a cause.

python -m eidrive_reports.closed_loop --out reports

The output is closed_loop.jsonl, with one line per run, and the table closed_loop.md. Runs of an existing
closed_loop.jsonl are not repeated.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter

from rich.console import Console

from eidrive_reports.paper import EGO, HIDDEN, SCENARIOS
from eidrive_reports.run_record import RunRecord
from eidrive_reports.studies import command, group_by, markdown_table, publish, study_options
from eidrive_scenario.api.experiments import Job, resolve_scenario, run_jobs, wilson
from eidrive_scenario.api.run import RunSettings, run_file

DETECTORS = ("yolov5", "ssd")
CHANNELS = ("none", "ideal")


@dataclass(frozen=True)
class ClosedLoopRun:
    """Outcome of one run: `distance` between the bodies [m], 0 after a contact; `false_tracks` per simulated minute."""

    scenario: str
    detector: str
    channel: str
    seed: int
    collisions: int
    distance: float
    false_tracks: float
    brakings: int
    without_cause: int


class ClosedLoopRecord(RunRecord[ClosedLoopRun]):
    """Record of the runs."""

    kind = ClosedLoopRun
    key = attrgetter("scenario", "detector", "channel", "seed")
    hint = "remove the line"


def jobs(detectors: Sequence[str], channels: Sequence[str], seed: int) -> list[Job]:
    """Return all runs of one seed; the arm is named `detector channel`."""
    return [
        Job(scenario, f"{detector} {channel}", seed, RunSettings(channel=channel, detector=detector))
        for scenario in SCENARIOS
        for detector in detectors
        for channel in channels
    ]


def run_of(job: Job) -> ClosedLoopRun:
    """Run a job and return its outcome."""
    result = run_file(resolve_scenario(job.scenario), seed=job.seed, settings=job.settings)
    detector, channel = job.arm.split(" ", 1)
    metrics = result.metrics
    return ClosedLoopRun(
        job.scenario,
        detector,
        channel,
        job.seed,
        int(metrics["collision.count"]),
        float(metrics[f"min_distance.{EGO}.{HIDDEN}.box"]),
        float(metrics[f"false_tracks.{EGO}.per_minute"]),
        int(metrics[f"false_tracks.{EGO}.brakings"]),
        int(metrics[f"false_tracks.{EGO}.brakings_without_cause"]),
    )


def table(runs: Sequence[ClosedLoopRun]) -> str:
    """Return the runs as a Markdown table, one line per detector, scenario and channel in their order of appearance."""
    titles = ("detector", "scenario", "channel", "collision-free", "95 % interval", "false tracks per minute")
    lines = []
    for (detector, scenario, channel), mine in group_by(runs, attrgetter("detector", "scenario", "channel")).items():
        free = wilson(sum(run.collisions == 0 for run in mine), len(mine))
        false = sum(run.false_tracks for run in mine) / len(mine)
        without_cause, brakings = sum(run.without_cause for run in mine), sum(run.brakings for run in mine)
        interval = f"{free.low:.2f} to {free.high:.2f}"
        cells = (f"`{detector}`", scenario.removeprefix("coop/"), f"`{channel}`", f"{free.successes} of {len(mine)}")
        lines.append((*cells, interval, f"{false:.1f}", f"{without_cause} of {brakings}"))
    return markdown_table((*titles, "brakings without cause"), lines)


@command
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--detectors", default=",".join(DETECTORS))
    parser.add_argument("--channels", default=",".join(CHANNELS))
    options = study_options(parser, arguments, seeds=20)
    console = Console(stderr=True)
    with ClosedLoopRecord.open(options.out / "closed_loop.jsonl") as record:
        for seed in range(1, options.seeds + 1):
            requested = jobs(options.detectors.split(","), options.channels.split(","), seed)
            left = [job for job in requested if (job.scenario, *job.arm.split(" ", 1), job.seed) not in record.runs]
            run_jobs(left, run_of, workers=options.workers, console=console, title=f"seed {seed}", finished=record.add)
    runs = sorted(record.runs.values(), key=attrgetter("detector", "scenario", "channel", "seed"))
    publish(table(runs), options.out / "closed_loop.md")


if __name__ == "__main__":
    sys.exit(main())

"""Scenarios of the paper with learned detectors in closed loop: collisions, false tracks, brakings without a cause.

python -m eidrive_reports.closed_loop --out reports

The output is closed_loop.jsonl, with one line per run, written after each seed, and the table closed_loop.md. Runs of
an existing closed_loop.jsonl are not repeated.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console

from eidrive_reports.paper import EGO, HIDDEN, SCENARIOS
from eidrive_scenario.api.common import write_atomically
from eidrive_scenario.api.experiments import Job, resolve_scenario, run_jobs, wilson
from eidrive_scenario.api.run import RunSettings, run_file

DETECTORS = ("yolov5", "ssd")
CHANNELS = ("none", "ideal")


@dataclass(frozen=True)
class Row:
    """One run. `distance` is between the bodies [m], 0 after a contact; `false_tracks` per simulated minute."""

    scenario: str
    detector: str
    channel: str
    seed: int
    collisions: int
    distance: float
    false_tracks: float
    brakings: int
    without_cause: int


def jobs(detectors: Sequence[str], channels: Sequence[str], seed: int) -> list[Job]:
    """Return all runs of one seed; the arm is named `detector channel`."""
    return [
        Job(scenario, f"{detector} {channel}", seed, RunSettings(channel=channel, detector=detector))
        for scenario in SCENARIOS
        for detector in detectors
        for channel in channels
    ]


def row_of(job: Job) -> Row:
    """Run a job and return its row of the table."""
    result = run_file(resolve_scenario(job.scenario), seed=job.seed, settings=job.settings)
    detector, channel = job.arm.split(" ", 1)
    metrics = result.metrics
    return Row(
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


def table(rows: Sequence[Row]) -> str:
    """Return the rows as a Markdown table, one line per detector, scenario and channel in their order of appearance."""
    lines = [
        "| detector | scenario | channel | collision-free | 95 % interval | false tracks per minute | "
        "brakings without cause |",
        "|---|---|---|---|---|---|---|",
    ]
    for detector, scenario, channel in dict.fromkeys((row.detector, row.scenario, row.channel) for row in rows):
        mine = [row for row in rows if (row.detector, row.scenario, row.channel) == (detector, scenario, channel)]
        free = wilson(sum(row.collisions == 0 for row in mine), len(mine))
        false = sum(row.false_tracks for row in mine) / len(mine)
        without_cause, brakings = sum(row.without_cause for row in mine), sum(row.brakings for row in mine)
        lines.append(
            f"| `{detector}` | {scenario.removeprefix('coop/')} | `{channel}` | {free.successes} of {len(mine)} | "
            f"{free.low:.2f} to {free.high:.2f} | {false:.1f} | {without_cause} of {brakings} |"
        )
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("reports"))
    parser.add_argument("--seeds", type=int, default=20, help="number of seeds, from 1")
    parser.add_argument("--detectors", default=",".join(DETECTORS))
    parser.add_argument("--channels", default=",".join(CHANNELS))
    parser.add_argument("--workers", type=int, default=None, help="processes; all cores by default")
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    record = options.out / "closed_loop.jsonl"
    text = record.read_text(encoding="utf-8") if record.is_file() else ""
    rows = [Row(**json.loads(line)) for line in text.splitlines()]
    console = Console(stderr=True)
    for seed in range(1, options.seeds + 1):
        done = {(row.scenario, f"{row.detector} {row.channel}", row.seed) for row in rows}
        requested = jobs(options.detectors.split(","), options.channels.split(","), seed)
        left = [job for job in requested if (job.scenario, job.arm, job.seed) not in done]
        added = run_jobs(left, row_of, workers=options.workers, console=console, title=f"seed {seed}") if left else ()
        with record.open("a", encoding="utf-8") as lines:
            lines.writelines(json.dumps(asdict(row)) + "\n" for row in added)
        rows += added
    rows.sort(key=lambda row: (row.detector, row.scenario, row.channel, row.seed))
    result = table(rows)
    with write_atomically(options.out / "closed_loop.md") as stream:
        stream.write(result.encode())
    sys.stdout.write(result)


if __name__ == "__main__":
    main()

"""Report about the first run of each case of a part, with a replay of each."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console

from eidrive_scenario.experiments.repetitions import run_jobs
from eidrive_scenario.experiments.reproduction.episodes import EpisodeJob
from eidrive_scenario.experiments.reproduction.part import Part
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.reporting.replay.run_replays import write_replays
from eidrive_scenario.reporting.run_report.report import write_report
from eidrive_scenario.reporting.run_report.reported_run import ReportedRun, run_of_result


def replays_page(name: str) -> str:
    """Return the path of the report about the recorded runs of a part, in the folder of the results."""
    return f"replays_{name}/report.html"


def write_part_replays(
    part: Part, out: Path, detectors: Sequence[str], *, workers: int | None = None, console: Console | None = None
) -> Path:
    """Run each case with the seed 1 and a recording, and write a report with their replays. Return its path.

    Raise the exceptions of `run_jobs`, and SettingError if a file cannot be written.
    """
    page = out / replays_page(part.name)
    with TemporaryDirectory() as recordings:
        task = partial(_recorded_run, below=Path(recordings))
        runs = run_jobs(part.jobs(1, detectors), task, workers=workers, console=console, title=f"{part.name}, replays")
        linked, omitted = write_replays(runs, page.parent)
    return write_report(linked, page, omitted=omitted)


def _recorded_run(job: EpisodeJob, below: Path) -> ReportedRun:
    result = run_and_save(resolve_scenario(job.scenario), seed=job.seed, settings=job.settings, below=below)
    return run_of_result(result, job.scenario)

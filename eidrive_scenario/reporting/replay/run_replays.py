"""Replays of the runs of a report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from eidrive_scenario.errors import InputError
from eidrive_scenario.recording.recording import open_recording
from eidrive_scenario.recording.run_files import RECORDING, RESULT, result_of
from eidrive_scenario.reporting.replay.page import make_replay
from eidrive_scenario.reporting.run_report.reported_run import ReportedRun

FOLDER = "replays"
"""Folder of the replays beside the report."""


def write_replays(runs: Sequence[ReportedRun], beside: Path) -> tuple[list[ReportedRun], list[str]]:
    """Write the replay of each run with a recording into a folder `beside` the report.

    Return the runs with the addresses of their replays, and the recordings without a replay with the reason.
    """
    linked: list[ReportedRun] = []
    omitted: list[str] = []
    taken: set[str] = set()
    for run in runs:
        recording = run.folder / RECORDING if run.folder is not None else None
        if recording is None or not recording.is_file():
            linked.append(run)
            continue
        name = recording.parent.name
        while name in taken:
            name += "-"
        taken.add(name)
        page = beside / FOLDER / f"{name}.html"
        try:
            make_replay(open_recording(recording), page, result_of(recording), result_file=recording.with_name(RESULT))
        except InputError as error:
            omitted.append(f"{recording}: {error.diagnostics[0].message}")
            linked.append(run)
            continue
        linked.append(run.model_copy(update={"replay": f"{FOLDER}/{quote(page.name)}"}))
    return linked, omitted

"""Replays of the runs of a report."""

from __future__ import annotations

import os
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
MOST = 200
"""Maximum number of replays of a report; runs that did not pass come first."""


def write_replays(runs: Sequence[ReportedRun], beside: Path) -> tuple[list[ReportedRun], list[str]]:
    """Write the replay of each run with a recording into a folder `beside` the report.

    Return the runs with the addresses of their replays, and the reasons for which recordings have none.
    """
    linked = list(runs)
    omitted: list[str] = []
    taken: set[str] = set()
    recordings = [
        (index, run.folder / RECORDING)
        for index, run in sorted(enumerate(runs), key=lambda entry: entry[1].passed)
        if run.folder is not None and (run.folder / RECORDING).is_file()
    ]
    for index, recording in recordings[:MOST]:
        name = recording.parent.name
        while name in taken:
            name += "-"
        taken.add(name)
        page = beside / FOLDER / f"{name}.html"
        try:
            make_replay(open_recording(recording), page, result_of(recording), result_file=recording.with_name(RESULT))
        except InputError as error:
            omitted.append(f"{recording}: {error.diagnostics[0].message}; the run has no replay")
            continue
        linked[index] = runs[index].model_copy(update={"replay": f"{FOLDER}/{quote(os.fsencode(page.name))}"})
    if len(recordings) > MOST:
        omitted.append(f"{len(recordings) - MOST} passed or later runs have no replay: `eidrive view` writes it")
    return linked, omitted

"""Tasks of worker processes in the tests of sweeps.

As a program, `python sweep_tasks.py ROWS sweep …` is `eidrive sweep …` that is killed when its store has ROWS rows.
"""

from __future__ import annotations

import os
import runpy
import signal
import sys

from eidrive_scenario.experiments.sweeps.execution import KeptFiles, execute
from eidrive_scenario.experiments.sweeps.jobs import SweepJob
from eidrive_scenario.experiments.sweeps.store import ResultStore, StoredRun


def killed_at_30(job: SweepJob, wall_limit: float | None, files: KeptFiles | None) -> StoredRun:
    """Execute a job; the process of the one with the speed 30 is killed."""
    if job.point["Speed"] == 30:
        os.kill(os.getpid(), signal.SIGKILL)
    return execute(job, wall_limit, files)


def kill_at(rows: int) -> None:
    """Kill this process once a store has this number of rows."""
    add = ResultStore.add

    def add_and_kill(store: ResultStore, *runs: StoredRun) -> None:
        missing = rows - len(store.statuses())
        add(store, *runs[:missing])
        if missing <= len(runs):
            os.kill(os.getpid(), signal.SIGKILL)

    ResultStore.add = add_and_kill  # type: ignore[assignment, method-assign]


if __name__ == "__main__":
    kill_at(int(sys.argv.pop(1)))
    runpy.run_module("eidrive_scenario", run_name="__main__", alter_sys=True)

"""Tasks of worker processes in the tests of sweeps.

As a program, `python sweep_tasks.py ROWS sweep …` is `eidrive sweep …` that is killed when its store has ROWS rows.
"""

from __future__ import annotations

import os
import re
import runpy
import signal
import sys
from dataclasses import replace
from pathlib import Path

from eidrive_scenario.api.criteria import Criterion, Frame, Verdict
from eidrive_scenario.base import wall_limit as wall_limit_module
from eidrive_scenario.experiments.sweeps.jobs import SweepJob
from eidrive_scenario.experiments.sweeps.store import ResultStore, StoredRun
from eidrive_scenario.experiments.sweeps.workers import KeptFiles, execute
from eidrive_scenario.extensions.registry import registry


def killed_at_30(job: SweepJob, wall_limit: float | None, files: KeptFiles | None) -> StoredRun:
    """Execute a job; the process of the one with the speed 30 is killed."""
    if job.point["Speed"] == 30:
        os.kill(os.getpid(), signal.SIGKILL)
    return execute(job, wall_limit, files)


def faulty_at_30(job: SweepJob, wall_limit: float | None, files: KeptFiles | None) -> StoredRun:
    """Execute a job; the one with the speed 30 has the criterion `interrupts`, or with a wall limit `hangs`."""
    result = execute(job, None, files)  # loads what a run needs, so that the wall limit is that of the criterion
    if job.point["Speed"] == 30:
        wall_limit_module.GRACE = 0.1
        name = "interrupts" if wall_limit is None else "hangs"
        registry("criteria").add(name, f"sweep_tasks:{name.capitalize()}")
        job = replace(job, settings=replace(job.settings, criteria=f"{{{name}: {{}}}}"))
        result = execute(job, wall_limit, files)
    return result


class Interrupts(Criterion):
    """Criterion that raises KeyboardInterrupt."""

    def observe(self, frame: Frame) -> None:
        raise KeyboardInterrupt

    def verdict(self) -> Verdict:
        raise AssertionError("no run with this criterion ends")


class Hangs(Interrupts):
    """Criterion that holds the interpreter's lock for years."""

    def observe(self, frame: Frame) -> None:
        with Path("calls").open("a") as stream:
            stream.write("x")
        re.match("(a+)+$", "a" * 60 + "b")


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

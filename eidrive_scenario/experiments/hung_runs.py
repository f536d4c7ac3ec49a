"""Ends of processes whose run does not return at its wall limit, and the reports that they leave.

The run executes code that no exception interrupts. Its process reports the error and ends; if no thread of it can run
any more, faulthandler writes its stack. `run`, `check`, sweeps and pytest differ in what they do with the report only.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import IO, Any

from eidrive_scenario.base.wall_limit import LastResort, Limit, set_last_resort
from eidrive_scenario.errors import ABORTED, SimulationError, WallLimitError

_DUMP = "Timeout"
"""Beginning of a stack that faulthandler wrote at the limit."""


def last_resort(
    report: Callable[[WallLimitError], object],
    dump: IO[Any] | None = None,
    publish: Callable[[Limit], None] | None = None,
    *,
    in_check: bool = False,
) -> LastResort:
    """Return the end of a process whose run does not return.

    report    prints or saves the error, which has the notes of the run
    dump      open file for the stack that faulthandler writes
    publish   saves the notes of the run in progress
    in_check  whether the process checks files; the error then has no simulated time

    The process imports the engine for its report only, as pytest loads its plugin in every project.
    """

    def end(limit: Limit, frame: FrameType | None) -> None:
        from eidrive_scenario.simulation.attribution import describe_hung_run, wall_limit_error

        error = wall_limit_error(frame, limit.seconds) if in_check else describe_hung_run(limit, frame)
        for note in limit.notes:
            error.add_note(note)
        try:
            report(error)
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(ABORTED)

    return LastResort(end, dump, publish)


def describe_report(report: str, limit: float | None) -> str:
    """Return the error of a run from its report, or from the stack that faulthandler wrote instead."""
    if not report.startswith(_DUMP):
        return report
    from eidrive_scenario.simulation.attribution import describe_dump

    return str(describe_dump(limit or 0.0, report))


class HungRunError(SimulationError):
    """End of a worker process whose run did not return at its wall limit; its text is the report."""


def report_hung_runs(report: Path) -> None:
    """End this process at a wall limit if the code of the run does not return, and write a report to this file."""
    file = report.open("wb", buffering=0)  # open as long as the process, as faulthandler needs its descriptor
    set_last_resort(last_resort(lambda error: file.write(f"{error}\n".encode()), file))


def hang_of(report: Path) -> HungRunError | None:
    """Return the error of an ended process from its report; None if it ended for another reason."""
    try:
        text = report.read_text(encoding="utf-8", errors="replace").strip()
    except FileNotFoundError:
        return None
    return HungRunError(text) if text else None

"""Reports of runs whose code does not return at its wall limit, from a worker process that ends with them."""

from __future__ import annotations

import os
from pathlib import Path
from types import FrameType
from typing import IO, Any

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.exit_codes import ABORTED
from eidrive_scenario.wall_limit import LastResort, Limit, set_last_resort

_DUMP = "Timeout"
"""Beginning of a stack that faulthandler wrote at the limit."""


class HungRunError(SimulationError):
    """End of a worker process whose run did not return at its wall limit.

    report  error of the run in one line, or the stack that faulthandler wrote
    """

    def __init__(self, report: str) -> None:
        super().__init__(report)
        self.report = report

    def describe(self, wall_limit: float | None) -> str:
        """Return the error of the run, whose limit of the wall time was `wall_limit` [s]."""
        if not self.report.startswith(_DUMP):
            return self.report
        from eidrive_scenario.simulation.hung_runs import describe_dump

        return str(describe_dump(wall_limit or 0.0, self.report))


def report_hung_runs(report: Path) -> None:
    """End this process at a wall limit if the code of the run does not return, and write a report to this file."""
    file = report.open("wb", buffering=0)  # open as long as the process, as faulthandler needs its descriptor
    set_last_resort(LastResort(_Reporter(file), file))


def hang_of(report: Path) -> HungRunError | None:
    """Return the error of an ended process from its report; None if it ended for another reason."""
    try:
        text = report.read_text(encoding="utf-8", errors="replace").strip()
    except FileNotFoundError:
        return None
    return HungRunError(text) if text else None


class _Reporter:
    """Callable that writes the report of an uninterruptible run to a file and ends the process."""

    def __init__(self, file: IO[Any]) -> None:
        self._file = file

    def __call__(self, limit: Limit, frame: FrameType | None) -> None:
        from eidrive_scenario.simulation.hung_runs import describe_hung_run

        try:
            self._file.write(f"{describe_hung_run(limit, frame)}\n".encode(errors="replace"))
        finally:
            os._exit(ABORTED)

"""Report of a check that exceeds its wall limit and cannot be interrupted."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from eidrive_scenario.cli.error_output import print_error
from eidrive_scenario.exit_codes import ABORTED

if TYPE_CHECKING:
    from eidrive_scenario.wall_limit import Limit


class HungCheck:
    """Reports of `eidrive check` for `supervise`; `file` is the file of the check in progress."""

    def __init__(self) -> None:
        self.file: Path | None = None

    def end(self, limit: Limit, frame: FrameType | None) -> None:
        """Report a check that executes this frame, and end the process."""
        from eidrive_scenario.simulation.attribution import wall_limit_error

        try:
            print_error(wall_limit_error(frame, limit.seconds), "check", self.file)
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(ABORTED)

    def report_dump(self, limit: float, dump: str) -> None:
        """Report a check whose process ended with this dump of its stack.

        The report omits the file, which only the child process has.
        """
        from eidrive_scenario.simulation.hung_runs import describe_dump

        print_error(describe_dump(limit, dump), "check")

"""Reports of aborted runs of `eidrive run`, on standard error and as a line of `--json`."""

from __future__ import annotations

import json
import mmap
import os
import struct
import sys
from types import FrameType
from typing import TYPE_CHECKING

from eidrive_scenario.cli.error_output import print_error, show_traceback
from eidrive_scenario.cli.streams import echo, has_all_characters
from eidrive_scenario.errors import EidriveError, SimulationError
from eidrive_scenario.exit_codes import ABORTED

if TYPE_CHECKING:
    from eidrive_scenario.wall_limit import Limit


_SHARED = 2**16
"""Size of the memory that is shared with the process that waits for a run [bytes]."""
_LENGTH = struct.Struct("<I")


class RunFailures:
    """Reports of the runs of one command.

    scenario   argument of the command
    traceback  whether errors are printed with their traceback
    """

    def __init__(self, scenario: str, *, json: bool, traceback: bool) -> None:
        self._scenario = scenario
        self._json = json
        self._traceback = traceback
        self._seed: int | None = None
        self._run: int | None = None
        self._shared = mmap.mmap(-1, _SHARED)
        """The run in progress, for the process that waits for it: length and JSON."""

    def begin(self, seed: int, run: int | None) -> None:
        """Set seed and distribution number of the run in progress."""
        self._seed, self._run = seed, run

    def report(self, error: EidriveError) -> None:
        """Report the error of the run in progress, with its traceback on request."""
        self._print_json(error)
        (show_traceback if self._traceback else print_error)(error)

    def end_hung_run(self, limit: Limit, frame: FrameType | None) -> None:
        """Report an uninterruptible run that executes this frame, and end the process."""
        from eidrive_scenario.simulation.hung_runs import describe_hung_run

        error = describe_hung_run(limit, frame)
        for note in limit.notes:
            error.add_note(note)
        try:
            self._print_json(error)
            print_error(error)
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(ABORTED)

    def share(self, limit: Limit) -> None:
        """Save seed, number and notes of the run in progress for `report_dump` in another process."""
        data = json.dumps([self._seed, self._run, limit.notes]).encode()
        if _LENGTH.size + len(data) > _SHARED:
            data = json.dumps([self._seed, self._run, []]).encode()
        self._shared[: _LENGTH.size + len(data)] = _LENGTH.pack(len(data)) + data

    def report_dump(self, limit: float, dump: str) -> None:
        """Report a run whose process ended with this dump of its stack."""
        from eidrive_scenario.simulation.hung_runs import describe_dump

        error = describe_dump(limit, dump)
        (length,) = _LENGTH.unpack_from(self._shared)
        if length:
            self._seed, self._run, notes = json.loads(self._shared[_LENGTH.size : _LENGTH.size + length])
            for note in notes:
                error.add_note(note)
        self._print_json(error)
        print_error(error)

    def _print_json(self, error: EidriveError) -> None:
        """Print the JSON object of the run if `--json` is set."""
        if not self._json:
            return
        description = error.as_json() if isinstance(error, SimulationError) else {"kind": "run", "message": str(error)}
        run = {} if self._run is None else {"run": self._run}
        seed = {} if self._seed is None else {"seed": self._seed}
        entry = {
            "scenario": self._scenario,
            **run,
            **seed,
            "passed": False,
            "end_reason": "error",
            "error": description,
        }
        if notes := getattr(error, "__notes__", None):
            entry["notes"] = notes
        echo(json.dumps(entry, ensure_ascii=not has_all_characters()))

"""Runs that do not end as they should: failures of `eidrive run`, `--wall-limit` in a child process."""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import signal
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, BinaryIO

import typer

from eidrive_scenario.cli.output import echo, has_all_characters, print_error, show_traceback
from eidrive_scenario.errors import ABORTED, EidriveError, SimulationError

if TYPE_CHECKING:
    from eidrive_scenario.base.wall_limit import Limit

_FORWARDED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
_DEATH_SIGNAL = 1
"""Option PR_SET_PDEATHSIG of prctl(2)."""
_allowed = False


def allow() -> None:
    """Allow commands of this process to fork: the process belongs to the command line."""
    global _allowed
    _allowed = True


def supervise(
    limit: float, report: Callable[[SimulationError], None], subject: dict[str, Any] | None = None, what: str = "run"
) -> None:
    """Continue in a child process. The parent waits and ends with its exit code, or 3 for an abnormal end.

    limit    wall limit of each run or check [s]
    report   prints the error of a run that does not return, in the child or else in the parent, or that of an ended
             child
    subject  description of the run in progress, which the parent gets before it reports
    what     subject of messages: run or check

    Outside the process of the command line, only runs that return to the interpreter are limited.
    """
    if not _allowed:
        return
    import ctypes

    from eidrive_scenario.base.wall_limit import set_last_resort
    from eidrive_scenario.experiments.hung_runs import last_resort
    from eidrive_scenario.files.bounded import file_in_memory

    dump, notes = file_in_memory(), file_in_memory()  # stay open as long as the process
    finished, finish = os.pipe()
    sys.stdout.flush()
    sys.stderr.flush()
    child = os.fork()
    if child == 0:
        os.close(finished)
        os.setpgid(0, 0)
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
        atexit.register(os.write, finish, b".")

        def publish(limit: Limit) -> None:
            notes.seek(0)
            notes.truncate()
            notes.write(json.dumps([subject, limit.notes]).encode())
            notes.flush()

        set_last_resort(last_resort(report, dump, None if subject is None else publish, in_check=what == "check"))
        return
    os.close(finish)
    status = _wait(child)
    if stack := _content(dump):
        from eidrive_scenario.simulation.attribution import describe_dump

        error = describe_dump(limit, stack)
        if subject is not None and (saved := _content(notes)):
            in_progress, lines = json.loads(saved)
            subject.update(in_progress)
            for line in lines:
                error.add_note(line)
        report(error)
        raise typer.Exit(ABORTED)
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        from eidrive_scenario.base.wall_limit import signal_name

        report(SimulationError(f"its process was ended by {signal_name(-code)}"))
        raise typer.Exit(ABORTED)
    if code != ABORTED and not os.read(finished, 1):
        report(SimulationError("an extension ended its process (os._exit)"))
        raise typer.Exit(ABORTED)
    raise typer.Exit(code)


def _content(file: BinaryIO) -> str:
    file.seek(0)
    return file.read().decode(errors="replace")


def _wait(child: int) -> int:
    """Wait for a child, forward all signals except ignored ones, and return its status."""
    for number in _FORWARDED:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda received, frame: os.kill(child, received))
    return os.waitpid(child, 0)[1]


class RunFailures:
    """Reports of the runs of one command.

    scenario   argument of the command
    traceback  whether errors are printed with their traceback
    """

    def __init__(self, scenario: str, *, json: bool, traceback: bool) -> None:
        self._scenario = scenario
        self._json = json
        self._traceback = traceback
        self.subject: dict[str, Any] = {}
        """Distribution number and seed of the run in progress."""

    def begin(self, seed: int, run: int | None) -> None:
        """Set seed and distribution number of the run in progress."""
        self.subject |= {"seed": seed} if run is None else {"run": run, "seed": seed}

    def report(self, error: EidriveError) -> None:
        """Report the error of the run in progress, with its traceback on request."""
        self._print_json(error)
        (show_traceback if self._traceback else print_error)(error)

    def report_hang(self, error: SimulationError) -> None:
        """Report a run that does not return at its wall limit, or whose process ended."""
        self._print_json(error)
        print_error(error)

    def _print_json(self, error: EidriveError) -> None:
        """Print the JSON object of the run if `--json` is set."""
        if not self._json:
            return
        entry = {
            "scenario": self._scenario,
            **self.subject,
            "passed": False,
            "end_reason": "error",
            "error": error.as_json(),
        }
        if notes := getattr(error, "__notes__", None):
            entry["notes"] = notes
        echo(json.dumps(entry, ensure_ascii=not has_all_characters()))

"""`--wall-limit` in a child process, whose parent reports code that cannot be interrupted."""

from __future__ import annotations

import atexit
import contextlib
import os
import signal
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, BinaryIO

import typer

from eidrive_scenario.cli.streams import echo
from eidrive_scenario.exit_codes import ABORTED

if TYPE_CHECKING:
    from types import FrameType

    from eidrive_scenario.wall_limit import Limit

_FORWARDED = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")
_DEATH_SIGNAL = 1
"""Option PR_SET_PDEATHSIG of prctl(2)."""
_allowed = False


def allow() -> None:
    """Allow commands of this process to fork: the process belongs to the command line."""
    global _allowed
    _allowed = True


def supervise(
    end: Callable[[Limit, FrameType | None], None],
    report: Callable[[str], None],
    what: str = "run",
    publish: Callable[[Limit], None] | None = None,
) -> None:
    """Continue in a child process. The parent waits and ends with its exit code, or 3 for an abnormal end.

    end      report of an uninterruptible run in the child, with the executed frame
    report   the same report in the parent, with the stack that faulthandler wrote
    what     subject of messages: run or check
    publish  function that saves the notes of the run in progress for `report`; see LastResort

    Without `fork`, or outside the process of the command line, only runs that return to the interpreter are limited.
    """
    if not _allowed or not hasattr(os, "fork"):
        return
    import ctypes

    from eidrive_scenario.files.bounded import file_in_memory
    from eidrive_scenario.wall_limit import LastResort, set_last_resort

    dump = file_in_memory()  # stays open as long as the process
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
        set_last_resort(LastResort(end, dump, publish))
        return
    os.close(finish)
    code = _exit_code(_wait(child), finished, dump, report, what)
    raise typer.Exit(code)


def _wait(child: int) -> int:
    """Wait for a child, forward all signals except ignored ones, and return its status."""
    for number in [getattr(signal, name) for name in _FORWARDED]:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda received, frame: os.kill(child, received))
    return os.waitpid(child, 0)[1]


def _exit_code(status: int, finished: int, dump: BinaryIO, report: Callable[[str], None], what: str) -> int:
    dump.seek(0)
    stack = dump.read().decode(errors="replace")
    if stack:
        report(stack)
        return ABORTED
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        echo(f"{what} aborted: its process was ended by {signal.Signals(-code).name}", err=True)
        return ABORTED
    if code != ABORTED and not os.read(finished, 1):
        echo(f"{what} aborted: an extension ended its process (os._exit)", err=True)
        return ABORTED
    return code

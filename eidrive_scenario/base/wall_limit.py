"""Limit of the wall time of a run, for runs that would not terminate.

A watchdog thread interrupts the thread of the run by raising LimitReached in it: through a signal in the main thread,
which also ends waiting system calls, else between two steps of the interpreter. It repeats that until the run ends,
as code may catch the exception, and the interpreter ignores exceptions in finalizers and callbacks of weak references:
each time step and the end of a run raise it, too, and interruptions that were ignored are not reported. Code that never
returns to the interpreter cannot be interrupted: a process that has a LastResort ends in that case. The run does not
depend on the clock before the limit is reached.
"""

from __future__ import annotations

import ctypes
import faulthandler
import math
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from numbers import Real
from types import FrameType, TracebackType
from typing import IO, Any

from eidrive_scenario.errors import Diagnostic, SettingError, WallLimitError, quoted

REPEAT = 1.0
"""Time from one interruption to the next [s]."""
POSTPONEMENT = 0.01
"""Time to the next interruption if one cannot be raised [s]."""
GRACE = 3.0
"""Time from the first interruption to the last resort [s]."""
CLOSING = 30.0
"""Time in which an interrupted run has to close its files before the last resort [s]."""
LONGEST = 1e9
"""Limit that replaces longer ones, which exceed the timers of some systems [s]. No run takes 30 years."""


class LimitReached(BaseException):
    """Interruption of a run whose limit is reached; Simulation converts it to WallLimitError."""


@dataclass
class Limit:
    """Limit of a run in progress.

    seconds  wall time [s]
    notes    lines that are appended to the report of the last resort, such as the path of the recording
    """

    seconds: float
    notes: list[str] = field(default_factory=list)
    armed: bool = True
    """Whether the run is interrupted at the limit; see `disarm`."""
    deadline: float = field(init=False)
    """Instant of the limit by the monotonic clock [s]."""

    def __post_init__(self) -> None:
        self.deadline = time.monotonic() + self.seconds

    def disarm(self) -> None:
        """End the interruptions, as the error of the run is being raised: it may now take longer to close its files."""
        self.armed = False
        _dump_later(CLOSING + GRACE)

    def add_note(self, note: str) -> None:
        """Append a line to the report of the last resort."""
        self.notes.append(note)
        self.publish()

    def end(self) -> None:
        """Withdraw the notes: the run is over, so that a later end of the process is not about it."""
        self.notes.clear()
        self.publish()

    def publish(self) -> None:
        """Pass the notes to a location that outlasts the process."""
        if _last_resort is not None and _last_resort.publish is not None:
            _last_resort.publish(self)


@dataclass(frozen=True)
class LastResort:
    """End of a process whose run cannot be interrupted.

    end      called in the watchdog thread with the limit and the topmost frame of the run; must end the process
    dump     open file for the stack of a process in which no thread can run; the exit code is then 1
    publish  called at the start of a limit and with each of its notes; saves them for the reader of `dump`
    """

    end: Callable[[Limit, FrameType | None], None]
    dump: IO[Any] | None = None
    publish: Callable[[Limit], None] | None = None


_of_thread = threading.local()
_last_resort: LastResort | None = None


def set_last_resort(resort: LastResort | None) -> LastResort | None:
    """Set the last resort of all later runs of this process, None for no last resort. Return the earlier one."""
    global _last_resort
    before, _last_resort = _last_resort, resort
    return before


def _dump_later(seconds: float) -> None:
    """Let the process end after this time [s] if no thread can run by then."""
    if _last_resort is not None and _last_resort.dump is not None:
        faulthandler.dump_traceback_later(seconds, exit=True, file=_last_resort.dump)


def limit_wall_time(seconds: float | None) -> AbstractContextManager[Limit | None]:
    """Return a context manager that limits the wall time of its block [s].

    None sets no limit, and an outer limit of the thread stays in force. Raise SettingError for a limit that is not
    positive; the block raises WallLimitError when the limit is reached. Outside of the main thread, a waiting system
    call is not interrupted before it returns.
    """
    if seconds is not None and not _is_positive(seconds):
        raise SettingError(Diagnostic(f"wall_limit is {quoted(seconds)}", "give a positive number of seconds"))
    return _LimitedBlock(seconds)


def _is_positive(seconds: object) -> bool:
    # bool is a subclass of int, but True is not a number of seconds
    return not isinstance(seconds, bool) and isinstance(seconds, Real) and 0.0 < float(seconds) < math.inf


def current_limit() -> Limit | None:
    """Return the limit under which this thread runs, or None."""
    limit: Limit | None = getattr(_of_thread, "limit", None)
    return limit


def raise_if_limit_reached() -> None:
    """Raise LimitReached if the limit of this thread is reached, also if the watchdog thread has not run since."""
    limit = current_limit()
    if limit is not None and limit.armed and time.monotonic() >= limit.deadline:
        raise LimitReached


def running_line(trace: TracebackType | None) -> str:
    """Return `file:line in function` of the innermost frame of a traceback outside of this module."""
    frames = [entry for entry in traceback.extract_tb(trace) if entry.filename != __file__]
    return f"{frames[-1].filename}:{frames[-1].lineno} in {frames[-1].name}" if frames else ""


def signal_name(number: int) -> str:
    """Return the name of a signal, such as `SIGKILL`, or `signal 40` for one without a name."""
    try:
        return signal.Signals(number).name
    except ValueError:  # a real-time signal
        return f"signal {number}"


class _LimitedBlock:
    """Context manager of a limit; it sets none within the block of another limit of its thread.

    No interruption is raised in its own methods: a context manager that fails while it is left would stay in force.
    """

    def __init__(self, seconds: float | None) -> None:
        self._seconds = None if seconds is None else min(float(seconds), LONGEST)
        self._watchdog: _Watchdog | None = None

    def __enter__(self) -> Limit | None:
        if self._seconds is None or current_limit() is not None:
            return current_limit()
        limit = Limit(self._seconds)
        limit.publish()
        self._watchdog = _Watchdog(limit)
        _of_thread.limit = limit
        self._watchdog.start()
        return limit

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        watchdog = self._watchdog
        if watchdog is None:
            return
        try:
            watchdog.stop()
        except LimitReached:  # of a thread other than the main thread: after the block, hence of no importance
            watchdog.stop()
        self._watchdog = _of_thread.limit = None
        watchdog.limit.end()
        if isinstance(error, LimitReached):
            raise WallLimitError(watchdog.limit.seconds, where=running_line(error.__traceback__)) from error


def _is_protected(frame: FrameType | None) -> bool:
    """Whether a frame belongs to the beginning or the end of a limited block, or saves notes."""
    while frame is not None:
        if frame.f_code in _PROTECTED:
            return True
        frame = frame.f_back
    return False


_PROTECTED = frozenset({_LimitedBlock.__enter__.__code__, _LimitedBlock.__exit__.__code__, Limit.publish.__code__})


class _UnreportedInterruptions:
    """Context manager in which the interpreter does not report the interruptions that it ignores.

    pytest would fail the test of a run for such a report. Several threads may enter it at once.
    """

    def __init__(self) -> None:
        self._entered = 0
        self._lock = threading.Lock()
        self._before = sys.unraisablehook

    def __enter__(self) -> None:
        with self._lock:
            self._entered += 1
            if self._entered == 1:
                self._before, sys.unraisablehook = sys.unraisablehook, self._report

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._entered -= 1
            if self._entered == 0 and sys.unraisablehook == self._report:
                sys.unraisablehook = self._before

    def _report(self, unraisable: sys.UnraisableHookArgs) -> None:
        if not issubclass(unraisable.exc_type, LimitReached):
            self._before(unraisable)


_unreported_interruptions = _UnreportedInterruptions()


class _Watchdog:
    """Thread that interrupts the thread of its creation from the limit on."""

    def __init__(self, limit: Limit) -> None:
        self.limit = limit
        self._target = threading.get_ident()
        self._by_signal = threading.current_thread() is threading.main_thread()
        self._before: Callable[[int, FrameType | None], object] | int | None = None
        self._is_postponed = False
        """Whether the last interruption fell into the beginning or the end of the block, or into saving notes."""
        self._ended = threading.Event()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._watch, name="eidrive wall limit", daemon=True)

    def start(self) -> None:
        """Watch the run from now on."""
        if self._by_signal:
            self._before = signal.signal(signal.SIGUSR2, self._interrupted)
        _dump_later(self.limit.seconds + 2.0 * GRACE)
        self._thread.start()

    def stop(self) -> None:
        """Interrupt the run no more. A second call has no effect.

        An interruption that is pending in a thread is raised here: to withdraw it by PyThreadState_SetAsyncExc would
        make the interpreter check for it forever.
        """
        self.limit.armed = False
        with self._lock:
            self._ended.set()
        self._thread.join(REPEAT)
        if _last_resort is not None and _last_resort.dump is not None:
            faulthandler.cancel_dump_traceback_later()
        if self._by_signal:
            signal.signal(signal.SIGUSR2, signal.SIG_DFL if self._before is None else self._before)

    def _watch(self) -> None:
        if not self._ended.wait(self.limit.seconds):
            with _unreported_interruptions:
                self._interrupt_until_end()

    def _interrupt_until_end(self) -> None:
        last, is_closing = time.monotonic() + GRACE, False
        while not self._ended.is_set():
            self._is_postponed = False
            self._interrupt()
            if self._ended.wait(POSTPONEMENT):
                return
            if not self._is_postponed and self._ended.wait(min(REPEAT, max(last - time.monotonic(), 0.01))):
                return
            if not self.limit.armed and not is_closing:
                last, is_closing = time.monotonic() + CLOSING, True
            if time.monotonic() >= last:
                self._resort()
                last = math.inf

    def _interrupt(self) -> None:
        with self._lock:
            if self._ended.is_set() or not self.limit.armed:
                return
            if self._by_signal:
                signal.pthread_kill(self._target, signal.SIGUSR2)
            elif _is_protected(sys._current_frames().get(self._target)):
                self._is_postponed = True
            else:
                ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self._target), ctypes.py_object(LimitReached))

    def _interrupted(self, number: int, frame: FrameType | None) -> None:
        if not self.limit.armed:
            return
        if _is_protected(frame):
            self._is_postponed = True
        else:
            raise LimitReached

    def _resort(self) -> None:
        if _last_resort is not None:
            _last_resort.end(self.limit, sys._current_frames().get(self._target))

"""Workers of a sweep: processes of this machine."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any, Protocol, TypeVar

from eidrive_scenario.experiments.repetitions import end_with_parent
from eidrive_scenario.experiments.sweeps.execution import prepare_process
from eidrive_scenario.experiments.sweeps.hang_reports import hang_of, report_hung_runs
from eidrive_scenario.experiments.sweeps.worker_start import worker_context

R = TypeVar("R")


class Workers(Protocol):
    """Workers that execute functions, as `concurrent.futures.Executor`.

    The exception of a future is HungRunError if its worker ended with a run that did not return.
    """

    @property
    def capacity(self) -> int:
        """Number of jobs that should be submitted at a time."""

    def submit(self, function: Callable[..., R], /, *arguments: Any) -> Future[R]:
        """Return the future of a call in a worker."""

    def is_crash(self, error: BaseException) -> bool:
        """Return whether the exception of a future means that its worker ended for another reason."""

    def close(self) -> None:
        """End all workers. Calls that are not complete are lost."""


class _Worker:
    """Process that is replaced when it ends.

    folder  folder of the reports of hung runs;  number  number of the report, another one for each process
    """

    def __init__(self, folder: Path, number: int) -> None:
        self._report = folder / str(number)
        self._pool = ProcessPoolExecutor(
            1, mp_context=worker_context(), initializer=_initialize, initargs=(self._report,)
        )
        self.has_ended = False

    def submit(self, function: Callable[..., R], /, *arguments: Any) -> Future[R]:
        """Start a call. Raise BrokenProcessPool if the process ended while it was idle."""
        outer: Future[R] = Future()
        inner = self._pool.submit(function, *arguments)
        outer.set_running_or_notify_cancel()
        inner.add_done_callback(lambda done: self._pass_on(done, outer))
        return outer

    def _pass_on(self, inner: Future[R], outer: Future[R]) -> None:
        error = CancelledError() if inner.cancelled() else inner.exception()
        self.has_ended = isinstance(error, BrokenProcessPool)
        if error is None:
            outer.set_result(inner.result())
        else:
            outer.set_exception((hang_of(self._report) if self.has_ended else None) or error)

    def terminate(self) -> None:
        """End the process and its call, without waiting for it."""
        # Executors have no method before Python 3.14 that ends a call in progress.
        for process in list((getattr(self._pool, "_processes", None) or {}).values()):
            with suppress(OSError, ValueError):
                process.terminate()

    def shut_down(self, *, wait: bool) -> None:
        """Release the process once it has ended."""
        self._pool.shutdown(wait=wait, cancel_futures=True)


class LocalWorkers:
    """Processes of this machine. The end of one affects its own call only; it is replaced."""

    def __init__(self, capacity: int) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="eidrive-workers-"))
        self._numbers = count()
        self._idle = [self._start() for _ in range(capacity)]
        self._busy: dict[Future[Any], _Worker] = {}
        self.capacity = capacity

    def _start(self) -> _Worker:
        return _Worker(self._folder, next(self._numbers))

    def submit(self, function: Callable[..., R], /, *arguments: Any) -> Future[R]:
        """Start a call in an idle worker. Raise RuntimeError if there is none."""
        for future in [future for future in self._busy if future.done()]:
            worker = self._busy.pop(future)
            if worker.has_ended:
                worker.shut_down(wait=False)
                worker = self._start()
            self._idle.append(worker)
        if not self._idle:
            raise RuntimeError("all workers are busy")
        worker = self._idle.pop(0)
        try:
            future = worker.submit(function, *arguments)
        except BrokenProcessPool:  # the process was killed while it was idle
            worker.shut_down(wait=False)
            worker = self._start()
            future = worker.submit(function, *arguments)
        self._busy[future] = worker
        return future

    def is_crash(self, error: BaseException) -> bool:
        return isinstance(error, BrokenProcessPool)

    def close(self) -> None:
        workers = (*self._idle, *self._busy.values())
        for worker in workers:
            worker.terminate()
        for worker in workers:
            worker.shut_down(wait=True)
        self._idle, self._busy = [], {}
        shutil.rmtree(self._folder, ignore_errors=True)


def _initialize(report: Path) -> None:
    prepare_process()
    report_hung_runs(report)
    end_with_parent()

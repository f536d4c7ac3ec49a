"""Workers of a sweep: processes of this machine."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from typing import Any, Protocol, TypeVar

from eidrive_scenario.experiments.repetitions import end_with_parent
from eidrive_scenario.experiments.sweeps.execution import prepare_process
from eidrive_scenario.experiments.sweeps.worker_start import worker_context

R = TypeVar("R")


class Workers(Protocol):
    """Workers that execute functions, as `concurrent.futures.Executor`."""

    @property
    def capacity(self) -> int:
        """Number of jobs that should be submitted at a time."""

    def submit(self, function: Callable[..., R], /, *arguments: Any) -> Future[R]:
        """Return the future of a call in a worker."""

    def is_crash(self, error: BaseException) -> bool:
        """Return whether the exception of a future means that its worker ended."""

    def close(self) -> None:
        """End all workers. Calls that are not complete are lost."""


class LocalWorkers:
    """Processes of this machine. The end of one affects its own call only; it is replaced."""

    def __init__(self, count: int) -> None:
        self._context = worker_context()
        self._idle = [self._start() for _ in range(count)]
        self._busy: dict[Future[Any], ProcessPoolExecutor] = {}
        self.capacity = count

    def _start(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(1, mp_context=self._context, initializer=_initialize)

    def submit(self, function: Callable[..., R], /, *arguments: Any) -> Future[R]:
        """Start a call in an idle worker. Raise RuntimeError if there is none."""
        for future in [future for future in self._busy if future.done()]:
            pool = self._busy.pop(future)
            if not future.cancelled() and isinstance(future.exception(), BrokenProcessPool):
                pool.shutdown(wait=False)
                pool = self._start()
            self._idle.append(pool)
        if not self._idle:
            raise RuntimeError("all workers are busy")
        pool = self._idle.pop(0)
        try:
            future = pool.submit(function, *arguments)
        except BrokenProcessPool:  # the process was killed while it was idle
            pool.shutdown(wait=False)
            pool = self._start()
            future = pool.submit(function, *arguments)
        self._busy[future] = pool
        return future

    def is_crash(self, error: BaseException) -> bool:
        return isinstance(error, BrokenProcessPool)

    def close(self) -> None:
        for pool in (*self._idle, *self._busy.values()):
            # Executors have no method before Python 3.14 that ends a call in progress.
            for process in list((getattr(pool, "_processes", None) or {}).values()):
                with suppress(OSError, ValueError):
                    process.terminate()
            pool.shutdown(wait=True, cancel_futures=True)
        self._idle, self._busy = [], {}


def _initialize() -> None:
    prepare_process()
    end_with_parent()

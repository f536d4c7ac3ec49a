"""Writing of ended runs to the store while other runs are computed."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Self

from eidrive_scenario.experiments.sweeps.store import ResultStore, StoredRun


class RunWriter:
    """Writer of ended runs in a separate thread, so that workers do not wait for the disk.

    Runs that end during a transaction are written together in the next one.

    written  function that gets each run once it is on the disk, in the thread of `collect`
    """

    def __init__(self, store: ResultStore, written: Callable[[StoredRun], None]) -> None:
        self._store = store
        self._written = written
        self._waiting: list[StoredRun] = []
        self._batch: list[StoredRun] = []
        self._thread = ThreadPoolExecutor(1, "store")
        self.transaction: Future[None] | None = None
        """Transaction in progress."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write the runs that wait, also if an error ends the sweep."""
        try:
            while self.transaction is not None:
                self.collect()
        finally:
            self._thread.shutdown()

    def add(self, run: StoredRun) -> None:
        """Write a run as soon as the transaction in progress has ended."""
        self._waiting.append(run)
        self._start()

    def collect(self) -> None:
        """Wait for the transaction in progress, report its runs, and start the next one.

        Raise SimulationError if the store cannot be written.
        """
        if self.transaction is not None:
            transaction, self.transaction = self.transaction, None
            transaction.result()
            for run in self._batch:
                self._written(run)
            self._start()

    def _start(self) -> None:
        if self.transaction is None and self._waiting:
            self._batch, self._waiting = self._waiting, []
            self.transaction = self._thread.submit(self._store.add, *self._batch)

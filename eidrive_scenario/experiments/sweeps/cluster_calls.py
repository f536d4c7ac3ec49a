"""Calls in child processes of a Dask worker, one for each of its threads.

Code that does not return, or ends its process, affects its own call only, and no call that waits at the same worker.
"""

from __future__ import annotations

import multiprocessing
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.util import Finalize
from typing import Any, TypeVar

from eidrive_scenario.experiments.sweeps.workers import LocalWorkers
from eidrive_scenario.optional_imports import optional_import
from eidrive_scenario.registry import use_project

R = TypeVar("R")


class _Children:
    """Child processes of this worker, with the sweep for which they were started."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: list[tuple[str, LocalWorkers]] = []
        self._busy: list[tuple[str, LocalWorkers]] = []
        self._finalizer: Finalize | None = None

    @contextmanager
    def of(self, sweep: str) -> Iterator[LocalWorkers]:
        """Return a child of a sweep for one call. A new one replaces idle children of other sweeps."""
        others: list[tuple[str, LocalWorkers]] = []
        with self._lock:
            held = next((entry for entry in self._idle if entry[0] == sweep), None)
            if held is not None:
                self._idle.remove(held)
            else:  # the command of another sweep may have been killed
                others, self._idle = self._idle, []
        for _, child in others:
            child.close()
        entry = held or (sweep, self._start())
        with self._lock:
            self._busy.append(entry)
        try:
            yield entry[1]
        finally:
            with self._lock:
                if entry in self._busy:  # else the sweep has ended
                    self._busy.remove(entry)
                    self._idle.append(entry)

    def end(self, sweep: str | None = None) -> None:
        """End the children of a sweep, None for all, with their calls."""
        with self._lock:
            ended = [entry for entry in (*self._idle, *self._busy) if sweep in (None, entry[0])]
            self._idle = [entry for entry in self._idle if entry not in ended]
            self._busy = [entry for entry in self._busy if entry not in ended]
        for _, child in ended:
            child.close()

    def _start(self) -> LocalWorkers:
        process = multiprocessing.current_process()
        if process.daemon:  # as workers with a nanny are; only other processes may have children
            process.daemon = False
        with self._lock:
            if self._finalizer is None:  # a process joins its children before it ends
                self._finalizer = Finalize(None, self.end, exitpriority=10)
        return LocalWorkers(1)


_children = _Children()


def call_in_child(sweep: str, folder: str | None, function: Callable[..., R], /, *arguments: Any) -> R:
    """Return the result of a call in a child process of this worker.

    sweep   identifier of the sweep; its children execute no calls of others
    folder  folder of the project whose extensions are used; None for none. A worker does not inherit the environment
            of the command

    Raise HungRunError or BrokenProcessPool if the child ends, SettingError for an invalid project, and RegistryError
    if another extension has one of the names.
    """
    cloudpickle = optional_import("cloudpickle", "cluster")
    with _children.of(sweep) as child:
        result: R = child.submit(_call, folder, cloudpickle.dumps((function, arguments))).result()
        return result


def end_children(sweep: str) -> None:
    """End the child processes of a sweep in this worker, also those with a call."""
    _children.end(sweep)


def _call(folder: str | None, pickled: bytes) -> Any:
    if folder is not None:
        use_project(folder)
    function, arguments = optional_import("cloudpickle", "cluster").loads(pickled)
    return function(*arguments)

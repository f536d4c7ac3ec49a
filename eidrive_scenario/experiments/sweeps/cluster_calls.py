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
    """Child processes of this worker that have no call, with the sweep for which they were started."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: list[tuple[str, LocalWorkers]] = []
        self._finalizer: Finalize | None = None

    @contextmanager
    def of(self, sweep: str) -> Iterator[LocalWorkers]:
        """Return a child of a sweep for one call. Idle children of other sweeps end."""
        with self._lock:
            others = [child for of, child in self._idle if of != sweep]
            self._idle = [(of, child) for of, child in self._idle if of == sweep]
            held = self._idle.pop()[1] if self._idle else None
        for child in others:
            child.close()
        child = self._start() if held is None else held
        try:
            yield child
        finally:
            with self._lock:
                self._idle.append((sweep, child))

    def _start(self) -> LocalWorkers:
        process = multiprocessing.current_process()
        if process.daemon:  # as workers with a nanny are; only other processes may have children
            process.daemon = False
        with self._lock:
            if self._finalizer is None:  # a process joins its children before it ends
                self._finalizer = Finalize(None, self._close, exitpriority=10)
        return LocalWorkers(1)

    def _close(self) -> None:
        for _, child in self._idle:
            child.close()


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


def _call(folder: str | None, pickled: bytes) -> Any:
    if folder is not None:
        use_project(folder)
    function, arguments = optional_import("cloudpickle", "cluster").loads(pickled)
    return function(*arguments)

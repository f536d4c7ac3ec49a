"""Workers of a sweep on a Dask cluster: one that runs, or one that Dask starts on SLURM or Kubernetes."""

from __future__ import annotations

import multiprocessing
import os
import threading
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing.util import Finalize
from typing import Any, TypeVar

from eidrive_scenario.base.imports import optional_import
from eidrive_scenario.errors import SimulationError
from eidrive_scenario.experiments.sweeps.workers import LocalWorkers
from eidrive_scenario.extensions.project import VARIABLE
from eidrive_scenario.extensions.registry import use_project

R = TypeVar("R")


class _Children:
    """Child processes of this worker, with the sweep for which they were started."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._children: dict[LocalWorkers, tuple[str, bool]] = {}
        """Sweep of each child, and whether it executes a call."""
        self._finalizer: Finalize | None = None

    @contextmanager
    def of(self, sweep: str) -> Iterator[LocalWorkers]:
        """Return a child of a sweep for one call. A new one replaces idle children of other sweeps."""
        others: list[LocalWorkers] = []
        with self._lock:
            child = next((child for child, state in self._children.items() if state == (sweep, False)), None)
            if child is not None:
                self._children[child] = sweep, True
            else:  # the command of another sweep may have been killed
                others = [child for child, (_, is_busy) in self._children.items() if not is_busy]
                for other in others:
                    del self._children[other]
        for other in others:
            other.close()
        if child is None:
            child = self._start()
            with self._lock:
                self._children[child] = sweep, True
        try:
            yield child
        finally:
            with self._lock:
                if child in self._children:  # else the sweep has ended
                    self._children[child] = sweep, False

    def end(self, sweep: str | None = None) -> None:
        """End the children of a sweep, None for all, with their calls."""
        with self._lock:
            ended = [child for child, (owner, _) in self._children.items() if sweep in (None, owner)]
            for child in ended:
                del self._children[child]
        for child in ended:
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


SLURM, KUBERNETES = "slurm", "kubernetes"
"""Schedulers that start workers; any other text is the address of a Dask scheduler."""
START = 120.0
"""Maximum time until the first worker is present [s]."""
AHEAD = 3
"""Number of submitted runs per worker thread, so that no worker waits for the network."""


class DaskWorkers:
    """Workers of a Dask cluster with the interface of `concurrent.futures`.

    A worker executes each run in a child process, whose end affects this run only. The children belong to one sweep, so
    that they import extensions as they are when it starts. A run whose worker is lost is repeated by Dask, up to its
    setting `distributed.scheduler.allowed-failures`.
    """

    def __init__(self, client: Any, resources: ExitStack) -> None:
        self._client = client
        self._resources = resources
        self._executor = client.get_executor(pure=False)
        self._killed = optional_import("distributed", "cluster").KilledWorker
        self._sweep = uuid.uuid4().hex

    @classmethod
    def connect(cls, scheduler: str, count: int | None) -> DaskWorkers:
        """Return the workers of a scheduler.

        scheduler  address (`tcp://host:8786`), `slurm` or `kubernetes`: the job settings are those of dask-jobqueue and
                   dask-kubernetes (`~/.config/dask`)
        count      number of workers that are started

        Raise SettingError without Dask, and SimulationError if there is no worker within 120 s.
        """
        distributed = optional_import("distributed", "cluster")
        with ExitStack() as stack:
            try:
                if scheduler == SLURM:
                    cluster = stack.enter_context(optional_import("dask_jobqueue", "cluster").SLURMCluster())
                    cluster.scale(jobs=count or 1)
                elif scheduler == KUBERNETES:
                    operator = optional_import("dask_kubernetes.operator", "kubernetes")
                    cluster = stack.enter_context(operator.KubeCluster(name="eidrive-sweep", n_workers=count or 1))
                else:
                    cluster = scheduler
                client = stack.enter_context(distributed.Client(cluster, timeout=START))
                client.wait_for_workers(1, timeout=START)
            except (OSError, TimeoutError, ValueError, RuntimeError) as error:
                raise SimulationError(f"--scheduler {scheduler}: no worker: {error}") from error
            return cls(client, stack.pop_all())

    @property
    def capacity(self) -> int:
        """Number of runs that are submitted at a time; workers may join and leave."""
        return AHEAD * max(1, int(sum(self._client.nthreads().values())))

    def submit(self, function: Callable[..., R], /, *arguments: Any) -> Future[R]:
        project = os.environ.get(VARIABLE)
        folder = None if project is None else os.path.abspath(project)
        future: Future[R] = self._executor.submit(call_in_child, self._sweep, folder, function, *arguments)
        return future

    def is_crash(self, error: BaseException) -> bool:
        return isinstance(error, self._killed | BrokenProcessPool)

    def close(self) -> None:
        self._executor.shutdown(wait=False)
        if self._client.status == "running":  # else the scheduler has ended
            with suppress(Exception):  # of workers that have left
                self._client.run(end_children, self._sweep, on_error="ignore")
        self._resources.close()

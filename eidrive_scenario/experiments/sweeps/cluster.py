"""Workers of a sweep on a Dask cluster: one that runs, or one that Dask starts on SLURM or Kubernetes."""

from __future__ import annotations

import os
import uuid
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, suppress
from typing import Any, TypeVar

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.experiments.sweeps.cluster_calls import call_in_child, end_children
from eidrive_scenario.optional_imports import optional_import
from eidrive_scenario.project import VARIABLE

R = TypeVar("R")
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

"""Sweeps on a local Dask cluster."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.experiments.sweeps.axes import parse_axes
from eidrive_scenario.experiments.sweeps.cluster import DaskWorkers
from eidrive_scenario.experiments.sweeps.designs import points_of
from eidrive_scenario.experiments.sweeps.execution import execute
from eidrive_scenario.experiments.sweeps.jobs import Shard, plan_of, versions
from eidrive_scenario.experiments.sweeps.store import ResultStore
from eidrive_scenario.experiments.sweeps.sweep import run_sweep
from eidrive_scenario.simulation import RunSettings

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def cluster() -> Iterator[object]:
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as found:
        yield found


def test_sweep_on_cluster_equals_local_one_with_killed_worker(cluster: object, scenario: Path, tmp_path: Path) -> None:
    """One of two workers is killed while the sweep runs; its runs are repeated, and all rows are there."""
    points = points_of(parse_axes(["Speed=1:30:1"]), "grid", None, 1)
    plan = plan_of(scenario, points, RunSettings(), seeds=[1, 2])
    workers = DaskWorkers.connect(cluster.scheduler_address, None)  # type: ignore[attr-defined]
    victim = min(worker.pid for worker in cluster.workers.values())  # type: ignore[attr-defined]
    killed = threading.Event()
    try:
        with ResultStore.open(tmp_path / "s.db", versions()) as store:

            def kill_once(progress: object, run: object) -> None:
                if run is not None and not killed.is_set():
                    killed.set()
                    os.kill(victim, signal.SIGKILL)

            progress = run_sweep(Shard(plan), store, workers, shown=kill_once)
            rows = {run.key: (run.status, run.result["trace_hash"]) for run in store.runs()}
    finally:
        workers.close()
    assert killed.is_set()
    assert progress.is_complete
    expected = {job.key: execute(job, None) for job in plan}
    assert rows == {key: (run.status, run.result["trace_hash"]) for key, run in expected.items()}


def test_connect_without_scheduler_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eidrive_scenario.experiments.sweeps.cluster.START", 0.5)
    with pytest.raises(SimulationError, match="no worker"):
        DaskWorkers.connect("tcp://127.0.0.1:9", None)

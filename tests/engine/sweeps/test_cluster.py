"""Sweeps on a local Dask cluster."""

from __future__ import annotations

import importlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from sweep_workers import InProcess

from eidrive_scenario.base.content_digest import package_versions
from eidrive_scenario.base.wall_limit import limit_wall_time
from eidrive_scenario.errors import SimulationError
from eidrive_scenario.experiments.sweeps.axes import parse_axes, points_of
from eidrive_scenario.experiments.sweeps.cluster import DaskWorkers
from eidrive_scenario.experiments.sweeps.jobs import Shard, SweepJob, plan_of
from eidrive_scenario.experiments.sweeps.store import ResultStore, StoredRun
from eidrive_scenario.experiments.sweeps.sweep import run_sweep
from eidrive_scenario.experiments.sweeps.workers import KeptFiles, execute
from eidrive_scenario.extensions.project import VARIABLE
from eidrive_scenario.extensions.registry import registry, use_project
from eidrive_scenario.simulation import RunSettings

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def cluster() -> Iterator[object]:
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0") as found:
        yield found


@pytest.mark.statistical
def test_sweep_on_cluster_equals_local_one_with_killed_worker(cluster: object, scenario: Path, tmp_path: Path) -> None:
    """One of two workers is killed while the sweep runs; its runs are repeated, and all rows are there."""
    points = points_of(parse_axes(["Speed=1:30:1"]), "grid", None, 1)
    plan = plan_of(scenario, points, RunSettings(), seeds=[1, 2])
    workers = DaskWorkers.connect(cluster.scheduler_address, None)  # type: ignore[attr-defined]
    victim = min(worker.pid for worker in cluster.workers.values())  # type: ignore[attr-defined]
    killed = threading.Event()
    try:
        with ResultStore.open(tmp_path / "s.db", package_versions()) as store:

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


def test_workers_use_project_of_command(
    cluster: object, scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Workers of a cluster do not inherit the environment of the command."""
    (tmp_path / "gap_of_cluster.py").write_text(
        "from eidrive_criteria.max_speed import MaxSpeed\n\nclass Gap(MaxSpeed):\n    pass\n"
    )
    (tmp_path / "pyproject.toml").write_text(
        '[tool.eidrive]\npythonpath = ["."]\n'
        '[project.entry-points."eidrive_scenario.criteria"]\ngap_of_cluster = "gap_of_cluster:Gap"\n'
    )
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(registry("criteria"), "_points", dict(registry("criteria")._points))
    use_project(str(tmp_path))
    scenario.write_text(scenario.read_text().replace("{max_speed:", "{gap_of_cluster:"))
    workers = DaskWorkers.connect(cluster.scheduler_address, None)  # type: ignore[attr-defined]
    try:
        with ResultStore.open(tmp_path / "s.db", package_versions()) as store:
            run_sweep(Shard(plan_of(scenario, [{}], RunSettings(), seeds=[1, 2])), store, workers)
            assert [(run.status, run.error) for run in store.runs()] == [("passed", ""), ("passed", "")]
    finally:
        workers.close()


@pytest.mark.exhaustive
def test_hung_run_on_cluster_is_one_row_and_waiting_runs_have_results(
    cluster: object, scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No worker of the cluster ends, and the hung run is executed once."""
    calls = tmp_path / "calls"

    def hung_at_30(job: SweepJob, wall_limit: float | None, files: KeptFiles | None) -> StoredRun:
        if job.point["Speed"] == 30:
            with calls.open("a") as stream:
                stream.write("x")
            importlib.import_module("eidrive_scenario.base.wall_limit").GRACE = 0.1  # type: ignore[attr-defined]
            with limit_wall_time(wall_limit):
                while True:
                    with suppress(BaseException):
                        time.sleep(0.01)
        return execute(job, None, files)

    pids = {worker.pid for worker in cluster.workers.values()}  # type: ignore[attr-defined]
    monkeypatch.setattr(cluster.scheduler, "allowed_failures", 0)  # type: ignore[attr-defined]
    points = points_of(parse_axes(["Speed=10,30,11,12,13,14,15"]), "grid", None, 1)
    plan = plan_of(scenario, points, RunSettings())
    monkeypatch.setattr("eidrive_scenario.experiments.sweeps.sweep.execute", hung_at_30)
    workers = DaskWorkers.connect(cluster.scheduler_address, None)  # type: ignore[attr-defined]
    try:
        with ResultStore.open(tmp_path / "s.db", package_versions()) as store:
            run_sweep(Shard(plan), store, workers, wall_limit=0.2)
            rows = {run.point["Speed"]: (run.status, run.error) for run in store.runs()}
    finally:
        workers.close()
    status, error = rows.pop(30)
    assert status == "aborted"
    assert error.endswith("after 0.2 s of wall time (the wall limit)")
    assert calls.read_text() == "x"
    assert set(rows.values()) == {("passed", "")}
    assert {worker.pid for worker in cluster.workers.values()} == pids  # type: ignore[attr-defined]


def test_end_of_a_sweep_ends_its_runs_on_the_workers(cluster: object, tmp_path: Path) -> None:
    """Runs of an interrupted sweep would occupy the workers until their wall limit."""

    def sleep(path: Path) -> None:
        path.touch()
        time.sleep(600.0)

    workers = DaskWorkers.connect(cluster.scheduler_address, None)  # type: ignore[attr-defined]
    later = DaskWorkers.connect(cluster.scheduler_address, None)  # type: ignore[attr-defined]
    try:
        for number in range(4):
            workers.submit(sleep, tmp_path / str(number))
        while len(list(tmp_path.iterdir())) < 2:  # both workers are busy
            time.sleep(0.01)
        workers.close()
        assert later.submit(os.path.basename, "a/b").result(timeout=60) == "b"
    finally:
        later.close()


def test_later_sweep_on_same_workers_uses_changed_extension(
    cluster: object, scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each module names its metric; a worker that kept the first one would write its name again."""
    (tmp_path / "pyproject.toml").write_text(
        '[tool.eidrive]\npythonpath = ["."]\n'
        '[project.entry-points."eidrive_scenario.criteria"]\ndated = "dated_criterion:Dated"\n'
    )
    module = tmp_path / "dated_criterion.py"
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(registry("criteria"), "_points", dict(registry("criteria")._points))
    scenario.write_text(scenario.read_text().replace("{max_speed:", "{dated:"))
    found: list[list[set[str]]] = []
    for body in ("    NAME = 'one'", "    NAME = 'other'"):
        module.write_text(
            "from eidrive_criteria.max_speed import MaxSpeed\n\nclass Dated(MaxSpeed):\n"
            f"{body}\n    def metrics(self):\n        return {{self.NAME: 1.0}}\n"
        )
        sys.modules.pop("dated_criterion", None)
        use_project(str(tmp_path))
        workers = DaskWorkers.connect(cluster.scheduler_address, None)  # type: ignore[attr-defined]
        try:
            with ResultStore.open(tmp_path / f"{len(found)}.db", package_versions()) as store:
                run_sweep(Shard(plan_of(scenario, [{}], RunSettings(), seeds=[1, 2, 3, 4])), store, workers)
                found.append([run.result.keys() & {"one", "other"} for run in store.runs()])
        finally:
            workers.close()
    assert found == [[{"one"}] * 4, [{"other"}] * 4]


def test_end_of_scheduler_keeps_earlier_runs(scenario: Path, tmp_path: Path) -> None:
    """Dask cancels all calls if its scheduler ends."""

    class EndingWorkers(InProcess):
        capacity = 2

        def submit(self, function: Callable[..., Any], /, *arguments: Any) -> Future[Any]:
            if self.calls == 0:
                return super().submit(function, *arguments)
            future: Future[Any] = Future()
            future.cancel()
            future.set_running_or_notify_cancel()
            return future

    plan = plan_of(scenario, points_of(parse_axes(["Speed=10,12"]), "grid", None, 1), RunSettings())
    with ResultStore.open(tmp_path / "s.db", package_versions()) as store:
        with pytest.raises(SimulationError, match="scheduler of the workers has ended"):
            run_sweep(Shard(plan), store, EndingWorkers())
        assert [run.status for run in store.runs()] == ["passed"]


@pytest.mark.exhaustive
def test_connect_without_scheduler_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eidrive_scenario.experiments.sweeps.cluster.START", 0.5)
    with pytest.raises(SimulationError, match="no worker"):
        DaskWorkers.connect("tcp://127.0.0.1:9", None)

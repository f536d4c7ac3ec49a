"""Writing of ended runs: transactions, reports, errors."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from sweep_runs import RUN, opened

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.experiments.sweeps.jobs import SweepJob
from eidrive_scenario.experiments.sweeps.store import ResultStore, StoredRun
from eidrive_scenario.experiments.sweeps.sweep import SweepProgress, run_sweep
from eidrive_scenario.simulation import RunSettings

JOBS = [SweepJob(str(number) * 64, number, Path("s.xosc"), None, 1, {}, RunSettings()) for number in range(5)]


class EndedRuns:
    """Workers whose runs have ended at once; the run with the number `broken` has an error."""

    capacity = len(JOBS)

    def __init__(self, broken: int | None = None) -> None:
        self._broken = broken

    def submit(self, function: Callable[..., Any], job: SweepJob, *_: object) -> Future[Any]:
        future: Future[Any] = Future()
        if job.number == self._broken:
            future.set_exception(KeyError("sweep"))
        else:
            future.set_result(replace(RUN, key=job.key, number=job.number))
        return future

    def is_crash(self, error: BaseException) -> bool:
        return False

    def close(self) -> None:
        pass


class Transactions:
    """Store that records the numbers of the runs of each transaction."""

    def __init__(self) -> None:
        self.numbers: list[list[int]] = []

    def statuses(self) -> dict[str, str]:
        return {}

    def add(self, *runs: StoredRun) -> None:
        self.numbers.append([run.number for run in runs])


def test_runs_that_ended_together_share_a_transaction() -> None:
    store: Any = Transactions()
    run_sweep(JOBS, store, EndedRuns())
    assert [numbers for numbers in store.numbers if numbers] == [[0, 1, 2, 3, 4]]


def test_run_is_reported_when_another_process_can_read_it(tmp_path: Path) -> None:
    path = tmp_path / "s.db"
    reported: list[int] = []

    def check(progress: SweepProgress, run: StoredRun | None) -> None:
        if run is not None:
            with ResultStore.read(path) as other:
                assert other.rows([run.key]) == [run]
            reported.append(run.number)

    with opened(path) as store:
        run_sweep(JOBS, store, EndedRuns(), shown=check)
    assert reported == [0, 1, 2, 3, 4]


def test_error_of_the_sweep_does_not_lose_ended_runs(tmp_path: Path) -> None:
    with opened(tmp_path / "s.db") as store:
        with pytest.raises(KeyError, match="sweep"):
            run_sweep(JOBS, store, EndedRuns(broken=2))
        assert [run.number for run in store.runs()] == [0, 1, 3, 4]


def test_error_of_the_store_is_raised() -> None:
    class FullStore(Transactions):
        def add(self, *runs: StoredRun) -> None:
            if runs:
                raise SimulationError("the disk is full")

    store: Any = FullStore()
    with pytest.raises(SimulationError, match="full"):
        run_sweep(JOBS, store, EndedRuns())

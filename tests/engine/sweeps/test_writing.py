"""Writing of ended runs: transactions, reports, errors."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from sweep_runs import RUN, opened

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.experiments.sweeps.store import ResultStore, RunWriter, StoredRun

RUNS = [replace(RUN, key=str(number) * 64, number=number) for number in range(5)]


class SlowStore:
    """Store whose first transaction waits for the test; it records the runs of each."""

    def __init__(self) -> None:
        self.may_write = threading.Event()
        self.transactions: list[list[int]] = []

    def add(self, *runs: StoredRun) -> None:
        assert self.may_write.wait(10.0)
        self.transactions.append([run.number for run in runs])


def test_runs_that_end_during_a_transaction_share_the_next_one() -> None:
    store: Any = SlowStore()
    written: list[int] = []
    with RunWriter(store, lambda run: written.append(run.number)) as writer:
        for run in RUNS:
            writer.add(run)
        assert written == []
        store.may_write.set()
        writer.collect()
        assert written == [0]
    assert store.transactions == [[0], [1, 2, 3, 4]]
    assert written == [0, 1, 2, 3, 4]


def test_run_is_reported_when_another_process_can_read_it(tmp_path: Path) -> None:
    path = tmp_path / "s.db"

    def check(run: StoredRun) -> None:
        with ResultStore.read(path) as other:
            assert other.rows([run.key]) == [run]
        reported.append(run.number)

    reported: list[int] = []
    with opened(path) as store, RunWriter(store, check) as writer:
        for run in RUNS:
            writer.add(run)
    assert reported == [0, 1, 2, 3, 4]


def test_error_of_the_sweep_does_not_lose_ended_runs(tmp_path: Path) -> None:
    def end_with_error() -> None:
        with RunWriter(store, lambda run: None) as writer:
            for run in RUNS:
                writer.add(run)
            raise KeyError("sweep")

    with opened(tmp_path / "s.db") as store:
        with pytest.raises(KeyError, match="sweep"):
            end_with_error()
        assert list(store.runs()) == RUNS


def test_error_of_the_store_is_raised() -> None:
    class FullStore:
        def add(self, *runs: StoredRun) -> None:
            raise SimulationError("the disk is full")

    def write() -> None:
        store: Any = FullStore()
        with RunWriter(store, lambda run: None) as writer:
            writer.add(RUN)
            writer.collect()

    with pytest.raises(SimulationError, match="full"):
        write()

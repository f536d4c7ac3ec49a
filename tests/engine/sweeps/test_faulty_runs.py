"""Runs of a sweep that hang, raise interruptions, or are interrupted by the user."""

from __future__ import annotations

import importlib
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from command_fixtures import Eidrive, eidrive
from sweep_workers import InProcess

from eidrive_scenario.base.content_digest import package_versions
from eidrive_scenario.experiments.repetitions import interrupt_once
from eidrive_scenario.experiments.sweeps.axes import parse_axes, points_of
from eidrive_scenario.experiments.sweeps.jobs import Shard, plan_of
from eidrive_scenario.experiments.sweeps.store import ResultStore, StoredRun
from eidrive_scenario.experiments.sweeps.sweep import run_sweep
from eidrive_scenario.experiments.sweeps.workers import KeptFiles, LocalWorkers, execute
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.simulation import RunSettings

__all__ = ["eidrive"]


def run_with(
    values: str, scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, **options: Any
) -> dict[Any, StoredRun]:
    """Return the rows by speed of a sweep by two workers whose runs are those of `faulty_at_30`."""
    monkeypatch.syspath_prepend(Path(__file__).parent)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(registry("criteria"), "_points", dict(registry("criteria")._points))
    registry("criteria").add("hangs", "sweep_tasks:Hangs")
    task = importlib.import_module("sweep_tasks").faulty_at_30
    monkeypatch.setattr("eidrive_scenario.experiments.sweeps.sweep.execute", task)
    plan = plan_of(scenario, points_of(parse_axes([f"Speed={values}"]), "grid", None, 1), RunSettings())
    workers = LocalWorkers(2)
    try:
        with ResultStore.open(tmp_path / "s.db", package_versions()) as store:
            run_sweep(Shard(plan), store, workers, **options)
            return {run.point["Speed"]: run for run in store.runs()}
    finally:
        workers.close()


@pytest.mark.exhaustive
def test_hung_run_is_one_aborted_row_with_its_line(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is executed once: a second try would last as long."""
    rows = run_with("8,30,10,12", scenario, tmp_path, monkeypatch, wall_limit=0.5)
    assert {speed: run.status for speed, run in rows.items()} == dict.fromkeys((8, 10, 12), "passed") | {30: "aborted"}
    line = r"sweep_tasks\.py:\d+: criterion 'hangs' .*: still running in observe after 0\.5 s of wall time"
    assert re.search(line, rows[30].error)
    assert (tmp_path / "calls").read_text() == "x"


def test_interrupt_of_extension_is_a_row_and_others_have_results(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = run_with("8,30,10,12", scenario, tmp_path, monkeypatch)
    assert {speed: run.status for speed, run in rows.items()} == dict.fromkeys((8, 10, 12), "passed") | {30: "aborted"}
    assert re.search(r"sweep_tasks\.py:\d+ in observe: KeyboardInterrupt", rows[30].error)


def test_interrupt_of_user_keeps_ended_runs(scenario: Path, tmp_path: Path) -> None:
    """The first run has ended when the user interrupts the start of the second one."""

    class InterruptedWorkers(InProcess):
        capacity = 2

        def submit(self, function: Callable[..., Any], /, *arguments: Any) -> Future[Any]:
            if self.calls == 1:
                raise KeyboardInterrupt
            return super().submit(function, *arguments)

    plan = plan_of(scenario, points_of(parse_axes(["Speed=10,12"]), "grid", None, 1), RunSettings())
    with ResultStore.open(tmp_path / "s.db", package_versions()) as store:
        with pytest.raises(KeyboardInterrupt):
            run_sweep(Shard(plan), store, InterruptedWorkers())
        assert [(run.point["Speed"], run.status) for run in store.runs()] == [(10, "passed")]


@pytest.mark.parametrize(
    ("number", "default"), [(signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL)]
)
def test_second_interrupt_does_not_interrupt_the_end(number: signal.Signals, default: signal._HANDLER) -> None:
    before = signal.signal(number, default)  # shells ignore SIGINT in processes of the background
    ended = []

    def interrupted_twice() -> None:
        with interrupt_once():
            try:
                signal.raise_signal(number)
            finally:
                signal.raise_signal(number)
                ended.append(True)

    try:
        with pytest.raises(KeyboardInterrupt):
            interrupted_twice()
        assert ended == [True]
        assert signal.getsignal(number) is default
    finally:
        signal.signal(number, before)


INTERRUPTED_START = """
import os, signal, time
from eidrive_scenario.experiments.sweeps.workers import start_server
signal.signal(signal.SIGINT, signal.default_int_handler)
start_server()
time.sleep(0.3)  # The server imports meanwhile.
try:
    os.killpg(0, signal.SIGINT)
    time.sleep(10.0)
except KeyboardInterrupt:
    print("interrupted")
"""


def test_server_that_is_interrupted_while_it_starts_prints_nothing() -> None:
    """A terminal sends the signal to the server, too."""
    command = [sys.executable, "-c", INTERRUPTED_START]
    ended = subprocess.run(command, capture_output=True, text=True, start_new_session=True, timeout=60)
    assert (ended.stdout, ended.stderr) == ("interrupted\n", "")


def test_unwritable_folder_of_a_run_is_aborted_and_repeatable(scenario: Path, tmp_path: Path) -> None:
    """The inputs are valid: the run is repeated once the folder can be written."""
    (job,) = plan_of(scenario, [{}], RunSettings())
    below = tmp_path / "out"
    below.write_text("a file")
    row = execute(job, None, KeptFiles(below, "always", tmp_path / "s.db"))
    assert (row.status, row.error.partition(": ")[2]) == (
        "aborted",
        "cannot write: Not a directory; choose another folder",
    )
    with ResultStore.open(tmp_path / "s.db", package_versions()) as store:
        store.add(row)
        below.unlink()
        workers = LocalWorkers(1)
        try:
            run_sweep(Shard(plan_of(scenario, [{}], RunSettings())), store, workers, retry=True)
        finally:
            workers.close()
        assert [run.status for run in store.runs()] == ["passed"]


def test_sweep_into_unwritable_folder_ends_before_its_runs(eidrive: Eidrive, scenario: Path, tmp_path: Path) -> None:
    store, file = tmp_path / "s.db", tmp_path / "file"
    file.touch()
    result = eidrive("sweep", scenario, "--store", store, "--out", file)
    assert result.exit_code == 2
    assert "file: cannot write: File exists; choose another folder" in result.stderr
    assert not store.exists()

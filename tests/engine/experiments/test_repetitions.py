"""Repetitions: the order of the jobs, whatever the number of workers; a dead worker is an error, not a hang."""

from __future__ import annotations

import importlib
import io
from pathlib import Path
from types import ModuleType

import pytest
from rich.console import Console

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.experiments.repetitions import jobs_of, run_jobs
from eidrive_scenario.simulation import RunSettings

JOBS = jobs_of("somewhere", {"a": RunSettings(), "b": RunSettings(channel="ideal")}, range(6))


@pytest.fixture
def tasks(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(Path(__file__).parent)
    return importlib.import_module("repetition_tasks")


def test_one_worker_keeps_the_order_of_the_jobs(tasks: ModuleType) -> None:
    answers = run_jobs(JOBS, tasks.draw, workers=1)
    assert [(arm, seed) for arm, seed, _ in answers] == [(job.arm, job.seed) for job in JOBS]


def test_the_answer_depends_neither_on_workers_nor_on_order(tasks: ModuleType) -> None:
    alone = run_jobs(JOBS, tasks.draw, workers=1)
    assert run_jobs(JOBS, tasks.draw, workers=2) == alone
    assert sorted(run_jobs(JOBS[::-1], tasks.draw, workers=2)) == sorted(alone)


def test_progress_is_shown_where_asked(tasks: ModuleType) -> None:
    out = io.StringIO()
    run_jobs(JOBS, tasks.draw, workers=1, console=Console(file=out, width=100), title="demo")
    assert "demo" in out.getvalue()
    assert "12/12" in out.getvalue()


def test_a_dead_worker_is_an_error(tasks: ModuleType) -> None:
    with pytest.raises(SimulationError, match="worker process died"):
        run_jobs(JOBS, tasks.die, workers=2)


@pytest.mark.parametrize("workers", [1, 2])
def test_what_a_task_raises_comes_through(tasks: ModuleType, workers: int) -> None:
    with pytest.raises(ValueError, match="seed 0 is wrong"):
        run_jobs(JOBS[:2], tasks.fail, workers=workers)


def test_no_worker_is_refused(tasks: ModuleType) -> None:
    with pytest.raises(ValueError, match="0 workers"):
        run_jobs(JOBS, tasks.draw, workers=0)

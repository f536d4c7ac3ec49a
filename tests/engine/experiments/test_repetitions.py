"""Repetitions: results in job order for any number of workers; a dead worker process is an error."""

from __future__ import annotations

import importlib
import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
from rich.console import Console

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.experiments.repetitions import JobQueue, jobs_of, run_jobs
from eidrive_scenario.simulation import RunSettings

JOBS = jobs_of("somewhere", {"a": RunSettings(), "b": RunSettings(channel="ideal")}, range(6))


@pytest.fixture
def tasks(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(Path(__file__).parent)
    return importlib.import_module("repetition_tasks")


def test_run_jobs_returns_results_in_job_order(tasks: ModuleType) -> None:
    results = run_jobs(JOBS, tasks.draw, workers=1)
    assert [(arm, seed) for arm, seed, _ in results] == [(job.arm, job.seed) for job in JOBS]


@pytest.mark.exhaustive
def test_run_jobs_results_depend_neither_on_workers_nor_order(tasks: ModuleType) -> None:
    alone = run_jobs(JOBS, tasks.draw, workers=1)
    assert run_jobs(JOBS, tasks.draw, workers=2) == alone
    assert sorted(run_jobs(JOBS[::-1], tasks.draw, workers=2)) == sorted(alone)


def test_queue_gives_jobs_of_one_seed_to_one_worker() -> None:
    """Two workers and three seeds of two arms: the worker that is free first gets the third seed."""
    queue = JobQueue(JOBS[:6])
    started = [(worker, JOBS[row].seed) for worker in (0, 1, 0, 0, 1, 0) if (row := queue.next_job(worker)) is not None]
    assert started == [(0, 0), (1, 1), (0, 0), (0, 2), (1, 1), (0, 2)]
    assert queue.next_job(0) is None


def test_queue_shares_last_seed_between_workers() -> None:
    """No worker is idle while jobs wait: the second one takes jobs of the only seed."""
    jobs = jobs_of("somewhere", {name: RunSettings() for name in "abcd"}, [1])
    queue = JobQueue(jobs)
    assert [queue.next_job(worker) for worker in (0, 1, 0, 1, 1)] == [0, 1, 2, 3, None]


def test_queue_of_equal_jobs_gives_each_once() -> None:
    queue = JobQueue((*JOBS, *JOBS))
    rows = [queue.next_job(row % 3) for row in range(25)]
    assert sorted(row for row in rows if row is not None) == list(range(24))
    assert rows[-1] is None


def test_run_jobs_with_console_shows_progress(tasks: ModuleType) -> None:
    out = io.StringIO()
    run_jobs(JOBS, tasks.draw, workers=1, console=Console(file=out, width=100), title="demo")
    assert "demo" in out.getvalue()
    assert "12/12" in out.getvalue()


def test_run_jobs_with_dead_worker_raises_error(tasks: ModuleType) -> None:
    with pytest.raises(SimulationError, match="worker process died"):
        run_jobs(JOBS, tasks.die, workers=2)


@pytest.mark.statistical
@pytest.mark.parametrize("workers", [1, 2])
def test_run_jobs_raises_error_of_task(tasks: ModuleType, workers: int) -> None:
    with pytest.raises(ValueError, match="seed 0 is invalid"):
        run_jobs(JOBS[:2], tasks.fail, workers=workers)


@pytest.mark.process
@pytest.mark.parametrize(("number", "leaks"), [(signal.SIGKILL, True), (signal.SIGTERM, False)])
def test_workers_of_a_killed_process_end(tmp_path: Path, number: signal.Signals, leaks: bool) -> None:
    """Each worker writes its process number and sleeps; after the end of their parent both end within seconds.

    A terminated parent also releases their semaphores, of which Python would warn.
    """
    code = (
        "if __name__ == '__main__':\n"
        "    import repetition_tasks\n"
        "    from eidrive_scenario.experiments.repetitions import jobs_of, run_jobs\n"
        "    from eidrive_scenario.simulation import RunSettings\n"
        f"    jobs = jobs_of({str(tmp_path)!r}, {{'a': RunSettings()}}, range(2))\n"
        "    run_jobs(jobs, repetition_tasks.sleep, workers=2)\n"
    )
    script = tmp_path / "parent.py"
    script.write_text(code)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    with subprocess.Popen([sys.executable, str(script)], env=environment, stderr=subprocess.PIPE, text=True) as parent:
        wait_until(lambda: len(list(tmp_path.glob("*.pid"))) == 2)
        numbers = [int(path.stem) for path in tmp_path.glob("*.pid")]
        assert all(map(is_running, numbers))
        parent.send_signal(number)
        err = parent.communicate()[1]  # up to the end of all processes
    assert ("leaked semaphore" in err) is leaks
    wait_until(lambda: not any(map(is_running, numbers)))


def wait_until(condition: Callable[[], bool], limit: float = 60.0) -> None:
    """Wait for a condition. Fail after the limit [s]."""
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, "the condition is not met in time"
        time.sleep(0.1)


def is_running(number: int) -> bool:
    """Return whether a process exists and is not a zombie."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_run_jobs_without_worker_raises_value_error(tasks: ModuleType) -> None:
    with pytest.raises(ValueError, match=r"workers: not a positive number \(got 0\)"):
        run_jobs(JOBS, tasks.draw, workers=0)


@pytest.mark.parametrize("workers", [1, 2])
def test_run_jobs_passes_each_result_when_its_run_has_ended(tasks: ModuleType, workers: int) -> None:
    ended: list[tuple[str, int, float]] = []
    assert sorted(run_jobs(JOBS, tasks.draw, workers=workers, finished=ended.append)) == sorted(ended)


def test_run_jobs_passes_results_before_an_error(tasks: ModuleType) -> None:
    ended: list[object] = []
    with pytest.raises(ValueError, match="seed 3 is invalid"):
        run_jobs(JOBS, tasks.fail_at_seed_3, workers=1, finished=ended.append)
    assert len(ended) == 6, "two arms of the seeds 0 to 2"

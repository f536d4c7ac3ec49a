"""One scenario, several arms, many seeds, on all cores; the answer does not depend on how many there are."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.simulation import RunSettings

T = TypeVar("T")


@dataclass(frozen=True)
class Job:
    """One run: a scenario (path or library name), the name of its arm, the seed, and what the arm sets."""

    scenario: str
    arm: str
    seed: int
    settings: RunSettings


def jobs_of(scenario: str, arms: dict[str, RunSettings], seeds: Sequence[int]) -> tuple[Job, ...]:
    """Every arm with every seed. Seed by seed, so that a run that was cut short still holds pairs."""
    return tuple(Job(scenario, arm, seed, settings) for seed in seeds for arm, settings in arms.items())


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_jobs(
    jobs: Sequence[Job],
    task: Callable[[Job], T],
    *,
    workers: int | None = None,
    console: Console | None = None,
    title: str = "runs",
) -> tuple[T, ...]:
    """The task's answer to every job, in the order of the jobs.

    `task` is a module-level function, as it travels to other processes, and so does its answer. `workers` defaults to
    the cores of this machine; 1 stays in this process. A progress bar is shown on `console` if one is given.
    Raises what a task raises, and SimulationError where a worker process dies.
    """
    workers = min(cores() if workers is None else workers, max(1, len(jobs)))
    if workers < 1:
        raise ValueError(f"{workers} workers cannot run anything")
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, disable=console is None) as progress:
        bar = progress.add_task(title, total=len(jobs))
        if workers == 1:
            answers = []
            for job in jobs:
                answers.append(task(job))
                progress.advance(bar)
            return tuple(answers)
        return _in_processes(jobs, task, workers, lambda: progress.advance(bar))


def _in_processes(
    jobs: Sequence[Job], task: Callable[[Job], T], workers: int, advance: Callable[[], None]
) -> tuple[T, ...]:
    # Spawned, not forked: a child must not inherit a half-used physics client or a running progress thread.
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))
    try:
        futures: list[Future[T]] = [pool.submit(task, job) for job in jobs]
        for future in as_completed(futures):
            future.result()
            advance()
        return tuple(future.result() for future in futures)
    except BrokenProcessPool as error:
        raise SimulationError("a worker process died; run with one worker to see why") from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)

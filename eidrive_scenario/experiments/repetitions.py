"""Runs of several arms and seeds on all cores. The results do not depend on the number of cores."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import FrameType
from typing import Any, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.perception.learned import image_memory
from eidrive_scenario.simulation import RunSettings

T = TypeVar("T")
J = TypeVar("J", bound="Job")


@dataclass(frozen=True)
class Job:
    """One run: scenario (path or library name), name of its arm, seed, and settings of the arm."""

    scenario: str
    arm: str
    seed: int
    settings: RunSettings


def jobs_of(scenario: str, arms: dict[str, RunSettings], seeds: Sequence[int]) -> tuple[Job, ...]:
    """Return every arm with every seed, ordered by seed, so that an interrupted experiment contains complete pairs."""
    return tuple(Job(scenario, arm, seed, settings) for seed in seeds for arm, settings in arms.items())


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_jobs(
    jobs: Sequence[J],
    task: Callable[[J], T],
    *,
    workers: int | None = None,
    console: Console | None = None,
    title: str = "runs",
    finished: Callable[[T], None] | None = None,
) -> tuple[T, ...]:
    """Return the result of the task for every job, in the order of the jobs.

    finished  function that gets each result in this process when its run has ended, in the order of the ends

    `task` is a module-level function: function and result are pickled for other processes. `workers` defaults to the
    number of cores; 1 runs all jobs in this process. `console` shows a progress bar.
    Raise the exceptions of the task, SimulationError if a worker process dies, and KeyboardInterrupt also at SIGTERM.
    """
    workers = min(cores() if workers is None else workers, max(1, len(jobs)))
    if workers < 1:
        raise ValueError(f"workers: not a positive number (got {workers})")
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

        def end(result: T) -> T:
            if finished is not None:
                finished(result)
            progress.advance(bar)
            return result

        with interrupt_once():
            if workers == 1:
                return tuple(end(task(job)) for job in jobs)
            return _in_processes(jobs, task, workers, end)


def end_with_parent() -> None:
    """End this worker process when its parent ends; that of a killed parent would wait for jobs forever."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def end() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()


def _start_worker() -> None:
    """Prepare a worker process: equal images of its runs are processed once, and it ends when its parent ends."""
    image_memory.activate(image_memory.ImageMemory())
    end_with_parent()


_INTERRUPTIONS: dict[signal.Signals, Any] = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
"""Signals that interrupt a command, with their default handlers."""


@contextmanager
def interrupt_once() -> Iterator[None]:
    """Raise KeyboardInterrupt at the first Ctrl-C or SIGTERM only: a second one does not interrupt the end of a block.

    Signals without their default handler keep it: a background job of a shell continues to ignore Ctrl-C. Threads other
    than the main one handle no signals.
    """
    is_main = threading.current_thread() is threading.main_thread()
    handled = [number for number, default in _INTERRUPTIONS.items() if is_main and signal.getsignal(number) is default]

    def interrupt(number: int, frame: FrameType | None) -> None:
        for each in handled:
            signal.signal(each, signal.SIG_IGN)
        raise KeyboardInterrupt

    for number in handled:
        signal.signal(number, interrupt)
    try:
        yield
    finally:
        for number in handled:
            signal.signal(number, _INTERRUPTIONS[number])


def terminate(pool: ProcessPoolExecutor) -> None:
    """End the processes of a pool and their calls, without waiting for them."""
    # Executors have no method before Python 3.14 that ends a call in progress.
    for process in list((getattr(pool, "_processes", None) or {}).values()):
        with suppress(OSError, ValueError):
            process.terminate()


class JobQueue:
    """Jobs that are not started. A worker gets jobs of one scenario and seed in turn, whose images are often equal."""

    def __init__(self, jobs: Sequence[Job]) -> None:
        self._waiting: dict[tuple[str, int], deque[int]] = {}
        for index, job in enumerate(jobs):
            self._waiting.setdefault((job.scenario, job.seed), deque()).append(index)
        self._untouched = deque(self._waiting)
        self._of_worker: dict[int, tuple[str, int]] = {}

    def next_job(self, worker: int) -> int | None:
        """Return the index of the next job of a worker, None if all are started.

        Without untouched groups, a worker takes jobs of the largest one.
        """
        group = self._of_worker.get(worker)
        if group not in self._waiting:
            if self._untouched:
                group = self._untouched.popleft()
            else:
                group = max(self._waiting, key=lambda group: len(self._waiting[group]), default=None)
        if group is None:
            return None
        self._of_worker[worker] = group
        indices = self._waiting[group]
        index = indices.popleft()
        if not indices:
            del self._waiting[group]
        return index


def _in_processes(jobs: Sequence[J], task: Callable[[J], T], workers: int, end: Callable[[T], T]) -> tuple[T, ...]:
    # Spawned, not forked: a child process must not inherit a physics client or a running progress thread.
    context = multiprocessing.get_context("spawn")
    pools = [ProcessPoolExecutor(1, mp_context=context, initializer=_start_worker) for _ in range(workers)]
    queue = JobQueue(jobs)
    results: dict[int, T] = {}
    running: dict[Future[T], tuple[int, int]] = {}

    def start(worker: int) -> None:
        index = queue.next_job(worker)
        if index is not None:
            running[pools[worker].submit(task, jobs[index])] = worker, index

    try:
        for worker in range(workers):
            start(worker)
        while running:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                worker, index = running.pop(future)
                results[index] = end(future.result())
                start(worker)
        return tuple(results[index] for index in range(len(jobs)))
    except BrokenProcessPool as error:
        raise SimulationError("a worker process died; run with one worker to see the error") from error
    except BaseException:
        for pool in pools:
            terminate(pool)
        raise
    finally:
        for pool in pools:
            pool.shutdown(wait=True, cancel_futures=True)

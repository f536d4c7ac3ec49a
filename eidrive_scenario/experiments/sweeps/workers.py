"""Execution of the jobs of a sweep in worker processes of this machine."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import tempfile
import time
import traceback
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from multiprocessing.context import BaseContext
from pathlib import Path
from typing import Any, Protocol, TypeVar

from eidrive_scenario import errors
from eidrive_scenario.base.wall_limit import running_line
from eidrive_scenario.errors import ConstraintError, InputError, OutputError, WallLimitError
from eidrive_scenario.experiments.commands import command_of_source
from eidrive_scenario.experiments.hung_runs import hang_of, report_hung_runs
from eidrive_scenario.experiments.repetitions import end_with_parent, terminate
from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.experiments.sweeps.jobs import SweepJob, source_of
from eidrive_scenario.experiments.sweeps.store import (
    ABORTED,
    EXCLUDED,
    FAILED,
    FOLDER,
    INVALID,
    NOT_JUDGED,
    PASSED,
    StoredRun,
)
from eidrive_scenario.extensions.library import name_of
from eidrive_scenario.openscenario import ConcreteRun, load_scenario
from eidrive_scenario.openscenario.model import ParameterType
from eidrive_scenario.perception.learned import image_memory
from eidrive_scenario.run_options import with_option_names
from eidrive_scenario.simulation.result import typed_parameters

_is_worker = False
"""Whether this process only executes runs, so that no user interrupts it."""


@dataclass(frozen=True)
class KeptFiles:
    """Files of the runs of a sweep.

    below   folder of a subfolder per run, with `result.json` and, by `record`, its recording
    record  `always`, `on-failure` or `never`
    store   file of the store; rows name folders relative to its folder
    """

    below: Path
    record: str
    store: Path


def execute(job: SweepJob, wall_limit: float | None, files: KeptFiles | None = None) -> StoredRun:
    """Run a job and return its row; errors are rows, too, also interruptions that an extension raises in a worker.

    Messages name the options of the command line, as in `result.json`.

    wall_limit  limit of the wall time of loading and run [s]
    files       files that are kept; None for none
    """
    start = time.perf_counter()
    try:
        result = run_and_save(
            source_of(job),
            seed=job.seed,
            settings=job.settings,
            below=None if files is None else files.below,
            record=False if files is None else files.record,
            wall_limit=wall_limit,
        )
        unjudged = result.exit_code == errors.NOT_JUDGED
        folder = {}
        if files is not None and result.folder is not None:
            folder[FOLDER] = os.path.relpath(result.folder.resolve(), files.store.resolve().parent)
        return StoredRun(
            key=job.key,
            number=job.number,
            scenario=result.scenario,
            run=job.run,
            seed=job.seed,
            status=PASSED if result.passed else NOT_JUDGED if unjudged else FAILED,
            point=dict(job.point),
            result={**result.to_dict(), **folder},
            error=with_option_names(result.warnings[0]) if unjudged else "",
            command=result.command,
            wall_s=round(time.perf_counter() - start, 4),
            settings=result.settings.canonical,
        )
    except ConstraintError as error:
        status, message = EXCLUDED, str(error)
    except OutputError as error:  # not of the inputs, so that --retry repeats the run
        status, message = ABORTED, str(error)
    except InputError as error:
        status, message = INVALID, str(error)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt) and not _is_worker:
            raise
        status, message = ABORTED, _message(error)
    return without_result(job, status, message, time.perf_counter() - start)


def without_result(job: SweepJob, status: str, message: str, wall_s: float) -> StoredRun:
    """Return the row of a job without a result."""
    source: Path | ConcreteRun = job.scenario
    with suppress(InputError):  # of a distribution that has changed since the plan
        source = source_of(job)
    is_known = job.run is None or isinstance(source, ConcreteRun)
    values = _values_of(source) if isinstance(source, ConcreteRun) else {}
    return StoredRun(
        key=job.key,
        number=job.number,
        scenario=name_of(source.scenario if isinstance(source, ConcreteRun) else source),
        run=job.run,
        seed=job.seed,
        status=status,
        point=dict(job.point),
        result={f"parameter.{name}": value for name, value in values.items()},
        error=with_option_names(message),
        command=command_of_source(source, job.seed, job.settings) if is_known else "",
        wall_s=round(wall_s, 4),
    )


def _values_of(run: ConcreteRun) -> dict[str, str | int | float]:
    """Return the values of the parameters that a distribution varies; all of an invalid scenario may be numbers."""
    types: dict[str, ParameterType] = {}
    with suppress(InputError):
        types = load_scenario(run.scenario).parameter_types
    strings = [name for name, kind in types.items() if kind is ParameterType.STRING]
    return typed_parameters(run.parameters, strings)


def _message(error: BaseException) -> str:
    """Return the error of a run; with its traceback if it is none of a run."""
    if isinstance(error, KeyboardInterrupt):
        return f"{running_line(error.__traceback__)}: KeyboardInterrupt (an extension cannot interrupt a sweep)"
    if isinstance(error, WallLimitError) or type(error).__module__.startswith("eidrive_scenario"):
        return str(error)
    return "".join(traceback.format_exception(error)).rstrip()


FORKSERVER = "forkserver"
_PRELOADED = ("eidrive_scenario.cli", "eidrive_scenario.experiments.sweeps.workers")
"""Modules that the server imports. It has no physics client and executes no run."""


def worker_context() -> BaseContext:
    """Return the context of worker processes: a server forks them, or each imports all if the system has no server."""
    if FORKSERVER not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context(FORKSERVER)
    context.set_forkserver_preload([*_PRELOADED])
    return context


def start_server() -> None:
    """Start the server of worker processes, which imports while this process prepares the jobs."""
    if worker_context().get_start_method() == FORKSERVER:
        from multiprocessing import forkserver, resource_tracker

        # The server inherits the mask: it ends with this process, without a traceback if that is interrupted.
        # The tracker, which it starts otherwise, resets the mask.
        resource_tracker.ensure_running()
        masked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, masked)


R = TypeVar("R")


class Workers(Protocol):
    """Workers that execute functions, as `concurrent.futures.Executor`.

    The exception of a future is HungRunError if its worker ended with a run that did not return.
    """

    @property
    def capacity(self) -> int:
        """Number of jobs that should be submitted at a time."""

    def submit(self, function: Callable[..., R], /, *arguments: Any) -> Future[R]:
        """Return the future of a call in a worker."""

    def is_crash(self, error: BaseException) -> bool:
        """Return whether the exception of a future means that its worker ended for another reason."""

    def close(self) -> None:
        """End all workers. Calls that are not complete are lost."""


class _Worker:
    """Process that is replaced when it ends.

    folder  folder of the reports of hung runs;  number  number of the report, another one for each process
    """

    def __init__(self, folder: Path, number: int) -> None:
        self._report = folder / str(number)
        self.pool = ProcessPoolExecutor(
            1, mp_context=worker_context(), initializer=_initialize, initargs=(self._report,)
        )
        self.has_ended = False

    def submit(self, function: Callable[..., R], /, *arguments: Any) -> Future[R]:
        """Start a call. Raise BrokenProcessPool if the process ended while it was idle."""
        outer: Future[R] = Future()
        inner = self.pool.submit(function, *arguments)
        outer.set_running_or_notify_cancel()
        inner.add_done_callback(lambda done: self._pass_on(done, outer))
        return outer

    def _pass_on(self, inner: Future[R], outer: Future[R]) -> None:
        error = CancelledError() if inner.cancelled() else inner.exception()
        self.has_ended = isinstance(error, BrokenProcessPool)
        if error is None:
            outer.set_result(inner.result())
        else:
            outer.set_exception((hang_of(self._report) if self.has_ended else None) or error)


class LocalWorkers:
    """Processes of this machine. The end of one affects its own call only; it is replaced."""

    def __init__(self, capacity: int) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="eidrive-workers-"))
        self._numbers = count()
        self._idle = [self._start() for _ in range(capacity)]
        self._busy: dict[Future[Any], _Worker] = {}
        self.capacity = capacity

    def _start(self) -> _Worker:
        return _Worker(self._folder, next(self._numbers))

    def _replaced(self, worker: _Worker) -> _Worker:
        """Return a new worker in place of one that has ended."""
        worker.pool.shutdown(wait=False, cancel_futures=True)
        return self._start()

    def submit(self, function: Callable[..., R], /, *arguments: Any) -> Future[R]:
        """Start a call in an idle worker. Raise RuntimeError if there is none."""
        for future in [future for future in self._busy if future.done()]:
            worker = self._busy.pop(future)
            self._idle.append(self._replaced(worker) if worker.has_ended else worker)
        if not self._idle:
            raise RuntimeError("all workers are busy")
        worker = self._idle.pop(0)
        try:
            future = worker.submit(function, *arguments)
        except BrokenProcessPool:  # the process was killed while it was idle
            worker = self._replaced(worker)
            future = worker.submit(function, *arguments)
        self._busy[future] = worker
        return future

    def is_crash(self, error: BaseException) -> bool:
        return isinstance(error, BrokenProcessPool)

    def close(self) -> None:
        workers = (*self._idle, *self._busy.values())
        for worker in workers:
            terminate(worker.pool)
        for worker in workers:
            worker.pool.shutdown(wait=True, cancel_futures=True)
        self._idle, self._busy = [], {}
        shutil.rmtree(self._folder, ignore_errors=True)


def _initialize(report: Path) -> None:
    """Prepare a worker process: equal images are processed once, and an interruption ends the command, not the run."""
    global _is_worker
    image_memory.activate(image_memory.ImageMemory())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _is_worker = True
    report_hung_runs(report)
    end_with_parent()

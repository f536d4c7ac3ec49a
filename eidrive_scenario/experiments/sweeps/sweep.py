"""Execution of a sweep: jobs to workers, results to the store."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sized
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from typing import Protocol

from eidrive_scenario.errors import SimulationError
from eidrive_scenario.experiments.hung_runs import HungRunError, describe_report
from eidrive_scenario.experiments.sweeps.jobs import SweepJob
from eidrive_scenario.experiments.sweeps.store import (
    ABORTED,
    CRASHED,
    EXCLUDED,
    FAILED,
    NOT_JUDGED,
    PASSED,
    REPEATABLE,
    ResultStore,
    StoredRun,
)
from eidrive_scenario.experiments.sweeps.workers import KeptFiles, Workers, execute, without_result

JUDGED = frozenset({PASSED, FAILED, EXCLUDED})
"""Outcomes with a verdict, and those of runs that constraints exclude."""
MOST_REASONS = 100
"""Maximum number of different messages that are counted."""
TRIES = 2
"""Number of tries of a job whose worker process ends."""


class Jobs(Sized, Iterable[SweepJob], Protocol):
    """Jobs with a known number."""


@dataclass
class SweepProgress:
    """Progress of a sweep.

    total   number of runs
    stored  number of runs that the store already had, by status
    counts  number of runs of this call by status
    errors  number of runs of this call without a verdict, by status and first line of the message, the first hundred
    warned  number of runs of this call with warnings, and the command of the first of them
    """

    total: int
    stored: Counter[str] = field(default_factory=Counter)
    counts: Counter[str] = field(default_factory=Counter)
    errors: Counter[tuple[str, str]] = field(default_factory=Counter)
    warned: tuple[int, str] = (0, "")
    start: float = field(default_factory=time.perf_counter)

    def count(self, run: StoredRun) -> None:
        """Count a run that has ended."""
        self.counts[run.status] += 1
        if run.result.get("warnings"):
            self.warned = self.warned[0] + 1, self.warned[1] or run.command
        reason = run.status, run.error.partition("\n")[0]
        if run.status not in JUDGED and (reason in self.errors or len(self.errors) < MOST_REASONS):
            self.errors[reason] += 1

    @property
    def kept(self) -> int:
        """Number of runs that the store already had."""
        return self.stored.total()

    @property
    def done(self) -> int:
        """Number of runs of this call that have ended."""
        return self.counts.total()

    @property
    def is_complete(self) -> bool:
        """Whether all runs have a verdict, or are excluded by constraints."""
        return self.left == 0 and not self._without_verdict

    @property
    def lacks_criteria_only(self) -> bool:
        """Whether all runs have ended, and those without a verdict lack only a criterion."""
        return self.left == 0 and self._without_verdict == {NOT_JUDGED}

    @property
    def _without_verdict(self) -> set[str]:
        return (self.counts.keys() | self.stored.keys()) - JUDGED

    @property
    def left(self) -> int:
        """Number of runs that have not ended."""
        return self.total - self.kept - self.done

    @property
    def elapsed_s(self) -> float:
        """Duration of this call [s]."""
        return time.perf_counter() - self.start

    @property
    def rate(self) -> float:
        """Number of ended runs per second."""
        return self.done / max(self.elapsed_s, 1e-9)

    @property
    def seconds_left(self) -> float | None:
        """Expected duration of the other runs [s]; None before the first end."""
        return self.left / self.rate if self.done else None


def run_sweep(
    jobs: Jobs,
    store: ResultStore,
    workers: Workers,
    *,
    wall_limit: float | None = None,
    retry: bool = False,
    files: KeptFiles | None = None,
    shown: Callable[[SweepProgress, StoredRun | None], None] = lambda progress, run: None,
) -> SweepProgress:
    """Run all jobs without a result in the store, and return the progress.

    wall_limit  limit of the wall time of each run [s]
    retry       repeat runs that were aborted or whose worker ended
    files       files of the runs that are kept; None for none
    shown       function that gets the progress at the start, at the end, and each run once it is stored

    Raise SimulationError if the store cannot be written, or if the scheduler of the workers ends; the results of all
    earlier runs are stored.
    """
    held = store.statuses()
    progress = SweepProgress(len(jobs))
    running: dict[Future[StoredRun], tuple[SweepJob, int]] = {}

    def start(job: SweepJob, tries: int) -> None:
        running[workers.submit(execute, job, wall_limit, files)] = job, tries

    def left() -> Iterator[SweepJob]:
        for job in jobs:
            status = held.get(job.key)
            if status is None or (retry and status in REPEATABLE):
                yield job
            else:
                progress.stored[status] += 1

    def write() -> None:
        """Write the runs that have ended in one transaction."""
        store.add(*ended)
        while ended:
            progress.count(ended[0])
            shown(progress, ended.popleft())

    def end(future: Future[StoredRun]) -> None:
        job, tries = running.pop(future)
        if future.cancelled():
            raise SimulationError(
                "the scheduler of the workers has ended; the results of all earlier runs are stored, and the same "
                "command continues"
            )
        error = future.exception()
        if error is None:
            ended.append(future.result())
        elif isinstance(error, HungRunError):
            ended.append(without_result(job, ABORTED, describe_report(str(error), wall_limit), wall_limit or 0.0))
        elif not workers.is_crash(error):
            raise error
        elif tries < TRIES:
            again.append((job, tries + 1))
        else:
            text = f"the worker process ended in {tries} of {tries} tries: {error}"
            ended.append(without_result(job, CRASHED, text, 0.0))

    waiting = left()
    again: deque[tuple[SweepJob, int]] = deque()
    ended: deque[StoredRun] = deque()
    shown(progress, None)
    try:
        while True:
            while len(running) < workers.capacity and (job := next(waiting, None)) is not None:
                start(job, 1)
            if again and not running:  # alone, so that the end of its worker has no other cause
                start(*again.popleft())
            write()  # while the workers execute the next runs
            if not running:
                break
            done = wait(running, return_when=FIRST_COMPLETED).done
            for future in [future for future in running if future in done]:
                end(future)
    except BaseException:
        ended += [
            future.result()
            for future in running
            if future.done() and not future.cancelled() and future.exception() is None
        ]
        write()
        raise
    shown(progress, None)
    return progress

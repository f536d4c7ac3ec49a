"""Progress of a sweep on standard error: a bar in a terminal, a line now and then in a file."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Self

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from eidrive_scenario.cli.verdicts import console
from eidrive_scenario.experiments.sweeps.store import PASSED, StoredRun
from eidrive_scenario.experiments.sweeps.sweep import SweepProgress

INTERVAL = 30.0
"""Time between two lines if standard error is no terminal [s]."""


class ProgressDisplay:
    """Display of a running sweep: ended runs, rate, runs that did not pass, time left."""

    def __init__(self, total: int) -> None:
        self._console = console(stderr=True)
        columns = (TextColumn("sweep"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}"))
        self._bar = Progress(*columns, console=self._console, disable=not self._console.is_terminal)
        self._task = self._bar.add_task("", total=total)
        self._printed = time.perf_counter()

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def show(self, progress: SweepProgress, run: StoredRun | None) -> None:
        """Show the state after a run, or at the start and the end."""
        text = state_of(progress)
        self._bar.update(self._task, completed=progress.kept + progress.done, description=text)
        now = time.perf_counter()
        if self._bar.disable and run is not None and now - self._printed >= INTERVAL:
            self._printed = now
            self._console.print(f"{progress.kept + progress.done} of {progress.total} runs, {text}", soft_wrap=True)


def state_of(progress: SweepProgress) -> str:
    """Return rate, number of runs that did not pass, and time left."""
    others = progress.done - progress.counts[PASSED]
    left = progress.seconds_left
    parts = [f"{progress.rate:.1f}/s", f"{others} not passed"]
    return ", ".join(parts if left is None else [*parts, f"{_duration(left)} left"])


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"

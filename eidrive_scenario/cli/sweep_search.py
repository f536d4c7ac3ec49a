"""Execution of a sweep on the terminal: its progress, and the searches that replace its runs."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from eidrive_scenario.cli.console import console
from eidrive_scenario.cli.output import echo
from eidrive_scenario.errors import Diagnostic, SettingError, counted
from eidrive_scenario.experiments.sweeps.axes import Axis, check_different
from eidrive_scenario.experiments.sweeps.jobs import SweepJob, SweepPlan
from eidrive_scenario.experiments.sweeps.searches import Execute, falsify, find_boundary
from eidrive_scenario.experiments.sweeps.store import PASSED, ResultStore, StoredRun
from eidrive_scenario.experiments.sweeps.sweep import SweepProgress, run_sweep
from eidrive_scenario.experiments.sweeps.workers import KeptFiles, Workers

MOST_RUNS = 200
"""Default maximum number of runs of a search."""
BOUND = 0.5
"""Default success rate at the boundary."""
_SEEDS = "--seeds does not fit to the search"


@dataclass(frozen=True)
class Search:
    """Search that replaces the runs of a sweep.

    boundary  axis of `--find-boundary`; None for `--falsify`
    space     axes of `--falsify`
    fixed     axes with one value, which all runs have
    """

    boundary: Axis | None
    bound: float
    tolerance: float
    space: tuple[Axis, ...]
    fixed: tuple[Axis, ...]
    objective: str | None
    runs: int

    @classmethod
    def of(
        cls,
        axes: Sequence[Axis],
        boundary: Axis | None,
        bound: float | None,
        tolerance: float | None,
        falsified: bool,
        objective: str | None,
        runs: int | None,
        seeds: Sequence[int] | None = None,
    ) -> Self | None:
        """Return the search of these options, None without one. Raise SettingError for options that do not fit."""
        for name, given, is_requested, option in (
            ("--bound", bound, boundary is not None, "--find-boundary"),
            ("--tolerance", tolerance, boundary is not None, "--find-boundary"),
            ("--objective", objective, falsified, "--falsify"),
        ):
            if given is not None and not is_requested:
                hint = f"add {option}, or remove {name}"
                raise SettingError(Diagnostic(f"{name} without {option} has no effect", hint))
        space = tuple(axis for axis in axes if axis.is_interval or len(axis.values) > 1)
        fixed = tuple(axis for axis in axes if axis not in space)
        most = runs or MOST_RUNS
        if boundary is None:
            if seeds is not None and falsified and len(seeds) != 1:
                raise SettingError(Diagnostic(_SEEDS, "give one seed, which all runs have"))
            return cls(None, BOUND, math.nan, space, fixed, objective, most) if falsified else None
        if falsified:
            raise SettingError(Diagnostic("--find-boundary and --falsify are two searches", "give one of them"))
        if seeds is not None:
            raise SettingError(Diagnostic(_SEEDS, "remove it: each run has another seed"))
        check_different([*axes, boundary])
        if not boundary.is_interval:
            message = f"--find-boundary: {boundary.name} is not an interval"
            raise SettingError(Diagnostic(message, "expected NAME=LOW:HIGH"))
        if space:
            hint = "give each axis of --vary one value, or use a sweep for each"
            raise SettingError(Diagnostic(f"--find-boundary: {space[0].name} varies, too", hint))
        bound = BOUND if bound is None else bound
        if not 0.0 < bound < 1.0:
            raise SettingError(Diagnostic(f"--bound is {bound}", "give a success rate between 0 and 1"))
        width = boundary.high - boundary.low
        least = max(0.02 * width, 0.5 * boundary.is_whole) if tolerance is None else tolerance
        if not 0.0 < least < math.inf:
            raise SettingError(Diagnostic(f"--tolerance is {tolerance}", "give a positive number"))
        return cls(boundary, bound, least, (), fixed, objective, most)

    @property
    def axes(self) -> tuple[Axis, ...]:
        """Axes whose values the search selects."""
        return self.space if self.boundary is None else (self.boundary,)

    def check(self, plan: SweepPlan) -> None:
        """Raise SettingError for a distribution of several runs, or without axes."""
        if len(plan.points) > 1:
            text = f"{plan.scenario}: a search needs one scenario (got a distribution of {len(plan.points)} runs)"
            raise SettingError(Diagnostic(text, "give the scenario of the distribution, and --vary or --param"))
        if not self.axes:
            raise SettingError(Diagnostic("--falsify without --vary", "give the axes of the space"))

    def run(
        self,
        plan: SweepPlan,
        store: ResultStore,
        workers: Workers,
        *,
        wall_limit: float | None,
        retry: bool,
        files: KeptFiles | None = None,
    ) -> None:
        """Search, and print the result."""
        unjudged: dict[str, StoredRun] = {}

        def execute(jobs: Sequence[SweepJob]) -> list[StoredRun]:
            run_sweep(jobs, store, workers, wall_limit=wall_limit, retry=retry, files=files)
            executed = store.rows([job.key for job in jobs])
            unjudged.update({run.key: run for run in executed if not run.has_verdict})
            return executed

        if self.boundary is None:
            self._falsify(plan, execute)
        else:
            self._find_boundary(plan, self.boundary, execute)
        if unjudged:
            run = next(iter(unjudged.values()))
            verbs = "has no verdict and does" if len(unjudged) == 1 else "have no verdict and do"
            echo(f"{counted(len(unjudged), 'run')} {verbs} not count: {run.status}: {run.error}", err=True)

    def _find_boundary(self, plan: SweepPlan, axis: Axis, execute: Execute) -> None:
        boundary = find_boundary(
            plan,
            axis,
            execute,
            bound=self.bound,
            tolerance=self.tolerance,
            runs=self.runs,
            shown=lambda estimate: echo(
                f"{counted(estimate.runs, 'run')}: {estimate.low:.4g} to {estimate.high:.4g}", err=True
            ),
        )
        name = axis.name
        if math.isnan(boundary.value) or boundary.inside < 0.5:
            runs = f"({counted(boundary.runs, 'run')})"
            echo(f"{name}: the success rate does not cross {self.bound:g} in the range if it is monotone {runs}")
            return
        change = "rises" if boundary.rising > 0.5 else "falls"
        echo(
            f"{name}: the success rate {change} through {self.bound:g} at {boundary.value:.4g} "
            f"(95 %: {boundary.low:.4g} to {boundary.high:.4g}; {counted(boundary.runs, 'run')})"
        )

    def _falsify(self, plan: SweepPlan, execute: Execute) -> None:
        falsification = falsify(
            plan,
            self.space,
            execute,
            runs=self.runs,
            objective=self.objective,
            shown=lambda done, failed: echo(f"{counted(done, 'run')}, {failed} failed", err=True),
        )
        echo(f"{falsification.failed} of {counted(falsification.runs, 'run')} failed")
        for run in falsification.failures:
            echo(run.command)
        if not falsification.failures and falsification.least is not None:
            echo(f"nearest to a failure: {falsification.least.command}")


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

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def show(self, progress: SweepProgress, run: StoredRun | None) -> None:
        """Show the state after a run, or at the start and the end."""
        text = state_of(progress)
        self._bar.update(self._task, completed=progress.kept + progress.done, description=text)
        now = time.perf_counter()
        if self._bar.disable and run is not None and now - self._printed >= INTERVAL:
            self._printed = now
            self._console.print(
                f"{progress.kept + progress.done} of {counted(progress.total, 'run')}, {text}", soft_wrap=True
            )


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

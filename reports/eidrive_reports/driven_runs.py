"""Runs of scenarios that were written for other engines, driven by a planner: jobs, outcomes and their record."""

from __future__ import annotations

import itertools
import json
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path

import msgspec
import numpy as np
from msgspec.structs import replace
from rich.console import Console

from eidrive_reports.run_record import RunRecord
from eidrive_scenario.api.common import Array, ConstraintError, EidriveError, InputError
from eidrive_scenario.api.criteria import Criterion, Frame
from eidrive_scenario.api.experiments import Job, definition, run_jobs
from eidrive_scenario.api.run import (
    Assignment,
    ConcreteRun,
    DistributionExpansion,
    RunResult,
    RunSettings,
    Simulation,
    load_distribution,
    load_scenario,
)

CONTACT = "contact"
"""Name of the criterion that judges the contacts of the vehicle."""
WINDOW = 0.5
"""Length of the average of the accelerations [s]."""
HARD = 4.05
"""Deceleration above which braking is hard [m/s²]: the limit of comfort of nuPlan."""
STANDING = 0.1
"""Maximum speed of a standing vehicle [m/s]."""
DISPLACED = 5.0
"""Time after a contact in which another one is a consequence of the first one [s]."""


@dataclass(frozen=True)
class Stop:
    """Standstill from `time` for `duration` [s] at x, y [m]; `reason` is the most frequent one of the plans."""

    time: float
    duration: float
    x: float
    y: float
    reason: str


def decelerations(times: Sequence[float], speeds: Sequence[float]) -> Array:
    """Return the mean decelerations over `WINDOW` (N,) [m/s²]; none of a drive that is shorter."""
    steps = round(WINDOW / (times[1] - times[0])) if len(times) > 1 else 0
    if not 0 < steps < len(speeds):
        return np.empty(0)
    return np.subtract(speeds[:-steps], speeds[steps:]) / WINDOW


class DrivenMotion:
    """Motion of one vehicle, from frames in order.

    A contact is by own fault if the criterion `contact` judges so. One within `DISPLACED` of an earlier contact does
    not count: a vehicle that was hit is pushed against others.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self.distance = 0.0
        """Distance covered [m]."""
        self.stops: list[Stop] = []
        self.contacts: list[tuple[float, bool]] = []
        """Time [s] of each contact, and whether it is by own fault."""
        self._times: list[float] = []
        self._speeds: list[float] = []
        self._place: tuple[float, float] | None = None
        self._stopped_at: float | None = None
        self._reasons: Counter[str] = Counter()

    def observe(self, frame: Frame, criteria: Iterable[Criterion]) -> None:
        """Add a frame, which the criteria have observed."""
        view = frame.view
        row = view.rows.get(self._name)
        if row is None:
            self._end_stop(view.time)
            self._place = None
            return
        state = view.states[row]
        if self._place is not None:
            self.distance += float(np.hypot(state.x - self._place[0], state.y - self._place[1]))
        self._place = (state.x, state.y)
        self._times.append(view.time)
        self._speeds.append(state.speed)
        if abs(state.speed) > STANDING:
            self._end_stop(view.time)
        else:
            if self._stopped_at is None:
                self._stopped_at = view.time
            step = frame.steps.get(self._name)
            if step is not None and step.plan is not None:
                self._reasons[step.plan.reason] += 1
        if any(self._name in (contact.first, contact.second) for contact in view.contacts):
            self._add_contacts(view.time, criteria)

    def finish(self) -> None:
        """End the stop in which the run ended."""
        if self._times:
            self._end_stop(self._times[-1])

    def _end_stop(self, time: float) -> None:
        if self._stopped_at is not None and self._place is not None:
            reason = max(self._reasons, key=lambda reason: self._reasons[reason], default="")
            self.stops.append(Stop(self._stopped_at, time - self._stopped_at, *self._place, reason))
        self._stopped_at = None
        self._reasons.clear()

    def _add_contacts(self, time: float, criteria: Iterable[Criterion]) -> None:
        metrics = next(criterion.metrics() for criterion in criteria if criterion.name == CONTACT)
        count, at_fault = (int(metrics.get(f"{CONTACT}.{key}", 0.0)) for key in ("count", "at_fault"))
        fresh = count - len(self.contacts)
        blamed = at_fault - sum(fault for _, fault in self.contacts)
        self.contacts += [(time, n < blamed) for n in range(fresh)]

    @property
    def collided(self) -> bool:
        """Whether it had a contact."""
        return bool(self.contacts)

    @property
    def at_fault(self) -> bool:
        """Whether a contact was by its own fault and not the consequence of an earlier one."""
        last = -np.inf
        for time, fault in self.contacts:
            if fault and not 0.0 < time - last < DISPLACED:
                return True
            last = time
        return False

    @property
    def longest_stop(self) -> float:
        """Duration of the longest standstill [s]."""
        return max((stop.duration for stop in self.stops), default=0.0)

    @property
    def hardest_braking(self) -> float:
        """Maximum mean deceleration over `WINDOW` before the first contact [m/s²]."""
        return float(self._braking().max(initial=0.0))

    @property
    def hard_brakings(self) -> int:
        """Number of times that the mean deceleration over `WINDOW` exceeds `HARD`."""
        hard = self._braking() > HARD
        return int(np.count_nonzero(np.diff(hard.astype(int), prepend=0) > 0))

    def _braking(self) -> Array:
        """Return the mean decelerations over `WINDOW` before the first contact (N,) [m/s²]."""
        end = self.contacts[0][0] if self.contacts else np.inf
        speeds = [speed for time, speed in zip(self._times, self._speeds, strict=True) if time < end]
        return decelerations(self._times, speeds)


def observed_run(
    scenario: str | Path, vehicle: str, *, seed: int, settings: RunSettings
) -> tuple[RunResult, DrivenMotion]:
    """Run a scenario and return its result and the motion of a vehicle."""
    motion = DrivenMotion(vehicle)
    with Simulation(scenario, seed=seed, settings=settings) as simulation:
        end = None
        while end is None:
            frame, end = simulation.tick()
            motion.observe(frame, simulation.criteria)
        result = simulation.result()
    motion.finish()
    return result, motion


case_of = attrgetter("group", "file", "number", "seed", "planner", "drive")
"""Function that returns the identity of a run, or of its job, except for its arm."""
STACK, REFERENCE = "stack", "reference"
DEFAULT = "behavior"
"""Planner of the stack if none is given."""
ORACLE = {"detector": "oracle", "mount": "roof", "range": 150}
"""Perception of the driven vehicle."""
TIME_LIMIT = 60.0
"""Maximum simulated time of a run [s]."""
DRAWS = 20
"""Maximum number of combinations that are drawn per requested sample: each is read, and all may violate constraints."""


@dataclass(frozen=True)
class DrivenJob(Job):
    """Run of the scenario of `file` in which `drive` is judged; `number` is that of the run in its distribution.

    `reference` names the controller and its model in a run of the reference driver.
    """

    file: str
    number: int
    drive: str
    group: str = ""
    planner: str = DEFAULT
    reference: str = ""


class DrivenRun(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Outcome of one run of an arm: `stack` or `reference`.

    file, number  file, and number of the run in its distribution
    at_fault      whether a contact was by own fault
    failed        criteria of the file that failed;  judged  number of its criteria
    distance      distance that the entity covered [m];  duration  simulated time [s]
    stop          longest standstill [s];  braking  maximum deceleration before a contact [m/s²]
    unstarted     warnings about acts and events that never started
    error         message of a run without a result, else ""
    planner       planner of the stack, also of that with which the reference driver is compared
    excluded      whether the values violate the constraints of a parameter, so that the run is not evaluated
    drive         judged entity;  reference  controller and model of the reference driver
    """

    file: str
    number: int
    arm: str
    seed: int
    parameters: dict[str, str] = {}
    collided: bool = False
    at_fault: bool = False
    failed: tuple[str, ...] = ()
    judged: int = 0
    distance: float = 0.0
    duration: float = 0.0
    stop: float = 0.0
    braking: float = 0.0
    unstarted: tuple[str, ...] = ()
    error: str = ""
    excluded: bool = False
    group: str = ""
    planner: str = DEFAULT
    drive: str = ""
    reference: str = ""


def jobs_of_file(
    path: Path, drive: str, planner: str, samples: int, reference: dict[str, str] | None, *, group: str = ""
) -> Iterator[DrivenJob]:
    """Yield the jobs of a file: of each run one with the stack, and one with the reference driver if there is one.

    group  name that distinguishes files of the same name in a record
    """
    for number, scenario, parameters in _runs(path, samples):
        contact = {"collision": {"of": drive, "name": CONTACT}}
        common = {"criteria": contact, "parameters": parameters, "time_limit": TIME_LIMIT}
        arms = {STACK: RunSettings(drive={drive: {**ORACLE, "planner": planner}}, **common)}  # type: ignore[arg-type]
        if reference is not None:
            arms[REFERENCE] = RunSettings(controllers=reference, **common)  # type: ignore[arg-type]
        for arm, settings in arms.items():
            driver = ", ".join(map("=".join, settings.controllers.items()))
            yield DrivenJob(str(scenario), arm, 1, settings, path.name, number, drive, group, planner, driver)


def _runs(path: Path, samples: int) -> Iterator[tuple[int, Path, dict[str, str | Assignment]]]:
    if definition(path) != "distribution":
        yield 0, path, {}
        return
    runs = load_distribution(path)
    for number in selected_runs(runs, samples):
        yield number, runs[number].scenario, dict(runs[number].assignments)


def selected_runs(runs: DistributionExpansion, samples: int) -> list[int]:
    """Return the ascending numbers of the first `samples` runs of a spread whose values satisfy all constraints.

    They are fewer if the distribution is exhausted, or after DRAWS combinations per sample. A larger number of samples
    adds runs to those of a smaller one. A run with another error is selected, as its outcome is that error.
    """
    drawn = (runs[number] for number in itertools.islice(runs.draws(), DRAWS * samples))
    return sorted(run.number for run in itertools.islice(filter(_satisfies_constraints, drawn), samples))


def _satisfies_constraints(run: ConcreteRun) -> bool:
    try:
        load_scenario(run.scenario, run.assignments)
    except ConstraintError:
        return False
    except InputError:
        return True
    return True


def run_of(job: DrivenJob) -> DrivenRun:
    """Run a job and return its outcome."""
    values = {
        name: value.text if isinstance(value, Assignment) else value for name, value in job.settings.parameters.items()
    }
    named = {name: getattr(job, name) for name in ("group", "planner", "drive", "reference")}
    run = DrivenRun(job.file, job.number, job.arm, job.seed, values, **named)
    try:
        result, motion = observed_run(job.scenario, job.drive, seed=job.seed, settings=job.settings)
    except ConstraintError:
        return replace(run, excluded=True)
    except EidriveError as error:
        return replace(run, error=str(error).splitlines()[0].replace(f"{Path(job.scenario).parent}{os.sep}", ""))
    own = [verdict for verdict in result.criteria if verdict.name != CONTACT]
    return replace(
        run,
        collided=motion.collided,
        at_fault=motion.at_fault,
        failed=tuple(verdict.name for verdict in own if not verdict.passed),
        judged=len(own),
        distance=motion.distance,
        duration=result.simulated_s,
        stop=motion.longest_stop,
        braking=motion.hardest_braking,
        unstarted=tuple(warning for warning in result.warnings if " never started" in warning),
    )


class DrivenRecord(RunRecord[DrivenRun]):
    """Record of driven runs."""

    kind = DrivenRun
    key = attrgetter("group", "file", "number", "seed", "planner", "drive", "arm", "reference")
    hint = "remove the line, or start again without --resume"

    def encode(self, run: DrivenRun) -> bytes:
        return json.dumps(msgspec.to_builtins(run), ensure_ascii=False).encode()


def run_recorded(
    jobs: Sequence[DrivenJob], record: Path, *, workers: int | None, console: Console, title: str
) -> list[DrivenRun]:
    """Return the runs of all jobs; those of the reference driver where the stack has a contact by own fault only.

    Runs of the record are not repeated; new ones are added to it. Raise SettingError if the record is damaged.
    """
    stacks = [job for job in jobs if job.arm == STACK]
    with DrivenRecord.open(record) as driven:
        runs = driven.runs

        def add_runs(jobs: Sequence[DrivenJob], title: str) -> None:
            left = [job for job in jobs if driven.key(job) not in runs]
            run_jobs(left, run_of, workers=workers, console=console, title=title, finished=driven.add)

        add_runs(stacks, title)
        compared = {case_of(job) for job in stacks if runs[driven.key(job)].at_fault}
        add_runs([job for job in jobs if job.arm == REFERENCE and case_of(job) in compared], f"{title}, reference")
    return [runs[key] for key in map(DrivenRecord.key, jobs) if key in runs]

"""Runs of scenarios that were written for other engines, driven by a planner: jobs, outcomes and their record."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from rich.console import Console

from eidrive_scenario.errors import ConstraintError, Diagnostic, EidriveError, InputError, SettingError
from eidrive_scenario.experiments.driven_motion import CONTACT, observed_run
from eidrive_scenario.experiments.repetitions import Job, run_jobs
from eidrive_scenario.library import definition
from eidrive_scenario.openscenario import ConcreteRun, DistributionExpansion, load_distribution, load_scenario
from eidrive_scenario.openscenario.values.parameters import Assignment
from eidrive_scenario.simulation import RunSettings

Case = tuple[str, str, int, int, str]
"""Group, file, number of the run in its distribution, seed and planner."""
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
    """Run of the scenario of `file` in which `drive` is judged; `number` is that of the run in its distribution."""

    file: str
    number: int
    drive: str
    group: str = ""
    planner: str = DEFAULT

    @property
    def case(self) -> Case:
        """Identity of the run except for its arm."""
        return self.group, self.file, self.number, self.seed, self.planner


@dataclass(frozen=True)
class DrivenRun:
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
    """

    file: str
    number: int
    arm: str
    seed: int
    parameters: dict[str, str] = field(default_factory=dict)
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

    @property
    def case(self) -> Case:
        """Identity of the run except for its arm."""
        return self.group, self.file, self.number, self.seed, self.planner


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
            yield DrivenJob(str(scenario), arm, 1, settings, path.name, number, drive, group, planner)


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
    run = DrivenRun(job.file, job.number, job.arm, job.seed, values, group=job.group, planner=job.planner)
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


def read_record(record: Path) -> list[DrivenRun]:
    """Return the runs of a record; none if it does not exist.

    An incomplete last line, as a killed process leaves it, is none. Raise SettingError if any other line is invalid.
    """
    runs = []
    for number, line in enumerate(_complete_lines(record).splitlines(), 1):
        try:
            row = json.loads(line)
            runs.append(DrivenRun(**{**row, **{key: tuple(row[key]) for key in ("failed", "unstarted")}}))
        except (ValueError, TypeError, KeyError) as error:
            hint = "remove the line, or start again without --resume"
            raise SettingError(Diagnostic(f"the record is damaged: {error}", hint, str(record), number)) from error
    return runs


def _complete_lines(record: Path) -> bytes:
    content = record.read_bytes() if record.is_file() else b""
    return content[: content.rfind(b"\n") + 1]


def run_recorded(
    jobs: Sequence[DrivenJob], record: Path, *, workers: int | None, console: Console, title: str
) -> list[DrivenRun]:
    """Return the runs of all jobs; those of the reference driver where the stack has a contact by own fault only.

    Runs of the record are not repeated; new ones are added to it. Raise SettingError if the record is damaged.
    """
    runs = {(*run.case, run.arm): run for run in read_record(record)}
    stacks = [job for job in jobs if job.arm == STACK]
    _add_runs(stacks, runs, record, workers=workers, console=console, title=title)
    compared = {job.case for job in stacks if runs[(*job.case, STACK)].at_fault}
    references = [job for job in jobs if job.arm == REFERENCE and job.case in compared]
    _add_runs(references, runs, record, workers=workers, console=console, title=f"{title}, reference")
    return [run for job in jobs if (run := runs.get((*job.case, job.arm))) is not None]


def _add_runs(
    jobs: Sequence[DrivenJob],
    runs: dict[tuple[*Case, str], DrivenRun],
    record: Path,
    *,
    workers: int | None,
    console: Console,
    title: str,
) -> None:
    """Add the runs of jobs that are missing to `runs` and to the record."""
    left = [job for job in jobs if (*job.case, job.arm) not in runs]
    with record.open("ab") as lines:
        lines.truncate(len(_complete_lines(record)))

        def add(run: DrivenRun) -> None:
            lines.write(json.dumps(asdict(run), ensure_ascii=False).encode() + b"\n")
            lines.flush()
            runs[(*run.case, run.arm)] = run

        run_jobs(left, run_of, workers=workers, console=console, title=title, finished=add)

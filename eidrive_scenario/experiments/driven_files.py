"""Scenarios that were written for other engines, driven by a planner: contacts, own criteria, and a reference driver.

python -m eidrive_scenario.experiments.driven_files FILE… --drive Ego --reference ALKSController=alks --samples 200

Each file is run with a driving stack for the entity. Of a parameter value distribution, `--samples` runs are taken that
are spread over all values; combinations that violate the constraints of a parameter do not count. With `--reference` a
run with a contact by own fault is repeated without the stack and with that controller model, so that collisions which
the reference driver avoids are counted separately. The output is the table driven_files.md, and driven_files.jsonl with
one line per run; `--resume` repeats no run of that file.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from rich.console import Console

from eidrive_scenario.errors import ConstraintError, Diagnostic, EidriveError, InputError, quoted, suggestion
from eidrive_scenario.experiments.driven_motion import CONTACT, observed_run
from eidrive_scenario.experiments.repetitions import Job, run_jobs
from eidrive_scenario.library import definition
from eidrive_scenario.openscenario import ConcreteRun, DistributionExpansion, load_distribution, load_scenario
from eidrive_scenario.openscenario.model import Controller
from eidrive_scenario.openscenario.properties import is_agent_controller
from eidrive_scenario.openscenario.values.parameters import Assignment
from eidrive_scenario.registry import registry
from eidrive_scenario.simulation import RunSettings

STACK, REFERENCE = "stack", "reference"
ORACLE = {"detector": "oracle", "mount": "roof", "range": 150}
"""Perception of the driven vehicle."""
TIME_LIMIT = 60.0
"""Maximum simulated time of a run [s]."""
DRAWS = 20
"""Maximum number of combinations that are drawn per requested sample: each is read, and all may violate constraints."""
REFERENCE_OPTION = "--reference"


@dataclass(frozen=True)
class DrivenJob(Job):
    """Run of the scenario of `file` in which `drive` is judged; `number` is that of the run in its distribution."""

    file: str
    number: int
    drive: str
    group: str = ""

    @property
    def case(self) -> tuple[str, str, int, int]:
        """Identity of the run except for its arm."""
        return self.group, self.file, self.number, self.seed


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

    @property
    def case(self) -> tuple[str, str, int, int]:
        """Identity of the run except for its arm."""
        return self.group, self.file, self.number, self.seed


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
            yield DrivenJob(str(scenario), arm, 1, settings, path.name, number, drive, group)


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
    run = DrivenRun(job.file, job.number, job.arm, job.seed, values, group=job.group)
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


COLUMNS = (
    "file",
    "runs",
    "collisions",
    "by own fault",
    "by own fault where the reference has none",
    "distance [m]",
    "hardest braking [m/s²]",
    "own criteria failed",
)


def table(runs: Iterable[DrivenRun], *, has_reference: bool) -> str:
    """Return the runs as a Markdown table, one line per file in order of appearance; distances are means.

    has_reference  whether runs with a contact by own fault are compared with a reference driver
    """
    lines = [f"| {' | '.join(COLUMNS)} |", "|---" * len(COLUMNS) + "|"]
    evaluated = [run for run in runs if not run.excluded]
    for file in dict.fromkeys(run.file for run in evaluated):
        mine = [run for run in evaluated if run.file == file]
        stacks = [run for run in mine if run.arm == STACK]
        errors = sorted({run.error for run in stacks if run.error})
        if errors:
            lines.append(f"| {file} | {len(stacks)} | {errors[0]} |{' |' * (len(COLUMNS) - 3)}")
            continue
        worse = str(len(worse_runs(mine))) if has_reference else "-"
        failed = sorted({name for run in stacks for name in run.failed})
        criteria = ", ".join(f"`{name}`" for name in failed) or ("none" if any(run.judged for run in stacks) else "-")
        cells = [
            file,
            str(len(stacks)),
            str(sum(run.collided for run in stacks)),
            str(sum(run.at_fault for run in stacks)),
            worse,
            f"{np.mean([run.distance for run in stacks]):.0f}",
            f"{max(run.braking for run in stacks):.1f}",
            criteria,
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def worse_runs(runs: Iterable[DrivenRun]) -> list[DrivenRun]:
    """Return the runs of the stack with a contact by own fault in which the reference driver has none."""
    runs = tuple(runs)
    avoided = {run.case for run in runs if run.arm == REFERENCE and not run.collided and not run.error}
    return [run for run in runs if run.arm == STACK and run.at_fault and run.case in avoided]


def read_record(record: Path) -> list[DrivenRun]:
    """Return the runs of a record; none if it does not exist."""
    text = record.read_text(encoding="utf-8") if record.is_file() else ""
    rows = map(json.loads, text.splitlines())
    return [DrivenRun(**{**row, **{key: tuple(row[key]) for key in ("failed", "unstarted")}}) for row in rows]


def run_recorded(
    jobs: Sequence[DrivenJob], record: Path, *, workers: int | None, console: Console, title: str
) -> list[DrivenRun]:
    """Return the runs of all jobs; those of the reference driver where the stack has a contact by own fault only.

    Runs of the record are not repeated; new ones are added to it.
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
    runs: dict[tuple[str, str, int, int, str], DrivenRun],
    record: Path,
    *,
    workers: int | None,
    console: Console,
    title: str,
) -> None:
    """Add the runs of jobs that are missing to `runs` and to the record."""
    left = [job for job in jobs if (*job.case, job.arm) not in runs]
    with record.open("a", encoding="utf-8") as lines:

        def add(run: DrivenRun) -> None:
            lines.write(json.dumps(asdict(run), ensure_ascii=False) + "\n")
            lines.flush()
            runs[(*run.case, run.arm)] = run

        run_jobs(left, run_of, workers=workers, console=console, title=title, finished=add)


def positive(text: str) -> int:
    """Return the positive number of an option. Raise ValueError for any other text."""
    number = int(text)
    if number < 1:
        raise ValueError
    return number


def wrong_reference(files: Iterable[Path], name: str, model: str) -> Diagnostic | None:
    """Return the error of a reference driver that does not exist, or whose controller a file lacks; None without one.

    Runs of the reference would else move the vehicle without any driver. A file with errors is left to its runs.
    """
    if model not in registry("controllers"):
        return registry("controllers").unknown(model, source=REFERENCE_OPTION)
    for path in files:
        try:
            known = _controller_names(path)
        except InputError:
            continue
        if name not in known:
            hint = suggestion(name, known) if known else "the file has no controller of another tool"
            return Diagnostic(f"{path.name} has no controller {quoted(name)}", hint, REFERENCE_OPTION)
    return None


def _controller_names(path: Path) -> list[str]:
    """Return the names of the controllers of other tools in a scenario, or in that of a distribution."""
    scenario = load_scenario(load_distribution(path).scenario if definition(path) == "distribution" else path)
    trees = (scenario.document, *scenario.entries.values())
    found = (one for tree in trees for one in tree.walk() if isinstance(one, Controller))
    return list(dict.fromkeys(one.name for one in found if not is_agent_controller(one)))


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", type=Path, nargs="+", help="scenarios and parameter value distributions")
    parser.add_argument("--drive", default="Ego", help="entity that gets the driving stack")
    parser.add_argument("--planner", default="behavior")
    parser.add_argument("--samples", type=positive, default=200, help="number of runs of a distribution")
    parser.add_argument(REFERENCE_OPTION, metavar="CONTROLLER=MODEL", help="controller model of the reference driver")
    parser.add_argument("--out", type=Path, default=Path("reports"))
    parser.add_argument("--resume", action="store_true", help="keep the runs of an earlier call")
    parser.add_argument("--workers", type=int, default=None, help="processes; all cores by default")
    options = parser.parse_args(arguments)
    name, separator, model = (options.reference or "").partition("=")
    if options.reference and not (name and separator and model):
        parser.error("--reference: expected CONTROLLER=MODEL, for example ALKSController=alks")
    if options.reference and (wrong := wrong_reference(options.files, name, model)) is not None:
        parser.error(str(wrong))
    reference = {name: model} if options.reference else None
    jobs = [
        job
        for path in options.files
        for job in jobs_of_file(path, options.drive, options.planner, options.samples, reference)
    ]
    options.out.mkdir(parents=True, exist_ok=True)
    record = options.out / "driven_files.jsonl"
    if not options.resume:
        record.unlink(missing_ok=True)
    runs = run_recorded(jobs, record, workers=options.workers, console=Console(stderr=True), title="driven files")
    result = table(runs, has_reference=reference is not None)
    (options.out / "driven_files.md").write_text(result, encoding="utf-8")
    sys.stdout.write(result)


if __name__ == "__main__":
    main()

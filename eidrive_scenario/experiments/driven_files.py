"""Scenarios that were written for other engines, driven by a planner: contacts, own criteria, and a reference driver.

python -m eidrive_scenario.experiments.driven_files FILE… --drive Ego --reference ALKSController=alks --samples 200

Each file is run with a driving stack for the entity. Of a parameter value distribution, `--samples` runs are taken that
are spread over all values. With `--reference` each run is repeated without the stack and with that controller
model, so that collisions which the reference driver avoids are counted separately.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from eidrive_scenario.errors import ConstraintError, EidriveError
from eidrive_scenario.experiments.repetitions import Job, run_jobs
from eidrive_scenario.library import definition
from eidrive_scenario.openscenario import load_distribution
from eidrive_scenario.openscenario.values.parameters import Assignment
from eidrive_scenario.simulation import RunSettings, run_file

CONTACT = "contact"
"""Name of the criterion that counts collisions."""
STACK, REFERENCE = "stack", "reference"
ORACLE = {"detector": "oracle", "mount": "roof", "range": 150}
"""Perception of the driven vehicle."""
TIME_LIMIT = 60.0
"""Maximum simulated time of a run [s]."""


@dataclass(frozen=True)
class DrivenRun:
    """Outcome of one run: contacts, contacts by own fault, and the criteria of the file that failed.

    error     message of a run without a result, else ""
    excluded  whether the values violate the constraints of a parameter, so that the run is not evaluated
    """

    file: str
    arm: str
    collided: bool = False
    at_fault: bool = False
    failed: tuple[str, ...] = ()
    judged: int = 0
    error: str = ""
    excluded: bool = False


def jobs_of_file(
    path: Path, drive: str, planner: str, samples: int, reference: dict[str, str] | None
) -> Iterator[tuple[Job, ...]]:
    """Yield the jobs of each run of a file: with the stack, and with the reference driver if there is one."""
    for scenario, parameters in _runs(path, samples):
        contact = {"collision": {"of": drive, "name": CONTACT}}
        common = {"criteria": contact, "parameters": parameters, "time_limit": TIME_LIMIT}
        stack = RunSettings(drive={drive: {**ORACLE, "planner": planner}}, **common)  # type: ignore[arg-type]
        jobs = [Job(str(scenario), STACK, 1, stack)]
        if reference is not None:
            jobs.append(Job(str(scenario), REFERENCE, 1, RunSettings(controllers=reference, **common)))  # type: ignore[arg-type]
        yield tuple(jobs)


def _runs(path: Path, samples: int) -> Iterator[tuple[Path, dict[str, str | Assignment]]]:
    if definition(path) != "distribution":
        yield path, {}
        return
    runs = load_distribution(path)
    for number in runs.spread(samples):
        yield runs[number].scenario, dict(runs[number].assignments)


def run_of(job: Job) -> DrivenRun:
    """Run a job and return its outcome."""
    name = Path(job.scenario).name
    try:
        result = run_file(job.scenario, seed=job.seed, settings=job.settings)
    except ConstraintError:
        return DrivenRun(name, job.arm, excluded=True)
    except EidriveError as error:
        return DrivenRun(name, job.arm, error=str(error).splitlines()[0])
    own = [verdict for verdict in result.criteria if verdict.name != CONTACT]
    return DrivenRun(
        name,
        job.arm,
        collided=result.metrics.get(f"{CONTACT}.count", 0.0) > 0.0,
        at_fault=result.metrics.get(f"{CONTACT}.at_fault", 0.0) > 0.0,
        failed=tuple(verdict.name for verdict in own if not verdict.passed),
        judged=len(own),
    )


def table(pairs: Sequence[tuple[DrivenRun, ...]]) -> str:
    """Return the runs as a Markdown table, one line per file in order of appearance."""
    lines = [
        "| file | runs | collisions | by own fault | by own fault where the reference has none | own criteria failed |",
        "|---|---|---|---|---|---|",
    ]
    for file in dict.fromkeys(pair[0].file for pair in pairs):
        mine = [pair for pair in pairs if pair[0].file == file]
        stacks = [pair[0] for pair in mine]
        errors = sorted({run.error for run in stacks if run.error})
        if errors:
            lines.append(f"| {file} | {len(mine)} | {errors[0]} | | | |")
            continue
        worse = "-"
        if all(len(pair) > 1 for pair in mine):
            worse = str(sum(pair[0].at_fault and not pair[1].collided for pair in mine))
        failed = sorted({name for run in stacks for name in run.failed})
        criteria = ", ".join(f"`{name}`" for name in failed) or ("none" if any(run.judged for run in stacks) else "-")
        cells = (sum(run.collided for run in stacks), sum(run.at_fault for run in stacks), worse, criteria)
        lines.append(f"| {file} | {len(mine)} | {' | '.join(map(str, cells))} |")
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", type=Path, nargs="+", help="scenarios and parameter value distributions")
    parser.add_argument("--drive", default="Ego", help="entity that gets the driving stack")
    parser.add_argument("--planner", default="behavior")
    parser.add_argument("--samples", type=int, default=200, help="number of runs of a distribution")
    parser.add_argument("--reference", metavar="CONTROLLER=MODEL", help="controller model of the reference driver")
    parser.add_argument("--out", type=Path, default=Path("reports"))
    parser.add_argument("--workers", type=int, default=None, help="processes; all cores by default")
    options = parser.parse_args(arguments)
    name, separator, model = (options.reference or "").partition("=")
    if options.reference and not (name and separator and model):
        parser.error("--reference: expected CONTROLLER=MODEL, for example ALKSController=alks")
    reference = {name: model} if options.reference else None
    groups = [
        group
        for path in options.files
        for group in jobs_of_file(path, options.drive, options.planner, options.samples, reference)
    ]
    jobs = [job for group in groups for job in group]
    outcomes = iter(run_jobs(jobs, run_of, workers=options.workers, console=Console(stderr=True), title="driven"))
    pairs = [tuple(next(outcomes) for _ in group) for group in groups]
    result = table([pair for pair in pairs if not pair[0].excluded])
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "driven_files.md").write_text(result, encoding="utf-8")
    sys.stdout.write(result)


if __name__ == "__main__":
    main()

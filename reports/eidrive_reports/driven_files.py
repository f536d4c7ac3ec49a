"""Scenarios that were written for other engines, driven by a planner: contacts, own criteria, and a reference driver.

python -m eidrive_reports.driven_files FILE… --drive Ego --reference ALKSController=alks --samples 200

Each file is run with a driving stack for the entity. Of a parameter value distribution, `--samples` runs are taken that
are spread over all values; combinations that violate the constraints of a parameter do not count. With `--reference` a
run with a contact by own fault is repeated without the stack and with that controller model, so that collisions which
the reference driver avoids are counted separately. The output is the table driven_files.md, and driven_files.jsonl with
one line per run; `--resume` repeats no run of that file.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from operator import attrgetter
from pathlib import Path

import numpy as np
from rich.console import Console

from eidrive_reports.driven_runs import DEFAULT, REFERENCE, STACK, DrivenRun, case_of, jobs_of_file, run_recorded
from eidrive_reports.studies import (
    check_different,
    command,
    group_by,
    markdown_table,
    positive,
    publish,
    study_options,
)
from eidrive_scenario.api.actions import is_agent_controller
from eidrive_scenario.api.common import Diagnostic, InputError, quoted, registry, suggestion
from eidrive_scenario.api.experiments import definition
from eidrive_scenario.api.run import Controller, load_distribution, load_scenario

REFERENCE_OPTION = "--reference"

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

    Runs without a result have a line per error.

    has_reference  whether runs with a contact by own fault are compared with a reference driver
    """
    lines: list[Sequence[object]] = []
    evaluated = [run for run in runs if not run.excluded]
    for file, mine in group_by(evaluated, attrgetter("file")).items():
        errors = Counter(run.error for run in mine if run.arm == STACK and run.error)
        lines += [(file, count, error, *[""] * (len(COLUMNS) - 3)) for error, count in sorted(errors.items())]
        stacks = [run for run in mine if run.arm == STACK and not run.error]
        if not stacks:
            continue
        failed = sorted({name for run in stacks for name in run.failed})
        criteria = ", ".join(f"`{name}`" for name in failed) or ("none" if any(run.judged for run in stacks) else "-")
        cells = (
            file,
            len(stacks),
            sum(run.collided for run in stacks),
            sum(run.at_fault for run in stacks),
            len(worse_runs(mine)) if has_reference else "-",
            f"{np.mean([run.distance for run in stacks]):.0f}",
            f"{max(run.braking for run in stacks):.1f}",
            criteria,
        )
        lines.append(cells)
    return markdown_table(COLUMNS, lines)


def worse_runs(runs: Iterable[DrivenRun]) -> list[DrivenRun]:
    """Return the runs of the stack with a contact by own fault in which the reference driver has none."""
    runs = tuple(runs)
    avoided = {case_of(run) for run in runs if run.arm == REFERENCE and not run.collided and not run.error}
    return [run for run in runs if run.arm == STACK and run.at_fault and case_of(run) in avoided]


def wrong_reference(files: Iterable[Path], name: str, model: str) -> Diagnostic | None:
    """Return the error of a reference driver that does not exist, or whose controller a file lacks; None without one.

    Runs of the reference would else move the vehicle without any driver. A file with errors is left to its runs.
    """
    if model not in registry("controllers"):
        return registry("controllers").unknown(model, source=REFERENCE_OPTION)
    for path in files:
        try:
            names = _controller_names(path)
        except InputError:
            continue
        if name not in names:
            hint = suggestion(name, names) if names else "the file has no controller of another tool"
            return Diagnostic(f"{path.name} has no controller {quoted(name)}", hint, REFERENCE_OPTION)
    return None


def _controller_names(path: Path) -> list[str]:
    """Return the names of the controllers of other tools in a scenario, or in that of a distribution."""
    scenario = load_scenario(load_distribution(path).scenario if definition(path) == "distribution" else path)
    trees = (scenario.document, *scenario.entries.values())
    controllers = (element for tree in trees for element in tree.walk() if isinstance(element, Controller))
    return list(dict.fromkeys(element.name for element in controllers if not is_agent_controller(element)))


@command
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", type=Path, nargs="+", help="scenarios and parameter value distributions")
    parser.add_argument("--drive", default="Ego", help="entity that gets the driving stack")
    parser.add_argument("--planner", default=DEFAULT)
    parser.add_argument("--samples", type=positive, default=200, help="number of runs of a distribution")
    parser.add_argument(REFERENCE_OPTION, metavar="CONTROLLER=MODEL", help="controller model of the reference driver")
    parser.add_argument("--resume", action="store_true", help="keep the runs of an earlier call")
    options = study_options(parser, arguments)
    name, separator, model = (options.reference or "").partition("=")
    if options.reference and not (name and separator and model):
        parser.error("--reference: expected CONTROLLER=MODEL, for example ALKSController=alks")
    check_different(parser, [path.name for path in options.files])
    if options.reference and (wrong := wrong_reference(options.files, name, model)) is not None:
        parser.error(str(wrong))
    reference = {name: model} if options.reference else None
    jobs = [
        job
        for path in options.files
        for job in jobs_of_file(path, options.drive, options.planner, options.samples, reference)
    ]
    record = options.out / "driven_files.jsonl"
    if not options.resume:
        record.unlink(missing_ok=True)
    console = Console(stderr=True)
    runs = run_recorded(jobs, record, workers=options.workers, console=console, title="driven files")
    publish(table(runs, has_reference=reference is not None), options.out / "driven_files.md")


if __name__ == "__main__":
    sys.exit(main())

"""Corpora of other tools, driven by the planner `behavior`: tables of contacts and of the files' own criteria.

python -m eidrive_reports.driven_corpora --samples 200 --out reports

EIDRIVE_CORPORA is the folder of the corpora: OSC-ALKS-scenarios in `alks`, the examples of ScenarioRunner in
`scenario_runner`, those of ASAM in `asam-1.3.1`, those of esmini in `esmini/xosc`. EIDRIVE_MAPS is the folder of the
maps that the examples of ScenarioRunner name. The output is driven_corpora.md, the tables of docs/driven_files.md,
and driven_corpora.jsonl with one line per run; `--resume` repeats no run of that file.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from eidrive_reports.driven_files import table, worse_runs
from eidrive_reports.driven_runs import DEFAULT, STACK, DrivenRun, jobs_of_file, run_recorded
from eidrive_reports.studies import command, markdown_table, positive, study_options
from eidrive_scenario.api.common import write_atomically

CORPORA, MAPS = "EIDRIVE_CORPORA", "EIDRIVE_MAPS"
"""Environment variables with the folders of the corpora and of the maps."""


@dataclass(frozen=True)
class Group:
    """Files of one table.

    name, title  name in the record, and heading of the table
    folder       folder below that of the corpora
    patterns     names of the files, with wildcards
    drive        entity that gets the driving stack
    reference    controller of the files and its controller model for the runs of the reference driver
    """

    name: str
    title: str
    folder: str
    patterns: tuple[str, ...]
    drive: str = "Ego"
    reference: tuple[str, str] | None = None

    def files(self, corpora: Path) -> list[Path]:
        """Return the files, sorted by name."""
        folder = corpora / self.folder
        return sorted({path for pattern in self.patterns for path in folder.glob(pattern)})


ALKS = ("ALKSController", "alks")
GROUPS = (
    Group("alks", "UN R157, concrete scenarios", "alks/concrete_scenarios", ("*.xosc",), reference=ALKS),
    Group("alks_variations", "UN R157, variations", "alks", ("*.xosc",), reference=ALKS),
    Group("scenario_runner", "ScenarioRunner", "scenario_runner", ("*.xosc",), drive="hero"),
    Group(
        "asam",
        "ASAM",
        "asam-1.3.1",
        ("[A-R]*.xosc", "Sequential*.xosc", "Slow*.xosc", "Synchronized*.xosc", "TrafficJam.xosc"),
    ),
    Group("asam_overtake", "ASAM, overtaking vehicle", "asam-1.3.1", ("SimpleOvertake.xosc",), drive="Vehicle 1"),
    Group(
        "esmini",
        "esmini: cut-ins, pedestrians, oncoming and slow vehicles",
        "esmini/xosc",
        (
            "acc-test.xosc",
            "alks*.xosc",
            "cut-in*.xosc",
            "drive_when_close.xosc",
            "highway_merge*.xosc",
            "keep_lateral_distance.xosc",
            "lane_change*.xosc",
            "left-hand-traffic*.xosc",
            "ltap-od*.xosc",
            "pedestrian*.xosc",
            "slow-lead-vehicle.xosc",
            "straight_500m*.xosc",
            "synchronize.xosc",
            "traffic_lights.xosc",
            "two_plus_one_road.xosc",
        ),
    ),
)


def summary(groups: Sequence[tuple[Group, Sequence[DrivenRun]]]) -> str:
    """Return a Markdown table with one line per group."""
    columns = (
        "group",
        "files",
        "runs",
        "without a result",
        "collisions",
        "by own fault",
        "where the reference has none",
    )
    lines = []
    for group, every in groups:
        runs = [run for run in every if not run.excluded]
        stacks = [run for run in runs if run.arm == STACK]
        counts = (
            group.title,
            len({run.file for run in stacks}),
            len(stacks),
            sum(bool(run.error) for run in stacks),
            sum(run.collided for run in stacks),
            sum(run.at_fault for run in stacks),
            "-" if group.reference is None else len(worse_runs(runs)),
        )
        lines.append(counts)
    return markdown_table(columns, lines)


def report(groups: Sequence[tuple[Group, Sequence[DrivenRun]]]) -> str:
    """Return the summary and the table of each group."""
    tables = (
        f"### {group.title}\n\n{table(runs, has_reference=group.reference is not None)}" for group, runs in groups
    )
    return "\n".join([summary(groups), *tables])


def folders(environment: dict[str, str] | os._Environ[str]) -> Path:
    """Return the folder of the corpora. Raise ValueError that names the variable which is not set or not a folder."""
    for name, content in ((CORPORA, "the corpora"), (MAPS, "the maps of ScenarioRunner's examples")):
        given = environment.get(name, "")
        if not given:
            raise ValueError(f"{name} is not set; set it to the folder of {content}")
        missing = [entry for entry in given.split(os.pathsep) if not Path(entry).is_dir()]
        if missing:
            raise ValueError(f"{name}: {missing[0]} is not a folder; set it to the folder of {content}")
    return Path(environment[CORPORA])


def selected(names: Iterable[str]) -> list[Group]:
    """Return the groups of these names; all groups without names. Raise ValueError for an unknown name."""
    names = list(names)
    unknown = sorted(set(names) - {group.name for group in GROUPS})
    if unknown:
        raise ValueError(f"unknown group {unknown[0]!r}; known: {', '.join(group.name for group in GROUPS)}")
    return [group for group in GROUPS if not names or group.name in names]


@command
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = ", ".join(group.name for group in GROUPS)
    parser.add_argument("groups", nargs="*", help=f"groups, all by default: {names}")
    parser.add_argument("--planner", default=DEFAULT)
    parser.add_argument("--samples", type=positive, default=200, help="number of runs of a distribution")
    parser.add_argument("--resume", action="store_true", help="keep the runs of an earlier call")
    options = study_options(parser, arguments)
    try:
        corpora, groups = folders(os.environ), selected(options.groups)
    except ValueError as error:
        parser.error(str(error))
    record = options.out / "driven_corpora.jsonl"
    if not options.resume:
        record.unlink(missing_ok=True)
    console = Console(stderr=True)
    results = []
    for group in groups:
        reference = None if group.reference is None else dict([group.reference])
        jobs = [
            job
            for path in group.files(corpora)
            for job in jobs_of_file(path, group.drive, options.planner, options.samples, reference, group=group.name)
        ]
        runs = run_recorded(jobs, record, workers=options.workers, console=console, title=group.name)
        results.append((group, runs))
        with write_atomically(options.out / "driven_corpora.md") as stream:
            stream.write(report(results).encode())
    sys.stdout.write(report(results))


if __name__ == "__main__":
    sys.exit(main())

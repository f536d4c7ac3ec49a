"""Ratios of the times of two commits for scenario suites of third parties, measured in turn on this machine.

Every scenario under `EIDRIVE_CORPORA` is loaded and run to its end with steps of 0.01 s, in one process for each
commit; the processes take turns at each file. With `--processes`, `eidrive run` of both commits is measured as well, as
one process per file. Scenarios that do not end by themselves within `--limit` are omitted. All times are processor
times. A ratio below one means that HEAD is faster. `--csv` writes the times of each file.

    python benchmarks/compare_corpora.py BASE [HEAD] [--match cut-in] [--repeats 2] [--processes] [--csv FILE]
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from statistics import geometric_mean
from typing import NamedTuple

from compare import checkout
from figures import COMMAND, children_time, variables

STEP = 0.01


class Times(NamedTuple):
    """Times of one file with both commits [s], in the processes that run all files, and in separate processes."""

    name: str
    base: float
    head: float
    base_process: float | None = None
    head_process: float | None = None


class Runner:
    """Process that runs scenarios with the package of one checkout."""

    def __init__(self, side: Path) -> None:
        self._process = subprocess.Popen(
            (sys.executable, __file__, "--runner"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=variables(side),
        )

    def seconds(self, path: Path, limit: float) -> float | None:
        """Return the processor time of a scenario [s]; None if it is invalid or does not end by itself."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps([str(path), limit]) + "\n")
        self._process.stdin.flush()
        answer: float | None = json.loads(self._process.stdout.readline())
        return answer

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def answer_requests() -> None:
    """Run the scenarios of the requests on the standard input, and print their processor times [s]."""
    from eidrive_scenario.errors import EidriveError
    from eidrive_scenario.openscenario import load_scenario
    from eidrive_scenario.simulation import RunSettings, Simulation

    for request in sys.stdin:
        path, limit = json.loads(request)
        started = time.process_time()
        try:
            settings = RunSettings(dt=STEP, time_limit=limit)
            result = Simulation(load_scenario(Path(path)), settings=settings).run()
        except EidriveError:
            print("null", flush=True)
            continue
        # Version 0.1.0 names the end reason `end`.
        end = getattr(result, "end_reason", None) or getattr(result, "end", None)
        print(json.dumps(None if end == "time limit" else time.process_time() - started), flush=True)


def process_seconds(path: Path, limit: float, side: Path) -> float:
    """Return the processor time of a process of `eidrive run` of a checkout for a file [s]."""
    command = (*COMMAND, "run", str(path), "--dt", f"{STEP}", "--time-limit", f"{limit}")
    before = children_time()
    subprocess.run(
        command,
        check=False,
        cwd=tempfile.gettempdir(),
        env=variables(side),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    return children_time() - before


def measured(paths: Sequence[Path], base: Path, head: Path, options: argparse.Namespace) -> Iterator[Times]:
    """Yield the times of each file that ends by itself with both commits: the best of the measurements."""
    if options.processes and paths:
        for side in (base, head):
            process_seconds(paths[0], options.limit, side)  # The first process writes the byte code
    with closing(Runner(base)) as of_base, closing(Runner(head)) as of_head:
        for path in paths:
            turns = [
                [runner.seconds(path, options.limit) for runner in (of_base, of_head)] for _ in range(options.repeats)
            ]
            completed = [[value for value in values if value is not None] for values in zip(*turns, strict=True)]
            if not all(completed):
                continue
            sides = (base, head) if options.processes else ()
            processes = [process_seconds(path, options.limit, side) for side in sides]
            yield Times(path.stem, *map(min, completed), *processes)


def summary(title: str, pairs: Sequence[tuple[float, float]]) -> str:
    """Return the line with the sums of pairs of times [s] of both commits, and their ratios."""
    base, head = (sum(column) for column in zip(*pairs, strict=True))
    ratios = [b / a for a, b in pairs]
    return (
        f"{title:24}{base:9.2f} s{head:9.2f} s   ratio of the sums {head / base:.3f}, "
        f"geometric mean of the ratios {geometric_mean(ratios):.3f} ({min(ratios):.2f} to {max(ratios):.2f})"
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("base", nargs="?", help="commit")
    parser.add_argument("head", nargs="?", default="HEAD", help="commit that is compared with it (default: HEAD)")
    parser.add_argument("--match", default="", help="text in the path of the selected files")
    parser.add_argument("--limit", type=float, default=60.0, help="maximum simulated time of a scenario [s]")
    parser.add_argument("--repeats", type=int, default=2, help="number of measurements of each file (default: 2)")
    parser.add_argument("--processes", action="store_true", help="measure processes of `eidrive run`, too")
    parser.add_argument("--csv", type=Path, help="file for the times of each file")
    parser.add_argument("--runner", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.runner:
        answer_requests()
        return
    folder = os.environ.get("EIDRIVE_CORPORA")
    if not options.base or not folder or options.repeats < 1:
        sys.exit("compare_corpora: BASE, EIDRIVE_CORPORA, and at least one measurement are required")
    paths = [path for path in sorted(Path(folder).resolve().rglob("*.xosc")) if options.match in str(path)]
    with checkout(options.base) as base, checkout(options.head) as head:
        table = list(measured(paths, base, head, options))
    if not table:
        sys.exit("compare_corpora: no scenario ends by itself with both commits")
    print(f"{len(table)} scenarios that end by themselves, dt {STEP:g}, {options.base} and {options.head}")
    print(summary("one process", [(row.base, row.head) for row in table]))
    processes = [
        (row.base_process, row.head_process)
        for row in table
        if row.base_process is not None and row.head_process is not None
    ]
    if processes:
        print(summary("one process per file", processes))
    if options.csv:
        with options.csv.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(["scenario", "base_s", "head_s", "base_process_s", "head_process_s"])
            writer.writerows(table)


if __name__ == "__main__":
    main()

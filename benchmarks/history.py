"""Add the figures of the current commit to `benchmarks/history.csv`.

Each line names commit, its date, the processor, the speed of one core while the figures were measured, and the figures,
each the best of its measurements. The speed of the core is that of a loop of plain Python, in millions of rounds per
second: lines of different speeds differ for that reason, too. `benchmarks/compare.py` compares commits.

    python benchmarks/history.py [--repeats 3] [--file benchmarks/history.csv]
"""

from __future__ import annotations

import argparse
import csv
import platform
import sys
import time
from pathlib import Path
from statistics import median

from compare import git
from figures import FIGURES, HERE, available, best, line

FILE = HERE / "history.csv"
ROUNDS = 3_000_000


def core_speed() -> float:
    """Return the speed of a loop of plain Python [million rounds per s of processor time]."""
    started = time.process_time()
    total = 0
    for number in range(ROUNDS):
        total += number * number % 7
    return ROUNDS / (time.process_time() - started) / 1e6


def processor() -> str:
    """Return the name of the processor."""
    path = Path("/proc/cpuinfo")
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    names = (entry.partition(":")[2].strip() for entry in lines if entry.startswith("model name"))
    return next(names, platform.processor() or platform.machine())


def columns() -> list[str]:
    """Return the names of the columns."""
    figures = [f"{name} [{figure.unit}]" for name, figure in FIGURES.items()]
    return ["commit", "committed", "processor", "python", "core speed [1e6/s]", *figures]


def add_row(file: Path, row: list[str]) -> None:
    """Append a line to the file. Raise SystemExit if the file has other columns."""
    is_new = not file.exists()
    if not is_new:
        with file.open(newline="", encoding="utf-8") as stream:
            if (header := next(csv.reader(stream), None)) != columns():
                sys.exit(f"{file}: other columns than those of the figures ({header}); rename the file or its columns")
    with file.open("a", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        if is_new:
            writer.writerow(columns())
        writer.writerow(row)


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--file", type=Path, default=FILE)
    options = parser.parse_args()
    if git("status", "--porcelain", "--untracked-files=no"):
        sys.exit("the checkout has changes; commit them, so that the line belongs to a commit")
    commit, date = git("log", "-1", "--format=%H %cI").split()
    speeds, values = [core_speed()], dict.fromkeys(FIGURES, "")
    for name in available():
        value = best(name, options.repeats)
        values[name] = "" if value is None else f"{value:.4g}"
        print(line(name, value), flush=True)
        speeds.append(core_speed())
    row = [commit[:12], date, processor(), platform.python_version(), f"{median(speeds):.1f}", *values.values()]
    add_row(options.file, row)
    print(f"wrote {options.file}")


if __name__ == "__main__":
    main()

"""Ratios of the figures of two commits, which are measured in turn on this machine.

Both commits are checked out to temporary folders, and measured by the scripts of this checkout. A ratio above one means
that HEAD is better. Each figure is the best of its measurements; the range is that of the ratios of measurements made
directly one after the other: its width is the effect of other load.

    python benchmarks/compare.py BASE [HEAD] [--figures NAME ...] [--repeats 3]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from figures import FIGURES, ROOT, available, better, measure


def git(*arguments: str) -> str:
    """Return the output of git in this repository. Raise SystemExit with its message if it fails."""
    done = subprocess.run(("git", "-C", str(ROOT), *arguments), check=False, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"git {arguments[0]}: {done.stderr.strip()}")
    return done.stdout.strip()


@contextmanager
def checkout(revision: str) -> Iterator[Path]:
    """Yield a temporary folder with the files of a commit."""
    commit = git("rev-parse", "--verify", f"{revision}^{{commit}}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / commit[:8]
        git("worktree", "add", "--detach", str(path), commit)
        try:
            yield path
        finally:
            git("worktree", "remove", "--force", str(path))


def gain(name: str, base: float, head: float) -> float:
    """Return the ratio of two figures, above one if `head` is better."""
    return base / head if FIGURES[name].is_less else head / base


def pairs(name: str, base: Path, head: Path, repeats: int) -> list[tuple[float, float]]:
    """Return the figures of both checkouts, measured in turn; empty if one of them has none."""
    figure_pairs = []
    for number in range(repeats):
        sides = (base, head) if number % 2 == 0 else (head, base)
        values = {side: value for side in sides if (value := measure(name, side)) is not None}
        if len(values) < len(sides):
            return []
        figure_pairs.append((values[base], values[head]))
    return figure_pairs


def comparison(name: str, measured: list[tuple[float, float]]) -> str:
    """Return the line of a figure."""
    if not measured:
        return f"{name:20}{'no figure of one of the commits':>40}"
    base, head = (better(name, values) for values in zip(*measured, strict=True))
    ratios = [gain(name, *pair) for pair in measured]
    return (
        f"{name:20}{base:12.4g}{head:12.4g}  {FIGURES[name].unit:24}{gain(name, base, head):6.2f}"
        f"   ({min(ratios):.2f} to {max(ratios):.2f})"
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("base", help="commit")
    parser.add_argument("head", nargs="?", default="HEAD", help="commit that is compared with it (default: HEAD)")
    parser.add_argument("--figures", nargs="+", default=(), help="figures (default: all)")
    parser.add_argument("--repeats", type=int, default=3, help="number of measurements of each (default: 3)")
    options = parser.parse_args()
    if options.repeats < 1:
        parser.error("--repeats must be at least 1")
    names = available(options.figures)
    with checkout(options.base) as base, checkout(options.head) as head:
        print(f"{'figure':20}{base.name:>12}{head.name:>12}  {'unit':24} ratio   (range)")
        for name in names:
            print(comparison(name, pairs(name, base, head, options.repeats)), flush=True)


if __name__ == "__main__":
    main()

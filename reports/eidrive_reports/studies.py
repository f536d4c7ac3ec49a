"""Tables of the studies as Markdown, and what their commands have in common."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, Protocol, TypeVar

from eidrive_scenario.api.common import EidriveError, InputError, write_atomically

T = TypeVar("T")


def markdown_table(titles: Sequence[str], lines: Iterable[Iterable[object]]) -> str:
    """Return a table as Markdown, with the text of each cell."""
    escaped = ([str(cell).replace("|", "\\|") for cell in cells] for cells in (titles, *lines))
    header, *rest = [f"| {' | '.join(cells)} |\n" for cells in escaped]
    return "".join([header, "|---" * len(titles) + "|\n", *rest])


def group_by(runs: Iterable[T], key: Callable[[T], Any]) -> dict[Any, list[T]]:
    """Return runs by their key, in the order of the first ones."""
    groups: dict[Any, list[T]] = {}
    for run in runs:
        groups.setdefault(key(run), []).append(run)
    return groups


def publish(text: str, path: Path) -> None:
    """Write the result of a study to a file and to the standard output."""
    with write_atomically(path) as stream:
        stream.write(text.encode())
    sys.stdout.write(text)


def positive(text: str) -> int:
    """Return the positive number of an option. Raise ArgumentTypeError for any other text."""
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"not a positive number (got {text})")
    return int(text)


def check_different(parser: argparse.ArgumentParser, names: Sequence[str]) -> None:
    """End with an error of the options if two files have one name, as each result is named after its file."""
    if (twice := next((name for name in names if names.count(name) > 1), None)) is not None:
        parser.error(f"two files have the name {twice}: the results have one entry per name")


class Command(Protocol):
    def __call__(self, arguments: Sequence[str] | None = None) -> int: ...


def command(main: Callable[[Sequence[str] | None], None]) -> Command:
    """Return a command that prints errors. Exit codes: 0 completed, 2 invalid input, 3 aborted."""

    @wraps(main)
    def run(arguments: Sequence[str] | None = None) -> int:
        try:
            main(arguments)
        except EidriveError as error:
            sys.stderr.write(f"{error}\n")
            return 2 if isinstance(error, InputError) else 3
        return 0

    return run


def study_options(
    parser: argparse.ArgumentParser, arguments: Sequence[str] | None, *, seeds: int | None = None, out: str = "reports"
) -> argparse.Namespace:
    """Return the options of a study, with `--out` and `--workers` in addition, and create the folder of its results.

    seeds  default of the option `--seeds`; None for a study without it
    out    default of `--out`
    """
    parser.add_argument("--out", type=Path, default=Path(out))
    if seeds is not None:
        parser.add_argument("--seeds", type=positive, default=seeds, help="number of seeds, from 1")
    parser.add_argument("--workers", type=positive, default=None, help="processes; all cores by default")
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    return options

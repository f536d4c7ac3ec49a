"""Wall limit of each run, and handling of uninterruptible runs.

A run that returns to the interpreter fails like any other. Code that does not return ends its process after a grace
period. A worker of pytest-xdist is replaced, and its test fails with the report of the worker. Without workers the
session ends.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from argparse import ArgumentTypeError
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import IO, Any

import pytest

from eidrive_scenario.exit_codes import ABORTED
from eidrive_scenario.wall_limit import LastResort, Limit, set_last_resort

USUAL_LIMIT = 1800.0
"""Default of the ini option `eidrive_wall_limit` [s]."""
_NO_LIMIT = "none"
_WORKER_KEY = "eidrive_hung_runs"
_reports = pytest.StashKey[Path]()
"""Folder of the reports of workers."""
_limit = pytest.StashKey["float | None"]()
_before = pytest.StashKey["LastResort | None"]()
_file = pytest.StashKey["IO[Any]"]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the command line option and the ini option of the wall limit."""
    group = parser.getgroup("eidrive", "OpenSCENARIO files")
    group.addoption(
        "--eidrive-wall-limit",
        metavar="SECONDS|none",
        type=_seconds,
        help=f"maximum wall time of each run (default: the ini option eidrive_wall_limit, or {USUAL_LIMIT:g})",
    )
    parser.addini(
        "eidrive_wall_limit",
        f"maximum wall time of each run in seconds, or none (default: {USUAL_LIMIT:g})",
        default=None,
    )


def pytest_configure(config: pytest.Config) -> None:
    """Read the limit, and install the handler of uninterruptible runs in this process."""
    config.stash[_limit] = _given_limit(config)
    workerinput = getattr(config, "workerinput", None)
    if workerinput is not None:
        file: IO[Any] = (Path(workerinput[_WORKER_KEY]) / workerinput["workerid"]).open("wb", buffering=0)
    else:
        try:
            file = os.fdopen(os.dup(2), "wb", buffering=0)
        except OSError:  # the process has no standard error
            return
    config.stash[_file] = file
    publish = None if workerinput is None else _Notes(Path(workerinput[_WORKER_KEY]) / workerinput["workerid"])
    dump = None if _has_faulthandler_timeout(config) else file
    config.stash[_before] = set_last_resort(LastResort(_Reporter(file), dump, publish))


def pytest_unconfigure(config: pytest.Config) -> None:
    """Undo `pytest_configure`."""
    if _file in config.stash:
        set_last_resort(config.stash[_before])
        config.stash[_file].close()
    if _reports in config.stash:
        shutil.rmtree(config.stash[_reports], ignore_errors=True)


def pytest_configure_node(node: Any) -> None:
    """Send the folder of reports to a worker of pytest-xdist."""
    if _reports not in node.config.stash:
        node.config.stash[_reports] = Path(tempfile.mkdtemp(prefix="eidrive-hung-runs-"))
    node.workerinput[_WORKER_KEY] = str(node.config.stash[_reports])


@pytest.hookimpl(optionalhook=True)
def pytest_handlecrashitem(crashitem: str, report: pytest.TestReport) -> None:
    """Add the report of an ended worker to the report of its test."""
    node: Any = getattr(report, "node", None)
    if node is None or _WORKER_KEY not in node.workerinput:
        return
    file = Path(node.workerinput[_WORKER_KEY]) / node.gateway.id
    text = file.read_text(errors="replace").strip() if file.is_file() else ""
    if text.startswith("Timeout"):
        from eidrive_scenario.simulation.hung_runs import describe_dump

        limit = node.config.stash[_limit] or 0.0
        notes = _Notes(file).read()
        text = "\n".join([str(describe_dump(limit, text)), *notes, "", text])
    if text:
        report.longrepr = f"{text}\n\n{report.longrepr}"


def wall_limit_of(config: pytest.Config) -> float | None:
    """Return the limit of the wall time of each run [s], or None."""
    return config.stash[_limit]


class _Notes:
    """Notes of the run in progress, in a file beside the report of its worker."""

    def __init__(self, report: Path) -> None:
        self._path = report.with_name(f"{report.name}.notes")

    def __call__(self, limit: Limit) -> None:
        with suppress(OSError):  # notes are optional
            self._path.write_text("\n".join(limit.notes), encoding="utf-8", errors="surrogateescape")

    def read(self) -> list[str]:
        """Return the notes; empty before the first run."""
        if not self._path.is_file():
            return []
        return self._path.read_text(encoding="utf-8", errors="replace").splitlines()


class _Reporter:
    """Callable that writes the report of an uninterruptible run to a file and ends the process."""

    def __init__(self, file: IO[Any]) -> None:
        self._file = file

    def __call__(self, limit: Limit, frame: FrameType | None) -> None:
        from eidrive_scenario.simulation.hung_runs import describe_hung_run

        try:
            report = "\n".join([str(describe_hung_run(limit, frame)), *limit.notes])
            self._file.write(f"{report}\n".encode(errors="replace"))
            sys.stdout.flush()
        finally:
            os._exit(ABORTED)


def _given_limit(config: pytest.Config) -> float | None:
    given = config.getoption("eidrive_wall_limit")
    if given is not None:
        return None if given == _NO_LIMIT else float(given)
    text = config.getini("eidrive_wall_limit")
    if text is None:
        return USUAL_LIMIT
    try:
        seconds = _seconds(str(text))
    except ArgumentTypeError as error:
        raise pytest.UsageError(f"eidrive_wall_limit: {error}") from None
    return None if seconds == _NO_LIMIT else float(seconds)


def _seconds(text: str) -> float | str:
    if text.strip() == _NO_LIMIT:
        return _NO_LIMIT
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0.0 < seconds < float("inf"):
        raise ArgumentTypeError(f"not a positive number of seconds or none (got {text!r})")
    return seconds


def _has_faulthandler_timeout(config: pytest.Config) -> bool:
    """True if pytest uses the only faulthandler timer of the process."""
    try:
        return float(config.getini("faulthandler_timeout") or 0.0) > 0.0
    except (KeyError, ValueError):
        return False

"""Wall limit of each run, and handling of uninterruptible runs.

A run that returns to the interpreter fails like any other. Code that does not return ends its process after a grace
period. A worker of pytest-xdist is replaced, and its test fails with the report of the worker. Without workers the
session ends.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import IO, Any

import pytest

from eidrive_scenario.exit_codes import ABORTED
from eidrive_scenario.pytest_plugin.run_records import RunRecord, add_notes
from eidrive_scenario.wall_limit import LastResort, Limit, set_last_resort

USUAL_LIMIT = 1800.0
"""Default wall limit of each run [s]."""
WAIT = 5.0
"""Maximum duration from the end of the output of a worker to that of its process [s]."""
_WORKER_KEY = "eidrive_hung_runs"
_reports = pytest.StashKey[Path]()
"""Folder of the reports of workers."""
_limit = pytest.StashKey["float | None"]()
_before = pytest.StashKey["LastResort | None"]()
_file = pytest.StashKey["IO[Any]"]()


def configure(config: pytest.Config, limit: float | str) -> None:
    """Store the limit of each run [s], or `none`, and install the handler of uninterruptible runs in this process."""
    config.stash[_limit] = None if isinstance(limit, str) else limit
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
    """Undo `configure`."""
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
    """Add the report of an ended worker to the report of its test.

    A scenario file that ends its worker is an error, as its verdict is unknown; a test in Python is a failure.
    """
    node: Any = getattr(report, "node", None)
    if node is None or _WORKER_KEY not in node.workerinput:
        return
    file = Path(node.workerinput[_WORKER_KEY]) / node.gateway.id
    text = file.read_text(errors="replace").strip() if file.is_file() else ""
    notes = _Notes(file).read()
    if text.startswith("Timeout"):
        from eidrive_scenario.simulation.hung_runs import describe_dump

        limit = node.config.stash[_limit] or 0.0
        text = "\n".join([str(describe_dump(limit, text)), *notes, "", text])
    elif not text:
        end = _end_of(node)
        if notes:
            text = "\n".join([f"the process of the run {end}", *notes])
        else:
            report.longrepr = f"the process of the test {end}\n\n{report.longrepr}"
    if crashitem.partition("::")[0].endswith(".xosc"):
        report.when = "setup"
    if not text:
        return
    record = RunRecord(reasons=[text.splitlines()[0]])
    add_notes(record, dict.fromkeys([*text.splitlines(), *notes]))
    report.eidrive, report.eidrive_is_crash = record.as_report(), True  # type: ignore[attr-defined]
    report.longrepr = f"{text}\n\n{report.longrepr}"


def _end_of(node: Any) -> str:
    """Return how the process of a worker ended."""
    try:
        code = node.gateway._io.popen.wait(WAIT)
    except (AttributeError, subprocess.TimeoutExpired):  # a worker on another machine, or another version of execnet
        return "ended: it was killed, or native code crashed"
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"was ended by {signal.Signals(-code).name}"
    except ValueError:
        return f"was ended by signal {-code}"


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


def _has_faulthandler_timeout(config: pytest.Config) -> bool:
    """True if pytest uses the only faulthandler timer of the process."""
    try:
        return float(config.getini("faulthandler_timeout") or 0.0) > 0.0
    except (KeyError, ValueError):
        return False

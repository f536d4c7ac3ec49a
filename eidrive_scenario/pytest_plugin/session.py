"""Beginning and end of a session: options, project, and the handling of uninterruptible runs.

A run that returns to the interpreter fails like any other at its wall limit. Code that does not return ends its process
after a grace period. A worker of pytest-xdist is replaced, and its test fails with the report of the worker. Without
workers the session ends.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import pytest

from eidrive_scenario.base.wall_limit import LastResort, Limit, set_last_resort, signal_name
from eidrive_scenario.errors import InputError, WallLimitError
from eidrive_scenario.experiments.hung_runs import describe_report, last_resort
from eidrive_scenario.pytest_plugin import markers
from eidrive_scenario.pytest_plugin.failures import RunRecord, add_notes
from eidrive_scenario.pytest_plugin.options import add_options, read_options, send_paths, wall_limit
from eidrive_scenario.pytest_plugin.reports import register_attachments

WAIT = 5.0
"""Maximum duration from the end of the output of a worker to that of its process [s]."""
_WORKER_KEY = "eidrive_hung_runs"
_reports = pytest.StashKey[Path]()
"""Folder of the reports of workers."""
_before = pytest.StashKey[LastResort | None]()
_file = pytest.StashKey["IO[Any]"]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options `--eidrive-…` and the ini options."""
    add_options(parser)
    markers.add_ini_option(parser)


@pytest.hookimpl(tryfirst=True)
def pytest_load_initial_conftests(early_config: pytest.Config) -> None:
    """Select the project of the root, as `eidrive` does, before a `conftest.py` registers further extensions."""
    from eidrive_scenario.extensions.project import VARIABLE, select_project

    if VARIABLE in os.environ:
        return
    try:
        select_project(early_config.rootpath)
    except InputError as error:
        raise pytest.UsageError(str(error)) from None

    def restore() -> None:
        os.environ.pop(VARIABLE, None)

    early_config.add_cleanup(restore)


def pytest_configure(config: pytest.Config) -> None:
    """Declare the markers, check the values of all options, and install the handler of uninterruptible runs."""
    markers.declare(config)
    read_options(config)
    register_attachments(config)
    workerinput = getattr(config, "workerinput", None)
    publish = None
    if workerinput is not None:
        report = Path(workerinput[_WORKER_KEY]) / workerinput["workerid"]
        file: IO[Any] = report.open("wb", buffering=0)
        publish = _Notes(report)
    else:
        try:
            file = os.fdopen(os.dup(2), "wb", buffering=0)
        except OSError:  # the process has no standard error
            return
    config.stash[_file] = file

    def write(error: WallLimitError) -> None:
        file.write("\n".join([str(error), *getattr(error, "__notes__", ()), ""]).encode(errors="replace"))

    dump = None if _has_faulthandler_timeout(config) else file
    config.stash[_before] = set_last_resort(last_resort(write, dump, publish))


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Send the paths of the command line and the folder of reports to a worker of pytest-xdist."""
    if _reports not in node.config.stash:
        node.config.stash[_reports] = Path(tempfile.mkdtemp(prefix="eidrive-hung-runs-"))
    node.workerinput[_WORKER_KEY] = str(node.config.stash[_reports])
    send_paths(node)


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the handler and the reports of uninterruptible runs."""
    if _file in config.stash:
        set_last_resort(config.stash[_before])
        config.stash[_file].close()
    if _reports in config.stash:
        shutil.rmtree(config.stash[_reports], ignore_errors=True)


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
    if (described := describe_report(text, wall_limit(node.config))) != text:
        text = "\n".join([described, *notes, "", text])
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
    return f"ended with exit code {code}" if code >= 0 else f"was ended by {signal_name(-code)}"


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


def _has_faulthandler_timeout(config: pytest.Config) -> bool:
    """True if pytest uses the only faulthandler timer of the process."""
    try:
        return float(config.getini("faulthandler_timeout") or 0.0) > 0.0
    except (KeyError, ValueError):
        return False

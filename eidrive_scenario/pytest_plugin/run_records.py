"""Records of the runs of a test: its properties, and what CI systems show of a failure."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from eidrive_scenario.errors import ExtensionError, InputError

if TYPE_CHECKING:
    from eidrive_scenario.simulation import RunResult

_SECTION = "eidrive"
"""Title of the sections of test reports with failed runs."""
_COMMAND = "reproduce: "
_RECORDING = "recording: "
_records = pytest.StashKey["RunRecord"]()


@dataclass
class RunRecord:
    """Facts about the runs of a test, most of them about those that did not pass.

    properties   entries of `user_properties` that the plugin has added
    reasons      one line for each reason
    commands     command lines that reproduce the runs
    attachments  recordings and results
    folders      folders of the files of all runs
    file, line   place of the first reason; line 0 if it is unknown
    """

    properties: list[tuple[str, object]] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    commands: list[str] = field(default_factory=list)
    attachments: list[str] = field(default_factory=list)
    folders: list[str] = field(default_factory=list)
    file: str = ""
    line: int = 0

    def as_report(self) -> dict[str, Any]:
        """Return the facts in types that pytest-xdist sends to its controller."""
        return {
            "reasons": self.reasons,
            "commands": self.commands,
            "attachments": self.attachments,
            "folders": self.folders,
            "file": self.file,
            "line": self.line,
        }

    def place_at(self, file: str | Path, line: int | None) -> None:
        """Set the place unless an earlier reason has set it."""
        if not self.file:
            self.file, self.line = str(file), line or 0


def record_of(item: pytest.Item) -> RunRecord:
    """Return the record of a test, which is empty before its first run."""
    if _records not in item.stash:
        item.stash[_records] = RunRecord()
    return item.stash[_records]


def add_properties(item: pytest.Item, entries: Iterable[tuple[str, object]]) -> None:
    """Add properties to the report of a test."""
    added = list(entries)
    record_of(item).properties.extend(added)
    item.user_properties.extend(added)


def add_failed_run(item: pytest.Item, result: RunResult, file: Path) -> None:
    """Record a run whose verdict is failed, or that is out of time."""
    from eidrive_scenario.pytest_plugin.criterion_lines import line_of_criterion
    from eidrive_scenario.pytest_plugin.failure_text import reasons

    record = record_of(item)
    record.reasons += reasons(result)
    record.commands += [result.command] if result.command else []
    if result.recording is not None:
        record.attachments.append(str(result.recording))
    if result.folder is not None:
        record.attachments.append(str(result.folder / "result.json"))
    failed = [verdict.name for verdict in result.criteria if not verdict.passed]
    record.place_at(file, line_of_criterion(file, failed[0]) if failed else None)


def add_error(item: pytest.Item, error: BaseException, file: Path) -> None:
    """Record a run that was not started or was aborted."""
    record = record_of(item)
    if isinstance(error, InputError):
        first = error.diagnostics[0]
        record.place_at(first.source if Path(first.source).is_file() else file, first.line)
    if isinstance(error, ExtensionError) and error.place.file:
        record.place_at(error.place.file, error.place.line)
    record.place_at(file, None)
    record.reasons += (str(error) or type(error).__name__).splitlines()
    add_notes(record, getattr(error, "__notes__", []))


def add_notes(record: RunRecord, notes: Iterable[str]) -> None:
    """Record the command and the recording that notes of an aborted run contain."""
    for note in notes:
        if note.startswith(_COMMAND):
            record.commands.append(note.removeprefix(_COMMAND))
        elif note.startswith(_RECORDING):
            record.attachments.append(note.removeprefix(_RECORDING))


def add_section(item: pytest.Item, text: str) -> None:
    """Add a text about a failed run to the report of a test."""
    item.add_report_section("call", _SECTION, text)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Remove the records of an earlier attempt, such as those of pytest-rerunfailures."""
    if _records not in item.stash:
        return
    earlier = {id(entry) for entry in item.stash[_records].properties}
    item.user_properties[:] = [entry for entry in item.user_properties if id(entry) not in earlier]
    sections: list[tuple[str, str, str]] = getattr(item, "_report_sections", [])
    sections[:] = [section for section in sections if section[1] != _SECTION]
    del item.stash[_records]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add the records of a test to its reports; workers of pytest-xdist send them to the controller."""
    report = yield
    if _records in item.stash:
        report.eidrive = item.stash[_records].as_report()  # type: ignore[attr-defined]
    return report

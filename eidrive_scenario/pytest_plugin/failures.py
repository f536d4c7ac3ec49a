"""Records of the runs of a test, and the texts about those that failed: reasons, commands, places."""

from __future__ import annotations

import re
from collections.abc import Generator, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from eidrive_scenario.errors import ABORTED, NOT_JUDGED, EidriveError, ExtensionError, InputError, counted
from eidrive_scenario.files.bounded import MIB, read_regular_file
from eidrive_scenario.files.encodable import encodable, printable

if TYPE_CHECKING:
    from eidrive_scenario.evaluation import Verdict
    from eidrive_scenario.experiments.success_rate import RateVerdict
    from eidrive_scenario.simulation import RunResult


_SECTION = "eidrive"
"""Title of the sections of test reports with failed runs."""
_COMMAND = "reproduce: "
_RECORDING = "recording: "
WARNING = "warning"
"""Name of the properties with the warnings of a run."""
_records = pytest.StashKey["RunRecord"]()


@dataclass
class RunRecord:
    """Facts about the runs of a test, most of them about those that did not pass.

    properties   entries of `user_properties` that the plugin has added
    essence      criterion, value and instant of the first failed run, in a few words
    reasons      one line for each reason, and those of the state at the first violation
    commands     command lines that reproduce the runs
    attachments  recordings and results
    folders      folders of the files of all runs
    file, line   place of the first reason; line 0 if it is unknown
    """

    properties: list[tuple[str, object]] = field(default_factory=list)
    essence: str = ""
    reasons: list[str] = field(default_factory=list)
    commands: list[str] = field(default_factory=list)
    attachments: list[str] = field(default_factory=list)
    folders: list[str] = field(default_factory=list)
    file: str = ""
    line: int = 0

    def as_report(self) -> dict[str, Any]:
        """Return the facts in types that pytest-xdist sends to its controller."""
        return {name: value for name, value in vars(self).items() if name != "properties"}

    def place_at(self, file: str | Path, line: int | None) -> None:
        """Set the place unless an earlier reason has set it."""
        if not self.file:
            self.file, self.line = str(file), line or 0


def record_of(item: pytest.Item) -> RunRecord:
    """Return the record of a test, which is empty before its first run."""
    return item.stash.setdefault(_records, RunRecord())


def add_properties(item: pytest.Item, entries: Iterable[tuple[str, object]]) -> None:
    """Add properties to the report of a test."""
    added = [(printable(name), value) for name, value in entries]  # pytest writes names to JUnit files as they are
    record_of(item).properties.extend(added)
    item.user_properties.extend(added)


def add_failures(item: pytest.Item, result: RunResult | RateVerdict, file: Path) -> None:
    """Record a run that did not pass, or the first failed runs of a test of the success rate; nothing if it passed."""
    record = record_of(item)
    for failure in failures_of(result):
        record.essence = record.essence or essence(result)
        record.reasons += reasons(failure)
        record.commands += [failure.command] if failure.command else []
        if failure.recording is not None:
            record.attachments.append(str(failure.recording))
        if failure.folder is not None:
            record.attachments.append(str(failure.folder / "result.json"))
        failed = [verdict.name for verdict in failure.criteria if not verdict.passed]
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


@pytest.hookimpl(wrapper=True)
def pytest_report_teststatus(report: Any, config: pytest.Config) -> Generator[None, Any, Any]:
    """Add the essence of a failed run to the word for its outcome, if the short summary would cut the reason.

    pytest cuts what follows the name of the test at the width of the terminal, and a name may have that width.
    """
    status = yield
    text = printable(getattr(report, "eidrive", {}).get("essence", ""))
    if not text or status is None or status[0] not in ("failed", "error"):
        return status
    category, letter, word = status
    name, *style = word if isinstance(word, tuple) else (word,)
    fits = len(f"{name} {report.nodeid} - {text}") + len("...") <= config.get_terminal_writer().fullwidth
    if not (fits and str(report.longrepr).startswith(text)):
        name = f"{name} ({text})"
    return category, letter, (name, *style) if style else name


_SHOWN_FAILURES = 5
"""Number of failed runs that a failed test of the success rate explains."""


class ScenarioFailed(Exception):
    """Failed verdict of a run."""

    def __init__(self, result: RunResult | RateVerdict) -> None:
        super().__init__(explain_outcome(result))
        self.result = result


def explain_outcome(result: RunResult | RateVerdict) -> str:
    """Return the reason of a failed run, or of a failed or undecided test of the success rate with its first ones."""
    from eidrive_scenario.simulation import RunResult

    if isinstance(result, RunResult):
        return printable(explain(result))
    shown = [explain(failure) for failure in failures_of(result)]
    more = len(result.failures) - len(shown)
    return printable("\n\n".join([str(result), *shown, *([f"and {counted(more, 'more failed run')}"] if more else [])]))


def explain(result: RunResult) -> str:
    """Return the reasons of a failed run, the last state of its storyboard, the command that repeats it, and its
    recording.

    The first line is the first reason, because the short summary of pytest shows its beginning.
    """
    from eidrive_scenario.experiments.commands import reproduction_lines
    from eidrive_scenario.recording.text.run_log import LAST_DECISION

    run = "" if result.run is None else f"run {result.run} of "
    outcome = "is not judged" if result.exit_code == NOT_JUDGED else "failed"
    head = f"{run}{result.scenario} {outcome} with channel {result.channel}, seed {result.seed}"
    state: Iterable[str] = result.final_state
    if not has_no_verdict(result):  # Decisions are those at the first violation
        state = (line for line in state if not line.startswith(LAST_DECISION))
    return "\n".join([*reasons(result), head, *state, *reproduction_lines(result)])


def reasons(result: RunResult) -> list[str]:
    """Return lines for each failed criterion, the state at its first violation included, and the reason of a run
    without a verdict."""
    lines: list[str] = []
    for verdict in result.criteria:
        if not verdict.passed:
            lines.append(f"{essential_facts(verdict)}: {verdict.reason}")
            lines += [f"  {line}" for line in verdict.violation_state]
    if not lines or has_no_verdict(result):
        lines.append(_reason_without_verdict(result))
    return lines


def essence(result: RunResult | RateVerdict) -> str:
    """Return criterion, value, limit and instant of the first failed criterion of a run, or why it has none; the number
    of passed runs of a test of the success rate."""
    from eidrive_scenario.simulation import RunResult

    if not isinstance(result, RunResult):
        return f"{result.rate.successes} of {counted(result.rate.trials, 'run')} passed"
    failed = next((verdict for verdict in result.criteria if not verdict.passed), None)
    if failed is not None:
        return essential_facts(failed)
    return "not judged" if result.exit_code == NOT_JUDGED else f"{result.end_reason} at {result.simulated_s:.2f} s"


def essential_facts(verdict: Verdict) -> str:
    """Return `min_distance 0 m, limit 3 m, first violated at 1.75 s` of a failed verdict."""
    value = "" if verdict.value is None else f" {verdict.value:.4g} {verdict.unit}".rstrip()
    limit = "" if verdict.limit is None else f", limit {verdict.limit:.4g} {verdict.unit}".rstrip()
    violation = verdict.first_violation
    instant = "at the end" if violation is None else f"first violated at {violation:.2f} s"
    return f"{verdict.name}{value}{limit}, {instant}"


def has_no_verdict(result: RunResult | RateVerdict) -> bool:
    """Whether a single run has reached its limit of simulated time before a criterion failed, or has no criterion."""
    return getattr(result, "exit_code", None) in (ABORTED, NOT_JUDGED)


def failures_of(result: RunResult | RateVerdict) -> list[RunResult]:
    """Return the failed runs that a report explains; none for a passed test."""
    from eidrive_scenario.simulation import RunResult

    if result.passed:
        return []
    return [result] if isinstance(result, RunResult) else list(result.failures[:_SHOWN_FAILURES])


def _reason_without_verdict(result: RunResult) -> str:
    if result.exit_code == NOT_JUDGED:
        from eidrive_scenario.simulation.run_outcome import UNJUDGED

        return (
            f"{UNJUDGED}; add one to the scenario or by --eidrive-criterion '{{collision: {{of: Ego}}}}', or set the "
            "ini option eidrive_without_criteria to warn or pass"
        )
    return f"ended by its {result.end_reason} after {result.simulated_s:.2f} s"


def failure_text(error: BaseException) -> str | None:
    """Return the text of a failure without traceback, or None for an error that requires a traceback."""
    if isinstance(error, ScenarioFailed | InputError):
        return printable(str(error))
    notes: list[str] = getattr(error, "__notes__", [])
    if isinstance(error, OSError) and notes:
        return printable("\n".join([f"aborted: {error}", *notes]))
    if not isinstance(error, EidriveError):
        return None
    lines = [str(error), *notes]
    if isinstance(error, ExtensionError):
        from eidrive_scenario.simulation.attribution import traceback_from_extension

        lines += ["", encodable(traceback_from_extension(error))]
    return printable("\n".join(lines).rstrip())


_CRITERION = "eidrive.criterion"
_END = "</CustomCommandAction>"
_MAX_BYTES = 16 * MIB


def line_of_criterion(file: Path, name: str) -> int | None:
    """Return the line of the first command that declares criteria and contains the name, from 1; None without one."""
    try:
        lines = read_regular_file(file, _MAX_BYTES).decode(errors="replace").splitlines()
    except (OSError, ValueError):
        return None
    word = re.compile(rf"(?<!\w){re.escape(name)}(?!\w)")
    is_inside = False
    for number, line in enumerate(lines, 1):
        is_inside = is_inside or _CRITERION in line
        if is_inside and word.search(line.partition(_CRITERION)[2] if _CRITERION in line else line):
            return number
        if _END in line:
            is_inside = False
    return None

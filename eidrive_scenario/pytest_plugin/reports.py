"""Reports of a session: summary, page of its runs, JUnit attachments, annotations and summary of GitHub Actions."""

from __future__ import annotations

import os
import re
from collections.abc import Generator, Iterable, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from _pytest.junitxml import xml_key  # the JUnit writer has no public interface for elements of a test case

from eidrive_scenario.errors import InputError
from eidrive_scenario.files.encodable import printable
from eidrive_scenario.pytest_plugin.failures import WARNING
from eidrive_scenario.pytest_plugin.items import show_left_out
from eidrive_scenario.pytest_plugin.options import path_value


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Print the omitted runs and the warnings of all runs, in GitHub Actions the annotations, and write the report."""
    show_left_out(terminalreporter, config)
    show_warnings(terminalreporter)
    show_annotations(terminalreporter, config)
    show_report(terminalreporter, config)


_SHOWN = 20
"""Maximum number of listed warnings; the number of further warnings is printed."""


def show_warnings(terminalreporter: Any) -> None:
    """List the warnings, including those in the reports of pytest-xdist workers."""
    tests: dict[str, list[str]] = {}
    for reports in terminalreporter.stats.values():
        for report in reports:
            when = getattr(report, "when", None)
            if when == "call" or (when == "setup" and report.failed):
                for text in {value for name, value in report.user_properties if name == WARNING}:
                    tests.setdefault(str(text), []).append(report.nodeid)
    if not tests:
        return
    terminalreporter.section("warnings of runs", sep="-", yellow=True)
    for text, nodes in list(tests.items())[:_SHOWN]:
        more = f" and {len(nodes) - 1} more" if len(nodes) > 1 else ""
        terminalreporter.line(printable(f"{nodes[0]}{more}: {text}"))
    if len(tests) > _SHOWN:
        terminalreporter.line(f"{len(tests) - _SHOWN} more are properties of the tests (--junitxml)")


def show_report(terminalreporter: Any, config: pytest.Config) -> None:
    """Write the report about the runs of this session, and print its path and what it omits."""
    page = path_value(config, "report")
    if page is None:
        return
    from eidrive_scenario.reporting.report_files import report_files

    locations = [path for path in _folders(terminalreporter) if path.is_dir()]
    terminalreporter.section("report", sep="-")
    if not locations:
        terminalreporter.line(f"{page}: not written, as no run has kept files")
        return
    try:
        written = report_files(locations, page, warn=lambda text: terminalreporter.line(printable(f"warning: {text}")))
    except InputError as error:
        terminalreporter.line(printable(f"{page}: not written: {error}"), red=True)
        return
    terminalreporter.line(str(written))


def _folders(terminalreporter: Any) -> list[Path]:
    """Return the folders of all runs, including those in the reports of workers of pytest-xdist, each once."""
    folders: dict[Path, None] = {}
    for reports in terminalreporter.stats.values():
        for report in reports:
            facts = _facts(report)
            folders.update(dict.fromkeys(Path(folder) for folder in facts.get("folders", ())))
            folders.update(dict.fromkeys(Path(path).parent for path in facts.get("attachments", ())))
    return list(folders)


_SYSTEM_OUT = "system-out"


def register_attachments(config: pytest.Config) -> None:
    """Add attachments to the JUnit file of this session, if it writes one."""
    if config.getoption("xmlpath", None) and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_Attachments(config), "eidrive_junit_attachments")


def attachment_lines(report: Any) -> list[str]:
    """Return a line for each attachment of a report whose test did not pass."""
    facts = _facts(report)
    project = os.environ.get("CI_PROJECT_DIR")  # of a GitLab job; Jenkins requires absolute paths
    return [f"[[ATTACHMENT|{_path_below(path, project)}]]" for path in facts.get("attachments", ())]


def _path_below(path: str, folder: str | None) -> str:
    """Return a path relative to a folder that contains it, else the absolute path."""
    full = Path(os.path.abspath(path))
    if folder and full.is_relative_to(os.path.abspath(folder)):
        return full.relative_to(os.path.abspath(folder)).as_posix()
    return str(full)


class _Attachments:
    """Plugin that completes the test case of a report when the JUnit writer has closed it."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> Generator[None, object, object]:
        """Append the attachments to `system-out`, which exists only with the ini option `junit_logging`."""
        xml = self._config.stash.get(xml_key, None)
        lines = attachment_lines(report)
        is_last = report.when == "teardown" or getattr(report, "eidrive_is_crash", False)
        if xml is None or not lines or not is_last:
            return (yield)
        reporter = xml.node_reporter(report)
        result = yield
        if report.when != "teardown":  # no further report follows
            reporter.append(_system_out(lines))
            return result
        case: ElementTree.Element = reporter.to_xml()
        existing = case.find(_SYSTEM_OUT)
        if existing is None:
            case.append(_system_out(lines))
        else:
            existing.text = "\n".join([(existing.text or "").rstrip(), *lines, ""])
        return result


def _system_out(lines: list[str]) -> ElementTree.Element:
    element = ElementTree.Element(_SYSTEM_OUT)
    element.text = "\n".join([*lines, ""])
    return element


_PLUGIN = "pytest_github_actions_annotate_failures"
"""Plugin that writes annotations of all tests itself."""
_MOST_ANNOTATIONS = 10
"""Maximum number of error annotations that GitHub shows of one step."""
_MAX_BYTES = 1_000_000
"""Maximum size of the summary of one step; GitHub rejects a file of more than 1 MiB."""
_MAX_REASON = 300
"""Maximum number of characters of a reason in the summary."""
_OUTCOMES = ("passed", "failed", "error", "skipped", "xfailed", "xpassed", "rerun")


def show_annotations(terminalreporter: Any, config: pytest.Config) -> None:
    """Print one error annotation per failed test of a scenario, and append the job summary, in GitHub Actions.

    Workers of pytest-xdist write neither: their controller has all reports.
    """
    if os.environ.get("GITHUB_ACTIONS") != "true" or hasattr(config, "workerinput"):
        return
    reports = _failed(terminalreporter)
    if reports and not config.pluginmanager.hasplugin(_PLUGIN):
        terminalreporter.section("annotations", sep="-")
        for report in reports[:_MOST_ANNOTATIONS]:
            terminalreporter.line(printable(annotation(report, config.rootpath)))
    path = os.environ.get("GITHUB_STEP_SUMMARY")
    if path:
        counts = {outcome: _count(terminalreporter.stats.get(outcome, ())) for outcome in _OUTCOMES}
        try:
            with open(path, "a", encoding="utf-8") as file:
                file.write(summary(counts, reports))
        except OSError as error:
            terminalreporter.line(f"GITHUB_STEP_SUMMARY: the summary is not written ({error})", yellow=True)


def annotation(report: Any, root: Path) -> str:
    """Return the workflow command of one failed test: its place in the scenario file and its reasons."""
    facts = _facts(report)
    file = facts.get("file") or str(root / report.nodeid.split("::")[0])
    workspace = os.environ.get("GITHUB_WORKSPACE") or os.getcwd()  # paths that GitHub maps to the repository
    position = f"file={_property(_path_below(file, workspace))},line={facts.get('line') or 1}"
    return f"::error {position},title={_property(report.nodeid)}::{_data(_text(facts, report))}"


def summary(counts: Mapping[str, int], reports: Iterable[Any]) -> str:
    """Return the job summary as Markdown: the number of tests by outcome, and a table of failed tests."""
    listed = ", ".join(f"{number} {outcome}" for outcome, number in counts.items() if number)
    lines = ["## Scenarios", "", listed or "no tests", ""]
    rows = [
        f"| {_cell(report.nodeid)} | {'error' if report.when != 'call' else 'failed'} | {_cell(reason)} | {command} |"
        for report in reports
        for facts in (_facts(report),)
        for reason in (_short(_text(facts, report)),)
        for command in (_code(facts["commands"][0]) if facts.get("commands") else "",)
    ]
    if rows:
        lines += ["| test | outcome | reason | command |", "|---|---|---|---|"]
    size = len("\n".join(lines).encode())
    for number, line in enumerate(rows):
        size += len(line.encode()) + 1
        if size > _MAX_BYTES:
            lines += ["", f"and {len(rows) - number} more"]
            break
        lines.append(line)
    return "\n".join([*lines, ""])


def _failed(terminalreporter: Any) -> list[Any]:
    """Return the reports of failed tests that run scenarios, each test once."""
    failed: dict[str, Any] = {}
    for outcome in ("failed", "error"):
        for report in terminalreporter.stats.get(outcome, ()):
            if hasattr(report, "eidrive") or ".xosc" in Path(report.nodeid.split("::")[0]).suffixes:
                failed.setdefault(report.nodeid, report)
    return list(failed.values())


def _count(reports: Iterable[Any]) -> int:
    return sum(getattr(report, "count_towards_summary", True) for report in reports)


def _facts(report: Any) -> Mapping[str, Any]:
    facts: Mapping[str, Any] = getattr(report, "eidrive", {})
    return facts


def _text(facts: Mapping[str, Any], report: Any) -> str:
    return "\n".join(facts.get("reasons") or [str(getattr(report, "longrepr", "")).strip() or "failed"])


def _data(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")


def _short(text: str) -> str:
    return text if len(text) <= _MAX_REASON else f"{text[:_MAX_REASON]}…"


def _cell(text: str) -> str:
    """Return a text for a cell of a Markdown table, without markup."""
    escaped = re.sub(r"([\\`*_{}\[\]<>#|~&!])", r"\\\1", text)
    return "<br>".join(escaped.splitlines())


def _code(command: str) -> str:
    """Return a command as code in a cell: HTML, as a vertical bar ends a cell even in backquotes."""
    command = re.sub(r"[&<>|`*_\[\]\\$~]", lambda match: f"&#{ord(match[0])};", command)
    return f"<code>{' '.join(command.splitlines())}</code>"

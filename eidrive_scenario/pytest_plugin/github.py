"""Annotations and job summary of GitHub Actions, with `GITHUB_ACTIONS=true` only."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pytest

from eidrive_scenario.files.encodable import printable

_PLUGIN = "pytest_github_actions_annotate_failures"
"""Plugin that writes annotations of all tests itself."""
_MOST_ANNOTATIONS = 10
"""Maximum number of error annotations that GitHub shows of one step."""
_MAX_BYTES = 1_000_000
"""Maximum size of the summary of one step; GitHub rejects a file of more than 1 MiB."""
_MAX_REASON = 300
"""Maximum number of characters of a reason in the summary."""
_OUTCOMES = ("passed", "failed", "error", "skipped", "xfailed", "xpassed", "rerun")


def is_active() -> bool:
    """Whether the process is a step of GitHub Actions."""
    return os.environ.get("GITHUB_ACTIONS") == "true"


def show_annotations(terminalreporter: Any, config: pytest.Config) -> None:
    """Print one error annotation per failed test of a scenario, and append the job summary.

    Workers of pytest-xdist write neither: their controller has all reports.
    """
    if not is_active() or hasattr(config, "workerinput"):
        return
    reports = _failed(terminalreporter)
    if reports and not config.pluginmanager.hasplugin(_PLUGIN):
        terminalreporter.section("annotations", sep="-")
        for report in reports[:_MOST_ANNOTATIONS]:
            terminalreporter.line(printable(annotation(report, config.rootpath)))
    path = os.environ.get("GITHUB_STEP_SUMMARY")
    if path:
        counts = Counter({outcome: _count(terminalreporter.stats.get(outcome, ())) for outcome in _OUTCOMES})
        try:
            _append(Path(path), summary(counts, reports))
        except OSError as error:
            terminalreporter.line(f"GITHUB_STEP_SUMMARY: the summary is not written ({error})", yellow=True)


def annotation(report: Any, root: Path) -> str:
    """Return the workflow command of one failed test: its place in the scenario file and its reasons."""
    facts = _facts(report)
    file = facts.get("file") or str(root / report.nodeid.split("::")[0])
    place = f"file={_property(_below_workspace(file))},line={facts.get('line') or 1}"
    return f"::error {place},title={_property(report.nodeid)}::{_data(_text(facts, report))}"


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
    for number, row in enumerate(rows):
        size += len(row.encode()) + 1
        if size > _MAX_BYTES:
            lines += ["", f"and {len(rows) - number} more"]
            break
        lines.append(row)
    return "\n".join([*lines, ""])


def _failed(terminalreporter: Any) -> list[Any]:
    """Return the reports of failed tests that run scenarios, each test once."""
    found: dict[str, Any] = {}
    for outcome in ("failed", "error"):
        for report in terminalreporter.stats.get(outcome, ()):
            if hasattr(report, "eidrive") or ".xosc" in Path(report.nodeid.split("::")[0]).suffixes:
                found.setdefault(report.nodeid, report)
    return list(found.values())


def _count(reports: Iterable[Any]) -> int:
    return sum(getattr(report, "count_towards_summary", True) for report in reports)


def _facts(report: Any) -> Mapping[str, Any]:
    facts: Mapping[str, Any] = getattr(report, "eidrive", {})
    return facts


def _text(facts: Mapping[str, Any], report: Any) -> str:
    return "\n".join(facts.get("reasons") or [str(getattr(report, "longrepr", "")).strip() or "failed"])


def _below_workspace(file: str) -> str:
    """Return a path as GitHub maps it to the repository: relative to the workspace."""
    full = Path(os.path.abspath(file))
    workspace = os.environ.get("GITHUB_WORKSPACE")
    base = os.path.abspath(workspace) if workspace else os.getcwd()
    return full.relative_to(base).as_posix() if full.is_relative_to(base) else str(full)


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
    command = re.sub(r"[&<>|`*_\[\]\\$~]", lambda found: f"&#{ord(found[0])};", command)
    return f"<code>{' '.join(command.splitlines())}</code>"


def _append(path: Path, text: str) -> None:
    with path.open("a", encoding="utf-8") as file:
        file.write(text)

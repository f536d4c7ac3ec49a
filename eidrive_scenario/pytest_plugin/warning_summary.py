"""Warnings of all runs in the summary of a test session, each once with the number of its tests."""

from __future__ import annotations

from typing import Any

from eidrive_scenario.files.encodable import printable
from eidrive_scenario.pytest_plugin.outcome import WARNING

_SHOWN = 20
"""Maximum number of listed warnings; the number of further warnings is printed."""


def show_warnings(terminalreporter: Any) -> None:
    """List the warnings, including those in the reports of pytest-xdist workers."""
    tests: dict[str, list[str]] = {}
    for reports in terminalreporter.stats.values():
        for report in reports:
            if getattr(report, "when", None) == "call":
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

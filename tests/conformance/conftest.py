"""At the end of the report: how each scenario of the corpora ended, and how far we are from the reference."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from reference_traces import END, LINE


def handed_on(terminalreporter: pytest.TerminalReporter, wanted: str) -> list[str]:
    """The values of a property over all tests, from whatever worker they ran on."""
    return [
        str(value)
        for reports in terminalreporter.stats.values()
        for report in reports
        if getattr(report, "when", "") == "call"
        for name, value in report.user_properties
        if name == wanted
    ]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    ends = handed_on(terminalreporter, END)
    if ends:
        terminalreporter.section("how the scenarios of the corpora end")
        for line in sorted(ends):
            terminalreporter.write_line(line)
        words = Counter(line.split(": ", 1)[1].rsplit(" at ", 1)[0] for line in ends)
        total = ", ".join(f"{count} by {word}" for word, count in words.most_common())
        terminalreporter.write_line(f"{len(ends)} scenarios: {total}")
    lines = handed_on(terminalreporter, LINE)
    if lines:
        terminalreporter.section("deviations from the reference")
        for line in sorted(lines):
            terminalreporter.write_line(line)
        agreeing = sum(" ok " in line for line in lines)
        terminalreporter.write_line(f"{agreeing} of {len(lines)} agree")

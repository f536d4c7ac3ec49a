"""Summary after the report: ends of the corpora scenarios, and deviations from the reference."""

from __future__ import annotations

from collections import Counter

import pytest
from reference_traces import END, LINE


def property_values(terminalreporter: pytest.TerminalReporter, name: str) -> list[str]:
    """Return the values of a property over all tests of all workers."""
    return [
        str(value)
        for reports in terminalreporter.stats.values()
        for report in reports
        if getattr(report, "when", "") == "call"
        for key, value in report.user_properties
        if key == name
    ]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    ends = property_values(terminalreporter, END)
    if ends:
        terminalreporter.section("how the scenarios of the corpora end")
        for line in sorted(ends):
            terminalreporter.write_line(line)
        words = Counter(line.split(": ", 1)[1].rsplit(" at ", 1)[0] for line in ends)
        total = ", ".join(f"{count} by {word}" for word, count in words.most_common())
        terminalreporter.write_line(f"{len(ends)} scenarios: {total}")
    lines = property_values(terminalreporter, LINE)
    if lines:
        terminalreporter.section("deviations from the reference")
        for line in sorted(lines):
            terminalreporter.write_line(line)
        agreeing = sum(" ok " in line for line in lines)
        terminalreporter.write_line(f"{agreeing} of {len(lines)} agree")

"""The table of how far we are from the reference, at the end of the report."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from reference_traces import LINE


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    lines = [
        str(value)
        for reports in terminalreporter.stats.values()
        for report in reports
        if getattr(report, "when", "") == "call"
        for name, value in report.user_properties
        if name == LINE
    ]
    if lines:
        terminalreporter.section("deviations from the reference")
        for line in sorted(lines):
            terminalreporter.write_line(line)
        agreeing = sum(" ok " in line for line in lines)
        terminalreporter.write_line(f"{agreeing} of {len(lines)} agree")

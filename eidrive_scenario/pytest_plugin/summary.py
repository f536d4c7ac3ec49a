"""Sections of the plugin in the summary of a test session."""

from __future__ import annotations

from typing import Any

import pytest

from eidrive_scenario.pytest_plugin.distributions import show_left_out
from eidrive_scenario.pytest_plugin.github import show_annotations
from eidrive_scenario.pytest_plugin.session_report import show_report
from eidrive_scenario.pytest_plugin.warning_summary import show_warnings


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Print the omitted runs and the warnings of all runs, in GitHub Actions the annotations, and write the report."""
    show_left_out(terminalreporter, config)
    show_warnings(terminalreporter)
    show_annotations(terminalreporter, config)
    show_report(terminalreporter, config)

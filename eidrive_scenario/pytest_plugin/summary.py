"""Sections of the plugin at the end of a test session."""

from __future__ import annotations

from typing import Any

import pytest

from eidrive_scenario.pytest_plugin.distributions import show_left_out
from eidrive_scenario.pytest_plugin.warning_summary import show_warnings


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Show the runs that were left out, and the warnings of those that were not."""
    show_left_out(terminalreporter, config)
    show_warnings(terminalreporter)

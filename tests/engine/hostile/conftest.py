"""Fixture that writes the scenario of the tests."""

from __future__ import annotations

from pathlib import Path

import pytest
from hostile_scenario import Write, scenario_writer


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Return a function that writes a scenario into the folder of the test."""
    return scenario_writer(tmp_path)

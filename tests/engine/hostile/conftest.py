"""Import path of the shared modules, and a fixture that writes the scenario of the tests."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent / "shared"))

from hostile_scenario import Write, scenario_writer


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Return a function that writes a scenario into the folder of the test."""
    return scenario_writer(tmp_path)

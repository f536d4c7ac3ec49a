"""Fixtures: scenes on a straight street with two cars, run without a physics engine or in the complete simulation."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from recorded_scene import RunScene
from whole_run import run as run


@pytest.fixture
def scene(tmp_path: Path) -> RunScene:
    """Return a function that runs actions without a physics engine."""
    return RunScene(tmp_path)

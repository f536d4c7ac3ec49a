"""Fixtures that run actions on a straight street, without a physics engine and in the complete simulation."""

from __future__ import annotations

from pathlib import Path

import pytest
from recorded_scene import RunScene
from whole_run import Run


@pytest.fixture
def scene(tmp_path: Path) -> RunScene:
    return RunScene(tmp_path)


@pytest.fixture
def run(tmp_path: Path) -> Run:
    return Run(tmp_path)

"""Project with scenario files as tests."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"


@pytest.fixture
def project(pytester: pytest.Pytester) -> pytest.Pytester:
    """Return a project with a passing, a failing and an invalid scenario."""
    text = PASSING_BY.read_text(encoding="utf-8")
    folder = pytester.mkdir("xosc")
    shutil.copy(PASSING_BY, folder / "far.xosc")
    (folder / "near.xosc").write_text(text.replace('value="5.0"', 'value="0.0"'), encoding="utf-8")
    (folder / "wrong.xosc").write_text(text.replace('"step"', '"stp"'), encoding="utf-8")
    return pytester

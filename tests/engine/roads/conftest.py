"""Fixtures of roads: the library and, if available, external corpora."""

from __future__ import annotations

from pathlib import Path

import pytest
from corpora import corpora_folder


@pytest.fixture(scope="session")
def corpora() -> Path:
    """External maps and scenarios, which are not part of the project."""
    return corpora_folder()


@pytest.fixture
def library() -> Path:
    """Folder of the library roads."""
    return Path(__file__).parents[3] / "xosc" / "roads"

"""Fixtures of roads: the library and, if available, external corpora."""

from __future__ import annotations

import warnings
from pathlib import Path
from types import ModuleType

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


@pytest.fixture(scope="session")
def carla() -> ModuleType:
    """CARLA's Python package, whose Map reads OpenDRIVE without a simulator."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        module: ModuleType = pytest.importorskip("carla", reason="the carla wheel is not installed")
    return module

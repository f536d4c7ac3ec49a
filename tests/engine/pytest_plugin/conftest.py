"""Project with scenario files as tests, for sessions in the process of the tests."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from eidrive_scenario.experiments.single_run import run_and_save
from eidrive_scenario.extensions.project import GROUPS
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.simulation import RunSettings

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"


@pytest.fixture(scope="session", autouse=True)
def loaded_modules(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Load what runs use: pytester unloads modules that a session loads first, and the registry keeps classes."""
    for kind in GROUPS:
        for name in registry(kind):
            registry(kind).load(name)
    run_and_save(PASSING_BY, settings=RunSettings(drive=("Ego",)), below=tmp_path_factory.mktemp("loaded"))


@pytest.fixture
def project(pytester: pytest.Pytester) -> pytest.Pytester:
    """Return a project with a passing, a failing and an invalid scenario."""
    text = PASSING_BY.read_text(encoding="utf-8")
    folder = pytester.mkdir("xosc")
    shutil.copy(PASSING_BY, folder / "far.xosc")
    (folder / "near.xosc").write_text(text.replace('value="5.0"', 'value="0.0"'), encoding="utf-8")
    (folder / "wrong.xosc").write_text(text.replace('"step"', '"stp"'), encoding="utf-8")
    return pytester

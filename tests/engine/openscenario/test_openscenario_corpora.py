"""Files for other engines in the folder EIDRIVE_CORPORA; tests/conformance validates them by the ASAM schemas."""

import os
from pathlib import Path

import pytest
from corpora import corpora_folder, corpora_name, needs_corpora, scenario_files

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario, read_document

pytestmark = needs_corpora

EXCEPTIONS = {
    "esmini/xosc/Catalogs/Maneuvers/HWManeuvers.xosc": "an entry uses a parameter that it does not declare",
    "esmini/xosc/auto_light.xosc": "the folder of its catalog does not exist",
    "esmini/xosc/car_walk.xosc": "its catalogs lie outside the corpus",
    "scenario_runner/catalogs/EnvironmentCatalog.xosc": "written for 0.9",
    "scenario_runner/catalogs/ManeuverCatalog.xosc": "written for 0.9",
    "scenario_runner/catalogs/MiscObjectCatalog.xosc": "written for 0.9",
    "scenario_runner/catalogs/PedestrianCatalog.xosc": "written for 0.9",
    "scenario_runner/catalogs/VehicleCatalog.xosc": "written for 0.9",
}


def is_exempt(path: Path) -> bool:
    return corpora_name(path) in EXCEPTIONS


@pytest.fixture
def maps(monkeypatch: pytest.MonkeyPatch) -> None:
    folders = sorted({str(path.parent) for path in corpora_folder().rglob("*.xodr")})
    monkeypatch.setenv("EIDRIVE_MAPS", os.pathsep.join(folders))


@pytest.mark.exhaustive
@pytest.mark.usefixtures("maps")
def test_corpora_files_are_read() -> None:
    refused = {}
    for path in scenario_files():
        try:
            document = read_document(path)
            if document.storyboard is not None:
                load_scenario(path)
        except ScenarioError as error:
            refused[path] = str(error)
    assert {path: text for path, text in refused.items() if not is_exempt(path)} == {}
    assert len(refused) <= len(EXCEPTIONS)
    assert len(scenario_files()) > 150

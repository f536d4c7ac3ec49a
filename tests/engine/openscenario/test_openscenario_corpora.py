"""Files for other engines in the folder EIDRIVE_CORPORA; tests/conformance validates them by the ASAM schemas."""

import os
from pathlib import Path

import pytest

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario, read_document

CORPORA = Path(os.environ["EIDRIVE_CORPORA"]) if "EIDRIVE_CORPORA" in os.environ else None
pytestmark = pytest.mark.skipif(CORPORA is None, reason="EIDRIVE_CORPORA is not set")

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


def files() -> list[Path]:
    return sorted(CORPORA.rglob("*.xosc")) if CORPORA else []


def is_exempt(path: Path) -> bool:
    return CORPORA is not None and path.relative_to(CORPORA).as_posix() in EXCEPTIONS


@pytest.fixture
def maps(monkeypatch: pytest.MonkeyPatch) -> None:
    assert CORPORA is not None
    folders = sorted({str(path.parent) for path in CORPORA.rglob("*.xodr")})
    monkeypatch.setenv("EIDRIVE_MAPS", os.pathsep.join(folders))


@pytest.mark.usefixtures("maps")
def test_corpora_files_are_read() -> None:
    refused = {}
    for path in files():
        try:
            document = read_document(path)
            if document.storyboard is not None:
                load_scenario(path)
        except ScenarioError as error:
            refused[path] = str(error)
    assert {path: text for path, text in refused.items() if not is_exempt(path)} == {}
    assert len(refused) <= len(EXCEPTIONS)
    assert len(files()) > 150

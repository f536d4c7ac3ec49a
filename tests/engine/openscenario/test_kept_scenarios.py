"""Scenarios that stay in the process: shared while their files are unchanged, read again after any change."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from openscenario_xml import catalog_xml, object_xml, scenario_xml

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import loading
from eidrive_scenario.openscenario.loading import load_kept
from eidrive_scenario.openscenario.reading.parsing import KeptFiles
from eidrive_scenario.openscenario.scenario import Scenario

DECLARED = """<ParameterDeclarations>
<ParameterDeclaration name="Speed" parameterType="double" value="5"/></ParameterDeclarations>"""
DRIVER = """<Controller name="driver"><Properties><Property name="limit" value="{limit}"/></Properties></Controller>"""
LOCATION = "<ControllerCatalog><Directory path='catalogs'/></ControllerCatalog>"
REFERENCE = '<ObjectController><CatalogReference catalogName="Drivers" entryName="driver"/></ObjectController>'


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """Return a scenario whose Ego has the controller `driver` of a catalog in the file `all.xosc`."""
    path = tmp_path / "car.xosc"
    path.write_bytes(
        scenario_xml(declarations=DECLARED, catalogs=LOCATION, entities=object_xml("Ego", controller=REFERENCE))
    )
    (tmp_path / "catalogs").mkdir()
    write_catalog(path, "all.xosc", limit=3)
    return path


def write_catalog(scenario: Path, file: str, limit: int) -> Path:
    path = scenario.parent / "catalogs" / file
    path.write_bytes(catalog_xml("Drivers", DRIVER.format(limit=limit)))
    return path


def limit_of(scenario: Scenario) -> str:
    properties = scenario.controllers["Ego"][0].properties
    assert properties is not None
    return properties.property[0].value


def test_unchanged_files_give_the_same_scenario(scenario: Path) -> None:
    assert load_kept(scenario) is load_kept(scenario)


def test_other_parameters_give_another_scenario(scenario: Path) -> None:
    plain, fast = load_kept(scenario), load_kept(scenario, {"Speed": "9"})
    assert (plain.parameters["Speed"], fast.parameters["Speed"]) == ("5", "9")
    assert load_kept(scenario, {"Speed": "9"}) is fast
    assert load_kept(scenario) is plain


def in_catalog(scenario: Path) -> None:
    """Change the content only: size and time of modification are those of before."""
    path = scenario.parent / "catalogs" / "all.xosc"
    before = path.stat()
    write_catalog(scenario, "all.xosc", limit=4)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert (path.stat().st_size, path.stat().st_mtime_ns) == (before.st_size, before.st_mtime_ns)


def beside_catalog(scenario: Path) -> None:
    """Add the file that is searched first for a catalog of this name."""
    write_catalog(scenario, "Drivers.xosc", limit=4)


@pytest.mark.parametrize("change", [in_catalog, beside_catalog])
def test_changed_catalogs_are_read_again(scenario: Path, change: Callable[[Path], None]) -> None:
    assert limit_of(load_kept(scenario)) == "3"
    change(scenario)
    assert limit_of(load_kept(scenario)) == "4"


def test_changed_scenario_is_read_again(scenario: Path) -> None:
    """The change keeps the size and the time of modification."""
    assert load_kept(scenario).parameters["Speed"] == "5"
    before = scenario.stat()
    scenario.write_bytes(scenario.read_bytes().replace(b'value="5"', b'value="7"'))
    os.utime(scenario, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert load_kept(scenario).parameters["Speed"] == "7"


def test_removed_catalog_is_an_error(scenario: Path) -> None:
    load_kept(scenario)
    (scenario.parent / "catalogs" / "all.xosc").unlink()
    with pytest.raises(ScenarioError, match="no catalog 'Drivers'"):
        load_kept(scenario)


def test_kept_scenarios_are_bounded_by_the_size_of_their_files(scenario: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    size = scenario.stat().st_size
    monkeypatch.setattr(loading, "_kept", KeptFiles(2 * size))
    loaded = [load_kept(scenario, {"Speed": str(speed)}) for speed in (1, 2, 3)]
    again = [load_kept(scenario, {"Speed": str(speed)}) for speed in (3, 2)]
    assert again == [loaded[2], loaded[1]]
    assert load_kept(scenario, {"Speed": "1"}) is not loaded[0]

"""Repeated reading of a file: elements without parameters are shared, and the result is that of the first reading."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
from openscenario_xml import catalog_xml, object_xml, scenario_xml

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.extensions.library import scenarios
from eidrive_scenario.openscenario import Scenario, load_scenario
from eidrive_scenario.openscenario.model import Element
from eidrive_scenario.openscenario.reading import parsing
from eidrive_scenario.openscenario.reading.parsing import KeptFiles

DECLARED = """<ParameterDeclarations>
<ParameterDeclaration name="Speed" parameterType="double" value="5"/></ParameterDeclarations>"""
LOCATION = "<ControllerCatalog><Directory path='catalogs'/></ControllerCatalog>"
DRIVER = """<Controller name="driver">
<ParameterDeclarations><ParameterDeclaration name="limit" parameterType="double" value="3"/></ParameterDeclarations>
<Properties><Property name="limit" value="$limit"/><Property name="kind" value="calm"/></Properties></Controller>"""
REFERENCE = """<ObjectController><CatalogReference catalogName="Drivers" entryName="driver"><ParameterAssignments>
<ParameterAssignment parameterRef="limit" value="{limit}"/></ParameterAssignments></CatalogReference>
</ObjectController>"""


@pytest.fixture(autouse=True)
def kept(monkeypatch: pytest.MonkeyPatch) -> KeptFiles:  # type: ignore[type-arg]
    """Return the kept documents, none at the start of a test."""
    files: KeptFiles = KeptFiles(2**22)  # type: ignore[type-arg]
    monkeypatch.setattr(parsing, "_kept", files)
    return files


def with_driver(folder: Path, limit: str = "$Speed") -> Path:
    """Write a scenario whose Ego has the driver of a catalog, with this limit."""
    path = folder / "car.xosc"
    entities = object_xml("Ego", controller=REFERENCE.format(limit=limit))
    path.write_bytes(scenario_xml(declarations=DECLARED, catalogs=LOCATION, entities=entities))
    (folder / "catalogs").mkdir(exist_ok=True)
    (folder / "catalogs" / "all.xosc").write_bytes(catalog_xml("Drivers", DRIVER))
    return path


def limit_of(scenario: Scenario) -> str:
    properties = scenario.controllers["Ego"][0].properties
    assert properties is not None
    return properties.property[0].value


def located(scenario: Scenario) -> Iterator[tuple[Element, int, str]]:
    """Yield all elements of a scenario with their locations."""
    for tree in (scenario.document, *scenario.entries.values()):
        for element in tree.walk():
            yield element, element.line, element.source


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", scenarios())
def test_library_scenarios_are_read_again_as_before(name: str) -> None:
    first, *again = (load_scenario(name) for _ in range(4))
    for other in again:
        assert other.document == first.document
        assert list(located(other)) == list(located(first))
        assert list(other.entries.items()) == list(first.entries.items())
        assert (other.warnings, other.digest, other.catalogs) == (first.warnings, first.digest, first.catalogs)


@pytest.mark.parametrize("speeds", [("5", "7", "9"), ("9", "9", "5")])
def test_values_of_each_reading_reach_catalog_entries(tmp_path: Path, speeds: tuple[str, ...]) -> None:
    path = with_driver(tmp_path)
    for speed in speeds:
        assert limit_of(load_scenario(path, {"Speed": speed})) == speed


def test_elements_without_parameters_are_shared_from_the_second_reading_on(tmp_path: Path) -> None:
    path = with_driver(tmp_path)
    scenarios = [load_scenario(path, {"Speed": str(speed)}) for speed in (1, 2, 3)]
    headers = [scenario.document.file_header for scenario in scenarios]
    assert headers[1] is headers[2]
    entities = [scenario.document.entities for scenario in scenarios]
    assert entities[1] is not entities[2]


def test_changed_files_are_read_anew(tmp_path: Path) -> None:
    path = with_driver(tmp_path)
    for _ in range(3):
        assert limit_of(load_scenario(path)) == "5"
    with_driver(tmp_path, limit="4")
    assert limit_of(load_scenario(path)) == "4"


@pytest.mark.parametrize(
    "values",
    [{}, {"Speed": "fast"}, {"Speeed": "3"}, {"Speed": "INF"}],
    ids=["missing", "type", "name", "number"],
)
def test_each_reading_reports_the_same_diagnostics(tmp_path: Path, values: Mapping[str, str]) -> None:
    path = with_driver(tmp_path)
    text = path.read_text()
    path.write_text(text.replace('catalogName="Drivers"', 'catalogName="Drivers" wrong="1"'))
    found = []
    for _ in range(4):
        with pytest.raises(ScenarioError) as caught:
            load_scenario(path, values)
        found.append(str(caught.value))
    assert len(set(found)) == 1
    assert "wrong" in found[0]


def test_warnings_are_repeated_by_each_reading(tmp_path: Path) -> None:
    path = with_driver(tmp_path)
    catalog = tmp_path / "catalogs" / "all.xosc"
    catalog.write_text(catalog.read_text().replace('value="$limit"', 'value="$Speed"'))
    warnings = [load_scenario(path).warnings for _ in range(4)]
    assert any("uses the parameter 'Speed' of the scenario" in str(one) for one in warnings[0])
    assert warnings == [warnings[0]] * 4


def test_repaired_catalogs_keep_no_elements(tmp_path: Path, kept: KeptFiles) -> None:  # type: ignore[type-arg]
    path = with_driver(tmp_path)
    catalog = tmp_path / "catalogs" / "all.xosc"
    island = """<MiscObject name="island" miscObjectCategory="grafficIsland" mass="0"><BoundingBox>
    <Center x="0" y="0" z="0"/><Dimensions width="2" length="4" height="1"/></BoundingBox></MiscObject>"""
    catalog.write_bytes(catalog_xml("Drivers", DRIVER + island))
    assert any("grafficIsland" in str(one) for one in load_scenario(path).warnings)
    for _ in range(3):
        load_scenario(path)
    sizes = [len(document.read or ()) for document, _ in kept._kept.values()]
    for _ in range(3):
        load_scenario(path)
    assert [len(document.read or ()) for document, _ in kept._kept.values()] == sizes

"""Paths that begin with eidrive_library: catalogs, roads and scenarios of the library from any folder."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from corpora import corpora_folder
from lxml import etree
from openscenario_xml import deterministic_xml, distribution_xml, object_xml, road_file_xml, scenario_xml, values_xml
from storyboard_xml import end_xml, init_xml, lane_position_xml, teleport_xml
from typer.testing import CliRunner

from eidrive_scenario.cli import app
from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.extensions.library import library_path, resolve_path
from eidrive_scenario.openscenario import load_distribution, load_scenario
from eidrive_scenario.openscenario.library_catalogs import library_catalog_entries

START = init_xml("Bus", teleport_xml(lane_position_xml(-1, 20)))
BUS = object_xml("Bus", '<CatalogReference catalogName="vehicles" entryName="bus"/>')
PLACE = "eidrive_library/catalogs"


def write(folder: Path, catalogs: str = PLACE) -> Path:
    path = folder / "scene.xosc"
    path.write_bytes(
        scenario_xml(
            catalogs=f'<VehicleCatalog><Directory path="{catalogs}"/></VehicleCatalog>',
            road=road_file_xml("eidrive_library/roads/coop_1.xodr"),
            entities=BUS,
            init=START,
            stop=end_xml(0.5),
        )
    )
    return path


def width_of_bus(path: Path) -> float:
    return load_scenario(path).entities["Bus"].bounding_box.dimensions.width


def test_distribution_is_loaded_by_library_name() -> None:
    by_name = load_distribution("ncap/crossing_car_participants")
    by_path = load_distribution(library_path() / "ncap" / "crossing_car_participants.xosc")
    assert [str(run) for run in by_name] == [str(run) for run in by_path] != []


@pytest.mark.parametrize("place", [PLACE, f"{PLACE}/vehicles.xosc", "eidrive_library\\catalogs"])
def test_library_catalog_is_found_from_any_folder(tmp_path: Path, place: str) -> None:
    path = write(tmp_path, place)
    assert width_of_bus(path) == 2.55
    assert load_scenario(path).road_file == library_path() / "roads" / "coop_1.xodr"
    checked = CliRunner().invoke(app, ["check", str(path)])
    assert checked.stdout.strip().endswith("1 file, 0 errors, 0 warnings, 1 note")
    assert CliRunner().invoke(app, ["run", str(path), "--no-criteria"]).exit_code == 0


def test_copy_in_scenario_folder_takes_precedence(tmp_path: Path) -> None:
    path = write(tmp_path)
    shutil.copytree(library_path() / "catalogs", tmp_path / PLACE)
    copy = tmp_path / PLACE / "vehicles.xosc"
    copy.write_text(copy.read_text().replace('width="2.55"', 'width="2.4"'))
    assert width_of_bus(path) == 2.4


def test_file_stays_valid_against_the_schema(tmp_path: Path) -> None:
    schema = etree.XMLSchema(etree.parse(corpora_folder() / "schema" / "OpenSCENARIOv1.3.1.xsd"))
    schema.assertValid(etree.parse(write(tmp_path)))


def test_distribution_may_refer_to_library_scenario(tmp_path: Path) -> None:
    path = tmp_path / "speeds.xosc"
    body = deterministic_xml(values_xml("EgoSpeed", "5"))
    path.write_bytes(distribution_xml(body, scenario="eidrive_library/coop/scenario_1.xosc"))
    (run,) = load_distribution(path)
    assert load_scenario(run.scenario, run.assignments).parameters["EgoSpeed"] == "5"


@pytest.mark.parametrize(
    "path",
    [
        "eidrive_library/../../etc/passwd",
        "eidrive_library/catalogs/../../../etc",
        "eidrive_library/nothing",
        "eidrive_library2/catalogs",
        "../eidrive_library/catalogs",
        "/eidrive_library/catalogs",
        "catalogs",
    ],
)
def test_other_paths_are_relative_to_the_folder(tmp_path: Path, path: str) -> None:
    assert resolve_path(path, tmp_path) == tmp_path / path


def test_broken_link_in_scenario_folder_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "eidrive_library").mkdir()
    (tmp_path / PLACE).symlink_to(tmp_path / "gone")
    assert resolve_path(PLACE, tmp_path) == tmp_path / PLACE


def test_missing_catalog_error_suggests_library_path(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="correct the Directory; that of the library is eidrive_library/catalogs"):
        load_scenario(write(tmp_path, "../catalogs"))


def test_list_catalogs_prints_sizes_and_reference_path() -> None:
    printed = CliRunner().invoke(app, ["list", "catalogs"]).stdout.splitlines()
    bus = next(line for line in printed if line.split()[1:2] == ["bus"])
    assert "12.13 x 2.55 x 3.12 m" in bus
    assert {line.split()[0] for line in printed if line} >= {"vehicles", "pedestrians", "misc_objects", "environments"}
    assert f'<VehicleCatalog><Directory path="{PLACE}"/></VehicleCatalog>' in printed[-2]
    assert str(library_path() / "catalogs") in printed[-1]


REAL = {
    "lincoln_mkz": (4.925, 1.864, 1.476),
    "lincoln_mkz_2017": (4.925, 2.113, 1.476),
    "fire_engine": (8.040, 2.440, 3.200),
    "bus": (12.135, 2.550, 3.120),
    "van": (5.932, 2.020, 2.623),
}
"""Length, width, height [m] by the manufacturers; of lincoln_mkz_2017 with mirrors."""
BLUEPRINTS = {
    "firetruck": (8.468, 2.891, 3.827),
    "ambulance": (6.366, 2.351, 2.431),
    "nissan_patrol": (4.60, 1.93, 1.85),
    "seat_leon": (4.19, 1.82, 1.47),
    "tesla_model3": (4.79, 2.16, 1.49),
}
"""Length, width, height [m] of the blueprints of CARLA 0.9.14 that the entries represent."""
LEGAL_WIDTH, LEGAL_HEIGHT = 2.55, 4.0
"""EU directive 96/53/EC [m]."""


def test_library_vehicles_have_documented_sizes() -> None:
    sizes = {entry.name: entry.size for entry in library_catalog_entries() if entry.kind == "Vehicle"}
    for name, size in REAL.items():
        assert sizes[name] == pytest.approx(size, rel=0.025), name
    for name, size in BLUEPRINTS.items():
        assert sizes[name] == pytest.approx(size, abs=0.005), name
    for name, found in sizes.items():
        assert found is not None
        if name not in BLUEPRINTS:
            assert found[1] <= LEGAL_WIDTH, name
            assert found[2] <= LEGAL_HEIGHT, name

from collections.abc import Callable
from pathlib import Path

import pytest

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario, model

Build = Callable[..., bytes]

HEADER = '<FileHeader revMajor="{0}" revMinor="{1}" date="2026-01-31T12:00:00" description="" author=""/>'
LOCATIONS = "<{kind}Catalog><Directory path='{path}'/></{kind}Catalog>"
CONTROLLER = """<Controller name="driver"><ParameterDeclarations>
<ParameterDeclaration name="Model" parameterType="string" value="calm"/></ParameterDeclarations>
<Properties><Property name="model" value="$Model"/><Property name="limit" value="{limit}"/></Properties></Controller>"""


@pytest.fixture
def shelf(tmp_path: Path) -> Callable[..., Path]:
    """Puts a catalog into the folder where the scenario will lie."""

    def put(file: str, name: str, content: str, revision: tuple[int, int] = (1, 3)) -> Path:
        path = tmp_path / "catalogs" / file
        path.parent.mkdir(exist_ok=True)
        header = HEADER.format(*revision)
        path.write_text(f'<OpenSCENARIO>{header}\n<Catalog name="{name}">{content}</Catalog></OpenSCENARIO>')
        return path

    return put


@pytest.fixture
def scene(tmp_path: Path, scenario_xml: Build) -> Callable[..., Path]:
    """Writes a scenario whose ego has a controller from a catalog."""

    def write(reference: str, *, kind: str = "Controller", path: str = "catalogs", declarations: str = "") -> Path:
        xml = scenario_xml(catalogs=LOCATIONS.format(kind=kind, path=path), declarations=declarations).decode()
        xml = xml.replace("</Vehicle></Scen", f"</Vehicle><ObjectController>{reference}</ObjectController></Scen")
        file = tmp_path / "scene.xosc"
        file.write_text(xml)
        return file

    return write


def reference(catalog: str, entry: str, **assignments: str) -> str:
    one = '<ParameterAssignment parameterRef="{}" value="{}"/>'
    inside = "".join(one.format(name, value) for name, value in assignments.items())
    assigned = f"<ParameterAssignments>{inside}</ParameterAssignments>" if inside else ""
    return f'<CatalogReference catalogName="{catalog}" entryName="{entry}">{assigned}</CatalogReference>'


def properties_of(controller: model.Controller) -> dict[str, str]:
    assert controller.properties is not None
    return {one.name: one.value for one in controller.properties.property}


@pytest.mark.element("CatalogReference", "ParameterAssignment")
def test_an_entry_gets_its_own_values(shelf: Callable[..., Path], scene: Callable[..., Path]) -> None:
    shelf("Drivers.xosc", "Drivers", CONTROLLER.format(limit=3))
    plain = load_scenario(scene(reference("Drivers", "driver")))
    assert properties_of(plain.controllers["Ego"][0]) == {"model": "calm", "limit": "3"}
    assigned = load_scenario(scene(reference("Drivers", "driver", Model="wild")))
    assert properties_of(assigned.controllers["Ego"][0])["model"] == "wild"


def test_the_reference_stays_in_the_model(shelf: Callable[..., Path], scene: Callable[..., Path]) -> None:
    catalog = shelf("Drivers.xosc", "Drivers", CONTROLLER.format(limit=3))
    scenario = load_scenario(scene(reference("Drivers", "driver")))
    assert scenario.document.entities is not None
    found = scenario.document.entities.scenario_object[0].object_controller[0].catalog_reference
    assert found is not None
    entry = scenario.resolved(found)
    assert isinstance(entry, model.Controller)
    assert entry is scenario.controllers["Ego"][0]
    assert (entry.source, entry.line) == (str(catalog), 2)


def test_a_catalog_is_found_by_the_name_within(shelf: Callable[..., Path], scene: Callable[..., Path]) -> None:
    shelf("a.xosc", "Others", "")
    shelf("b.xosc", "Drivers", CONTROLLER.format(limit=3))
    assert load_scenario(scene(reference("Drivers", "driver"))).warnings == ()


def test_a_catalog_that_only_its_file_names_is_found_with_a_warning(
    shelf: Callable[..., Path], scene: Callable[..., Path]
) -> None:
    shelf("Drivers.xosc", "ControllerCatalog", CONTROLLER.format(limit=3))
    scenario = load_scenario(scene(reference("Drivers", "driver")))
    assert [warning.message for warning in scenario.warnings] == [
        "the catalog in Drivers.xosc is named 'ControllerCatalog'"
    ]


def test_a_parameter_of_the_scenario_is_lent_with_a_warning(
    shelf: Callable[..., Path], scene: Callable[..., Path], parameters_xml: Callable[..., str]
) -> None:
    shelf("Drivers.xosc", "Drivers", CONTROLLER.format(limit="$Limit"))
    path = scene(reference("Drivers", "driver"), declarations=parameters_xml(Limit=("int", "8")))
    scenario = load_scenario(path)
    assert properties_of(scenario.controllers["Ego"][0])["limit"] == "8"
    assert "uses the scenario's parameter 'Limit'" in scenario.warnings[0].message


@pytest.mark.parametrize(
    ("catalog", "entry", "message"),
    [
        ("Driver", "driver", r"no catalog 'Driver' in .*; did you mean 'Drivers'\?"),
        ("Drivers", "drvier", r"the catalog 'Drivers' has no entry 'drvier'; did you mean 'driver'\?"),
        ("Drivers", "road", r"the catalog entry 'road' is of the kind Route; Controller is wanted here"),
    ],
)
def test_what_is_not_there_is_named_at_the_reference(
    shelf: Callable[..., Path], scene: Callable[..., Path], catalog: str, entry: str, message: str
) -> None:
    point = '<Waypoint routeStrategy="shortest"><Position><WorldPosition x="0" y="0"/></Position></Waypoint>'
    route = f'<Route name="road" closed="false">{point}{point}</Route>'
    shelf("Drivers.xosc", "Drivers", CONTROLLER.format(limit=3) + route)
    path = scene(reference(catalog, entry))
    line = 1 + next(number for number, text in enumerate(path.read_text().splitlines()) if "<CatalogRef" in text)
    with pytest.raises(ScenarioError, match=message) as caught:
        load_scenario(path)
    assert [(diagnostic.source, diagnostic.line) for diagnostic in caught.value.diagnostics] == [(str(path), line)]


def test_entry_name_that_occurs_twice_is_an_error_with_both_lines(
    shelf: Callable[..., Path], scene: Callable[..., Path]
) -> None:
    """Another entry of the same catalog can be used all the same."""
    named = '<Controller name="{}"><Properties/></Controller>\n'
    catalog = shelf("Drivers.xosc", "Drivers", "".join(map(named.format, ("calm", "wild", "calm"))))
    with pytest.raises(ScenarioError) as caught:
        load_scenario(scene(reference("Drivers", "calm")))
    (diagnostic,) = caught.value.diagnostics
    assert (diagnostic.source, diagnostic.line) == (str(catalog), 4)
    assert diagnostic.message == "the catalog has a second entry 'calm'; the first is at line 2"
    load_scenario(scene(reference("Drivers", "wild")))


def test_no_place_for_catalogs_is_named(scene: Callable[..., Path]) -> None:
    path = scene(reference("Drivers", "driver"))
    path.write_text(path.read_text().replace(LOCATIONS.format(kind="Controller", path="catalogs"), ""))
    with pytest.raises(ScenarioError, match="no place is given for the catalog 'Drivers'; add ControllerCatalog"):
        load_scenario(path)


def test_mistakes_in_an_entry_carry_the_catalog_and_its_line(
    shelf: Callable[..., Path], scene: Callable[..., Path]
) -> None:
    catalog = shelf(
        "Drivers.xosc", "Drivers", CONTROLLER.format(limit=3).replace("<Property name", "\n<Property nam", 1)
    )
    with pytest.raises(ScenarioError) as caught:
        load_scenario(scene(reference("Drivers", "driver")))
    assert {(diagnostic.source, diagnostic.line) for diagnostic in caught.value.diagnostics} == {(str(catalog), 5)}


def test_a_catalog_of_before_1_0_is_read_with_a_warning(shelf: Callable[..., Path], scene: Callable[..., Path]) -> None:
    shelf("Drivers.xosc", "Drivers", CONTROLLER.format(limit=3), revision=(0, 9))
    warnings = load_scenario(scene(reference("Drivers", "driver"))).warnings
    assert [warning.message for warning in warnings] == ["the file is written for OpenSCENARIO 0.9"]


def test_an_entry_that_refers_to_itself_is_refused(shelf: Callable[..., Path], scene: Callable[..., Path]) -> None:
    body = """<BoundingBox><Center x="0" y="0" z="0"/><Dimensions length="1" width="1" height="1"/></BoundingBox>
    <Performance maxSpeed="1" maxAcceleration="1" maxDeceleration="1"/>
    <Axles><RearAxle maxSteering="0" wheelDiameter="1" trackWidth="1" positionX="0" positionZ="0"/></Axles>"""
    trailer = f'<Trailer><Trailer name="t">{reference("Cars", "car")}</Trailer></Trailer>'
    shelf("Cars.xosc", "Cars", f'<Vehicle name="car" vehicleCategory="car">{body}{trailer}</Vehicle>')
    path = scene("", kind="Vehicle")
    text = path.read_text().replace("<ObjectController></ObjectController>", "")
    start, end = text.index("<Vehicle name"), text.index("</Vehicle>") + len("</Vehicle>")
    path.write_text(text[:start] + reference("Cars", "car") + text[end:])
    with pytest.raises(ScenarioError, match="the catalog entry 'car' refers to itself"):
        load_scenario(path)


def test_a_file_beside_the_catalog_that_cannot_be_read_is_a_warning(
    shelf: Callable[..., Path], scene: Callable[..., Path]
) -> None:
    shelf("all.xosc", "Drivers", CONTROLLER.format(limit=3))
    (shelf("aa.xosc", "Other", "")).write_text("<OpenSCENARIO><FileHeader")
    scenario = load_scenario(scene(reference("Drivers", "driver")))
    assert properties_of(scenario.controllers["Ego"][0])["limit"] == "3"
    assert [Path(warning.source).name for warning in scenario.warnings] == ["aa.xosc"]


def test_where_the_catalog_is_not_found_the_file_that_cannot_be_read_is_the_error(
    shelf: Callable[..., Path], scene: Callable[..., Path]
) -> None:
    shelf("aa.xosc", "Other", "").write_text("<OpenSCENARIO><FileHeader")
    with pytest.raises(ScenarioError, match=r"aa\.xosc:1: not well-formed XML"):
        load_scenario(scene(reference("Drivers", "driver")))


def test_a_folder_that_is_not_there_is_named(scene: Callable[..., Path]) -> None:
    with pytest.raises(ScenarioError, match=r"no catalog 'Drivers' in .*gone; .*gone is not there"):
        load_scenario(scene(reference("Drivers", "driver"), path=".\\gone"))


def test_a_scenario_that_has_the_name_of_a_catalog_is_none(
    shelf: Callable[..., Path], scene: Callable[..., Path], scenario_xml: Build
) -> None:
    shelf("Drivers.xosc", "", "").write_bytes(scenario_xml())
    with pytest.raises(ScenarioError, match=r"no catalog 'Drivers' in"):
        load_scenario(scene(reference("Drivers", "driver")))


def test_catalog_in_none_of_the_places_beside_a_folder_that_cannot_be_listed_is_an_error(
    scene: Callable[..., Path], shelf: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder may be passed through without the right to list it."""
    shelf("other.xosc", "other", CONTROLLER.format(limit="3"))
    path = scene('<CatalogReference catalogName="drivers" entryName="driver"/>')

    def refused(folder: Path) -> None:
        raise PermissionError(13, "Permission denied", str(folder))

    monkeypatch.setattr(Path, "iterdir", refused)
    with pytest.raises(ScenarioError, match="no catalog 'drivers'"):
        load_scenario(path)

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from openscenario_xml import catalog_xml, object_xml, parameters_xml, scenario_xml

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario, model

Write = Callable[..., Path]

LOCATIONS = "<{kind}Catalog><Directory path='{path}'/></{kind}Catalog>"
CONTROLLER = """<Controller name="driver"><ParameterDeclarations>
<ParameterDeclaration name="Model" parameterType="string" value="calm"/></ParameterDeclarations>
<Properties><Property name="model" value="$Model"/><Property name="limit" value="{limit}"/></Properties></Controller>"""


@pytest.fixture
def write_catalog(tmp_path: Path) -> Write:
    """Return a function that writes a catalog into the folder of the scenario."""

    def put(file: str, name: str, content: str) -> Path:
        path = tmp_path / "catalogs" / file
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(catalog_xml(name, content))
        return path

    return put


@pytest.fixture
def write_scenario(tmp_path: Path) -> Write:
    """Return a function that writes a scenario whose Ego has a controller from a catalog."""

    def write(reference: str, *, kind: str = "Controller", path: str = "catalogs", declarations: str = "") -> Path:
        file = tmp_path / "write_scenario.xosc"
        file.write_bytes(
            scenario_xml(
                declarations=declarations,
                catalogs=LOCATIONS.format(kind=kind, path=path),
                entities=object_xml("Ego", controller=f"<ObjectController>{reference}</ObjectController>"),
            )
        )
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
def test_catalog_entry_uses_assigned_values(write_catalog: Write, write_scenario: Write) -> None:
    write_catalog("Drivers.xosc", "Drivers", CONTROLLER.format(limit=3))
    plain = load_scenario(write_scenario(reference("Drivers", "driver")))
    assert properties_of(plain.controllers["Ego"][0]) == {"model": "calm", "limit": "3"}
    assigned = load_scenario(write_scenario(reference("Drivers", "driver", Model="wild")))
    assert properties_of(assigned.controllers["Ego"][0])["model"] == "wild"


def test_catalog_reference_that_assigns_a_parameter_twice_is_an_error(
    write_catalog: Write, write_scenario: Write
) -> None:
    write_catalog("Drivers.xosc", "Drivers", CONTROLLER.format(limit=3))
    once = '<ParameterAssignment parameterRef="Model" value="wild"/>'
    twice = reference("Drivers", "driver", Model="wild").replace(once, f"{once}\n{once}")
    with pytest.raises(ScenarioError, match=r"CatalogReference assigns 'Model' twice.*remove one") as caught:
        load_scenario(write_scenario(twice))
    assert len(caught.value.diagnostics) == 1


def test_catalog_reference_remains_in_the_model(write_catalog: Write, write_scenario: Write) -> None:
    catalog = write_catalog("Drivers.xosc", "Drivers", CONTROLLER.format(limit=3))
    scenario = load_scenario(write_scenario(reference("Drivers", "driver")))
    assert scenario.document.entities is not None
    found = scenario.document.entities.scenario_object[0].object_controller[0].catalog_reference
    assert found is not None
    entry = scenario.resolved(found)
    assert isinstance(entry, model.Controller)
    assert entry is scenario.controllers["Ego"][0]
    assert (entry.source, entry.line) == (str(catalog), 3)


def test_catalog_is_found_by_its_name_attribute(write_catalog: Write, write_scenario: Write) -> None:
    write_catalog("a.xosc", "Others", "")
    write_catalog("b.xosc", "Drivers", CONTROLLER.format(limit=3))
    assert load_scenario(write_scenario(reference("Drivers", "driver"))).warnings == ()


def test_catalog_found_by_file_name_is_a_warning(write_catalog: Write, write_scenario: Write) -> None:
    write_catalog("Drivers.xosc", "ControllerCatalog", CONTROLLER.format(limit=3))
    scenario = load_scenario(write_scenario(reference("Drivers", "driver")))
    assert [warning.message for warning in scenario.warnings] == [
        "the catalog in Drivers.xosc is named 'ControllerCatalog'"
    ]


def test_catalog_entry_using_scenario_parameter_is_a_warning(write_catalog: Write, write_scenario: Write) -> None:
    write_catalog("Drivers.xosc", "Drivers", CONTROLLER.format(limit="$Limit"))
    path = write_scenario(reference("Drivers", "driver"), declarations=parameters_xml(Limit=("int", "8")))
    scenario = load_scenario(path)
    assert properties_of(scenario.controllers["Ego"][0])["limit"] == "8"
    assert "uses the parameter 'Limit' of the scenario" in scenario.warnings[0].message


@pytest.mark.parametrize(
    ("catalog", "entry", "message"),
    [
        ("Driver", "driver", r"no catalog 'Driver' in .*; did you mean 'Drivers'\?"),
        ("Drivers", "drvier", r"catalog 'Drivers' has no entry 'drvier'; did you mean 'driver'\?"),
        ("Drivers", "road", r"catalog entry 'road' is a Route; expected Controller"),
    ],
)
def test_unknown_catalog_entry_error_is_at_the_reference(
    write_catalog: Write, write_scenario: Write, catalog: str, entry: str, message: str
) -> None:
    point = '<Waypoint routeStrategy="shortest"><Position><WorldPosition x="0" y="0"/></Position></Waypoint>'
    route = f'<Route name="road" closed="false">{point}{point}</Route>'
    write_catalog("Drivers.xosc", "Drivers", CONTROLLER.format(limit=3) + route)
    path = write_scenario(reference(catalog, entry))
    line = 1 + next(number for number, text in enumerate(path.read_text().splitlines()) if "<CatalogRef" in text)
    with pytest.raises(ScenarioError, match=message) as caught:
        load_scenario(path)
    assert [(diagnostic.source, diagnostic.line) for diagnostic in caught.value.diagnostics] == [(str(path), line)]


def test_duplicate_entry_name_error_has_both_lines(write_catalog: Write, write_scenario: Write) -> None:
    """Another entry of the same catalog can still be used."""
    named = '<Controller name="{}"><Properties/></Controller>\n'
    catalog = write_catalog("Drivers.xosc", "Drivers", "".join(map(named.format, ("calm", "wild", "calm"))))
    with pytest.raises(ScenarioError) as caught:
        load_scenario(write_scenario(reference("Drivers", "calm")))
    (diagnostic,) = caught.value.diagnostics
    assert (diagnostic.source, diagnostic.line) == (str(catalog), 5)
    assert diagnostic.message == "the catalog has a second entry 'calm'; the first is at line 3"
    load_scenario(write_scenario(reference("Drivers", "wild")))


def test_missing_catalog_location_is_an_error(write_scenario: Write) -> None:
    path = write_scenario(reference("Drivers", "driver"))
    path.write_text(path.read_text().replace(LOCATIONS.format(kind="Controller", path="catalogs"), ""))
    with pytest.raises(
        ScenarioError, match="catalog 'Drivers' has no location in CatalogLocations; add ControllerCatalog"
    ):
        load_scenario(path)


def test_catalog_entry_error_has_catalog_file_and_line(write_catalog: Write, write_scenario: Write) -> None:
    catalog = write_catalog(
        "Drivers.xosc", "Drivers", CONTROLLER.format(limit=3).replace("<Property name", "\n<Property nam", 1)
    )
    with pytest.raises(ScenarioError) as caught:
        load_scenario(write_scenario(reference("Drivers", "driver")))
    assert {(diagnostic.source, diagnostic.line) for diagnostic in caught.value.diagnostics} == {(str(catalog), 6)}


def test_catalog_older_than_1_0_is_a_warning(write_catalog: Write, write_scenario: Write) -> None:
    catalog = write_catalog("Drivers.xosc", "Drivers", CONTROLLER.format(limit=3))
    catalog.write_text(catalog.read_text().replace('revMajor="1" revMinor="3"', 'revMajor="0" revMinor="9"'))
    warnings = load_scenario(write_scenario(reference("Drivers", "driver"))).warnings
    assert [warning.message for warning in warnings] == ["FileHeader has the version 0.9"]


def test_invalid_header_of_a_catalog_is_a_warning(write_catalog: Write, write_scenario: Write) -> None:
    path = write_catalog("Drivers.xosc", "Drivers", CONTROLLER.format(limit=3))
    path.write_bytes(re.sub(rb' date="[^"]*"', b' date="2020-02-20"', path.read_bytes()))
    (warning,) = load_scenario(write_scenario(reference("Drivers", "driver"))).warnings
    assert "date of FileHeader is '2020-02-20', which is not a date and time" in str(warning)
    assert warning.source == str(path)


def test_self_referencing_catalog_entry_is_an_error(write_catalog: Write, write_scenario: Write) -> None:
    body = """<BoundingBox><Center x="0" y="0" z="0"/><Dimensions length="1" width="1" height="1"/></BoundingBox>
    <Performance maxSpeed="1" maxAcceleration="1" maxDeceleration="1"/>
    <Axles><RearAxle maxSteering="0" wheelDiameter="1" trackWidth="1" positionX="0" positionZ="0"/></Axles>"""
    trailer = f'<Trailer><Trailer name="t">{reference("Cars", "car")}</Trailer></Trailer>'
    write_catalog("Cars.xosc", "Cars", f'<Vehicle name="car" vehicleCategory="car">{body}{trailer}</Vehicle>')
    path = write_scenario("", kind="Vehicle")
    text = path.read_text().replace("<ObjectController></ObjectController>", "")
    start, end = text.index("<Vehicle name"), text.index("</Vehicle>") + len("</Vehicle>")
    path.write_text(text[:start] + reference("Cars", "car") + text[end:])
    with pytest.raises(ScenarioError, match="catalog entry 'car' refers to itself"):
        load_scenario(path)


def test_unreadable_file_beside_found_catalog_is_a_warning(write_catalog: Write, write_scenario: Write) -> None:
    write_catalog("all.xosc", "Drivers", CONTROLLER.format(limit=3))
    (write_catalog("aa.xosc", "Other", "")).write_text("<OpenSCENARIO><FileHeader")
    scenario = load_scenario(write_scenario(reference("Drivers", "driver")))
    assert properties_of(scenario.controllers["Ego"][0])["limit"] == "3"
    assert [Path(warning.source).name for warning in scenario.warnings] == ["aa.xosc"]


def test_unreadable_file_without_found_catalog_is_an_error(write_catalog: Write, write_scenario: Write) -> None:
    write_catalog("aa.xosc", "Other", "").write_text("<OpenSCENARIO><FileHeader")
    with pytest.raises(ScenarioError, match=r"aa\.xosc:1: not well-formed XML"):
        load_scenario(write_scenario(reference("Drivers", "driver")))


def test_missing_catalog_folder_is_an_error(write_scenario: Write) -> None:
    with pytest.raises(ScenarioError, match=r"no catalog 'Drivers' in .*gone; .*gone does not exist"):
        load_scenario(write_scenario(reference("Drivers", "driver"), path=".\\gone"))


def test_scenario_with_catalog_name_is_not_a_catalog(write_catalog: Write, write_scenario: Write) -> None:
    write_catalog("Drivers.xosc", "", "").write_bytes(scenario_xml())
    with pytest.raises(ScenarioError, match=r"no catalog 'Drivers' in"):
        load_scenario(write_scenario(reference("Drivers", "driver")))


def test_missing_catalog_beside_unlistable_folder_is_an_error(
    write_scenario: Write, write_catalog: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Execution permission without read permission allows access to files in a folder, but not its listing."""
    write_catalog("other.xosc", "other", CONTROLLER.format(limit="3"))
    path = write_scenario('<CatalogReference catalogName="drivers" entryName="driver"/>')

    def refused(folder: Path) -> None:
        raise PermissionError(13, "Permission denied", str(folder))

    monkeypatch.setattr(Path, "iterdir", refused)
    with pytest.raises(ScenarioError, match="no catalog 'drivers'"):
        load_scenario(path)


def test_entry_of_foreign_kind_is_an_error_with_its_location(write_catalog: Write, write_scenario: Write) -> None:
    catalog = write_catalog("Drivers.xosc", "Drivers", '<Story name="driver"/>')
    with pytest.raises(ScenarioError) as caught:
        load_scenario(write_scenario(reference("Drivers", "driver")))
    (error,) = caught.value.diagnostics
    assert error.message == "catalog entry 'driver' is a Story, which is not allowed in a catalog"
    assert error.hint == f"remove it from {catalog}:3"


def test_warnings_of_a_catalog_beyond_the_limit_are_counted(write_catalog: Write, write_scenario: Write) -> None:
    islands = "".join(f'\n<MiscObject name="{n}" miscObjectCategory="grafficIsland"/>' for n in range(250))
    write_catalog("Drivers.xosc", "Drivers", CONTROLLER.format(limit=3) + islands)
    warnings = load_scenario(write_scenario(reference("Drivers", "driver"))).warnings
    assert len(warnings) == 201
    assert warnings[-1].message == "50 more are not listed"

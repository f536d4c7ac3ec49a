"""Scenario files that shall hang, exhaust memory or end in an internal error: each is an error with file and line."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from hostile_scenario import Write
from openscenario_xml import catalog_xml
from processor_time import within_readings
from typer.testing import CliRunner

from eidrive_scenario.cli import app

BOMB = "{a: &a [x, x, x], b: &b [*a, *a, *a, *a], c: &c [*b, *b, *b, *b], d: [*c, *c, *c, *c]}"
LONG = "x" * 5000


def refused(path: Path, *words: str, line: bool = True) -> None:
    """Check and run report an error with the file and its line, without much work."""
    for command in (["check", str(path)], ["run", str(path), "--no-record"]):
        result = within_readings(100, partial(CliRunner().invoke, app, command))
        assert result.exit_code == 2, result.output
        assert "internal error" not in result.output
        errors = [one for one in result.output.splitlines() if "(warning" not in one and "(note" not in one]
        text = "\n".join(errors)
        assert all(word in text for word in words), text
        assert not line or any(part.split(":")[0].isdigit() for part in text.split(f"{path.name}:")[1:]), text
        assert len(result.output) < 50_000


@pytest.mark.parametrize("encoding", ["no-such-codec", "utf-7", "idna", "base64", "cp037", "GB18030", "UTF-99"])
def test_check_and_run_unknown_encoding_is_refused(write: Write, encoding: str) -> None:
    refused(write(opening=f'<?xml version="1.0" encoding="{encoding}"?>'), "hostile.xosc:1: ")


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("{description: &a [x], loss: *a}", "aliases"),
        (BOMB, "aliases"),
        ("{model: composed, <<: {delay: {kind: constant}}}", "merge keys"),
        ("&a {b: *a}", "aliases"),
        ("{a: " + "[" * 50, "nested too deeply"),
        ("{a: " * 50, "nested too deeply"),
        ("{a: [" + "1, " * 60_000 + "]}", "not valid YAML"),
        ("{seconds: 1" + "0" * 5000 + "}", "digits"),
        ("{seconds: " + "1:" * 3000 + "1}", "digits"),
        ("{seconds: !!python/object/apply:os.system [id]}", "tags are not supported"),
    ],
)
def test_check_and_run_hostile_yaml_is_refused(write: Write, value: str, words: str) -> None:
    refused(write(channel=value.replace("&", "&amp;").replace("<", "&lt;")), words)
    refused(write({"sensors": value}), words)


def test_check_and_run_exponential_texts_are_refused(write: Write) -> None:
    chain = '<ParameterDeclaration name="A0" parameterType="string" value="ab"/>\n' + "\n".join(
        f'<ParameterDeclaration name="A{n}" parameterType="string" value="${{{" + ".join([f"$A{n - 1}"] * 5)}}}"/>'
        for n in range(1, 25)
    )
    refused(
        write(before=f"<ParameterDeclarations>\n{chain}\n</ParameterDeclarations>"), "has more than 65536 characters"
    )


def test_check_and_run_many_concatenated_texts_are_refused(write: Write) -> None:
    """Each text is short enough; all of them together are not."""
    big = f'<ParameterDeclaration name="P" parameterType="string" value="{"x" * 60_000}"/>'
    many = "\n".join(
        f'<ParameterDeclaration name="Q{n}" parameterType="string" value="${{$P + y{n}}}"/>' for n in range(400)
    )
    refused(
        write(before=f"<ParameterDeclarations>{big}\n{many}</ParameterDeclarations>"), "the texts of all expressions"
    )


@pytest.mark.parametrize("value", ["1e308", "-1e308", "1e12", "1e999", "0", "-1", ".inf", ".nan", "9" * 30])
def test_check_and_run_excessive_sensor_range_is_refused(write: Write, value: str) -> None:
    refused(write({"range": value}), "setting 'range'")


@pytest.mark.parametrize(
    ("sensors", "words"),
    [
        ("{lidar: {points_per_second: 1000000000}}", "points_per_second"),
        ("{lidar: {rotation: 1e-9}}", "rotation"),
        ("{lidar: {points_per_second: 90000000, rotation: 0.1}}", "rays in one reading"),
        ("{lidar: {range_noise: 1e9}}", "range_noise"),
        ("{lidar: {ten_percent_range: 1e-300}}", "ten_percent_range"),
        ("{camera: {width: 8000, height: 8000}}", "pixels"),
        ("{camera: {width: 4000, height: 4000, supersampling: 4}}", "pixels"),
        ("{imu: {gyroscope_noise: 1e9}}", "gyroscope_noise"),
        ("{gnss: {bias_walk: 1e9}}", "bias_walk"),
        ("{truth: {rate: 1e-9}}", "rate"),
    ],
)
def test_check_and_run_excessive_sensor_memory_is_refused(write: Write, sensors: str, words: str) -> None:
    refused(write({"sensors": sensors}), words)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", [LONG, "/" + LONG, "../" * 2000 + "x", "a/" * 2000])
def test_check_and_run_path_of_5000_letters_is_refused(write: Write, name: str) -> None:
    refused(write(road=name), "is neither in the folder of the scenario")
    refused(write(channel=name), "no channel profile")
    refused(write(channel=name + "x.yaml"), "no file")
    refused(write({"detector": "yolov5", "detector_settings": f"{{weights: {name}.npz}}"}), "no file")
    place = f'<ControllerCatalog><Directory path="{name}"/></ControllerCatalog>'
    reference = '<CatalogReference catalogName="{}" entryName="e"/>'
    for text in ("C", LONG):
        path = write(catalogs=place)
        content = path.read_text()
        controller = content[content.index("<Controller ") : content.index("</Controller>") + len("</Controller>")]
        path.write_text(content.replace(controller, reference.format(text)))
        refused(path, "no catalog")


def test_check_and_run_200_000_attributes_are_refused(write: Write) -> None:
    path = write()
    attributes = " ".join(f'a{n}="1"' for n in range(200_000))
    path.write_text(path.read_text().replace("<OpenSCENARIO>", f"<OpenSCENARIO {attributes}>"))
    refused(path, "more than 200 attributes")


@pytest.mark.exhaustive
def test_check_and_run_millions_of_unknown_elements_are_refused(write: Write) -> None:
    path = write()
    path.write_text(path.read_text().replace("<Entities>", "<Entities>" + "<UnknownThing/>\n" * 3_500_000))
    assert path.stat().st_size > 49_000_000
    refused(path, "more than 2000000 elements and attributes")


@pytest.mark.exhaustive
def test_check_and_run_diagnostics_are_limited(write: Write) -> None:
    path = write()
    path.write_text(path.read_text().replace("<Entities>", "<Entities>\n" + "<UnknownThing/>\n" * 100_000))
    refused(path, "unknown element UnknownThing", "reading ends after 200 errors")
    assert len(CliRunner().invoke(app, ["check", str(path)]).output.splitlines()) < 210


def test_check_and_run_unknown_attribute_diagnostics_are_limited(write: Write) -> None:
    path = write()
    attributes = " ".join(f'b{number}="1"' for number in range(150))
    elements = f"<ScenarioObject {attributes}/>\n" * 500
    path.write_text(path.read_text().replace("<Entities>", f"<Entities>\n{elements}"))
    refused(path, "has no attribute", "reading ends after 200 errors")


def routes_of(tmp_path: Path, declared: str, assigned: str, count: int) -> tuple[str, str]:
    """A catalog of routes, of which each refers to the next one `count` times; locations and an action that uses it."""

    def waypoint(level: int, number: int) -> str:
        given = f"<ParameterAssignments>{assigned.format(number)}</ParameterAssignments>" if assigned else ""
        return (
            '<Waypoint routeStrategy="shortest"><Position><RoutePosition><RouteRef>\n'
            f'<CatalogReference catalogName="R" entryName="r{level}">{given}</CatalogReference></RouteRef>'
            f'<InRoutePosition><FromRoadCoordinates pathS="{number * (18.0 - level / 2.0)}" t="0"/></InRoutePosition>'
            "</RoutePosition></Position></Waypoint>\n"
        )

    places = "".join(
        f'<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-1" s="{s}"/>'
        "</Position></Waypoint>"
        for s in (5, 25)
    )
    routes = "\n".join(
        f'<Route name="r{n}" closed="false">{declared}{"".join(waypoint(n + 1, k) for k in range(count))}</Route>'
        for n in range(24)
    )
    routes += f'<Route name="r24" closed="false">{declared}{places}</Route>'
    (tmp_path / "R.xosc").write_bytes(catalog_xml("R", routes, minor=2))
    action = (
        '<Private entityRef="Ego"><PrivateAction><RoutingAction><AssignRouteAction>'
        '<CatalogReference catalogName="R" entryName="r0"/>'
        "</AssignRouteAction></RoutingAction></PrivateAction></Private>"
    )
    return f'<RouteCatalog><Directory path="{tmp_path}"/></RouteCatalog>', action


@pytest.mark.exhaustive
def test_check_and_run_catalog_entries_that_multiply_are_refused(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each route refers to the next one twice, with another value: 2^24 routes in a few lines."""
    monkeypatch.setattr("eidrive_scenario.openscenario.diagnostics.MAX_CATALOG_ELEMENTS", 60_000)
    declared = '<ParameterDeclaration name="p" parameterType="string" value="a"/>'
    assigned = '<ParameterAssignment parameterRef="p" value="${{$p + b{}}}"/>'
    declared = f"<ParameterDeclarations>{declared}</ParameterDeclarations>"
    catalogs, action = routes_of(tmp_path, declared, assigned, 2)
    refused(write(catalogs=catalogs, init=action), "R.xosc:", "the entries of catalogs have more than", line=False)


@pytest.mark.exhaustive
def test_check_and_run_positions_in_routes_of_positions_are_refused(write: Write, tmp_path: Path) -> None:
    """Each place of a route is a place on the next one: to find the first takes 2^24 routes."""
    catalogs, action = routes_of(tmp_path, "", "", 2)
    refused(write(catalogs=catalogs, init=action), "R.xosc:", "nested too deeply", line=False)

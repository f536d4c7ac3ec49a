"""Entities that settings of a run drive, and criteria that they add: `drive` and `criteria`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from opendrive_xml import lanes_xml, map_xml, road_xml
from openscenario_xml import agent_xml, controller_xml, object_xml, road_file_xml, scenario_xml
from storyboard_xml import end_xml, init_xml, lane_position_xml, private_xml, speed_xml, teleport_xml

from eidrive_scenario.errors import InputError, SettingError
from eidrive_scenario.simulation import RunSettings, Simulation, run_file

PASSING_BY = Path(__file__).parents[1] / "data" / "passing_by.xosc"
PEDESTRIAN = """<Pedestrian mass="80" name="p" pedestrianCategory="pedestrian"><BoundingBox>
<Center x="0" y="0" z="0.9"/>
<Dimensions length="0.5" width="0.5" height="1.8"/></BoundingBox></Pedestrian>"""
MAST = """<MiscObject mass="80" name="rsu" miscObjectCategory="pole"><BoundingBox><Center x="0" y="0" z="2"/>
<Dimensions length="0.5" width="0.5" height="4"/></BoundingBox></MiscObject>"""
LIMIT = '<type s="0" type="town"><speed max="8" unit="m/s"/></type>'


def assign_xml(*, activate: str = "") -> str:
    """Return the assignment of a controller of another tool, and an activation."""
    controller = '<Controller name="HeroAgent"><Properties/></Controller>'
    active = f"<ActivateControllerAction {activate}/>" if activate else ""
    actions = f"<AssignControllerAction>{controller}</AssignControllerAction>"
    both = [f"<ControllerAction>{one}</ControllerAction>" for one in (actions, active) if one]
    return "".join(map(private_xml, both))


def write(folder: Path, *init: str, controller: str = "", limit: str = "", more: str = "", seconds: float = 6) -> Path:
    """Write a scenario of Ego in lane -1 of a straight road of 1 km, at s = 20 m."""
    road = road_xml(lanes=lanes_xml(right=2), length=1000.0).replace("<planView>", f"{limit}<planView>", 1)
    (folder / "road.xodr").write_text(map_xml(road))
    path = folder / "a.xosc"
    path.write_bytes(
        scenario_xml(
            road=road_file_xml("road.xodr"),
            entities=object_xml("Ego", controller=controller) + more,
            init=init_xml("Ego", teleport_xml(lane_position_xml(-1, 20.0)), *init),
            stop=end_xml(seconds),
        )
    )
    return path


def motion(simulation: Simulation, name: str = "Ego") -> np.ndarray[Any, Any]:
    """Return time [s], x, y [m] and speed [m/s] of each frame."""
    rows = []
    with simulation:
        while True:
            frame, end = simulation.tick()
            row = frame.view.row(name)
            rows.append([frame.view.time, *frame.view.position[row, :2], frame.view.speed[row]])
            if end is not None:
                return np.array(rows)


def test_driven_entity_follows_the_speed_of_the_storyboard(tmp_path: Path) -> None:
    path = write(tmp_path, speed_xml(6), limit=LIMIT)
    simulation = Simulation(path, settings=RunSettings(drive="Ego"))
    driven = motion(simulation)
    assert simulation.stack.drivers == {"Ego"}
    assert driven[-1, 3] == pytest.approx(6.0, abs=0.1)
    assert driven[-1, 1] == pytest.approx(20.0 + 6.0 * driven[-1, 0], abs=1.0)
    assert np.abs(driven[:, 2] + 1.75).max() < 0.2, "it stays in the middle of lane -1"


@pytest.mark.parametrize(("limit", "speed"), [(LIMIT, 8.0), ("", 50.0 / 3.6)])
def test_driven_entity_without_a_request_follows_the_speed_limit(tmp_path: Path, limit: str, speed: float) -> None:
    driven = motion(Simulation(write(tmp_path, limit=limit, seconds=12), settings=RunSettings(drive=["Ego"])))
    assert driven[0, 3] == 0.0
    assert driven[-1, 3] == pytest.approx(speed, abs=0.2)


def test_target_speed_of_the_stack_replaces_the_speed_limit(tmp_path: Path) -> None:
    settings = RunSettings(drive={"Ego": {"target_speed": 3.0}})
    assert motion(Simulation(write(tmp_path, limit=LIMIT), settings=settings))[-1, 3] == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize("activate", ["", 'lateral="true" longitudinal="true"', 'lateral="false" longitudinal="false"'])
def test_controller_of_another_tool_is_replaced_with_a_warning(tmp_path: Path, activate: str) -> None:
    path = write(
        tmp_path, speed_xml(6), assign_xml(activate=activate), controller=controller_xml({"gain": 1}, name="Acc")
    )
    result = run_file(path, settings=RunSettings(drive="Ego"))
    message = "controller 'Acc' of 'Ego' is replaced by a driving stack (RunSettings.drive)"
    assert any(message in warning for warning in result.warnings)
    unused = [one for one in result.warnings if "no effect: the driving stack of the run drives 'Ego'" in one]
    assert len(unused) == (2 if activate else 1), result.warnings
    assert not any("is not executed" in one for one in result.warnings)
    assert result.trace_hash == run_file(write(tmp_path, speed_xml(6)), settings=RunSettings(drive="Ego")).trace_hash


@pytest.mark.exhaustive
def test_stack_of_an_option_equals_that_of_the_file(tmp_path: Path) -> None:
    properties = {"detector": "lidar", "sensors": "{lidar: {channels: 8}}", "target_speed": 4}
    in_file = run_file(write(tmp_path, controller=agent_xml(**properties)))
    (tmp_path / "stack.yaml").write_text("detector: lidar\nsensors:\n  lidar: {channels: 8}\ntarget_speed: 4\n")
    given = [
        tmp_path / "stack.yaml",
        str(tmp_path / "stack.yaml"),
        "{detector: lidar, sensors: {lidar: {channels: 8}}, target_speed: 4}",
        {"detector": "lidar", "sensors": {"lidar": {"channels": np.int64(8)}}, "target_speed": 4.0},
    ]
    path = write(tmp_path)
    results = [run_file(path, settings=RunSettings(drive={"Ego": stack})) for stack in given]
    assert {one.trace_hash for one in results} == {in_file.trace_hash}
    assert {one.settings.digest for one in results} == {results[0].settings.digest}
    assert results[0].settings.stations == in_file.settings.stations
    assert (results[0].settings.drive, in_file.settings.drive) == (("Ego",), ())


def test_references_in_a_stack_read_the_parameters_of_the_scenario() -> None:
    with Simulation(PASSING_BY, settings=RunSettings(drive={"Ego": {"target_speed": "$OtherY"}})) as simulation:
        assert simulation.resolved.stations["Ego"]["target_speed"] == 5.0


def test_every_unsuitable_entity_is_reported_with_its_reason(tmp_path: Path) -> None:
    more = object_xml("Walker", PEDESTRIAN) + object_xml("Mast", MAST) + object_xml("Own", controller=agent_xml())
    path = write(tmp_path, more=more)
    line = 1 + path.read_text().split('<Controller name="c"')[0].count("\n")
    with pytest.raises(InputError) as caught:
        run_file(path, settings=RunSettings(drive=("Walker", "Mast", "Own", "Egg"), criteria="{collision: {of: Walk}}"))
    assert [str(one) for one in caught.value.diagnostics] == [
        "RunSettings.drive: 'Walker' is a pedestrian, not a vehicle; the scenario has the vehicles Ego, Own",
        "RunSettings.drive: 'Mast' is a miscellaneous object, not a vehicle; the scenario has the vehicles Ego, Own",
        f"RunSettings.drive: 'Own' has a driving stack already ({path}:{line}); change the properties of its "
        "controller, or remove the option",
        "RunSettings.drive: the scenario has no entity 'Egg'; did you mean 'Ego'?",
        "RunSettings.criteria: criterion 'collision': unknown entity 'Walk'; did you mean 'Walker'?",
    ]


def test_trailer_cannot_be_driven(tmp_path: Path) -> None:
    trailer = object_xml("Cart").replace('vehicleCategory="car"', 'vehicleCategory="trailer"')
    with pytest.raises(InputError, match="'Cart' is a trailer, which is towed"):
        run_file(write(tmp_path, more=trailer), settings=RunSettings(drive="Cart"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("planer: route\n", "s.yaml:1: unknown setting 'planer'; did you mean 'planner'?"),
        ("range: 5\ndetector: radar\n", "s.yaml:2: unknown detector 'radar'; did you mean 'lidar'?"),
        ("range: -1\n", "s.yaml:1: setting 'range' is -1"),
        ("a: &x 1\nb: *x\n", "s.yaml:1: not valid YAML: anchors and aliases are not supported"),
        ("- planner\n", "s.yaml: a driving stack is a mapping of properties (got ['planner'])"),
        ("", "s.yaml: a driving stack is a mapping of properties (got None)"),
        ("module: other\n", "s.yaml:1: property 'module' is 'other'; remove it, or write eidrive"),
        ("target_speed: $Speed\n", "s.yaml:1: setting 'target_speed': unknown parameter $Speed; known: End, OtherY"),
        ("x: !!python/object:os.system {}\n", "s.yaml:1: not valid YAML: tags are not supported"),
        ("range: 5\nfusion_settings: {gaet: 1}\n", "s.yaml:2: unknown setting 'fusion_settings.gaet'; did you mean"),
        ("detector: yolov5\ndetector_settings: {weights: own.npz}\n", "s.yaml:2: no file 'own.npz' with weights"),
    ],
)
def test_invalid_stack_is_reported_with_file_and_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "s.yaml").write_text(text)
    with pytest.raises(InputError) as caught:
        run_file(PASSING_BY, settings=RunSettings(drive={"Ego": tmp_path / "s.yaml"}))
    assert message in str(caught.value).replace(f"{tmp_path}/", "")


def test_torchscript_of_a_stack_needs_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("EIDRIVE_ALLOW_TORCHSCRIPT", raising=False)
    (tmp_path / "own.pt").write_bytes(b"PK")
    own = {"weights": tmp_path / "own.pt", "classes": ["car"], "input_size": [320, 320]}
    stack = {"detector": "yolov5", "detector_settings": own}
    with pytest.raises(InputError, match="are TorchScript, which can execute any code"):
        run_file(PASSING_BY, settings=RunSettings(drive={"Ego": stack}))


@pytest.mark.parametrize(
    ("setting", "value", "message"),
    [
        ("drive", 5, "drive has the entity 5; give a name"),
        ("drive", {"Ego": 5}, r"drive\['Ego'\] is 5; give a name"),
        ("drive", {"": None}, "drive has the entity ''"),
        ("drive", ["Ego", "Ego"], "drive has the entity 'Ego' twice"),
        ("drive", {"Ego": {"range": object()}}, r"drive\['Ego'\] is .*, which is not YAML"),
        ("drive", {"Ego": "  "}, r"drive\['Ego'\] is '  '"),
        ("criteria", 5, "criteria is 5; give a mapping"),
        ("criteria", "", r"RunSettings\.criteria is ''; give a mapping"),
        ("criteria", [["collision"]], r"criteria is \['collision'\]; give a mapping"),
    ],
)
def test_setting_of_wrong_type_raises(setting: str, value: Any, message: str) -> None:
    with pytest.raises(SettingError, match=message):
        RunSettings(**{setting: value})


@pytest.mark.parametrize(
    ("criterion", "message"),
    [
        ("{colision: {of: Ego}}", "RunSettings.criteria: unknown criterion 'colision'; did you mean 'collision'?"),
        ("{collision: {oof: Ego}}", "RunSettings.criteria: criterion 'collision': unknown setting 'oof'; did you mean"),
        ("{collision: Ego}", "RunSettings.criteria: criterion 'collision': settings are not a mapping (got 'Ego')"),
        (
            "collision",
            "RunSettings.criteria: no file 'collision'; give the path of a YAML file, or a mapping {key: value}",
        ),
        ("{}", "RunSettings.criteria: no criterion is declared (got {}); write min_distance:"),
        ("{collision: {of: Ego}", "RunSettings.criteria:1: not valid YAML"),
    ],
)
def test_invalid_criterion_is_reported(criterion: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        run_file(PASSING_BY, settings=RunSettings(criteria=criterion))
    assert message in str(caught.value)


def test_criteria_are_added_to_those_of_the_file(tmp_path: Path) -> None:
    """Ego drives 10 m/s and passes the parked car with 3 m between the bodies: 5 m less twice half a width of 2 m."""
    (tmp_path / "more.yaml").write_text(
        "- max_speed: {of: Ego, at_most: 9}\n- min_distance: {of: Ego, to: Parked, at_least: 1}\n"
    )
    given: list[Any] = [{"collision": {"of": "Ego"}}, tmp_path / "more.yaml"]
    result = run_file(PASSING_BY, settings=RunSettings(criteria=given))
    names = ["collision", "min_distance", "collision_2", "max_speed", "min_distance_2"]
    assert [verdict.name for verdict in result.criteria] == names
    verdicts = {verdict.name: verdict for verdict in result.criteria}
    assert verdicts["min_distance_2"].value == pytest.approx(3.0, abs=1e-6)
    assert verdicts["max_speed"].value == pytest.approx(10.0)
    assert not verdicts["max_speed"].passed
    assert result.exit_code == 1
    plain = run_file(PASSING_BY)
    assert result.trace_hash == plain.trace_hash
    assert result.settings.digest != plain.settings.digest
    assert [list(one) for one in result.settings.criteria] == [["collision"], ["max_speed"], ["min_distance"]]
    assert result.settings.criteria[1]["max_speed"]["at_most"] == 9.0


def test_invalid_criterion_of_a_file_is_reported_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "c.yaml").write_text("- collision: {of: Ego}\n- max_speed:\n    of: Egon\n    at_most: 3\n")
    with pytest.raises(InputError, match=r"c\.yaml:2: criterion 'max_speed': unknown entity 'Egon'"):
        run_file(PASSING_BY, settings=RunSettings(criteria=tmp_path / "c.yaml"))


def test_set_of_entities_has_one_order() -> None:
    """The order of a set of texts differs between processes; warnings and the command keep one order."""
    assert list(RunSettings(drive={"b", "a", "c"}).drive or ()) == ["a", "b", "c"]


def test_speed_of_init_before_the_teleport_is_the_first_speed(tmp_path: Path) -> None:
    """The standard has no order of the actions of Init: the vehicle starts with the commanded speed."""
    path = write(tmp_path)
    text = path.read_text().replace('<Private entityRef="Ego">', f'<Private entityRef="Ego">{speed_xml(6)}', 1)
    path.write_text(text)
    assert motion(Simulation(path, settings=RunSettings(drive="Ego")))[0, 3] == 6.0

"""Settings of stations in the Properties of controllers."""

from __future__ import annotations

import pytest

from eidrive_scenario.driving.planning.conflict_area import ConflictAreaSettings
from eidrive_scenario.driving.settings import AgentSettings, agent_settings
from eidrive_scenario.errors import SettingError
from eidrive_scenario.openscenario.conventions import is_agent_controller
from eidrive_scenario.openscenario.model.controllers import Controller
from eidrive_scenario.openscenario.model.declarations import Properties, Property
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings, Mount, TruthSettings


def controller(*entries: tuple[str, str]) -> Controller:
    """Properties from line 11 on, one a line."""
    properties = tuple(
        Property(name=name, value=value, line=11 + index, source="s.xosc")
        for index, (name, value) in enumerate(entries)
    )
    return Controller(name="c", properties=Properties(property=properties), line=9, source="s.xosc")


def settings(*entries: tuple[str, str]) -> AgentSettings:
    return agent_settings(controller(("module", "eidrive"), *entries))


def test_defaults_of_agent_settings() -> None:
    found = settings()
    assert (found.detector, found.planner, found.cooperates_with) == ("oracle", None, None)
    assert found.fusion == "covariance_intersection"
    assert (found.report_timeout, found.planner_settings.min_existence) == (None, 0.5)
    assert found.rig_sensors(frozenset({"truth"})) == {"truth": TruthSettings()}
    assert found.rig_sensors(frozenset({"camera"})) == {"camera": CameraSettings()}


def test_sensors_of_the_station_replace_default_sensors_of_the_detector() -> None:
    """The learned detectors want a camera, and usually have a LiDAR to lift by as well."""
    usual = {"camera": CameraSettings(width=512, height=384, rate=10.0), "lidar": LidarSettings(rate=10.0)}
    needs = frozenset({"camera"})
    assert settings().rig_sensors(needs, usual) == settings(("sensors", "")).rig_sensors(needs, usual) == usual
    assert settings(("sensors", "camera")).rig_sensors(needs, usual) == {"camera": CameraSettings()}
    with pytest.raises(SettingError, match="needs a sensor of kind camera"):
        settings(("sensors", "lidar")).rig_sensors(needs, usual)


def test_is_agent_controller_requires_module_eidrive() -> None:
    assert is_agent_controller(controller(("module", "eidrive")))
    assert not is_agent_controller(controller(("module", "other")))
    assert not is_agent_controller(controller(("esminiController", "SumoController")))
    assert not is_agent_controller(Controller(name="empty"))


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("RSU", ("RSU",)),
        ("RSU, Spectator", ("RSU", "Spectator")),
        ("[RSU, Spectator]", ("RSU", "Spectator")),
        ("none", ()),
        ("all", None),
        ("", None),
        ("[]", ()),
    ],
)
def test_cooperates_with_accepts_names_all_and_none(text: str, names: tuple[str, ...] | None) -> None:
    assert settings(("cooperates_with", text)).cooperates_with == names


SQUARE = ((29.0, 4.5), (32.0, 4.5), (32.0, 10.5), (29.0, 10.5))


@pytest.mark.parametrize(
    ("text", "areas"),
    [
        ("[29, 32, 4.5, 10.5]", (SQUARE,)),
        ("[[29, 32, 4.5, 10.5]]", (SQUARE,)),
        ("[[29, 32, 4.5, 10.5], [0, 1, 0, 1]]", (SQUARE, ((0, 0), (1, 0), (1, 1), (0, 1)))),
        ("[[0, 0], [2, 0], [1, 2]]", (((0, 0), (2, 0), (1, 2)),)),
        ("[[[0, 0], [2, 0], [1, 2]], [29, 32, 4.5, 10.5]]", (((0, 0), (2, 0), (1, 2)), SQUARE)),
    ],
)
def test_conflict_area_accepts_rectangles_and_polygons(text: str, areas: object) -> None:
    found = settings(("planner", "conflict_area"), ("conflict_area", text)).planner_settings
    assert found.areas == areas
    assert isinstance(found, ConflictAreaSettings)
    assert (found.conflict_deceleration, found.conflict_hold_time) == (5.0, 1.05)


def test_planner_settings_are_properties_or_entries_of_one_property() -> None:
    area = ("conflict_area", "[0, 1, 0, 1]")
    single = settings(("planner", "conflict_area"), area, ("min_existence", "0.7"), ("conflict_hold_time", "2"))
    nested = settings(
        ("planner", "conflict_area"),
        ("planner_settings", "{conflict_area: [0, 1, 0, 1], min_existence: 0.7, conflict_hold_time: 2}"),
    )
    assert single.planner_settings == nested.planner_settings
    assert single.planner_settings.min_existence == 0.7
    assert single.model_dump(mode="json")["planner_settings"]["conflict_hold_time"] == 2.0


@pytest.mark.parametrize("planner", [("planner", "route"), ("planner", "none"), ("min_existence", "0.5")])
def test_properties_of_a_planner_that_is_not_selected_are_checked_and_ignored(planner: tuple[str, str]) -> None:
    """A file with these properties can be run with several planners."""
    assert settings(planner, ("conflict_hold_time", "2")).planner_settings.areas == ()
    with pytest.raises(SettingError, match=r"s.xosc:13: setting 'conflict_hold_time' is -1"):
        settings(planner, ("conflict_hold_time", "-1"))


def test_sensors_are_given_by_kind_or_with_settings() -> None:
    plain = settings(("sensors", "truth, camera"), ("range", "60"), ("field_of_view", "120"), ("mount", "[0, 0, 5]"))
    sensors = plain.rig_sensors(frozenset({"truth"}))
    assert sensors["truth"] == TruthSettings(range=60, field_of_view=120, mount=Mount(x=0, y=0, z=5))
    assert sensors["camera"] == CameraSettings()
    full = settings(("sensors", "{truth: {range: 70}, front: {kind: camera, width: 320, rate: 10}}"), ("range", "60"))
    sensors = full.rig_sensors(frozenset({"truth"}))
    assert sensors["truth"] == TruthSettings(range=70)
    assert sensors["front"] == CameraSettings(width=320, rate=10)


WRONG = [
    ([("detectr", "oracle")], "s.xosc:12: unknown setting 'detectr'; did you mean 'detector'?"),
    ([("detector", "oracl")], "s.xosc:12: unknown detector 'oracl'; did you mean 'oracle'?"),
    ([("planner", "conflictarea")], "s.xosc:12: unknown planner 'conflictarea'; did you mean 'conflict_area'?"),
    ([("fusion", "mean")], "s.xosc:12: unknown fusion method 'mean'"),
    ([("range", "50"), ("range", "60")], "s.xosc:13: property 'range' is given twice, first in line 12"),
    ([("range", "far")], "s.xosc:12: setting 'range' is 'far'"),
    ([("target_speed", "-3")], "s.xosc:12: setting 'target_speed' is -3"),
    ([("planner", "conflict_area")], "s.xosc:12: setting 'conflict_area' is missing"),
    ([("planner", "route"), ("planner_settings", "{gap: 1}")], "s.xosc:13: unknown setting 'planner_settings.gap'"),
    ([("planner_settings", "[1]")], "s.xosc:12: setting 'planner_settings' is [1]; a mapping is expected"),
    ([("vehicle_controller", "pdi")], "s.xosc:12: unknown vehicle controller 'pdi'; did you mean 'pid'?"),
    ([("tracker", "cvt")], "s.xosc:12: setting 'tracker' is 'cvt'; did you mean 'cv"),
    (
        [("min_existence", "0.2"), ("planner_settings", "{min_existence: 0.4}")],
        "s.xosc:12: setting 'min_existence' of the planner is given twice; remove it from 'planner_settings'",
    ),
    ([("messages", "cpm, cam, cpm")], "a station sends each kind of message once (got cpm, cam, cpm)"),
    ([("conflict_area", "[3, 1, 0, 1]")], "the rectangle [3, 1, 0, 1] is empty"),
    ([("conflict_area", "[1, 2, 3]")], "an area is [x0, x1, y0, y1]"),
    ([("conflict_area", "5")], "an area is [x0, x1, y0, y1]"),
    ([("conflict_area", "[1, 2")], "s.xosc:12: property 'conflict_area' is '[1, 2', which is not valid YAML"),
    ([("range", "2001-13-45")], "s.xosc:12: property 'range' is '2001-13-45', which is not valid YAML: month must be"),
    ([("sensors", "{truth: {range: 5}, truth: {}}")], "not valid YAML: duplicate key 'truth'"),
    ([("sensors", "truth, radar")], "sensor 'radar' needs a kind"),
    ([("sensors", "{a: {kind: truth}, b: {kind: truth}}")], "at most one sensor of kind 'truth' (got a, b)"),
    ([("sensors", "{a: {kind: gnss}, b: {kind: gnss}}")], "at most one sensor of kind 'gnss' (got a, b)"),
    (
        [("sensors", "{truth: {rnge: 5}}")],
        "s.xosc:12: unknown setting 'sensors.truth.rnge'; did you mean 'range'?",
    ),
    ([("mount", "[1, 2]")], "three to five numbers are expected"),
    ([("mount", "[0, 0, true]")], "'mount' is [0, 0, True]; a mapping is expected"),
]


@pytest.mark.parametrize(("entries", "message"), WRONG, ids=[str(row[0]) for row in WRONG])
def test_invalid_property_is_reported_with_line_and_hint(entries: list[tuple[str, str]], message: str) -> None:
    with pytest.raises(SettingError) as caught:
        settings(*entries)
    assert message in str(caught.value)
    assert "s.xosc:" in str(caught.value)


def test_duplicate_settings_of_the_planner_are_reported_in_order_of_properties() -> None:
    names = ["horizon", "memory", "time_gap", "caution", "uncertainty"]
    nested = "{uncertainty: 1, caution: true, time_gap: 1, memory: 1, horizon: 8}"
    with pytest.raises(SettingError) as caught:
        settings(*((name, "true" if name == "caution" else "8") for name in names), ("planner_settings", nested))
    assert [diagnostic.message.split("'")[1] for diagnostic in caught.value.diagnostics][:5] == names


def test_all_diagnostics_are_reported_at_once() -> None:
    with pytest.raises(SettingError) as caught:
        settings(("detector", "x"), ("color", "red"), ("range", "-1"))
    assert [diagnostic.line for diagnostic in caught.value.diagnostics] == [12, 14, 13]

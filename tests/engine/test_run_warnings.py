"""Warnings of a run: what never started, who never moved, delays below a step, conflict areas off the road, and
traffic lights out of view."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from scenario_1 import edited
from storyboard_xml import condition_xml, event_xml, maneuver_xml, time_xml, trigger_xml
from typer.testing import CliRunner

from eidrive_scenario.cli import app
from eidrive_scenario.simulation import RunSettings, run_file

Make = Callable[..., Path]
BEFORE = "</ManeuverGroup>"


def maneuver(name: str, at: float, *, priority: str = "parallel", limit: int = 1, action: str = "") -> str:
    """A maneuver with one event that starts after a time [s]."""
    action = action or (
        '<UserDefinedAction><CustomCommandAction type="test">nothing</CustomCommandAction></UserDefinedAction>'
    )
    start = trigger_xml(condition_xml(time_xml(at)))
    event = event_xml(name, action, start, action_name=f"A{name}", priority=priority, count=limit)
    return maneuver_xml(event, f"M{name}")


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """Scenario 1 with texts replaced."""

    def write(*edits: tuple[str, str]) -> Path:
        return edited(tmp_path, *edits, count=1)

    return write


def ours(warnings: tuple[str, ...]) -> list[str]:
    words = ("never started", "covered only", "step of", "never holds a vehicle", "show a car up to")
    return [warning for warning in warnings if any(word in warning for word in words)]


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["coop/scenario_1", "coop/scenario_2", "coop/scenario_1_late_rsu"])
@pytest.mark.parametrize("channel", ["none", "ideal", "latency_300ms"])
def test_library_scenarios_run_without_warnings(name: str, channel: str) -> None:
    assert run_file(name, settings=RunSettings(channel=channel)).warnings == ()


def test_event_that_never_started_is_reported_with_its_line(make: Make) -> None:
    path = make((BEFORE, f"{maneuver('Soon', 0.5)}\n{maneuver('Never', 90)}{BEFORE}"))
    (warning,) = ours(run_file(path).warnings)
    line = next(n for n, text in enumerate(path.read_text().splitlines(), 1) if '"Never"' in text)
    assert warning.startswith(f"{path}:{line}: event 'Never' never started: its start trigger was not fulfilled until ")
    assert "(stop trigger); eidrive run --explain 'Never'" in warning


def test_act_that_never_started_is_reported_instead_of_its_events(make: Make) -> None:
    path = make(
        (
            "</Act>",
            '</Act><Act name="Late"><ManeuverGroup name="G" maximumExecutionCount="1">'
            f'<Actors selectTriggeringEntities="false"/>{maneuver("Inner", 0)}</ManeuverGroup><StartTrigger>'
            '<ConditionGroup><Condition name="c" delay="0" conditionEdge="none"><ByValueCondition>'
            '<SimulationTimeCondition value="90" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup>'
            "</StartTrigger></Act>",
        )
    )
    (warning,) = ours(run_file(path).warnings)
    assert "act 'Late' never started" in warning


def test_many_unstarted_events_are_counted(make: Make) -> None:
    path = make((BEFORE, "".join(maneuver(f"E{number}", 90) for number in range(8)) + BEFORE))
    warnings = ours(run_file(path).warnings)
    assert len(warnings) == 6
    assert "3 more acts and events never started" in warnings[-1]


def test_event_that_may_never_run_is_not_reported(make: Make) -> None:
    path = make((BEFORE, f"{maneuver('Off', 0.5, limit=0)}{BEFORE}"))
    assert ours(run_file(path).warnings) == []


def test_run_cut_short_by_a_failure_does_not_report_later_events(make: Make) -> None:
    stop = '<UserDefinedAction><CustomCommandAction type="exitFailure"/></UserDefinedAction>'
    path = make((BEFORE, f"{maneuver('Never', 90)}{maneuver('Fail', 1.0, action=stop)}{BEFORE}"))
    result = run_file(path)
    assert result.end_reason == "command: exitFailure"
    assert ours(result.warnings) == []
    fatal = make(
        (BEFORE, f"{maneuver('Never', 90)}{BEFORE}"), ("collision: {of: Ego}", "collision: {of: Ego, fatal: true}")
    )
    result = run_file(fatal, settings=RunSettings(channel="none"))
    assert result.end_reason == "criterion: collision"
    assert ours(result.warnings) == []


def test_station_that_does_not_move_is_reported_with_its_line(make: Make) -> None:
    path = make()
    line = next(n for n, text in enumerate(path.read_text().splitlines(), 1) if 'ScenarioObject name="Ego"' in text)
    (warning,) = ours(run_file(path, settings=RunSettings(parameters={"EgoSpeed": "0"}, time_limit=4.0)).warnings)
    assert warning.startswith(f"{path}:{line}: station 'Ego' covered only 0.0")
    assert "check its target speed" in warning


def test_parked_station_and_mast_are_not_reported(make: Make) -> None:
    planner = '<Property name="planner" value="$Planner"/>'
    path = make((planner, planner.replace("conflict_area", "none")))
    assert ours(run_file(path, settings=RunSettings(time_limit=3.0)).warnings) == []


@pytest.mark.parametrize(
    ("channel", "dt", "median"),
    [
        ("{delay: {kind: constant, seconds: 0.02}}", 0.05, "the delay of the channel 'custom' is only 0.02 s"),
        ("{delay: {kind: constant, seconds: 0.02}}", 0.02, ""),
        ("{delay: {kind: constant, seconds: 0.02}}", 0.01, ""),
        ("{delay: {kind: constant, seconds: 0}}", 0.05, ""),
        ("{delay: {kind: uniform, minimum: 0.01, maximum: 0.05}}", 0.05, "the median delay of the channel 'custom'"),
        ("{delay: {kind: uniform, minimum: 0.01, maximum: 0.2}}", 0.05, ""),
        ("{delay: {kind: trace, seconds: [0.01, 0.01, 0.3]}}", 0.05, "the median delay of the channel 'custom'"),
        (
            "{delay: {kind: trace, seconds: [0.01, 0.02, 0.3], replay: true}}",
            0.05,
            "the median delay of the channel 'custom' is only 0.02 s",
        ),
        ("5g_uu", 0.05, "the median delay of the channel '5g_uu' is only 0.0103 s"),
        ("5g_uu", 0.01, ""),
        ("80211p_urban", 0.05, ""),
        ("none", 0.05, ""),
    ],
)
def test_delay_below_one_step_is_reported(channel: str, dt: float, median: str) -> None:
    warnings = ours(run_file("coop/scenario_1", settings=RunSettings(channel=channel, dt=dt, time_limit=0.3)).warnings)
    assert len(warnings) == bool(median)
    assert all(
        warning.startswith(f"RunSettings.channel: most messages take one step of {dt:g} s: {median}")
        for warning in warnings
    )


def test_delay_of_the_file_is_reported_with_its_line(make: Make) -> None:
    path = make(('"eidrive.channel">ideal', '"eidrive.channel">{delay: {kind: constant, seconds: 0.02}}'))
    line = next(n for n, text in enumerate(path.read_text().splitlines(), 1) if "eidrive.channel" in text)
    (warning,) = ours(run_file(path, settings=RunSettings(time_limit=0.3)).warnings)
    assert warning.startswith(f"{path}:{line}: most messages take one step")
    assert ours(run_file(path, settings=RunSettings(time_limit=0.3, channel="ideal")).warnings) == []


def test_detector_latency_below_one_step_is_reported(make: Make) -> None:
    area = '<Property name="conflict_area"'
    path = make((area, f'<Property name="detector_latency" value="0.02"/>{area}'))
    (warning,) = ours(run_file(path, settings=RunSettings(time_limit=0.3)).warnings)
    assert "detections of 'Ego' are known one step of 0.05 s later: its detector_latency is only 0.02 s" in warning


@pytest.mark.parametrize(("dt", "warns"), [(0.05, False), (0.1, True)])
def test_message_rate_beyond_one_message_per_step_is_reported(make: Make, dt: float, warns: bool) -> None:
    area = '<Property name="conflict_area"'
    path = make((area, f'<Property name="message_rate" value="20"/>{area}'))
    warnings = ours(run_file(path, settings=RunSettings(time_limit=0.3, dt=dt)).warnings)
    expected = "'Ego' sends one message in each step of 0.1 s: its message_rate is 20 Hz"
    assert [expected in warning for warning in warnings] == [True] * warns


@pytest.mark.parametrize(("speed", "warns"), [(18.0, False), (18.5, True)])
def test_target_speed_beyond_the_view_is_reported(make: Make, speed: float, warns: bool) -> None:
    """From 18.1 m/s a vehicle stops within 50 m: 0.5 s · 18.1 m/s + (18.1 m/s)² / (2 · 4 m/s²)."""
    speed_property = f'<Property name="target_speed" value="{speed}"/>'
    path = make(('name="module" value="eidrive"/>', f'name="module" value="eidrive"/>{speed_property}'))
    warnings = ours(run_file(path, settings=RunSettings(planner="behavior", time_limit=0.3)).warnings)
    assert [warning.partition(": from")[0] for warning in warnings] == (
        ["the sensors of 'Ego' show a car up to 50 m"] if warns else []
    )


@pytest.mark.parametrize(
    ("area", "off"),
    [
        ("[29.0, 32.0, 204.5, 210.5]", True),
        ("[[29, 32, 4.5, 10.5], [29, 32, 204.5, 210.5]]", True),
        ("[29.0, 32.0, 4.5, 10.5]", False),
        ("[-500, 500, -500, 500]", False),
        ("[29.0, 32.0, -300, 300]", False),
    ],
)
def test_conflict_area_off_the_road_is_reported_by_run_and_check(make: Make, area: str, off: bool) -> None:
    path = make(("[29.0, 32.0, 4.5, 10.5]", area))
    warnings = ours(run_file(path, settings=RunSettings(time_limit=0.3)).warnings)
    assert len(warnings) == off
    checked = CliRunner().invoke(app, ["check", str(path)]).stdout
    assert ("conflict-area-off-road" in checked) is off
    line = next(n for n, text in enumerate(path.read_text().splitlines(), 1) if '"conflict_area" value' in text)
    assert all(f"{path}:{line}: " in warning for warning in warnings)


@pytest.mark.parametrize(
    ("mount", "detector", "warns"), [("front", "ssd", 0), ("back", "ssd", 1), ("back", "lidar", 0)]
)
def test_cameras_that_show_no_traffic_light_are_reported(make: Make, mount: str, detector: str, warns: int) -> None:
    """The lidar detector reads no lights from images."""
    area = '<Property name="conflict_area"'
    sensors = f'<Property name="sensors" value="{{camera: {{mount: {mount}}}, lidar: {{}}}}"/>'
    obeys = '<Property name="obey_signals" value="true"/>'
    path = make((area, f"{obeys}{sensors}{area}"), ("coop_1.xodr", "coop_2.xodr"))
    warnings = run_file(path, settings=RunSettings(detector=detector, time_limit=0.05)).warnings
    assert len([warning for warning in warnings if "its cameras show no traffic light" in warning]) == warns


def test_conflict_area_beside_other_planner_settings_is_reported_with_its_own_line(make: Make) -> None:
    others = '<Property name="planner_settings" value="{min_existence: 0.4}"/>\n'
    area = '<Property name="conflict_area" value="[29.0, 32.0, {}]"/>'
    path = make((area.format("4.5, 10.5"), others + area.format("204.5, 210.5")))
    (warning,) = ours(run_file(path, settings=RunSettings(time_limit=0.3)).warnings)
    line = next(n for n, text in enumerate(path.read_text().splitlines(), 1) if '"conflict_area" value' in text)
    assert warning.startswith(f"{path}:{line}: ")


def test_warnings_are_in_json_and_on_standard_error(make: Make) -> None:
    path = make((BEFORE, f"{maneuver('Never', 90)}{BEFORE}"))
    plain = CliRunner().invoke(app, ["run", str(path)])
    assert "warning: " in plain.stderr
    assert "never started" not in plain.stdout
    printed = CliRunner().invoke(app, ["run", str(path), "--json"])
    (line,) = printed.stdout.splitlines()
    assert ["event 'Never' never started" in warning for warning in json.loads(line)["warnings"]].count(True) == 1
    assert "event 'Never' never started" in printed.stderr

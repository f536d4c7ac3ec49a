"""Every criterion in a run that passes it and in one that fails it, on the road of scenario 1.

The Ego drives 40 m along its lane at 10 m/s behind a car at 8 m/s, 20 m ahead of it (bumper to bumper 16 m).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from criteria_scenario import ROAD, write_scenario

from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.simulation import RunSettings, run_file

ACTORS = {
    "Ego": (-70.0, 0.0, 0.0, 10.0),
    "Lead": (-50.0, 0.0, 0.0, 8.0),
    "Oncoming": (-10.0, 3.5, 3.14159265, 5.0),
    "Sidewalk": (-30.0, -7.2, 0.0, 0.0),
    "Runner": (5.0, 0.0, 0.0, 6.0),
    "Changer": (60.0, 0.0, 0.0, 8.0),
    "Last": (131.0, 0.0, 0.0, 0.0),
}

CASES = {
    "actor_blocked": ("{of: Sidewalk, at_most: 4.1}", "{of: Sidewalk, at_most: 3.9}"),
    "comfort": ("{of: Ego}", "{of: Changer}"),
    "end_of_road": ("{of: Ego}", "{of: Last, within: 1.6}"),
    "keep_lane": ("{of: Ego}", "{of: Changer}"),
    "off_road": ("{of: Ego}", "{of: Sidewalk}"),
    "on_sidewalk": ("{of: Ego}", "{of: Sidewalk}"),
    "wrong_lane": ("{of: Ego}", "{of: Changer}"),
    "in_route": (
        "{of: Ego, route: [[-70, 0], [-30, 0]], at_most: 1}",
        "{of: Ego, route: [[-70, 35], [0, 35]], at_most: 30}",
    ),
    "outside_route_lanes": ("{of: Ego}", "{of: Changer}"),
    "route_completion": ("{of: Ego, route: [[-70, 0], [-31, 0]]}", "{of: Ego, route: [[-70, 0], [10, 0]]}"),
    "yield_to_emergency_vehicle": ("{of: Oncoming, to: Ego}", "{of: Lead, to: Ego}"),
    "average_speed": ("{of: Ego, at_least: 9.9}", "{of: Lead, at_least: 9.9}"),
    "collision": ("{of: Ego}", "{of: Rear}"),
    "deceleration_to_avoid_crash": ("{of: Ego, at_most: 0.26}", "{of: Ego, at_most: 0.2}"),
    "driven_distance": ("{of: Ego, at_least: 39}", "{of: Ego, at_least: 41}"),
    "max_speed": ("{of: Ego, at_most: 10.1}", "{of: Ego, at_most: 9.9}"),
    "min_distance": ("{of: Ego, to: Lead, at_least: 7.9}", "{of: Ego, to: Lead, at_least: 8.1}"),
    "min_speed": ("{of: Ego, at_least: 9.9, after: 1}", "{of: Lead, at_least: 8.1, after: 1}"),
    "post_encroachment_time": (
        "{of: Ego, to: Oncoming, at_least: 1.5}",
        "{of: Ego, to: Lead, at_least: 2.0}",
    ),
    "reach_position": ("{of: Ego, x: -40, y: 0}", "{of: Ego, x: -40, y: 9}"),
    "reached_region": ("{of: Ego, region: [[-45, -2], [-35, 2]]}", "{of: Ego, region: [[-20, -2], [-10, 2]]}"),
    "running_stop_sign": ("{of: Oncoming}", "{of: Runner}"),
    "rss_violation": ("{of: Oncoming}", "{of: Ego}"),
    "time_headway": ("{of: Ego, at_least: 0.79}", "{of: Ego, at_least: 0.81}"),
    "time_limit": ("{within: 5}", "{within: 3, fatal: false}"),
    "time_to_collision": ("{of: Ego, to: Lead, at_least: 3.9}", "{of: Ego, to: Lead, at_least: 4.1}"),
}
"""Settings with which a criterion passes and fails."""

LATE = {"model": "composed", "own_perception": True, "delay": {"kind": "constant", "seconds": 0.9}}
"""With 0.9 s of delay the car at 9 m/s has left the conflict area when the Ego brakes for it."""

BY_CHANNEL: dict[str, tuple[dict[str, Any], Any, Any]] = {
    "age_of_information": ({"receiver": "Ego", "at_most": 0.2}, "ideal", "latency_300ms"),
    "channel_busy_ratio": ({"of": "Ego", "at_most": 0.5}, "80211p_urban", "congested"),
    "cooperation_gain": ({"of": "Ego", "at_least": 0.1}, "ideal", "none"),
    "detection_count": ({"of": "Ego", "classes": ["car"], "at_least": 0.3}, "ideal", "none"),
    "detection_recall": ({"of": "Ego", "objects": "helper_only", "at_least": 0.99}, "ideal", "none"),
    "false_braking": ({"of": "Ego"}, "ideal", LATE),
    "first_detection": ({"of": "Ego", "to": "Incoming", "by": 1.0}, "ideal", "none"),
    "latency": ({"receiver": "Ego", "at_most": 0.2}, "ideal", "latency_300ms"),
    "packet_reception_ratio": ({"sender": "RSU", "receiver": "Ego", "at_least": 0.9}, "ideal", "error_30pct"),
    "position_error": ({"of": "Ego", "at_most": 0.1}, "none", "paper_latency_300ms"),
}
"""Settings of criteria on perception and communication, and the channels with which they pass and fail in scenario 1: a
truck hides the incoming car from the Ego until the crossing, and the roadside unit sees it from the start on."""

SEPARATE = {"monitor", "running_red_light"}
"""Criteria whose runs are separate tests below."""


def test_every_criterion_has_runs() -> None:
    assert set(CASES) | set(BY_CHANNEL) | SEPARATE == set(registry("criteria"))


@pytest.mark.exhaustive
@pytest.mark.parametrize("kind", sorted(BY_CHANNEL))
def test_criterion_in_runs_of_scenario_1(kind: str) -> None:
    settings, passing, failing = BY_CHANNEL[kind]
    for channel, passed in ((passing, True), (failing, False)):
        result = run_file("coop/scenario_1", settings=RunSettings(channel=channel, criteria={kind: settings}))
        assert [verdict.passed for verdict in result.criteria if verdict.name == kind] == [passed]


@pytest.mark.parametrize("index", [0, 1], ids=["passed", "failed"])
def test_criteria_in_run(tmp_path: Path, index: int) -> None:
    """A car 4 m behind the Ego, at 20 m/s, hits it: the criteria on the Ego are evaluated without it."""
    chosen = {kind: cases[index] for kind, cases in CASES.items() if "Rear" not in cases[index]}
    text = ", ".join(f"{kind}: {settings}" for kind, settings in chosen.items())
    result = run_file(write_scenario(tmp_path, text, ACTORS))
    assert {verdict.name: verdict.passed for verdict in result.criteria} == dict.fromkeys(chosen, index == 0)


def test_collision_in_run(tmp_path: Path) -> None:
    actors = {"Ego": (-50.0, 0.0, 0.0, 5.0), "Rear": (-60.0, 0.0, 0.0, 15.0)}
    result = run_file(write_scenario(tmp_path, "collision: {of: Rear}", actors))
    assert not result.passed


LIGHT = """<GlobalAction><InfrastructureAction><TrafficSignalAction>
<TrafficSignalStateAction name="10" state="{state}"/></TrafficSignalAction></InfrastructureAction></GlobalAction>"""


@pytest.mark.parametrize(("state", "passed"), [("red", False), ("green", True)])
def test_red_light_in_run(tmp_path: Path, state: str, passed: bool) -> None:
    """The sign at the end of road 1 is replaced by a light."""
    sign = 'id="10" name="stop near" dynamic="no" orientation="+" zOffset="2.4" country="DE" type="206"'
    text = ROAD.read_text(encoding="utf-8")
    assert sign in text
    road = tmp_path / "lights.xodr"
    road.write_text(text.replace(sign, sign.replace('"no"', '"yes"').replace("206", "1000001")), encoding="utf-8")
    actors = {"Ego": (0.0, 0.0, 0.0, 6.0)}
    path = write_scenario(tmp_path, "running_red_light: {of: Ego}", actors, road, LIGHT.format(state=state))
    (verdict,) = run_file(path).criteria
    assert (verdict.passed, verdict.value) == (passed, float(not passed))


MONITORS = '<MonitorDeclarations><MonitorDeclaration name="Seen" value="false"/></MonitorDeclarations>'


@pytest.mark.parametrize("value", ["true", "false"])
def test_monitor_in_run(tmp_path: Path, value: str) -> None:
    action = f'<GlobalAction><SetMonitorAction monitorRef="Seen" value="{value}"/></GlobalAction>'
    path = write_scenario(tmp_path, "monitor: {of: Seen}", {"Ego": (0.0, 0.0, 0.0, 6.0)}, init=action)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("<CatalogLocations/>", f"{MONITORS}<CatalogLocations/>"), encoding="utf-8")
    (verdict,) = run_file(path).criteria
    assert verdict.passed == (value == "true")


def test_file_of_the_test_is_valid(tmp_path: Path) -> None:
    assert not load_scenario(write_scenario(tmp_path, "collision: {of: Ego}", ACTORS)).warnings

"""Planner that the settings of a run give to all driven stations: `planner`, `--planner`, `--eidrive-planner`."""

from __future__ import annotations

from pathlib import Path

import pytest
from openscenario_xml import agent_xml, controller_xml, object_xml, scenario_xml
from storyboard_xml import end_xml, init_xml, teleport_xml, world_position_xml

from eidrive_scenario.errors import InputError
from eidrive_scenario.experiments.commands import command_of
from eidrive_scenario.simulation import RunSettings, Simulation, run_file

PASSING_BY = Path(__file__).parents[1] / "data" / "passing_by.xosc"
AREA = "[[10, -2], [20, -2], [20, 2], [10, 2]]"


def scenario(*objects: str) -> bytes:
    return scenario_xml(
        entities="".join(objects), init=init_xml("Ego", teleport_xml(world_position_xml(0))), stop=end_xml(0.1)
    )


def planners(source: bytes | Path, **settings: object) -> dict[str, object]:
    with Simulation(source, settings=RunSettings(**settings)) as simulation:  # type: ignore[arg-type]
        return {name: one["planner"] for name, one in simulation.resolved.stations.items()}


def test_planner_replaces_those_of_driven_stations_only() -> None:
    source = scenario(
        object_xml("Ego", controller=agent_xml(conflict_area=AREA, planner="conflict_area", target_speed=7)),
        object_xml("Default", controller=agent_xml()),
        object_xml("Parked", controller=agent_xml(planner="none")),
        object_xml("Scripted", controller=controller_xml({"gain": 1}, name="Acc")),
    )
    before = {"Ego": "conflict_area", "Default": None, "Parked": "none"}
    assert planners(source) == before
    assert planners(source, planner="route") == {"Ego": "route", "Default": "route", "Parked": "none"}
    with Simulation(source, settings=RunSettings(planner="route")) as simulation:
        assert simulation.resolved.planner == "route"
        assert simulation.resolved.stations["Ego"]["target_speed"] == 7.0, "other properties are kept"


def test_run_with_the_option_equals_a_file_with_the_planner() -> None:
    def written(planner: str) -> bytes:
        return scenario(object_xml("Ego", controller=agent_xml(planner=planner, conflict_area=AREA, target_speed=5)))

    in_file, by_option = (
        run_file(written("route")),
        run_file(written("conflict_area"), settings=RunSettings(planner="route")),
    )
    assert by_option.trace_hash == in_file.trace_hash
    assert by_option.settings.stations == in_file.settings.stations
    assert (by_option.settings.planner, in_file.settings.planner) == ("route", None)
    assert by_option.settings.digest != in_file.settings.digest
    command = command_of("coop/scenario_1", 1, RunSettings(planner="route"))
    assert command == "eidrive run coop/scenario_1 --planner route --seed 1"


def test_planner_settings_of_the_file_do_not_apply_to_another_planner() -> None:
    nested = agent_xml(planner="conflict_area", planner_settings=f"{{conflict_area: {AREA}}}", target_speed=5)
    assert planners(scenario(object_xml("Ego", controller=nested)), planner="route") == {"Ego": "route"}


def test_planner_applies_to_stacks_of_the_option_drive() -> None:
    settings = {"drive": {"Ego": {"planner": "route"}, "Parked": {"planner": "none"}}, "planner": "route"}
    assert planners(PASSING_BY, **settings) == {"Ego": "route", "Parked": "none"}


@pytest.mark.parametrize(
    ("planner", "message"),
    [
        ("rout", "RunSettings.planner: unknown planner 'rout'; did you mean 'route'?"),
        ("none", "RunSettings.planner: unknown planner 'none'"),
        ("", "RunSettings.planner: unknown planner ''"),
        (
            "route",
            "RunSettings.planner: planner 'route' has no effect: the scenario has no station that drives; "
            "remove the option, or give a vehicle a stack by RunSettings.drive",
        ),
        (5, "planner is 5"),
    ],
)
def test_invalid_planner_is_an_error_before_the_run(planner: object, message: str) -> None:
    with pytest.raises(InputError) as caught:
        run_file(PASSING_BY, settings=RunSettings(planner=planner))  # type: ignore[arg-type]
    assert message in str(caught.value)


def test_missing_setting_has_the_line_of_the_controller() -> None:
    source = scenario(object_xml("Ego", controller=agent_xml()))
    line = 1 + source[: source.index(b"<Controller ")].count(b"\n")
    with pytest.raises(InputError, match=f":{line}: setting 'conflict_area' is missing"):
        run_file(source, settings=RunSettings(planner="conflict_area"))


def test_invalid_property_of_the_station_is_the_only_error() -> None:
    with pytest.raises(InputError) as caught:
        run_file(scenario(object_xml("Ego", controller=agent_xml(speed=3))), settings=RunSettings(planner="route"))
    assert ["unknown setting 'speed'" in one.message for one in caught.value.diagnostics] == [True]

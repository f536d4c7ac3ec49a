"""Warning about criteria that a vehicle fulfills by standing still."""

from __future__ import annotations

import inspect
from pathlib import Path

import pytest
from openscenario_xml import agent_xml, object_xml, scenario_xml
from storyboard_xml import end_xml, init_xml, teleport_xml, world_position_xml

from eidrive_scenario.evaluation.criterion import Criterion
from eidrive_scenario.extensions.registry import registry
from eidrive_scenario.simulation import RunSettings, Simulation, run_file

PROGRESS = {
    "actor_blocked",
    "average_speed",
    "driven_distance",
    "min_speed",
    "reach_position",
    "reached_region",
    "route_completion",
}
"""Criteria that a vehicle which stands still fails, if its limit is above 0."""


def scenario(*criteria: str, controller: str = "", command: str = "") -> bytes:
    commands = [("eidrive.criterion", text) for text in criteria] + [(command, "")] * bool(command)
    actions = "".join(
        f'<UserDefinedAction><CustomCommandAction type="{kind}">{text}</CustomCommandAction></UserDefinedAction>'
        for kind, text in commands
    )
    return scenario_xml(
        entities=object_xml("Ego", controller=controller) + object_xml("Other"),
        init=actions + init_xml("Ego", teleport_xml(world_position_xml(0))),
        stop=end_xml(0.2),
    )


def warnings(source: bytes | Path, **settings: object) -> list[str]:
    return [one for one in run_file(source, settings=RunSettings(**settings)).warnings if "drives on" in one]  # type: ignore[arg-type]


def test_driven_vehicle_without_a_demand_of_progress_is_a_warning() -> None:
    (warning,) = warnings(scenario("collision: {of: Ego}", controller=agent_xml()))
    assert warning == (
        "no criterion demands that Ego drives on: a vehicle that stands still passes; add one such as "
        "driven_distance: {of: Ego, at_least: 50}, reached_region or route_completion"
    )


@pytest.mark.parametrize(
    "criterion",
    [
        "driven_distance: {of: Ego, at_least: 1}",
        "actor_blocked: {of: Ego}",
        "reach_position: {of: Ego, x: 9, y: 0}",
        "reached_region: {of: Ego, region: [[1, 1], [2, 2]]}",
        "average_speed: {of: Ego, at_least: 1}",
        "min_speed: {of: Ego, at_least: 1}",
        "route_completion: {of: Ego, route: [[0, 0], [9, 0]]}",
    ],
)
def test_criterion_that_demands_progress_prevents_the_warning(criterion: str) -> None:
    assert warnings(scenario("collision: {of: Ego}", criterion, controller=agent_xml())) == []
    assert warnings(scenario("collision: {of: Ego}"), drive="Ego", criteria=f"{{{criterion}}}") == []


@pytest.mark.parametrize(
    "criterion",
    [
        "driven_distance: {of: Other, at_least: 1}",
        "average_speed: {of: Ego}",
        "average_speed: {of: Ego, at_most: 9}",
        "min_speed: {of: Ego, at_least: 0}",
        "max_speed: {of: Ego, at_most: 9}",
        "route_completion: {of: Ego, route: [[0, 0], [9, 0]], at_least: 0}",
    ],
)
def test_criterion_that_a_standing_vehicle_fulfills_is_a_warning(criterion: str) -> None:
    assert len(warnings(scenario(criterion, controller=agent_xml()))) == 1


def test_runs_without_criteria_drivers_or_with_an_exit_have_no_warning() -> None:
    assert warnings(scenario(controller=agent_xml())) == []
    assert warnings(scenario("collision: {of: Ego}")) == []
    assert warnings(scenario("collision: {of: Ego}", controller=agent_xml(planner="none"))) == []
    assert warnings(scenario("collision: {of: Ego}", controller=agent_xml(), command="exitSuccess")) == []


def test_warning_names_every_driver() -> None:
    found = warnings(scenario("collision: {of: Ego}"), drive=["Other", "Ego"])
    assert [one.split(":")[0] for one in found] == ["no criterion demands that Ego or Other drives on"]


def test_criteria_of_the_library_that_demand_progress() -> None:
    """Every other criterion of the library passes a vehicle that stands still, or needs another actor to approach."""
    found = {
        name
        for name in registry("criteria")
        if registry("criteria").load(name, Criterion).demands_progress
        or "self.demands_progress" in inspect.getsource(registry("criteria").load(name, Criterion))
    }
    assert found == PROGRESS


def test_check_reports_the_warning_of_the_run() -> None:
    with Simulation(scenario("collision: {of: Ego}", controller=agent_xml(target_speed=5))) as simulation:
        assert len(simulation.progress_warnings) == 1
        assert simulation.run().warnings[-1] == str(simulation.progress_warnings[0])

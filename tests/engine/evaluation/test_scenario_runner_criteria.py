"""Criteria of ScenarioRunner: conditions `criteria_…` in the stop trigger."""

from __future__ import annotations

from pathlib import Path

import pytest

from eidrive_scenario.errors import SettingError
from eidrive_scenario.evaluation.criteria_parser import (
    CriteriaContext,
    build_criteria,
    parse_criteria,
    stop_trigger_declarations,
    unsupported_criteria,
)
from eidrive_scenario.openscenario import Scenario, load_scenario
from eidrive_scenario.simulation import Simulation

PASSING_BY = Path(__file__).parents[2] / "data" / "passing_by.xosc"

CONDITION = """
<Condition name="{name}" delay="0" conditionEdge="rising">
  <ByValueCondition><ParameterCondition parameterRef="{parameter}" value="{value}" rule="lessThan"/></ByValueCondition>
</Condition>"""


ROAD = Path(__file__).parents[3] / "xosc" / "roads" / "coop_1.xodr"


def written_for_scenario_runner(
    *conditions: tuple[str, str, str], ego: bool = True, road: Path | None = None
) -> Scenario:
    text = PASSING_BY.read_text(encoding="utf-8")
    if road is not None:
        text = text.replace("<RoadNetwork/>", f'<RoadNetwork><LogicFile filepath="{road}"/></RoadNetwork>')
    written = "".join(CONDITION.format(name=n, parameter=p, value=v) for n, p, v in conditions)
    text = text.replace("<ConditionGroup>", f"<ConditionGroup>{written}", 1)
    if ego:
        text = text.replace("<Properties/>", '<Properties><Property name="type" value="ego_vehicle"/></Properties>', 1)
    else:
        text = text.replace('"Ego"', '"Car"')
    return load_scenario(text.encode())


def test_stop_trigger_criteria_translates_supported_conditions() -> None:
    scenario = written_for_scenario_runner(
        ("criteria_CollisionTest", "", ""),
        ("criteria_DrivenDistanceTest", "distance_success", "100"),
        ("criteria_MaxVelocityTest", "max_velocity", "13.5"),
        ("criteria_AverageVelocityTest", "velocity", "5"),
        ("criteria_ActorBlockedTest", "max_time", "60"),
        ("criteria_ActorBlockedTest", "min_speed", "0.5"),
        ("criteria_ReachedRegionTest", "", ""),
        ("criteria_KeepLaneTest", "", ""),
    )
    criteria = build_criteria(stop_trigger_declarations(scenario))
    assert [criterion.name for criterion in criteria] == [
        *("collision", "driven_distance", "max_speed", "average_speed", "actor_blocked", "actor_blocked_2"),
    ]
    assert [criterion.verdict().limit for criterion in criteria] == [0.0, 100.0, 13.5, 5.0, 60.0, 180.0]
    assert {criterion.subjects for criterion in criteria} == {("Ego",)}
    unknown, without_roads = unsupported_criteria(scenario)
    assert unknown.message == "criterion 'ReachedRegionTest' is not evaluated"
    assert unknown.line is not None
    assert without_roads.message == "criterion 'KeepLaneTest' is not evaluated"
    assert without_roads.hint == "it requires roads, and the scenario has none"


def test_stop_trigger_criteria_on_lanes_and_signals_are_evaluated_with_roads() -> None:
    names = ["KeepLane", "WrongLane", "OnSidewalk", "OffRoad", "EndofRoad", "RunningRedLight", "RunningStop"]
    scenario = written_for_scenario_runner(*((f"criteria_{name}Test", "", "") for name in names), road=ROAD)
    assert unsupported_criteria(scenario) == []
    assert [criterion.name for criterion in build_criteria(stop_trigger_declarations(scenario))] == [
        *("keep_lane", "wrong_lane", "on_sidewalk", "off_road", "end_of_road", "running_red_light"),
        "running_stop_sign",
    ]
    with Simulation(scenario) as simulation:
        result = simulation.run()
    assert len(result.criteria) >= len(names)


def test_stop_trigger_criteria_on_routes_and_emergency_vehicles() -> None:
    scenario = written_for_scenario_runner(
        ("criteria_InRouteTest", "offroad_max", "20"),
        ("criteria_InRouteTest", "", ""),
        ("criteria_RouteCompletionTest", "", ""),
        ("criteria_OutsideRouteLanesTest", "", ""),
        ("criteria_YieldToEmergencyVehicleTest", "ev", "Ambulance"),
        road=ROAD,
    )
    assert unsupported_criteria(scenario) == []
    near, usual, completion, lanes, emergency = build_criteria(stop_trigger_declarations(scenario))
    assert [near.verdict().limit, usual.verdict().limit, completion.verdict().limit] == [20.0, 30.0, 0.99]
    assert (lanes.name, emergency.subjects) == ("outside_route_lanes", ("Ego", "Ambulance"))


TWENTY = {
    "ActorBlocked": "actor_blocked",
    "AverageVelocity": "average_speed",
    "Collision": "collision",
    "DrivenDistance": "driven_distance",
    "EndofRoad": "end_of_road",
    "InRadiusRegion": "reach_position",
    "InRoute": "in_route",
    "KeepLane": "keep_lane",
    "MaxVelocity": "max_speed",
    "MinimumSpeedRoute": "average_speed",
    "OffRoad": "off_road",
    "OnSidewalk": "on_sidewalk",
    "OutsideRouteLanes": "outside_route_lanes",
    "ReachedRegion": "reached_region",
    "RouteCompletion": "route_completion",
    "RunningRedLight": "running_red_light",
    "RunningStop": "running_stop_sign",
    "ScenarioTimeout": "time_limit",
    "WrongLane": "wrong_lane",
    "YieldToEmergencyVehicle": "yield_to_emergency_vehicle",
}
"""Criterion for each class of ScenarioRunner (`atomic_criteria.py`, version 0.9.15)."""
VALUES = {"YieldToEmergencyVehicle": ("ev", "Parked"), "DrivenDistance": ("distance_success", "9")}


@pytest.mark.parametrize("name", sorted(TWENTY))
def test_class_of_scenario_runner_is_translated_or_named_with_its_replacement(name: str) -> None:
    parameter, value = VALUES.get(name, ("", "9" if name in ("MaxVelocity", "AverageVelocity") else ""))
    scenario = written_for_scenario_runner((f"criteria_{name}Test", parameter, value), road=ROAD)
    criteria = build_criteria(stop_trigger_declarations(scenario))
    warnings = unsupported_criteria(scenario)
    assert len(criteria) + len(warnings) == 1
    if criteria:
        assert criteria[0].name == TWENTY[name]
    else:
        hint = warnings[0].hint
        assert hint.startswith(f"its arguments are not one number; declare {TWENTY[name]}: {{")
        example = (
            hint.removeprefix("its arguments are not one number; declare ").split(" (")[0].replace("Ego", "Parked")
        )
        (declared,) = parse_criteria(example, CriteriaContext(("Parked",)))
        assert declared.build().name == TWENTY[name]


def test_misspelled_class_of_scenario_runner_has_a_suggestion() -> None:
    (warning,) = unsupported_criteria(written_for_scenario_runner(("criteria_ColisionTest", "", "")))
    assert warning.hint == "did you mean 'CollisionTest'?"


def test_stop_trigger_criterion_with_a_duration_has_it_as_limit() -> None:
    scenario = written_for_scenario_runner(("criteria_OffRoadTest", "duration", "2.5"), road=ROAD)
    (criterion,) = build_criteria(stop_trigger_declarations(scenario))
    assert criterion.verdict().limit == 2.5


def test_stop_trigger_criteria_ignores_other_conditions() -> None:
    scenario = load_scenario(PASSING_BY)
    assert build_criteria(stop_trigger_declarations(scenario)) == []
    assert unsupported_criteria(scenario) == []


def test_stop_trigger_criterion_with_non_numeric_value_raises_setting_error() -> None:
    scenario = written_for_scenario_runner(("criteria_DrivenDistanceTest", "distance_success", "far"))
    with pytest.raises(SettingError, match="setting 'at_least' is 'far'"):
        build_criteria(stop_trigger_declarations(scenario))


def test_stop_trigger_criteria_without_ego_raises_setting_error() -> None:
    scenario = written_for_scenario_runner(("criteria_CollisionTest", "", ""), ego=False)
    with pytest.raises(SettingError, match="the scenario has no ego vehicle; give a Vehicle the property"):
        build_criteria(stop_trigger_declarations(scenario))


def test_stop_condition_with_prefix_but_without_parameter_ends_run() -> None:
    """Criteria of ScenarioRunner are ParameterConditions; a condition of another type only has a similar name."""
    text = PASSING_BY.read_text(encoding="utf-8")
    assert text.count('<Condition name="end"') == 1
    with Simulation(text.replace('<Condition name="end"', '<Condition name="criteria_end"').encode()) as simulation:
        result = simulation.run()
    assert result.end_reason == "stop trigger"
    assert result.simulated_s == pytest.approx(3.0)

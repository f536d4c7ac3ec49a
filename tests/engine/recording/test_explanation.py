"""Explanations of missing starts: values of the conditions, and effects of edges and delays."""

from collections.abc import Callable

import pytest
from openscenario_xml import object_xml, scenario_xml
from storyboard_xml import (
    act_xml,
    acts_xml,
    by_entity_xml,
    condition_xml,
    end_xml,
    event_xml,
    group_xml,
    init_xml,
    maneuver_xml,
    speed_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
    world_position_xml,
)

from eidrive_scenario.errors import SettingError
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.recording.text.explanation import Explanation
from eidrive_scenario.simulation import RunSettings, Simulation


def event(*groups: str, name: str = "go", priority: str = "parallel", action: str = "") -> str:
    return event_xml(name, action or speed_xml(10), trigger_xml(*groups), priority=priority)


GAP = """<RelativeDistanceCondition entityRef="Other" relativeDistanceType="cartesianDistance" freespace="false"
  rule="{}" value="{}"/>"""
NEAR = by_entity_xml(GAP.format("lessThan", 20))
Explained = Callable[..., list[str]]


@pytest.fixture
def explained() -> Explained:
    """Return a function that explains an event after 2 s. Ego approaches Other, 50 m ahead, at 10 m/s; Spare is
    absent."""

    def lines(*events: str, about: str = "go", start: str = "", end: str = "", limit: float = 2.0) -> list[str]:
        ego = init_xml("Ego", teleport_xml(world_position_xml(0)), speed_xml(10))
        text = scenario_xml(
            entities="".join(object_xml(name) for name in ("Ego", "Other", "Spare")),
            init=ego + init_xml("Other", teleport_xml(world_position_xml(50))),
            story=acts_xml(act_xml(group_xml(maneuver_xml("".join(events))), start + end)),
            stop=end_xml(limit),
        )
        explanation = Explanation(about)
        simulation = Simulation(load_scenario(text), settings=RunSettings(dt=0.1), observers=[explanation])
        with simulation:
            explanation.watch(simulation.storyboard)
            simulation.run()
        return [line.strip() for line in explanation.lines()]

    return lines


def test_explanation_of_unmet_distance_states_closest_value(explained: Explained) -> None:
    lines = explained(event(condition_xml(NEAR)))
    assert lines[0] == "event go (story/act/group/maneuver/go) never started"
    assert "never true in 20 evaluations from 0.00 s to 1.90 s" in lines
    assert "Ego: closest value 31 m, at 1.90 s" in lines


def test_explanation_of_initially_true_condition_reports_missing_rising_edge(explained: Explained) -> None:
    far = by_entity_xml(GAP.format("greaterThan", 20))
    lines = explained(event(condition_xml(far, "rising")))
    assert lines[-2:] == [
        "true at all of 20 evaluations from 0.00 s to 1.90 s",
        "true at the first evaluation, never became true afterwards, so edge 'rising' never occurred",
    ]


def test_explanation_of_always_true_condition_reports_missing_falling_edge(explained: Explained) -> None:
    far = by_entity_xml(GAP.format("greaterThan", 20))
    assert explained(event(condition_xml(far, "falling")))[-1] == "never became false, so edge 'falling' never occurred"


def test_explanation_of_delay_beyond_run_states_due_time(explained: Explained) -> None:
    lines = explained(event(condition_xml(time_xml(1, "greaterOrEqual"), "rising", 5)))
    assert "true from 1.00 s on" in lines
    assert "became true at 1.00 s" in lines
    assert lines[-1] == "due after its delay of 5 s, at 6.00 s; last evaluated at 1.90 s"


def test_explanation_of_group_reports_conditions_never_true_together(explained: Explained) -> None:
    early, late = condition_xml(time_xml(0.5, "lessThan")), condition_xml(time_xml(1))
    lines = explained(event(early + late))
    assert "each condition was fulfilled at some time, but never all 2 at once" in lines
    assert "true from 0.00 s to 0.40 s" in lines
    assert "true from 1.10 s on" in lines


def test_explanation_of_group_lists_missing_condition(explained: Explained) -> None:
    lines = explained(event(condition_xml(time_xml(1)) + condition_xml(NEAR), condition_xml(time_xml(9))))
    missing = "Ego: straight distance to Other < 20 m"
    assert f"group 1 of 2: 1 of 2 conditions at most, first at 1.10 s, without: {missing}" in lines
    assert "group 2 of 2: never fulfilled" in lines
    assert "closest value 1.90 s, at 1.90 s" in lines


def test_explanation_of_absent_entity_states_its_absence(explained: Explained) -> None:
    lines = explained(event(condition_xml(by_entity_xml('<SpeedCondition rule="greaterThan" value="1"/>', "Spare"))))
    assert lines[-1] == "at the last evaluation Spare is absent"


def test_explanation_of_undefined_quantity_states_it(explained: Explained) -> None:
    headway = '<TimeHeadwayCondition entityRef="Ego" freespace="false" rule="lessThan" value="1"/>'
    assert (
        explained(event(condition_xml(by_entity_xml(headway, "Other"))))[-1]
        == "Other: undefined or infinite at all evaluations"
    )


def test_explanation_of_started_event_states_time_and_reason(explained: Explained) -> None:
    lines = explained(event(condition_xml(time_xml(1, "greaterOrEqual"))))
    assert lines[:3] == [
        "event go (story/act/group/maneuver/go) started:",
        "at 1.00 s: simulation time 1.00 s ≥ 1 s",
        "its start trigger:",
    ]


def test_explanation_of_event_without_trigger_states_it(explained: Explained) -> None:
    assert explained(event())[1:] == ["at 0.00 s: it has no start trigger"]


def test_explanation_of_skipped_event_states_reason(explained: Explained) -> None:
    lines = explained(
        event(name="first", action=speed_xml(5, 9)), event(condition_xml(time_xml(1), "rising"), priority="skip")
    )
    assert "it was skipped once, first at 1.10 s: first is running" in lines


def test_explanation_of_event_in_unstarted_act_explains_act(explained: Explained) -> None:
    start = trigger_xml(condition_xml(time_xml(7)))
    lines = explained(event(condition_xml(NEAR)), start=start)
    assert lines[1] == "it never reached standbyState because its act did not run; explanation of the act:"
    assert lines[2] == "act act (story/act) never started"
    assert lines[-1] == "closest value 1.90 s, at 1.90 s"


def test_explanation_of_event_in_stopped_act_states_stop(explained: Explained) -> None:
    end = trigger_xml(condition_xml(time_xml(1, "greaterOrEqual")), kind="StopTrigger")
    lines = explained(event(condition_xml(NEAR)), end=end)
    assert lines[1] == (
        "it was in standbyState from 0.00 s to 1.00 s, when its parent was stopped (simulation time 1.00 s ≥ 1 s)"
    )


def test_explanation_of_storyboard_states_end_of_run(explained: Explained) -> None:
    assert explained(event(), about="storyboard")[0] == "the run stopped at 2.00 s: simulation time 2.00 s ≥ 2 s"


def test_explanation_of_unknown_name_raises_setting_error(explained: Explained) -> None:
    with pytest.raises(SettingError, match="no event or act is named 'goo'; did you mean 'go'"):
        explained(event(), about="goo")

"""Explanations of missing starts: values of the conditions, and effects of edges and delays."""

from collections.abc import Callable

import pytest

from eidrive_scenario.errors import SettingError
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.recording import Explanation
from eidrive_scenario.simulation import RunSettings, Simulation

CAR = """<ScenarioObject name="{0}"><Vehicle name="car" vehicleCategory="car">
  <BoundingBox><Center x="1.4" y="0" z="0.75"/><Dimensions length="4.5" width="1.8" height="1.5"/></BoundingBox>
  <Performance maxSpeed="60" maxAcceleration="5" maxDeceleration="9"/>
  <Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="2.8" positionZ="0.3"/>
  <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="0" positionZ="0.3"/></Axles>
</Vehicle></ScenarioObject>"""
SPEED = """<PrivateAction><LongitudinalAction><SpeedAction>
  <SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
  <SpeedActionTarget><AbsoluteTargetSpeed value="{}"/></SpeedActionTarget>
  </SpeedAction></LongitudinalAction></PrivateAction>"""
PLACED = """<Private entityRef="{}"><PrivateAction><TeleportAction><Position><WorldPosition x="{}" y="0"/></Position>
  </TeleportAction></PrivateAction>{}</Private>"""
SCENARIO = """<OpenSCENARIO>
<FileHeader revMajor="1" revMinor="3" date="2025-01-01T00:00:00" description="a ride" author="test"/>
<CatalogLocations/><RoadNetwork/><Entities>{cars}</Entities><Storyboard><Init><Actions>{init}</Actions></Init>
<Story name="story"><Act name="act"><ManeuverGroup name="group" maximumExecutionCount="1">
<Actors selectTriggeringEntities="false"><EntityRef entityRef="Ego"/></Actors><Maneuver name="maneuver">{events}
</Maneuver></ManeuverGroup>{start}{end}</Act></Story>
<StopTrigger><ConditionGroup>{stop}</ConditionGroup></StopTrigger></Storyboard></OpenSCENARIO>"""


def when(inside: str, edge: str = "none", delay: float = 0) -> str:
    return f'<Condition name="c" delay="{delay}" conditionEdge="{edge}">{inside}</Condition>'


def time(rule: str, value: float) -> str:
    return f'<ByValueCondition><SimulationTimeCondition rule="{rule}" value="{value}"/></ByValueCondition>'


def of(name: str, condition: str) -> str:
    return (
        f'<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="{name}"/>'
        f"</TriggeringEntities><EntityCondition>{condition}</EntityCondition></ByEntityCondition>"
    )


def event(*groups: str, name: str = "go", priority: str = "parallel", action: str = SPEED.format(10)) -> str:
    inside = "".join(f"<ConditionGroup>{group}</ConditionGroup>" for group in groups)
    trigger = f"<StartTrigger>{inside}</StartTrigger>" if groups else ""
    return f'<Event name="{name}" priority="{priority}"><Action name="{name} action">{action}</Action>{trigger}</Event>'


GAP = """<RelativeDistanceCondition entityRef="Other" relativeDistanceType="cartesianDistance" freespace="false"
  rule="{}" value="{}"/>"""
NEAR = of("Ego", GAP.format("lessThan", 20))
Explained = Callable[..., list[str]]


@pytest.fixture
def explained() -> Explained:
    """Return a function that explains an event after 2 s. Ego approaches Other, 50 m ahead, at 10 m/s; Spare is
    absent."""

    def lines(*events: str, about: str = "go", start: str = "", end: str = "", limit: float = 2.0) -> list[str]:
        init = PLACED.format("Ego", 0, SPEED.format(10)) + PLACED.format("Other", 50, "")
        text = SCENARIO.format(
            cars="".join(CAR.format(name) for name in ("Ego", "Other", "Spare")),
            init=init,
            events="".join(events),
            start=start,
            end=end,
            stop=when(time("greaterOrEqual", limit)),
        )
        explanation = Explanation(about)
        simulation = Simulation(load_scenario(text.encode()), settings=RunSettings(dt=0.1), observers=[explanation])
        with simulation:
            explanation.watch(simulation.storyboard)
            simulation.run()
        return [line.strip() for line in explanation.lines()]

    return lines


def test_explanation_of_unmet_distance_states_closest_value(explained: Explained) -> None:
    lines = explained(event(when(NEAR)))
    assert lines[0] == "event go (story/act/group/maneuver/go) never started"
    assert "never true in 20 evaluations from 0.00 s to 1.90 s" in lines
    assert "Ego: closest value 31 m, at 1.90 s" in lines


def test_explanation_of_initially_true_condition_reports_missing_rising_edge(explained: Explained) -> None:
    far = of("Ego", GAP.format("greaterThan", 20))
    lines = explained(event(when(far, "rising")))
    assert lines[-2:] == [
        "true at all of 20 evaluations from 0.00 s to 1.90 s",
        "true at the first evaluation, never became true afterwards, so edge 'rising' never occurred",
    ]


def test_explanation_of_always_true_condition_reports_missing_falling_edge(explained: Explained) -> None:
    far = of("Ego", GAP.format("greaterThan", 20))
    assert explained(event(when(far, "falling")))[-1] == "never became false, so edge 'falling' never occurred"


def test_explanation_of_delay_beyond_run_states_due_time(explained: Explained) -> None:
    lines = explained(event(when(time("greaterOrEqual", 1), "rising", 5)))
    assert "true from 1.00 s on" in lines
    assert "became true at 1.00 s" in lines
    assert lines[-1] == "due after its delay of 5 s, at 6.00 s; last evaluated at 1.90 s"


def test_explanation_of_group_reports_conditions_never_true_together(explained: Explained) -> None:
    early, late = when(time("lessThan", 0.5)), when(time("greaterThan", 1))
    lines = explained(event(early + late))
    assert "each condition was fulfilled at some time, but never all 2 at once" in lines
    assert "true from 0.00 s to 0.40 s" in lines
    assert "true from 1.10 s on" in lines


def test_explanation_of_group_lists_missing_condition(explained: Explained) -> None:
    lines = explained(event(when(time("greaterThan", 1)) + when(NEAR), when(time("greaterThan", 9))))
    missing = "Ego: straight distance to Other < 20 m"
    assert f"group 1 of 2: 1 of 2 conditions at most, first at 1.10 s, without: {missing}" in lines
    assert "group 2 of 2: never fulfilled" in lines
    assert "closest value 1.90 s, at 1.90 s" in lines


def test_explanation_of_absent_entity_states_its_absence(explained: Explained) -> None:
    lines = explained(event(when(of("Spare", '<SpeedCondition rule="greaterThan" value="1"/>'))))
    assert lines[-1] == "at the last evaluation Spare is absent"


def test_explanation_of_undefined_quantity_states_it(explained: Explained) -> None:
    headway = '<TimeHeadwayCondition entityRef="Ego" freespace="false" rule="lessThan" value="1"/>'
    assert explained(event(when(of("Other", headway))))[-1] == "Other: undefined or infinite at all evaluations"


def test_explanation_of_started_event_states_time_and_reason(explained: Explained) -> None:
    lines = explained(event(when(time("greaterOrEqual", 1))))
    assert lines[:3] == [
        "event go (story/act/group/maneuver/go) started:",
        "at 1.00 s: simulation time 1.00 s ≥ 1 s",
        "its start trigger:",
    ]


def test_explanation_of_event_without_trigger_states_it(explained: Explained) -> None:
    assert explained(event())[1:] == ["at 0.00 s: it has no start trigger"]


def test_explanation_of_skipped_event_states_reason(explained: Explained) -> None:
    slow = SPEED.format(5).replace('"step"', '"linear"').replace('value="0"', 'value="9"')
    lines = explained(event(name="first", action=slow), event(when(time("greaterThan", 1), "rising"), priority="skip"))
    assert "it was skipped once, first at 1.10 s: first is running" in lines


def test_explanation_of_event_in_unstarted_act_explains_act(explained: Explained) -> None:
    start = f"<StartTrigger><ConditionGroup>{when(time('greaterThan', 7))}</ConditionGroup></StartTrigger>"
    lines = explained(event(when(NEAR)), start=start)
    assert lines[1] == "it never reached standbyState because its act did not run; explanation of the act:"
    assert lines[2] == "act act (story/act) never started"
    assert lines[-1] == "closest value 1.90 s, at 1.90 s"


def test_explanation_of_event_in_stopped_act_states_stop(explained: Explained) -> None:
    end = f"<StopTrigger><ConditionGroup>{when(time('greaterOrEqual', 1))}</ConditionGroup></StopTrigger>"
    lines = explained(event(when(NEAR)), end=end)
    assert lines[1] == (
        "it was in standbyState from 0.00 s to 1.00 s, when its parent was stopped (simulation time 1.00 s ≥ 1 s)"
    )


def test_explanation_of_storyboard_states_end_of_run(explained: Explained) -> None:
    assert explained(event(), about="storyboard")[0] == "the run stopped at 2.00 s: simulation time 2.00 s ≥ 2 s"


def test_explanation_of_unknown_name_raises_setting_error(explained: Explained) -> None:
    with pytest.raises(SettingError, match="no event or act is named 'goo'; did you mean 'go'"):
        explained(event(), about="goo")

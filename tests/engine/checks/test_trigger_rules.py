"""Rules about triggers; expectations are derived by hand from the standard on edges, delays and states."""

from collections.abc import Callable

import pytest
from openscenario_xml import parameters_xml, scenario_xml
from storyboard_xml import (
    act_xml,
    acts_xml,
    by_entity_xml,
    condition_xml,
    element_state_xml,
    event_xml,
    group_xml,
    groups_xml,
    init_xml,
    maneuver_xml,
    private_xml,
    speed_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
    world_position_xml,
)

from eidrive_scenario.checks.scenario_rules import RULES
from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.openscenario import load_scenario

PLACE = init_xml("Ego", teleport_xml(world_position_xml(0)))
FOREVER = private_xml("""<LongitudinalAction><SpeedAction>
<SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="time" value="2"/><SpeedActionTarget>
<RelativeTargetSpeed entityRef="Ego" value="0" speedTargetValueType="delta" continuous="true"/></SpeedActionTarget>
</SpeedAction></LongitudinalAction>""")

GREATER, AT_LEAST, LESS, EQUAL = "greaterThan", "greaterOrEqual", "lessThan", "equalTo"


def parameter(name: str) -> str:
    return f'<ByValueCondition><ParameterCondition parameterRef="{name}" rule="equalTo" value="1"/></ByValueCondition>'


def when(what: str, edge: str = "none", delay: float = 0) -> str:
    return condition_xml(what, edge, delay, name="a condition")


def event(name: str, start: str = "", *, priority: str = "parallel", count: int = 1, action: str = "") -> str:
    return event_xml(name, action or speed_xml(10, 2), start, priority=priority, count=count)


def act(events: str, start: str = "", stop: str = "", name: str = "act", *, actors: str = "Ego") -> str:
    group = group_xml(maneuver_xml(events, f"{name} maneuver"), actors, name=f"{name} group", triggering=not actors)
    return act_xml(group, start + stop, name)


LATE = groups_xml(when(time_xml(60)))
"""Content of a stop trigger after 60 s."""
Check = Callable[..., list[str]]


@pytest.fixture
def check() -> Check:
    """Return a function for the rules that a story of acts violates, in the order of the file."""

    def found(
        *acts: str, init: str = PLACE, stop: str = LATE, declarations: str = "", entities: str | None = None
    ) -> list[str]:
        story = acts_xml(*acts)
        scenario = load_scenario(
            scenario_xml(declarations=declarations, entities=entities, init=init, story=story, stop=stop)
        )
        survey = LintContext(scenario)
        diagnostics = [diagnostic for rule in RULES for diagnostic in rule.run(survey)]
        return [diagnostic.rule for diagnostic in sorted(diagnostics, key=lambda diagnostic: diagnostic.line or 0)]

    return found


@pytest.mark.parametrize(
    ("condition", "edge", "expected"),
    [
        (time_xml(0, GREATER), "rising", []),
        (time_xml(0, GREATER), "none", []),
        (time_xml(0, AT_LEAST), "none", []),
        (time_xml(0, AT_LEAST), "rising", ["unobserved-edge"]),
        (time_xml(-1, GREATER), "rising", ["unobserved-edge"]),
        (time_xml(-1, GREATER), "risingOrFalling", ["unobserved-edge"]),
        (time_xml(5, GREATER), "falling", ["unobserved-edge"]),
        (time_xml(3, LESS), "rising", ["unobserved-edge"]),
        (time_xml(3, LESS), "falling", []),
        (time_xml(3, LESS), "risingOrFalling", []),
        (time_xml(0, LESS), "none", ["impossible-condition"]),
        (time_xml(0, EQUAL), "none", []),
        (time_xml(0, EQUAL), "rising", ["unobserved-edge"]),
        (time_xml(-2, EQUAL), "none", ["impossible-condition"]),
        (time_xml(4, EQUAL), "rising", ["exact-time-comparison"]),
        (time_xml(4, "notEqualTo"), "rising", []),
        (time_xml(0, "notEqualTo"), "rising", []),
    ],
)
def test_act_start_time_conditions(check: Check, condition: str, edge: str, expected: list[str]) -> None:
    assert check(act(event("go"), trigger_xml(when(condition, edge)))) == expected


def test_event_first_evaluation_is_at_the_start_of_its_act(check: Check) -> None:
    positive = when(time_xml(0, GREATER), "rising")
    assert check(act(event("go", trigger_xml(positive)), trigger_xml(when(time_xml(0, AT_LEAST))))) == []
    assert check(act(event("go", trigger_xml(positive)), trigger_xml(when(time_xml(0, GREATER))))) == [
        "unobserved-edge"
    ]
    assert check(act(event("go", trigger_xml(when(time_xml(3, LESS)))), trigger_xml(when(time_xml(5, GREATER))))) == [
        "impossible-condition"
    ]


def test_act_stop_trigger_first_evaluation_is_at_its_start(check: Check) -> None:
    late = when(time_xml(5, GREATER), "rising")
    assert check(act(event("go"), trigger_xml(late), trigger_xml(late, kind="StopTrigger"))) == ["unobserved-edge"]
    assert check(act(event("go"), "", trigger_xml(late, kind="StopTrigger"))) == []


@pytest.mark.parametrize(
    ("group", "expected"),
    [
        (when(time_xml(5, GREATER)) + when(time_xml(3, LESS)), ["contradictory-group"]),
        (when(time_xml(5, GREATER)) + when(time_xml(5, LESS)), ["contradictory-group"]),
        (when(time_xml(5, AT_LEAST)) + when(time_xml(5, "lessOrEqual")), []),
        (when(time_xml(5, GREATER), delay=2) + when(time_xml(6, LESS)), ["contradictory-group"]),
        (when(time_xml(5, GREATER), delay=2) + when(time_xml(8, LESS)), []),
        (when(time_xml(5, GREATER), "rising") + when(time_xml(8, LESS)), []),
        (when(time_xml(5, GREATER), "rising") + when(time_xml(8, GREATER)), ["contradictory-group"]),
        (when(time_xml(5, LESS), "falling", 4) + when(time_xml(8, GREATER)), []),
    ],
)
def test_contradictory_group_of_time_conditions(check: Check, group: str, expected: list[str]) -> None:
    assert check(act(event("go", trigger_xml(group)))) == expected


def test_trigger_with_another_possible_group_is_reachable(check: Check) -> None:
    both = trigger_xml(when(time_xml(-1, LESS)), when(time_xml(5, GREATER)))
    follower = event("follower", trigger_xml(when(element_state_xml("event", "go", "endTransition"))))
    assert check(act(event("go", both) + follower)) == ["impossible-condition"]


def test_events_with_circular_wait_are_unreachable(check: Check) -> None:
    after = {name: when(element_state_xml("event", name, "endTransition")) for name in ("one", "other")}
    circle = event("one", trigger_xml(after["other"])) + event("other", trigger_xml(after["one"]))
    assert check(act(circle)) == ["unreachable", "unreachable"]
    opened = event("one", trigger_xml(after["other"], when(time_xml(5, GREATER)))) + event(
        "other", trigger_xml(after["one"])
    )
    assert check(act(opened)) == []


def test_event_with_repetitions_may_wait_for_itself(check: Check) -> None:
    again = trigger_xml(when(time_xml(5, GREATER)), when(element_state_xml("event", "go", "endTransition")))
    assert check(act(event("go", again, count=3))) == []
    assert check(act(event("go", again, count=1))) == ["unreachable"]
    assert check(act(event("go", trigger_xml(when(element_state_xml("event", "go", "endTransition"))), count=3))) == [
        "unreachable"
    ]


def test_condition_on_unreachable_element_is_unreachable(check: Check) -> None:
    dead = event("dead", trigger_xml(when(time_xml(-1, LESS))))
    first = act(dead + event("alive"), name="first")
    ended = act(event("go"), trigger_xml(when(element_state_xml("act", "first", "endTransition"))), name="second")
    assert check(first, ended) == ["impossible-condition", "unreachable"]
    stopped = act(dead, "", trigger_xml(when(time_xml(9, GREATER)), kind="StopTrigger"), name="first")
    complete = act(event("go"), trigger_xml(when(element_state_xml("act", "first", "completeState"))), name="second")
    assert check(stopped, complete) == ["impossible-condition"]


def test_elements_below_unreachable_act_are_not_reported(check: Check) -> None:
    below = event("go", trigger_xml(when(time_xml(-1, LESS))))
    assert check(act(below, trigger_xml(when(time_xml(-1, LESS))))) == ["impossible-condition"]


def test_earliest_times_accumulate_along_chained_events(check: Check) -> None:
    chain = event("first", trigger_xml(when(time_xml(10, GREATER))))
    chain += event(
        "second", trigger_xml(when(element_state_xml("event", "first", "endTransition")) + when(time_xml(8, LESS)))
    )
    assert check(act(chain)) == ["contradictory-group"]


@pytest.mark.parametrize(
    ("what", "edge", "expected"),
    [
        ("runningState", "none", []),
        ("runningState", "rising", ["unobserved-edge"]),
        ("startTransition", "none", []),
        ("startTransition", "rising", ["unobserved-edge"]),
        ("startTransition", "falling", []),
        ("standbyState", "none", ["impossible-state"]),
        ("completeState", "none", ["unreachable"]),
        ("stopTransition", "none", ["unreachable"]),
        ("skipTransition", "none", ["impossible-state"]),
    ],
)
def test_event_condition_on_its_own_act(check: Check, what: str, edge: str, expected: list[str]) -> None:
    assert check(act(event("go", trigger_xml(when(element_state_xml("act", "act", what), edge))))) == expected


def test_skip_and_stop_transitions_require_matching_elements(check: Check) -> None:
    waits = {
        what: event("waits", trigger_xml(when(element_state_xml("event", "rival", what))))
        for what in ("skipTransition", "stopTransition")
    }
    rival = event("rival")
    assert check(act(rival + waits["skipTransition"])) == ["impossible-state"]
    assert check(act(event("rival", priority="skip") + waits["skipTransition"])) == []
    assert check(act(rival + waits["stopTransition"])) == ["impossible-state"]
    assert check(act(rival + event("taker", priority="override") + waits["stopTransition"])) == []
    assert (
        check(act(rival + waits["stopTransition"], "", trigger_xml(when(time_xml(5, GREATER)), kind="StopTrigger")))
        == []
    )


def test_end_transition_of_continuous_action_is_impossible(check: Check) -> None:
    waits = event("waits", trigger_xml(when(element_state_xml("action", "rival action", "endTransition"))))
    assert check(act(event("rival", action=FOREVER) + waits)) == ["impossible-state"]
    assert check(act(event("rival") + waits)) == []


def test_edge_of_constant_parameter_is_unobserved(check: Check) -> None:
    declarations = parameters_xml(Mode=("integer", "1"))
    rising, plain = (trigger_xml(when(parameter("Mode"), edge)) for edge in ("rising", "none"))
    assert check(act(event("go", rising)), declarations=declarations) == ["unobserved-edge"]
    assert check(act(event("go", plain)), declarations=declarations) == []
    setter = """<Event name="set" priority="parallel"><Action name="set"><GlobalAction><ParameterAction
        parameterRef="Mode"><SetAction value="1"/></ParameterAction></GlobalAction></Action></Event>"""
    assert check(act(event("go", rising) + setter), declarations=declarations) == []


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        (
            '<RelativeDistanceCondition entityRef="Ego" relativeDistanceType="lateral" freespace="false" '
            'rule="lessThan" value="5"/>',
            ["unobserved-edge"],
        ),
        ('<RelativeSpeedCondition entityRef="Ego" rule="greaterThan" value="0"/>', ["impossible-condition"]),
        ('<CollisionCondition><EntityRef entityRef="Ego"/></CollisionCondition>', ["impossible-condition"]),
        (
            '<RelativeAngleCondition entityRef="Ego" angleType="heading" angle="0.2" angleTolerance="0.1"/>',
            ["impossible-condition"],
        ),
        (
            '<RelativeAngleCondition entityRef="Ego" angleType="heading" angle="0.1" angleTolerance="0.2"/>',
            ["unobserved-edge"],
        ),
        ('<AccelerationCondition rule="lessThan" value="-3"/>', ["impossible-condition"]),
        ('<AccelerationCondition rule="lessThan" value="-3" direction="longitudinal"/>', []),
        ('<SpeedCondition rule="lessThan" value="-1"/>', []),
        ('<TraveledDistanceCondition value="10"/>', []),
    ],
)
def test_entity_conditions_with_impossible_values(check: Check, condition: str, expected: list[str]) -> None:
    assert check(act(event("go", trigger_xml(when(by_entity_xml(condition), "rising"))))) == expected


def test_traveled_distance_of_zero_has_no_edge(check: Check) -> None:
    start = trigger_xml(when(by_entity_xml('<TraveledDistanceCondition value="0"/>'), "rising"))
    assert check(act(event("go", start))) == ["unobserved-edge"]


def test_conditions_on_unplaced_entities_are_impossible(check: Check) -> None:
    moving = trigger_xml(when(by_entity_xml('<SpeedCondition rule="greaterThan" value="5"/>')))
    assert check(act(event("go", moving)), init="") == ["entity-without-position", "impossible-condition"]
    added = """<Event name="add" priority="parallel"><Action name="add"><GlobalAction><EntityAction entityRef="Ego">
        <AddEntityAction><Position><WorldPosition x="0" y="0"/></Position></AddEntityAction></EntityAction>
        </GlobalAction></Action></Event>"""
    assert check(act(event("go", moving) + added), init="") == []


def test_time_of_day_without_environment_is_impossible(check: Check) -> None:
    noon = (
        '<ByValueCondition><TimeOfDayCondition rule="greaterThan" dateTime="2025-01-01T12:00:00"/></ByValueCondition>'
    )
    assert check(act(event("go", trigger_xml(when(noon))))) == ["impossible-condition"]


def test_simultaneous_edges_are_reported(check: Check) -> None:
    fast = when(by_entity_xml('<SpeedCondition rule="greaterThan" value="5"/>'), "rising")
    ended = when(element_state_xml("event", "other", "endTransition"), "rising")
    assert check(act(event("other") + event("go", trigger_xml(fast + ended)))) == ["simultaneous-edges"]
    assert check(act(event("other") + event("go", trigger_xml(fast, ended)))) == []


def test_stop_trigger_criteria_are_not_conditions(check: Check) -> None:
    criterion = when(parameter(""), "rising").replace("a condition", "criteria_CollisionTest")
    assert check(act(event("go")), stop=groups_xml(criterion)) == []


def test_storyboard_without_stop_trigger_is_reported(check: Check) -> None:
    assert check(act(event("go")), stop="") == ["no-stop-trigger"]


def test_external_objects_need_no_position(check: Check) -> None:
    post = '<ScenarioObject name="Ego"><ExternalObjectReference name="post"/></ScenarioObject>'
    near = trigger_xml(when(by_entity_xml('<SpeedCondition rule="greaterThan" value="5"/>')))
    assert check(act(event("go", near)), init="", entities=post) == []


def test_select_triggering_entities_applies_to_acts_only(check: Check) -> None:
    fast = trigger_xml(when(by_entity_xml('<SpeedCondition rule="greaterThan" value="1"/>')))
    assert check(act(event("go"), fast, actors="")) == []
    assert check(act(event("go", fast), actors="")) == ["no-actors"]
    assert check(act(event("go", fast), trigger_xml(when(time_xml(1, GREATER))), actors="")) == ["no-actors"]

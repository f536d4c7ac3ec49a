"""Rules about triggers; expectations are derived by hand from the standard on edges, delays and states."""

from collections.abc import Callable

import pytest

from eidrive_scenario.checks.scenario_rules import RULES
from eidrive_scenario.checks.scenario_rules.context import LintContext
from eidrive_scenario.openscenario import load_scenario

PLACE = """<Private entityRef="Ego"><PrivateAction><TeleportAction><Position><WorldPosition x="0" y="0"/></Position>
</TeleportAction></PrivateAction></Private>"""
SPEED = """<PrivateAction><LongitudinalAction><SpeedAction>
<SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="time" value="2"/>
<SpeedActionTarget>{}</SpeedActionTarget></SpeedAction></LongitudinalAction></PrivateAction>"""
ABSOLUTE = '<AbsoluteTargetSpeed value="10"/>'
FOREVER = '<RelativeTargetSpeed entityRef="Ego" value="0" speedTargetValueType="delta" continuous="true"/>'
STOP = '<SimulationTimeCondition rule="greaterThan" value="60"/>'

GREATER, AT_LEAST, LESS, EQUAL = "greaterThan", "greaterOrEqual", "lessThan", "equalTo"


def time(rule: str, value: float) -> str:
    return f'<ByValueCondition><SimulationTimeCondition rule="{rule}" value="{value}"/></ByValueCondition>'


def state(kind: str, name: str, what: str) -> str:
    return (
        f'<ByValueCondition><StoryboardElementStateCondition storyboardElementType="{kind}" '
        f'storyboardElementRef="{name}" state="{what}"/></ByValueCondition>'
    )


def entity(condition: str, name: str = "Ego") -> str:
    return (
        f'<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="{name}"/>'
        f"</TriggeringEntities><EntityCondition>{condition}</EntityCondition></ByEntityCondition>"
    )


def parameter(name: str) -> str:
    return f'<ByValueCondition><ParameterCondition parameterRef="{name}" rule="equalTo" value="1"/></ByValueCondition>'


def when(what: str, edge: str = "none", delay: float = 0) -> str:
    return f'<Condition name="a condition" delay="{delay}" conditionEdge="{edge}">{what}</Condition>'


def trigger(*groups: str, kind: str = "StartTrigger") -> str:
    return f"<{kind}>{''.join(f'<ConditionGroup>{group}</ConditionGroup>' for group in groups)}</{kind}>"


def event(name: str, start: str = "", *, priority: str = "parallel", count: int = 1, target: str = ABSOLUTE) -> str:
    action = f'<Action name="{name} action">{SPEED.format(target)}</Action>'
    return f'<Event name="{name}" priority="{priority}" maximumExecutionCount="{count}">{action}{start}</Event>'


def act(events: str, start: str = "", stop: str = "", name: str = "act") -> str:
    return f"""<Act name="{name}"><ManeuverGroup name="{name} group" maximumExecutionCount="1">
<Actors selectTriggeringEntities="false"><EntityRef entityRef="Ego"/></Actors>
<Maneuver name="{name} maneuver">{events}</Maneuver></ManeuverGroup>{start}{stop}</Act>"""


Check = Callable[..., list[str]]


def selecting(events: str, start: str = "") -> str:
    """Return an act whose only actors are its triggering entities."""
    named = '<Actors selectTriggeringEntities="false"><EntityRef entityRef="Ego"/></Actors>'
    return act(events, start).replace(named, '<Actors selectTriggeringEntities="true"/>')


@pytest.fixture
def check(scenario_xml: Callable[..., bytes]) -> Check:
    """Return a function for the rules that a story of acts violates, in the order of the file."""

    def found(*acts: str, **parts: str) -> list[str]:
        story = f'<Story name="story">{"".join(acts)}</Story>'
        stop = parts.pop(
            "stop", f"<ConditionGroup>{when(f'<ByValueCondition>{STOP}</ByValueCondition>')}</ConditionGroup>"
        )
        init = parts.pop("init", PLACE)
        scenario = load_scenario(scenario_xml(story=story, init=init, stop=stop, **parts))
        survey = LintContext(scenario)
        diagnostics = [diagnostic for rule in RULES for diagnostic in rule.run(survey)]
        return [diagnostic.rule for diagnostic in sorted(diagnostics, key=lambda diagnostic: diagnostic.line or 0)]

    return found


@pytest.mark.parametrize(
    ("condition", "edge", "expected"),
    [
        (time(GREATER, 0), "rising", []),
        (time(GREATER, 0), "none", []),
        (time(AT_LEAST, 0), "none", []),
        (time(AT_LEAST, 0), "rising", ["unobserved-edge"]),
        (time(GREATER, -1), "rising", ["unobserved-edge"]),
        (time(GREATER, -1), "risingOrFalling", ["unobserved-edge"]),
        (time(GREATER, 5), "falling", ["unobserved-edge"]),
        (time(LESS, 3), "rising", ["unobserved-edge"]),
        (time(LESS, 3), "falling", []),
        (time(LESS, 3), "risingOrFalling", []),
        (time(LESS, 0), "none", ["impossible-condition"]),
        (time(EQUAL, 0), "none", []),
        (time(EQUAL, 0), "rising", ["unobserved-edge"]),
        (time(EQUAL, -2), "none", ["impossible-condition"]),
        (time(EQUAL, 4), "rising", ["exact-time-comparison"]),
        (time("notEqualTo", 4), "rising", []),
        (time("notEqualTo", 0), "rising", []),
    ],
)
def test_act_start_time_conditions(check: Check, condition: str, edge: str, expected: list[str]) -> None:
    assert check(act(event("go"), trigger(when(condition, edge)))) == expected


def test_event_first_evaluation_is_at_the_start_of_its_act(check: Check) -> None:
    positive = when(time(GREATER, 0), "rising")
    assert check(act(event("go", trigger(positive)), trigger(when(time(AT_LEAST, 0))))) == []
    assert check(act(event("go", trigger(positive)), trigger(when(time(GREATER, 0))))) == ["unobserved-edge"]
    assert check(act(event("go", trigger(when(time(LESS, 3)))), trigger(when(time(GREATER, 5))))) == [
        "impossible-condition"
    ]


def test_act_stop_trigger_first_evaluation_is_at_its_start(check: Check) -> None:
    late = when(time(GREATER, 5), "rising")
    assert check(act(event("go"), trigger(late), trigger(late, kind="StopTrigger"))) == ["unobserved-edge"]
    assert check(act(event("go"), "", trigger(late, kind="StopTrigger"))) == []


@pytest.mark.parametrize(
    ("group", "expected"),
    [
        (when(time(GREATER, 5)) + when(time(LESS, 3)), ["contradictory-group"]),
        (when(time(GREATER, 5)) + when(time(LESS, 5)), ["contradictory-group"]),
        (when(time(AT_LEAST, 5)) + when(time("lessOrEqual", 5)), []),
        (when(time(GREATER, 5), delay=2) + when(time(LESS, 6)), ["contradictory-group"]),
        (when(time(GREATER, 5), delay=2) + when(time(LESS, 8)), []),
        (when(time(GREATER, 5), "rising") + when(time(LESS, 8)), []),
        (when(time(GREATER, 5), "rising") + when(time(GREATER, 8)), ["contradictory-group"]),
        (when(time(LESS, 5), "falling", 4) + when(time(GREATER, 8)), []),
    ],
)
def test_contradictory_group_of_time_conditions(check: Check, group: str, expected: list[str]) -> None:
    assert check(act(event("go", trigger(group)))) == expected


def test_trigger_with_another_possible_group_is_reachable(check: Check) -> None:
    both = trigger(when(time(LESS, -1)), when(time(GREATER, 5)))
    follower = event("follower", trigger(when(state("event", "go", "endTransition"))))
    assert check(act(event("go", both) + follower)) == ["impossible-condition"]


def test_events_with_circular_wait_are_unreachable(check: Check) -> None:
    after = {name: when(state("event", name, "endTransition")) for name in ("one", "other")}
    circle = event("one", trigger(after["other"])) + event("other", trigger(after["one"]))
    assert check(act(circle)) == ["unreachable", "unreachable"]
    opened = event("one", trigger(after["other"], when(time(GREATER, 5)))) + event("other", trigger(after["one"]))
    assert check(act(opened)) == []


def test_event_with_repetitions_may_wait_for_itself(check: Check) -> None:
    again = trigger(when(time(GREATER, 5)), when(state("event", "go", "endTransition")))
    assert check(act(event("go", again, count=3))) == []
    assert check(act(event("go", again, count=1))) == ["unreachable"]
    assert check(act(event("go", trigger(when(state("event", "go", "endTransition"))), count=3))) == ["unreachable"]


def test_condition_on_unreachable_element_is_unreachable(check: Check) -> None:
    dead = event("dead", trigger(when(time(LESS, -1))))
    first = act(dead + event("alive"), name="first")
    ended = act(event("go"), trigger(when(state("act", "first", "endTransition"))), name="second")
    assert check(first, ended) == ["impossible-condition", "unreachable"]
    stopped = act(dead, "", trigger(when(time(GREATER, 9)), kind="StopTrigger"), name="first")
    complete = act(event("go"), trigger(when(state("act", "first", "completeState"))), name="second")
    assert check(stopped, complete) == ["impossible-condition"]


def test_elements_below_unreachable_act_are_not_reported(check: Check) -> None:
    below = event("go", trigger(when(time(LESS, -1))))
    assert check(act(below, trigger(when(time(LESS, -1))))) == ["impossible-condition"]


def test_earliest_times_accumulate_along_chained_events(check: Check) -> None:
    chain = event("first", trigger(when(time(GREATER, 10))))
    chain += event("second", trigger(when(state("event", "first", "endTransition")) + when(time(LESS, 8))))
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
    assert check(act(event("go", trigger(when(state("act", "act", what), edge))))) == expected


def test_skip_and_stop_transitions_require_matching_elements(check: Check) -> None:
    waits = {
        what: event("waits", trigger(when(state("event", "rival", what))))
        for what in ("skipTransition", "stopTransition")
    }
    rival = event("rival")
    assert check(act(rival + waits["skipTransition"])) == ["impossible-state"]
    assert check(act(event("rival", priority="skip") + waits["skipTransition"])) == []
    assert check(act(rival + waits["stopTransition"])) == ["impossible-state"]
    assert check(act(rival + event("taker", priority="override") + waits["stopTransition"])) == []
    assert check(act(rival + waits["stopTransition"], "", trigger(when(time(GREATER, 5)), kind="StopTrigger"))) == []


def test_end_transition_of_continuous_action_is_impossible(check: Check) -> None:
    waits = event("waits", trigger(when(state("action", "rival action", "endTransition"))))
    assert check(act(event("rival", target=FOREVER) + waits)) == ["impossible-state"]
    assert check(act(event("rival") + waits)) == []


def test_edge_of_constant_parameter_is_unobserved(
    check: Check, parameters_xml: Callable[..., str], scenario_xml: Callable[..., bytes]
) -> None:
    declarations = parameters_xml(Mode=("integer", "1"))
    rising, plain = (trigger(when(parameter("Mode"), edge)) for edge in ("rising", "none"))
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
            ["impossible-condition"],
        ),
        ('<AccelerationCondition rule="lessThan" value="-3"/>', ["impossible-condition"]),
        ('<AccelerationCondition rule="lessThan" value="-3" direction="longitudinal"/>', []),
        ('<SpeedCondition rule="lessThan" value="-1"/>', []),
        ('<TraveledDistanceCondition value="10"/>', []),
    ],
)
def test_entity_conditions_with_impossible_values(check: Check, condition: str, expected: list[str]) -> None:
    assert check(act(event("go", trigger(when(entity(condition), "rising"))))) == expected


def test_traveled_distance_of_zero_has_no_edge(check: Check) -> None:
    start = trigger(when(entity('<TraveledDistanceCondition value="0"/>'), "rising"))
    assert check(act(event("go", start))) == ["unobserved-edge"]


def test_conditions_on_unplaced_entities_are_impossible(check: Check) -> None:
    moving = trigger(when(entity('<SpeedCondition rule="greaterThan" value="5"/>')))
    assert check(act(event("go", moving)), init="") == ["entity-without-position", "impossible-condition"]
    added = """<Event name="add" priority="parallel"><Action name="add"><GlobalAction><EntityAction entityRef="Ego">
        <AddEntityAction><Position><WorldPosition x="0" y="0"/></Position></AddEntityAction></EntityAction>
        </GlobalAction></Action></Event>"""
    assert check(act(event("go", moving) + added), init="") == []


def test_time_of_day_without_environment_is_impossible(check: Check) -> None:
    noon = (
        '<ByValueCondition><TimeOfDayCondition rule="greaterThan" dateTime="2025-01-01T12:00:00"/></ByValueCondition>'
    )
    assert check(act(event("go", trigger(when(noon))))) == ["impossible-condition"]


def test_simultaneous_edges_are_reported(check: Check) -> None:
    fast = when(entity('<SpeedCondition rule="greaterThan" value="5"/>'), "rising")
    ended = when(state("event", "other", "endTransition"), "rising")
    assert check(act(event("other") + event("go", trigger(fast + ended)))) == ["simultaneous-edges"]
    assert check(act(event("other") + event("go", trigger(fast, ended)))) == []


def test_stop_trigger_criteria_are_not_conditions(check: Check) -> None:
    criterion = when(parameter(""), "rising").replace("a condition", "criteria_CollisionTest")
    assert check(act(event("go")), stop=f"<ConditionGroup>{criterion}</ConditionGroup>") == []


def test_storyboard_without_stop_trigger_is_reported(check: Check) -> None:
    assert check(act(event("go")), stop="") == ["no-stop-trigger"]


def test_external_objects_need_no_position(check: Check, scenario_xml: Callable[..., bytes]) -> None:
    post = '<ScenarioObject name="Ego"><ExternalObjectReference name="post"/></ScenarioObject>'
    near = trigger(when(entity('<SpeedCondition rule="greaterThan" value="5"/>')))
    assert check(act(event("go", near)), init="", entities=post) == []


def test_select_triggering_entities_applies_to_acts_only(check: Check) -> None:
    fast = trigger(when(entity('<SpeedCondition rule="greaterThan" value="1"/>')))
    assert check(selecting(event("go"), fast)) == []
    assert check(selecting(event("go", fast))) == ["no-actors"]
    assert check(selecting(event("go", fast), trigger(when(time(GREATER, 1))))) == ["no-actors"]

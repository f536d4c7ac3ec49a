"""Transitions at one instant: ends are observed in their step, and chains of elements need one step."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace
from openscenario_xml import variables_xml
from storyboard_xml import (
    act_xml,
    acts_xml,
    condition_xml,
    element_state_xml,
    event_xml,
    group_xml,
    groups_xml,
    maneuver_xml,
    speed_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
    world_position_xml,
)

from eidrive_scenario.storyboard.state.element_states import ElementTransition
from eidrive_scenario.storyboard.tree.trigger import ConditionEvaluator

PLACE = teleport_xml(world_position_xml(5))
NOTE = """<UserDefinedAction><CustomCommandAction type="note">{text}</CustomCommandAction></UserDefinedAction>"""
SET = """<GlobalAction><VariableAction variableRef="x"><SetAction value="{value}"/></VariableAction></GlobalAction>"""
VARIABLE = '<ByValueCondition><VariableCondition variableRef="x" value="{value}" rule="equalTo"/></ByValueCondition>'


def group(*whats: str, edge: str = "none", delay: float = 0.0) -> str:
    return "".join(condition_xml(what, edge, delay) for what in whats)


def when(*whats: str, edge: str = "none", delay: float = 0.0) -> str:
    """Return a start trigger of one group."""
    return trigger_xml(group(*whats, edge=edge, delay=delay))


def event(name: str, trigger: str = "", action: str | None = None, limit: int = 1) -> str:
    """Return an event; by default its action takes no time."""
    return event_xml(name, action or NOTE.format(text=name), trigger, count=limit)


def ended(of: str, state: str = "endTransition") -> str:
    return element_state_xml("event", of, state)


def course(storyboard: Any, ticks: int) -> list[list[str]]:
    """Return starts and ends in order, by tick of 0.1 s."""
    storyboard.initial()
    seen = []
    for tick in range(ticks):
        storyboard.tick(replace(storyboard.context.view, time=tick * 0.1, tick=tick))
        words = {ElementTransition.START: "starts", ElementTransition.END: "ends", ElementTransition.STOP: "stops"}
        made = [c for c in storyboard.changes if c.kind in ("event", "storyboard") and c.transition in words]
        seen.append([f"{c.element} {words[c.transition]}" for c in made])
    return seen


@pytest.mark.element("StoryboardElementStateCondition")
@pytest.mark.parametrize("state", ["endTransition", "completeState"])
@pytest.mark.parametrize("edge", ["none", "rising"])
def test_chain_transitions_in_one_step_in_any_order(build: Any, state: str, edge: str) -> None:
    events = event("third", when(ended("second", state), edge=edge)) + event(
        "second", when(ended("first", state), edge=edge)
    )
    ticks = course(build(PLACE, events + event("first", when(time_xml(0.05)))), 3)
    assert ticks[0] == ["storyboard starts"]
    assert ticks[1][:6] == [f"{name} {word}" for name in ("first", "second", "third") for word in ("starts", "ends")]
    assert ticks[2] == []


def as_events(first: str, second: str) -> tuple[str, str]:
    """Return two events of one maneuver: `slow`, and `after` with a trigger."""
    return event("slow", first, speed_xml(1, 3)), event("after", second)


def as_groups(first: str, second: str) -> tuple[str, str]:
    """Return these events in two groups of one act."""
    slow, after = as_events(first, second)
    return group_xml(maneuver_xml(slow), "A", name="1"), group_xml(maneuver_xml(after), "A", name="2")


def as_acts(first: str, second: str) -> tuple[str, str]:
    """Return two acts with these triggers, of which the first one is named as the event."""
    events = event("one", "", speed_xml(1, 3)), event("other")
    slow, after = (group_xml(maneuver_xml(inside), "A") for inside in events)
    return act_xml(slow, first, name="slow"), act_xml(after, second, name="after")


@pytest.mark.element("StoryboardElementStateCondition")
@pytest.mark.parametrize("state", ["startTransition", "runningState"])
@pytest.mark.parametrize("first", ["", trigger_xml(condition_xml(time_xml(0, "greaterOrEqual")))])
@pytest.mark.parametrize("parts", [as_events, as_groups, as_acts])
@pytest.mark.parametrize("order", [list, reversed])
def test_start_with_parent_is_observed_as_edge_in_any_order(
    build: Any, state: str, first: str, parts: Any, order: Any
) -> None:
    kind = "act" if parts is as_acts else "event"
    pair = "".join(order(parts(first, when(element_state_xml(kind, "slow", state), edge="rising"))))
    inside = group_xml(maneuver_xml(pair), "A") if parts is as_events else pair
    storyboard = build(PLACE, story=acts_xml(pair if parts is as_acts else act_xml(inside)))
    storyboard.initial()
    storyboard.tick(storyboard.context.view)
    assert [c.element for c in storyboard.changes if c.kind == kind and c.transition is ElementTransition.START] == [
        "slow",
        "after",
    ]


@pytest.mark.parametrize(("order", "x"), [(list, 40.0), (reversed, 20.0)], ids=["20 m, 40 m", "40 m, 20 m"])
def test_last_act_in_the_file_decides_in_one_step(build: Any, order: Any, x: float) -> None:
    acts = [
        act_xml(group_xml(maneuver_xml(event("move", "", teleport_xml(world_position_xml(to)))), "A"), name=f"to {to}")
        for to in (20, 40)
    ]
    storyboard = build(PLACE, story=acts_xml(*order(acts)))
    storyboard.initial()
    assert storyboard.tick(storyboard.context.view).placements["A"].x == x


@pytest.mark.element("StoryboardElementStateCondition", "edge falling")
def test_transition_before_the_first_evaluation_is_over_in_the_next_step(build: Any) -> None:
    """The start of the act is observed in its step, so that it becomes false in the next one."""
    over = element_state_xml("act", "act", "startTransition")
    ticks = course(build(PLACE, event("after", when(over, edge="falling")) + event("other", when(time_xml(9)))), 3)
    assert [entry[0] for entry in ticks if entry] == ["storyboard starts", "after starts"]
    assert ticks[1][0] == "after starts"


@pytest.mark.element("Act StopTrigger")
@pytest.mark.parametrize("order", [list, reversed])
def test_stop_of_an_act_is_observed_by_another_stop_trigger(build: Any, order: Any) -> None:
    """Stop triggers are evaluated from the step after the start on, in which the first act stops."""
    whats = {"first": time_xml(0.05), "second": element_state_xml("act", "first", "completeState")}
    acts = [
        act_xml(
            group_xml(maneuver_xml(event("waits", when(time_xml(9)))), "A"),
            trigger_xml(group(what, edge="none" if name == "first" else "rising"), kind="StopTrigger"),
            name=name,
        )
        for name, what in whats.items()
    ]
    storyboard = build(PLACE, story=acts_xml(*order(acts)))
    storyboard.initial()
    for tick in (0, 1):
        storyboard.tick(replace(storyboard.context.view, time=tick * 0.1, tick=tick))
    stopped = [c.element for c in storyboard.changes if c.kind == "act" and c.transition is ElementTransition.STOP]
    assert stopped == ["first", "second"]


@pytest.mark.element("StoryboardElementStateCondition")
def test_events_of_one_instant_start_though_one_changes_the_value_of_another(build: Any) -> None:
    writer = event("writer", when(time_xml(0.05)), action=SET.format(value="7"))
    reader = event("reader", when(time_xml(0.05), VARIABLE.format(value="0")))
    for events in (writer + reader, reader + writer):
        ticks = course(build(PLACE, events, declared=variables_xml(x=("int", "0"))), 2)
        assert {"writer starts", "reader starts"} <= set(ticks[1])


@pytest.mark.element("StoryboardElementStateCondition")
def test_next_action_starts_when_the_goal_is_reached(build: Any) -> None:
    events = event("slow", action=speed_xml(1, 0.3)) + event("next", when(ended("slow")))
    ticks = course(build(PLACE, events), 4)
    assert ticks[:3] == [["storyboard starts", "slow starts"], [], []]
    assert ticks[3] == ["slow ends", "next starts", "next ends", "storyboard ends"]


def test_cyclic_triggers_start_once_per_step(build: Any) -> None:
    either = trigger_xml(group(ended("b")), group(time_xml(0.05), edge="rising"))
    ticks = course(build(PLACE, event("a", either, limit=4) + event("b", when(ended("a")), limit=4)), 6)
    assert ticks[1] == ["a starts", "a ends", "b starts", "b ends"]
    assert [sum("starts" in entry for entry in tick) for tick in ticks[1:]] == [2, 2, 2, 2, 0]


def test_edge_coincides_with_condition_of_the_same_instant(build: Any) -> None:
    both = when(time_xml(0.05), ended("first"), edge="rising")
    ticks = course(build(PLACE, event("both", both) + event("first", when(time_xml(0.05), edge="rising"))), 3)
    assert ticks[1][:4] == ["first starts", "first ends", "both starts", "both ends"]


@pytest.mark.element("Storyboard StopTrigger")
def test_stop_trigger_observes_end_in_its_step(build: Any) -> None:
    events = event("slow", action=speed_xml(1, 0.2)) + event("other", when(time_xml(9)))
    storyboard = build(PLACE, events, stop=groups_xml(group(ended("slow"))))
    assert course(storyboard, 3)[2] == ["slow ends", "other stops", "storyboard stops"]
    assert storyboard.ended == "stop trigger"


def test_delay_counts_from_the_step_of_the_end(build: Any) -> None:
    events = event("slow", action=speed_xml(1, 0.2)) + event("late", when(ended("slow"), edge="rising", delay=0.3))
    ticks = course(build(PLACE, events), 6)
    assert ticks[2] == ["slow ends"]
    assert ticks[5][0] == "late starts"


@pytest.mark.element("VariableSetAction")
def test_value_is_observed_in_its_step_by_earlier_triggers(build: Any) -> None:
    events = event("reader", when(VARIABLE.format(value="7"), edge="rising")) + event(
        "writer", when(time_xml(0.15)), action=SET.format(value="7")
    )
    ticks = course(build(PLACE, events, declared=variables_xml(x=("int", "0"))), 3)
    assert ticks[1] == []
    assert ticks[2][:4] == ["writer starts", "writer ends", "reader starts", "reader ends"]


def test_repeated_event_starts_in_the_next_step(build: Any) -> None:
    ticks = course(build(PLACE, event("again", limit=3)), 4)
    assert [tick.count("again starts") for tick in ticks] == [1, 1, 1, 0]


def test_view_conditions_are_evaluated_once_per_step(clock: Any, script: Any, context: Any) -> None:
    watching, looking = script([False, True, True]), script([False, True, True])
    looking.instant = True
    clock.step()
    for condition in (watching, looking):
        monitor = ConditionEvaluator(condition, edge="rising")
        assert [monitor.evaluate(context) for _ in range(3)] == (
            [False] * 3 if condition is watching else [False, True, True]
        )
    assert (watching.asked, looking.asked) == (1, 3)


@pytest.mark.parametrize("order", [list, reversed])
@pytest.mark.parametrize(
    ("chained", "tick", "speed"),
    [
        (time_xml(0.25), 3, 18.7),
        (ended("note"), 3, 18.7),
        (ended("note", "startTransition"), 3, 18.7),
        (ended("note", "completeState"), 3, 18.7),
        (ended("slower", "startTransition"), 1, 20.5),
        (ended("slower", "runningState"), 1, 20.5),
    ],
)
def test_action_that_a_chain_preempts_moves_nothing_in_this_step(
    build: Any, order: Any, chained: str, tick: int, speed: float
) -> None:
    """20 m/s, to 10 m/s in 1 s from 0.1 s on: 18 m/s at 0.3 s. To 25 m/s in 1 s: 18 + 7 · 0.1, or 20 + 5 · 0.1."""
    events = [
        event("slower", when(time_xml(0.05)), speed_xml(10, 1.0)),
        event("note", when(time_xml(0.25))),
        event("faster", when(chained), speed_xml(25, 1.0)),
    ]
    storyboard = build(PLACE + speed_xml(20), "".join(order(events)))
    storyboard.initial()
    for now in range(tick + 1):
        commands = storyboard.tick(replace(storyboard.context.view, time=now * 0.1, tick=now))
    assert commands.placements["A"].speed == pytest.approx(speed)

"""Storyboards from files: commands, end of the run, rejected scenarios."""

from __future__ import annotations

from importlib.metadata import entry_points
from itertools import permutations
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from openscenario_xml import parameters_xml
from storyboard_xml import (
    condition_xml,
    element_state_xml,
    event_xml,
    groups_xml,
    speed_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
    world_position_xml,
)

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.extensions.registry import Registry
from eidrive_scenario.storyboard.state.element_states import ElementTransition

STARTS = teleport_xml(world_position_xml(5)) + speed_xml(10)


def later(value: float, edge: str = "none") -> str:
    """Return a start trigger by the simulation time."""
    return trigger_xml(condition_xml(time_xml(value), edge))


def relative_speed(entity: str) -> str:
    """Return an action that sets the speed 2 m/s above that of an entity."""
    target = f'<RelativeTargetSpeed entityRef="{entity}" value="2" speedTargetValueType="delta" continuous="false"/>'
    return speed_xml(0).replace('<AbsoluteTargetSpeed value="0"/>', target)


def view_of(placements: Any, tick: Any, like: Any) -> Any:
    """Return the view of cars at their placements."""
    count = len(placements)
    rows = list(placements.values())
    zeros = np.zeros((count, 3))
    return replace(
        like,
        time=tick * 0.1,
        tick=tick,
        names=tuple(placements),
        position=np.array([[p.x, p.y, p.z] for p in rows]).reshape(count, 3),
        yaw=np.array([p.yaw for p in rows]),
        pitch=np.zeros(count),
        roll=np.zeros(count),
        velocity=zeros,
        acceleration=zeros,
        yaw_rate=np.zeros(count),
        speed=np.array([p.speed for p in rows]),
        size=zeros,
        offset=zeros,
    )


def play(storyboard: Any, ticks: Any) -> Any:
    """Return the commands of each tick in a world that executes them."""
    placements = dict(storyboard.initial().spawns)
    answers = []
    for tick in range(ticks):
        commands = storyboard.tick(view_of(placements, tick, storyboard.context.view))
        answers.append(commands)
        placements.update(commands.spawns)
        placements.update(commands.placements)
        for name in commands.removals:
            placements.pop(name)
    return answers


def test_init_is_executed_before_the_first_view(build: Any) -> None:
    commands = build(STARTS).initial()
    assert list(commands.spawns) == ["A"]
    assert (commands.spawns["A"].x, commands.spawns["A"].speed) == (5.0, 10.0)
    assert commands.driven == frozenset()


def test_relative_positions_in_init_are_independent_of_order(build: Any) -> None:
    beside = teleport_xml('<RelativeWorldPosition entityRef="B" dx="2" dy="1"/>')
    storyboard = build(beside + '</Private><Private entityRef="B">' + teleport_xml(world_position_xml(30)))
    assert storyboard.initial().spawns["A"].x == 32.0


@pytest.mark.parametrize("separator", ["", '</Private><Private entityRef="A">'])
def test_speed_change_in_init_starts_from_the_speed_step_in_any_order(build: Any, separator: str) -> None:
    """From 10 to 20 m/s in 1 s: 15 m/s after 0.5 s, 5 + 0.1 · (11 + 12 + 13 + 14 + 15) = 11.5 m."""
    for actions in permutations([teleport_xml(world_position_xml(5)), speed_xml(10), speed_xml(20, 1)]):
        storyboard = build(separator.join(actions))
        assert storyboard.initial().spawns["A"].speed == 10.0
        last = play(build(separator.join(actions)), 5)[-1].placements["A"]
        assert (last.x, last.speed) == pytest.approx((11.5, 15.0))


def test_relative_speeds_in_init_are_independent_of_order(build: Any) -> None:
    """A drives 2 m/s faster than B; of two speeds that refer to each other, the first reads a speed of 0."""
    start, then_b = teleport_xml(world_position_xml(5)), '</Private><Private entityRef="B">'
    spawns = build(start + relative_speed("B") + then_b + start + speed_xml(10)).initial().spawns
    assert (spawns["A"].speed, spawns["B"].speed) == (12.0, 10.0)
    spawns = build(start + relative_speed("B") + then_b + start + relative_speed("A")).initial().spawns
    assert (spawns["A"].speed, spawns["B"].speed) == (2.0, 4.0)


def test_position_relative_to_unplaced_entity_in_init_is_rejected(build: Any) -> None:
    beside = teleport_xml('<RelativeWorldPosition entityRef="B" dx="2" dy="1"/>')
    with pytest.raises(ScenarioError, match="entity without a position"):
        build(beside).initial()


@pytest.mark.element("SimulationTimeCondition")
def test_speed_step_moves_the_actor_in_its_step(build: Any) -> None:
    """Speed 10 m/s from x = 5; the event at 0.2 s (the first time above 0.15 s) sets 20 m/s."""
    trigger = later(0.15, "rising")
    event = event_xml("go", speed_xml(20), trigger)
    answers = play(build(STARTS, event), 4)
    assert [round(a.placements["A"].x, 6) for a in answers] == [6.0, 7.0, 9.0, 11.0]


def test_linear_speed_change_ends_with_its_last_step(build: Any) -> None:
    event = event_xml("go", speed_xml(13, 0.3))
    storyboard = build(STARTS, event)
    answers = play(storyboard, 4)
    assert [a.placements["A"].speed for a in answers] == pytest.approx([11.0, 12.0, 13.0, 13.0])
    assert storyboard.ended == "storyboard complete"
    assert storyboard.changes[0].time == pytest.approx(0.3)


@pytest.mark.element("SimulationTimeCondition", "Storyboard StopTrigger")
def test_stop_trigger_ends_the_run(build: Any) -> None:
    storyboard = build(STARTS, stop=groups_xml(condition_xml(time_xml(0.25))))
    ended = []
    play(storyboard, 3)
    ended.append(storyboard.ended)
    storyboard.tick(replace(storyboard.context.view, time=0.3, tick=3))
    ended.append(storyboard.ended)
    assert ended == [None, "stop trigger"]
    assert storyboard.changes[-1].why == "simulation time 0.30 s > 0.25 s"


def test_criteria_in_the_stop_trigger_do_not_stop_the_run(build: Any) -> None:
    """ScenarioRunner evaluates conditions on parameters with such names; this condition is true."""
    fulfilled = '<ByValueCondition><ParameterCondition parameterRef="P" rule="equalTo" value="1"/></ByValueCondition>'
    stop = groups_xml(condition_xml(fulfilled, name="criteria_CollisionTest"))
    storyboard = build(STARTS, stop=stop, declared=parameters_xml(P=("double", "1")))
    play(storyboard, 2)
    assert storyboard.ended is None


def test_storyboard_without_stop_trigger_and_stories_continues(build: Any) -> None:
    storyboard = build(STARTS)
    play(storyboard, 5)
    assert storyboard.ended is None


@pytest.mark.element("AddEntityAction", "DeleteEntityAction")
def test_entities_are_added_and_deleted_by_triggers(build: Any) -> None:
    entity = '<GlobalAction><EntityAction entityRef="B">{}</EntityAction></GlobalAction>'
    come = entity.format(f"<AddEntityAction><Position>{world_position_xml(50)}</Position></AddEntityAction>")
    go = entity.format("<DeleteEntityAction/>")
    events = event_xml("come", come, later(0.05))
    events += event_xml("go", go, later(0.25))
    first, second, third, fourth = play(build(STARTS, events), 4)
    assert "B" not in first.spawns
    assert second.spawns["B"].x == 50.0
    assert "B" in third.placements
    assert fourth.removals == {"B"}
    assert "B" not in fourth.placements


def test_unsupported_actions_are_reported_together_with_lines(build: Any) -> None:
    swarm = "<GlobalAction><TrafficAction><TrafficStopAction/></TrafficAction></GlobalAction>"
    all_but_one = [point for point in entry_points(group="eidrive_scenario.actions") if "Stop" not in point.name]
    with pytest.raises(ScenarioError) as caught:
        build(
            STARTS,
            event_xml("odd", swarm),
            global_actions=swarm,
            registered=Registry("actions", all_but_one),
        )
    messages = [diagnostic.message for diagnostic in caught.value.diagnostics]
    assert messages == ["TrafficStopAction is not supported"] * 2
    assert all(diagnostic.line for diagnostic in caught.value.diagnostics)


def test_reference_to_unknown_element_suggests_the_nearest_name(build: Any) -> None:
    trigger = trigger_xml(condition_xml(element_state_xml("event", "goo", "endTransition")))
    action = speed_xml(20)
    with pytest.raises(ScenarioError, match="did you mean 'go'"):
        build(STARTS, event_xml("go", action, trigger))


@pytest.mark.element("StoryboardElementStateCondition")
@pytest.mark.parametrize(
    ("kind", "name", "state", "when"),
    [
        ("event", "first", "startTransition", 0.0),
        ("action", "first", "startTransition", 0.0),
        ("event", "first", "runningState", 0.0),
        ("event", "first", "endTransition", 0.3),
        ("action", "first", "endTransition", 0.3),
        ("event", "first", "completeState", 0.3),
    ],
)
def test_transitions_are_observed_in_their_step(build: Any, kind: Any, name: Any, state: Any, when: Any) -> None:
    """The action of the first event takes from 0 s to 0.3 s and ends with its third step."""
    events = event_xml("first", speed_xml(12, 0.3))
    observed = element_state_xml(kind, f"{name} action" if kind == "action" else name, state)
    watch = trigger_xml(condition_xml(observed))
    events += event_xml("second", speed_xml(5), watch)
    storyboard = build(STARTS, events)
    assert starts(storyboard, "second") == pytest.approx([when])


def test_transition_is_observed_once(build: Any) -> None:
    events = event_xml("first", speed_xml(20))
    watch = trigger_xml(condition_xml(element_state_xml("event", "first", "endTransition")))
    second = event_xml("second", speed_xml(5), watch)
    storyboard = build(STARTS, events + second)
    assert len(starts(storyboard, "second")) == 1


def starts(storyboard: Any, event: str) -> list[float]:
    """Return the start of an event within 10 ticks [s]."""
    placements, moments = dict(storyboard.initial().spawns), []
    for tick in range(10):
        commands = storyboard.tick(view_of(placements, tick, storyboard.context.view))
        placements.update(commands.placements)
        moments += [
            c.time for c in storyboard.changes if c.element == event and c.transition is ElementTransition.START
        ]
    return moments

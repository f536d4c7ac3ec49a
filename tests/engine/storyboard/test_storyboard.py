"""Storyboards from files: commands, end of the run, rejected scenarios."""

from __future__ import annotations

from dataclasses import replace
from importlib.metadata import entry_points
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.registry import Registry
from eidrive_scenario.storyboard.state.states import ElementTransition

TELEPORT = """<PrivateAction><TeleportAction><Position>{position}</Position></TeleportAction></PrivateAction>"""
AT = '<WorldPosition x="{x}" y="0"/>'
SPEED = """<PrivateAction><LongitudinalAction><SpeedAction>
  <SpeedActionDynamics dynamicsShape="{shape}" dynamicsDimension="time" value="{value}"/>
  <SpeedActionTarget><AbsoluteTargetSpeed value="{speed}"/></SpeedActionTarget>
  </SpeedAction></LongitudinalAction></PrivateAction>"""
EVENT = '<Event name="{name}" priority="override"><Action name="{name} action">{action}</Action>{trigger}</Event>'
AFTER = """<{kind}Trigger><ConditionGroup><Condition name="later" delay="0" conditionEdge="{edge}"><ByValueCondition>
  <SimulationTimeCondition value="{value}" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup>
  </{kind}Trigger>"""
STARTS = TELEPORT.format(position=AT.format(x=5)) + SPEED.format(shape="step", value=0, speed=10)


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
    beside = TELEPORT.format(position='<RelativeWorldPosition entityRef="B" dx="2" dy="1"/>')
    storyboard = build(beside + '</Private><Private entityRef="B">' + TELEPORT.format(position=AT.format(x=30)))
    assert storyboard.initial().spawns["A"].x == 32.0


def test_position_relative_to_unplaced_entity_in_init_is_rejected(build: Any) -> None:
    beside = TELEPORT.format(position='<RelativeWorldPosition entityRef="B" dx="2" dy="1"/>')
    with pytest.raises(ScenarioError, match="entity without a position"):
        build(beside).initial()


@pytest.mark.element("SimulationTimeCondition")
def test_speed_step_moves_the_actor_in_its_step(build: Any) -> None:
    """Speed 10 m/s from x = 5; the event at 0.2 s (the first time above 0.15 s) sets 20 m/s."""
    trigger = AFTER.format(kind="Start", edge="rising", value=0.15)
    event = EVENT.format(name="go", action=SPEED.format(shape="step", value=0, speed=20), trigger=trigger)
    answers = play(build(STARTS, event), 4)
    assert [round(a.placements["A"].x, 6) for a in answers] == [6.0, 7.0, 9.0, 11.0]


def test_linear_speed_change_ends_with_its_last_step(build: Any) -> None:
    event = EVENT.format(name="go", action=SPEED.format(shape="linear", value=0.3, speed=13), trigger="")
    storyboard = build(STARTS, event)
    answers = play(storyboard, 4)
    assert [a.placements["A"].speed for a in answers] == pytest.approx([11.0, 12.0, 13.0, 13.0])
    assert storyboard.ended == "storyboard complete"
    assert storyboard.changes[0].time == pytest.approx(0.3)


@pytest.mark.element("SimulationTimeCondition", "Storyboard StopTrigger")
def test_stop_trigger_ends_the_run(build: Any) -> None:
    storyboard = build(STARTS, stop=AFTER.format(kind="Stop", edge="none", value=0.25))
    ended = []
    play(storyboard, 3)
    ended.append(storyboard.ended)
    storyboard.tick(replace(storyboard.context.view, time=0.3, tick=3))
    ended.append(storyboard.ended)
    assert ended == [None, "stop trigger"]
    assert storyboard.changes[-1].why == "simulation time 0.30 s > 0.25 s"


def test_criteria_in_the_stop_trigger_do_not_stop_the_run(build: Any) -> None:
    stop = """<StopTrigger><ConditionGroup>
      <Condition name="criteria_CollisionTest" delay="0" conditionEdge="none"><ByValueCondition>
        <ParameterCondition parameterRef="" value="" rule="lessThan"/></ByValueCondition></Condition>
      </ConditionGroup></StopTrigger>"""
    storyboard = build(STARTS, stop=stop)
    play(storyboard, 2)
    assert storyboard.ended is None


def test_storyboard_without_stop_trigger_and_stories_continues(build: Any) -> None:
    storyboard = build(STARTS)
    play(storyboard, 5)
    assert storyboard.ended is None


@pytest.mark.element("AddEntityAction", "DeleteEntityAction")
def test_entities_are_added_and_deleted_by_triggers(build: Any) -> None:
    entity = '<GlobalAction><EntityAction entityRef="B">{}</EntityAction></GlobalAction>'
    come = entity.format(f"<AddEntityAction><Position>{AT.format(x=50)}</Position></AddEntityAction>")
    go = entity.format("<DeleteEntityAction/>")
    events = EVENT.format(name="come", action=come, trigger=AFTER.format(kind="Start", edge="none", value=0.05))
    events += EVENT.format(name="go", action=go, trigger=AFTER.format(kind="Start", edge="none", value=0.25))
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
            EVENT.format(name="odd", action=swarm, trigger=""),
            global_actions=swarm,
            registered=Registry("actions", all_but_one),
        )
    messages = [diagnostic.message for diagnostic in caught.value.diagnostics]
    assert messages == ["TrafficStopAction is not supported"] * 2
    assert all(diagnostic.line for diagnostic in caught.value.diagnostics)


def test_reference_to_unknown_element_suggests_the_nearest_name(build: Any) -> None:
    trigger = """<StartTrigger><ConditionGroup><Condition name="state" delay="0" conditionEdge="none"><ByValueCondition>
      <StoryboardElementStateCondition storyboardElementType="event" storyboardElementRef="goo" state="endTransition"/>
      </ByValueCondition></Condition></ConditionGroup></StartTrigger>"""
    action = SPEED.format(shape="step", value=0, speed=20)
    with pytest.raises(ScenarioError, match="did you mean 'go'"):
        build(STARTS, EVENT.format(name="go", action=action, trigger=trigger))


WATCH = """<StartTrigger><ConditionGroup><Condition name="watch" delay="0" conditionEdge="none"><ByValueCondition>
  <StoryboardElementStateCondition storyboardElementType="{kind}" storyboardElementRef="{name}" state="{state}"/>
  </ByValueCondition></Condition></ConditionGroup></StartTrigger>"""


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
    events = EVENT.format(name="first", action=SPEED.format(shape="linear", value=0.3, speed=12), trigger="")
    watch = WATCH.format(kind=kind, name=f"{name} action" if kind == "action" else name, state=state)
    events += EVENT.format(name="second", action=SPEED.format(shape="step", value=0, speed=5), trigger=watch)
    storyboard = build(STARTS, events)
    assert starts(storyboard, "second") == pytest.approx([when])


def test_transition_is_observed_once(build: Any) -> None:
    events = EVENT.format(name="first", action=SPEED.format(shape="step", value=0, speed=20), trigger="")
    watch = WATCH.format(kind="event", name="first", state="endTransition")
    second = EVENT.format(name="second", action=SPEED.format(shape="step", value=0, speed=5), trigger=watch)
    storyboard = build(STARTS, events + second.replace("<Event ", '<Event maximumExecutionCount="3" ', 1))
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

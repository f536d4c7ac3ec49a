"""State machines of the elements by tick, with scripted actions and triggers."""

from __future__ import annotations

from typing import Any

import pytest

from eidrive_scenario.storyboard.state.element_states import Domain
from eidrive_scenario.storyboard.tree.builder import InitBlock
from eidrive_scenario.storyboard.tree.elements import (
    ActElement,
    ManeuverElement,
    ManeuverGroupElement,
    StoryboardElement,
    StoryNode,
)
from eidrive_scenario.storyboard.tree.events import ActionElement, EventElement
from eidrive_scenario.storyboard.tree.trigger import ConditionEvaluator, ConditionGroup, Trigger, WaitForTrigger

YES, NO = True, False


class Builder:
    """Constructor of the elements of one tree with arbitrary paths."""

    def __init__(self, context: Any, script: Any) -> None:
        self.context, self.script = context, script

    def wait(self, values: Any) -> Any:
        if values is None:
            return None
        trigger = Trigger([ConditionGroup((ConditionEvaluator(self.script(values)),))])
        return WaitForTrigger("trigger", trigger, self.context)

    def action(self, name: Any, *tasks: Any) -> Any:
        by_actor = {task.actor_name: [task] for task in tasks}
        return ActionElement(self.context, (name,), lambda actor: by_actor[actor], list(by_actor))

    def event(self, name: Any, *tasks: Any, start: Any = None, priority: Any = "parallel", limit: Any = 1) -> Any:
        actions = [self.action(f"{name}.{number}", task) for number, task in enumerate(tasks)]
        return EventElement(self.context, (name,), actions, priority=priority, start=self.wait(start), limit=limit)

    def maneuver(self, *events: Any) -> Any:
        EventElement.resolve_priorities(events)
        return ManeuverElement(self.context, ("maneuver",), events)

    def group(self, *maneuvers: Any, limit: Any = 1) -> Any:
        return ManeuverGroupElement(self.context, ("group",), maneuvers, limit=limit)

    def act(self, *groups: Any, start: Any = None, stop: Any = None, name: Any = "act") -> Any:
        return ActElement(self.context, (name,), groups, start=self.wait(start), stop=self.wait(stop))

    def storyboard(self, *acts: Any, stop: Any = None) -> Any:
        story = StoryNode(self.context, ("story",), acts)
        return StoryboardElement(self.context, ("storyboard",), [story], stop=self.wait(stop))


@pytest.fixture
def make(context: Any, script: Any) -> Any:
    return Builder(context, script)


def play(clock: Any, root: Any, ticks: Any) -> Any:
    """Return one list of `element transition` per tick."""
    seen = []
    for _ in range(ticks):
        context = clock.step()
        root.tick_tree()
        seen.append([f"{c.element} {c.transition.name.lower()}" for c in context.progress.changes if c.transition])
    return seen


@pytest.mark.element("Event without StartTrigger")
def test_elements_without_triggers_start_in_one_tick_and_end_bottom_up(clock: Any, make: Any, task: Any) -> None:
    root = make.storyboard(make.act(make.group(make.maneuver(make.event("event", task(2))))))
    first, second, third, fourth = play(clock, root, 4)
    assert first == [
        f"{name} start" for name in ("storyboard", "story", "act", "group", "maneuver", "event", "event.0")
    ]
    assert second == []
    assert third == [f"{name} end" for name in ("event.0", "event", "maneuver", "group", "act", "story", "storyboard")]
    assert fourth == []


def test_action_of_one_step_ends_with_the_step(clock: Any, make: Any, task: Any) -> None:
    root = make.storyboard(make.act(make.group(make.maneuver(make.event("event", task(1))))))
    first, second = play(clock, root, 2)
    assert first[-1] == "event.0 start"
    assert second[-2:] == ["story end", "storyboard end"]


def test_immediate_action_takes_no_time(clock: Any, make: Any, setting: Any) -> None:
    root = make.storyboard(make.act(make.group(make.maneuver(make.event("event", setting())))))
    assert play(clock, root, 1)[0][-2:] == ["story end", "storyboard end"]


@pytest.mark.element("Act StartTrigger")
def test_events_are_evaluated_after_the_act_starts(clock: Any, make: Any, task: Any) -> None:
    event = make.event("event", task(1), start=[YES])
    root = make.storyboard(make.act(make.group(make.maneuver(event)), start=[NO, NO, YES]))
    ticks = play(clock, root, 3)
    assert ticks[1] == []
    assert ticks[2][:5] == ["act start", "group start", "maneuver start", "event start", "event.0 start"]
    assert event.start_leaf.trigger.groups[0].evaluators[0].condition.asked == 1


@pytest.mark.element("Storyboard StopTrigger")
def test_stop_trigger_is_evaluated_before_children(clock: Any, make: Any, task: Any) -> None:
    late = make.event("late", task(1), start=[NO, YES])
    running = make.event("running", task(9))
    root = make.storyboard(make.act(make.group(make.maneuver(running, late))), stop=[NO, YES])
    ticks = play(clock, root, 2)
    assert ticks[1] == [
        f"{name} stop" for name in ("running.0", "running", "late", "maneuver", "group", "act", "story", "storyboard")
    ]


@pytest.mark.element("Act StopTrigger")
def test_stop_trigger_of_act_counts_from_the_tick_after_its_start(clock: Any, make: Any, task: Any) -> None:
    one = make.act(make.group(make.maneuver(make.event("one", task(9)))), stop=[NO, YES], name="first")
    two = make.act(make.group(make.maneuver(make.event("two", task(9)))), name="second")
    ticks = play(clock, make.storyboard(one, two), 3)
    assert ticks[1] == []
    assert ticks[2] == ["one.0 stop", "one stop", "maneuver stop", "group stop", "first stop"]
    assert two.state.name == "RUNNING"


@pytest.mark.element("priority overwrite", "priority override")
@pytest.mark.parametrize("priority", ["override", "overwrite"])
def test_override_stops_running_events_of_its_maneuver_only(clock: Any, make: Any, task: Any, priority: str) -> None:
    old, new = make.event("old", task(9)), make.event("new", task(1), start=[NO, YES], priority=priority)
    other = make.maneuver(make.event("other", task(9)))
    ticks = play(clock, make.storyboard(make.act(make.group(make.maneuver(old, new), other))), 2)
    assert ticks[1] == ["old.0 stop", "old stop", "new start", "new.0 start"]
    assert other.state.name == "RUNNING"


@pytest.mark.element("priority override")
def test_overridden_event_is_complete_with_executions_left(clock: Any, make: Any, task: Any) -> None:
    old = make.event("old", task(9), start=[YES], limit=3)
    new = make.event("new", task(1), start=[NO, YES], priority="override")
    ticks = play(clock, make.storyboard(make.act(make.group(make.maneuver(old, new)))), 3)
    assert ticks[1] == ["old.0 stop", "old stop", "new start", "new.0 start"]
    assert ticks[2][:3] == ["new.0 end", "new end", "maneuver end"]
    assert old.executions == 1


@pytest.mark.element("priority skip")
def test_skipped_start_counts_as_execution(clock: Any, make: Any, task: Any) -> None:
    running = make.event("running", task(2))
    shy = make.event("shy", task(1), start=[NO, YES, YES], priority="skip", limit=2)
    ticks = play(clock, make.storyboard(make.act(make.group(make.maneuver(running, shy)))), 4)
    assert ticks[1] == ["shy skip"]
    assert ticks[2] == ["running.0 end", "running end", "shy start", "shy.0 start"]
    assert ticks[3][:3] == ["shy.0 end", "shy end", "maneuver end"]


@pytest.mark.element("priority skip")
def test_skipped_event_without_executions_left_is_complete(clock: Any, make: Any, task: Any) -> None:
    running = make.event("running", task(2))
    shy = make.event("shy", task(1), start=[NO, YES], priority="skip")
    ticks = play(clock, make.storyboard(make.act(make.group(make.maneuver(running, shy)))), 3)
    assert ticks[1] == ["shy skip"]
    assert shy.state.name == "COMPLETE"
    assert ticks[2][:3] == ["running.0 end", "running end", "maneuver end"]


def test_element_with_execution_count_zero_is_skipped(clock: Any, make: Any, task: Any) -> None:
    never, other = make.event("never", task(1), limit=0), make.event("other", task(1))
    ticks = play(clock, make.storyboard(make.act(make.group(make.maneuver(never, other)))), 2)
    assert "never skip" in ticks[0]
    assert "other start" in ticks[0]
    assert never.executions == 0
    assert ticks[1][-1] == "storyboard end"


@pytest.mark.element("priority parallel")
def test_parallel_event_does_not_stop_others(clock: Any, make: Any, task: Any) -> None:
    old, new = make.event("old", task(9)), make.event("new", task(9), start=[NO, YES])
    ticks = play(clock, make.storyboard(make.act(make.group(make.maneuver(old, new)))), 2)
    assert ticks[1] == ["new start", "new.0 start"]


@pytest.mark.element("Event maximumExecutionCount")
def test_event_is_executed_up_to_its_execution_count(clock: Any, make: Any, task: Any) -> None:
    event = make.event("event", task(1), start=[NO, YES], limit=2)
    ticks = play(clock, make.storyboard(make.act(make.group(make.maneuver(event)))), 4)
    assert ticks[1] == ["event start", "event.0 start"]
    assert ticks[2] == ["event.0 end", "event end", "event start", "event.0 start"]
    assert event.executions == 2
    assert ticks[3][-1] == "storyboard end"


@pytest.mark.element("ManeuverGroup maximumExecutionCount")
def test_repeated_group_restarts_its_children(clock: Any, make: Any, task: Any) -> None:
    doing = task(1)
    group = make.group(make.maneuver(make.event("event", doing)), limit=3)
    ticks = play(clock, make.storyboard(make.act(group)), 4)
    assert [tick.count("group start") for tick in ticks] == [1, 1, 1, 0]
    assert ticks[1][:6] == ["event.0 end", "event end", "maneuver end", "group end", "group start", "maneuver start"]
    assert doing.starts == 3
    assert ticks[3][-1] == "storyboard end"


def test_element_without_children_runs_until_stopped(clock: Any, make: Any) -> None:
    group = make.group()
    ticks = play(clock, make.storyboard(make.act(group), stop=[NO, NO, YES]), 3)
    assert ticks[1] == []
    assert ticks[2] == ["group stop", "act stop", "story stop", "storyboard stop"]


def test_storyboard_with_stop_trigger_continues_after_its_stories(clock: Any, make: Any, task: Any) -> None:
    root = make.storyboard(make.act(make.group(make.maneuver(make.event("event", task(1))))), stop=[NO])
    assert play(clock, root, 2)[1][-1] == "story end"
    assert root.state.name == "RUNNING"


@pytest.mark.element("conflicting actions")
def test_later_action_preempts_action_on_the_same_domain(clock: Any, make: Any, task: Any) -> None:
    slow = make.event("slow", task(9, actor="A", domain=Domain.LONGITUDINAL))
    aside = make.event("aside", task(9, actor="A", domain=Domain.LATERAL))
    other = make.event("other", task(9, actor="B", domain=Domain.LONGITUDINAL))
    fast = make.event("fast", task(9, actor="A", domain=Domain.LONGITUDINAL), start=[NO, YES])
    ticks = play(clock, make.storyboard(make.act(make.group(make.maneuver(slow, aside, other, fast)))), 2)
    assert ticks[1] == ["fast start", "fast.0 start", "slow.0 stop", "slow end"]


def test_action_preempted_in_its_last_step_stops_instead_of_ending(
    clock: Any, make: Any, task: Any, context: Any
) -> None:
    slow = make.event("slow", task(2, actor="A", domain=Domain.LATERAL))
    watching = make.event("watching", task(9, actor="A", domain=Domain.LATERAL), start=[NO, YES])
    ticks = play(clock, make.storyboard(make.act(make.group(make.maneuver(slow, watching)))), 3)
    assert "slow.0 stop" in ticks[1]
    assert ticks[2] == []


def test_action_of_two_actors_ends_with_the_later_one(clock: Any, make: Any, task: Any) -> None:
    action = make.action("action", task(1, actor="A"), task(2, actor="B"))
    event = EventElement(make.context, ("event",), [action], priority="parallel")
    ticks = play(clock, make.storyboard(make.act(make.group(make.maneuver(event)))), 3)
    assert ticks[1] == []
    assert ticks[2][0] == "action end"


@pytest.mark.element("conflicting actions")
def test_init_action_is_preempted(clock: Any, make: Any, task: Any, context: Any) -> None:
    init = InitBlock(context, [task(9, actor="A", domain=Domain.LONGITUDINAL)])
    init.start()
    event = make.event("event", task(9, actor="A", domain=Domain.LONGITUDINAL))
    play(clock, make.storyboard(make.act(make.group(make.maneuver(event)))), 1)
    assert init.running == []


def test_removed_actor_stops_its_actions(clock: Any, make: Any, task: Any, context: Any) -> None:
    event = make.event("event", task(9, actor="A", domain=Domain.LATERAL))
    root = make.storyboard(make.act(make.group(make.maneuver(event))))
    play(clock, root, 1)
    context.remove_actor("A")
    assert play(clock, root, 1)[0][:2] == ["event end", "maneuver end"]

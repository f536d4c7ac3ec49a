"""Edges, delays and groups, evaluation by evaluation."""

from __future__ import annotations

from typing import Any

import pytest

from eidrive_scenario.storyboard.tree.trigger import ConditionEvaluator, ConditionGroup, Trigger, WaitForTrigger

YES, NO = True, False


def answers(clock: Any, monitor: Any, count: Any) -> Any:
    return [monitor.evaluate(clock.step()) for _ in range(count)]


@pytest.mark.element("edge none", "edge rising", "edge falling", "edge risingOrFalling")
@pytest.mark.parametrize(
    ("edge", "expected"),
    [
        ("none", [YES, YES, NO, YES, NO]),
        ("rising", [NO, NO, NO, YES, NO]),
        ("falling", [NO, NO, YES, NO, YES]),
        ("risingOrFalling", [NO, NO, YES, YES, YES]),
    ],
)
def test_the_first_evaluation_yields_no_edge(clock: Any, script: Any, edge: Any, expected: Any) -> None:
    monitor = ConditionEvaluator(script([YES, YES, NO, YES, NO]), edge=edge)
    assert answers(clock, monitor, 5) == expected


@pytest.mark.element("delay")
def test_a_delay_shows_the_edge_of_that_time_ago(clock: Any, script: Any) -> None:
    monitor = ConditionEvaluator(script([NO, YES, YES, NO, NO, NO, NO]), edge="rising", delay=0.3)
    assert answers(clock, monitor, 7) == [NO, NO, NO, NO, YES, NO, NO]


@pytest.mark.element("delay")
def test_a_delayed_value_without_edge_lasts_as_long_as_it_lasted(clock: Any, script: Any) -> None:
    monitor = ConditionEvaluator(script([NO, YES, YES, NO, NO, NO, NO]), delay=0.3)
    assert answers(clock, monitor, 7) == [NO, NO, NO, NO, YES, YES, NO]


def test_before_the_delay_has_passed_nothing_is_true(clock: Any, script: Any) -> None:
    monitor = ConditionEvaluator(script([YES]), delay=0.2)
    assert answers(clock, monitor, 4) == [NO, NO, YES, YES]


def test_a_delay_that_is_no_multiple_of_the_step_ends_with_the_next_one(clock: Any, script: Any) -> None:
    monitor = ConditionEvaluator(script([NO, YES, NO]), edge="rising", delay=0.25)
    assert answers(clock, monitor, 6) == [NO, NO, NO, NO, YES, NO]


def test_reset_forgets_the_value_before(clock: Any, script: Any) -> None:
    monitor = ConditionEvaluator(script([NO, YES, YES]), edge="rising")
    answers(clock, monitor, 1)
    monitor.reset()
    assert answers(clock, monitor, 2) == [NO, NO]


def test_a_group_is_true_where_all_are_and_asks_each_of_them_every_time(clock: Any, script: Any) -> None:
    first, second = script([NO, YES, YES]), script([NO, YES, YES])
    group = ConditionGroup((ConditionEvaluator(first), ConditionEvaluator(second, edge="rising")))
    assert [group.evaluate(clock.step()) for _ in range(3)] == [NO, YES, NO]
    assert second.asked == 3


def test_two_edges_at_different_times_never_meet(clock: Any, script: Any) -> None:
    group = ConditionGroup(
        (
            ConditionEvaluator(script([NO, YES, YES]), edge="rising"),
            ConditionEvaluator(script([NO, NO, YES]), edge="rising"),
        )
    )
    assert [group.evaluate(clock.step()) for _ in range(3)] == [NO, NO, NO]


@pytest.mark.element("several condition groups")
def test_one_true_group_fires_and_says_why(clock: Any, script: Any) -> None:
    trigger = Trigger(
        [
            ConditionGroup((ConditionEvaluator(script([NO])),)),
            ConditionGroup((ConditionEvaluator(script([NO, YES])), ConditionEvaluator(script([NO, YES])))),
        ]
    )
    assert [trigger.evaluate(clock.step()) for _ in range(2)] == [NO, YES]
    assert trigger.why == "value 2 at 0.1 s and value 2 at 0.1 s"


def test_why_speaks_of_the_time_before_the_delay(clock: Any, script: Any) -> None:
    trigger = Trigger([ConditionGroup((ConditionEvaluator(script([NO, YES]), edge="rising", delay=0.2),))])
    assert [trigger.evaluate(clock.step()) for _ in range(4)] == [NO, NO, NO, YES]
    assert trigger.why == "value 2 at 0.1 s, 0.2 s ago"


def test_why_of_lasting_condition_has_the_value_of_the_delay_ago(clock: Any, script: Any) -> None:
    """It is true from the start; with another that is true from 0.2 s on, the trigger fires 0.3 s later."""
    lasting, late = script([YES] * 6), script([NO, NO, YES, YES, YES, YES])
    trigger = Trigger([ConditionGroup((ConditionEvaluator(lasting, delay=0.3), ConditionEvaluator(late, delay=0.3)))])
    assert [trigger.evaluate(clock.step()) for _ in range(6)] == [NO, NO, NO, NO, NO, YES]
    assert trigger.why == "value 3 at 0.2 s, 0.3 s ago and value 3 at 0.2 s, 0.3 s ago"


@pytest.mark.parametrize("edge", ["falling", "risingOrFalling"])
def test_why_of_falling_edge_says_so(clock: Any, script: Any, edge: str) -> None:
    trigger = Trigger([ConditionGroup((ConditionEvaluator(script([YES, NO]), edge=edge),))])
    assert [trigger.evaluate(clock.step()) for _ in range(2)] == [NO, YES]
    assert trigger.why == "value 2 at 0.1 s (falling edge)"


def test_a_trigger_without_groups_never_fires(clock: Any) -> None:
    assert not Trigger([])
    assert not Trigger([]).evaluate(clock.step())


def test_the_leaf_runs_until_the_trigger_fires(clock: Any, script: Any, context: Any) -> None:
    leaf = WaitForTrigger("start", Trigger([ConditionGroup((ConditionEvaluator(script([NO, YES])),))]), context)
    clock.step()
    leaf.tick_once()
    assert leaf.status.name == "RUNNING"
    clock.step()
    leaf.tick_once()
    assert leaf.status.name == "SUCCESS"

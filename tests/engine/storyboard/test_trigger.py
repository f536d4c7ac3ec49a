"""Edges, delays and groups by evaluation."""

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
def test_first_evaluation_has_no_edge(clock: Any, script: Any, edge: Any, expected: Any) -> None:
    monitor = ConditionEvaluator(script([YES, YES, NO, YES, NO]), edge=edge)
    assert answers(clock, monitor, 5) == expected


@pytest.mark.element("delay")
def test_delay_returns_the_earlier_edge(clock: Any, script: Any) -> None:
    monitor = ConditionEvaluator(script([NO, YES, YES, NO, NO, NO, NO]), edge="rising", delay=0.3)
    assert answers(clock, monitor, 7) == [NO, NO, NO, NO, YES, NO, NO]


@pytest.mark.element("delay")
def test_delayed_value_without_edge_keeps_its_duration(clock: Any, script: Any) -> None:
    monitor = ConditionEvaluator(script([NO, YES, YES, NO, NO, NO, NO]), delay=0.3)
    assert answers(clock, monitor, 7) == [NO, NO, NO, NO, YES, YES, NO]


def test_delayed_condition_is_false_before_the_delay(clock: Any, script: Any) -> None:
    monitor = ConditionEvaluator(script([YES]), delay=0.2)
    assert answers(clock, monitor, 4) == [NO, NO, YES, YES]


def test_delay_between_steps_ends_with_the_next_step(clock: Any, script: Any) -> None:
    monitor = ConditionEvaluator(script([NO, YES, NO]), edge="rising", delay=0.25)
    assert answers(clock, monitor, 6) == [NO, NO, NO, NO, YES, NO]


def test_reset_discards_the_previous_value(clock: Any, script: Any) -> None:
    monitor = ConditionEvaluator(script([NO, YES, YES]), edge="rising")
    answers(clock, monitor, 1)
    monitor.reset()
    assert answers(clock, monitor, 2) == [NO, NO]


def test_group_requires_all_conditions_and_evaluates_each(clock: Any, script: Any) -> None:
    first, second = script([NO, YES, YES]), script([NO, YES, YES])
    group = ConditionGroup((ConditionEvaluator(first), ConditionEvaluator(second, edge="rising")))
    assert [group.evaluate(clock.step()) for _ in range(3)] == [NO, YES, NO]
    assert second.asked == 3


def test_edges_at_different_times_do_not_coincide(clock: Any, script: Any) -> None:
    group = ConditionGroup(
        (
            ConditionEvaluator(script([NO, YES, YES]), edge="rising"),
            ConditionEvaluator(script([NO, NO, YES]), edge="rising"),
        )
    )
    assert [group.evaluate(clock.step()) for _ in range(3)] == [NO, NO, NO]


@pytest.mark.element("several condition groups")
def test_true_group_fires_with_its_reason(clock: Any, script: Any) -> None:
    trigger = Trigger(
        [
            ConditionGroup((ConditionEvaluator(script([NO])),)),
            ConditionGroup((ConditionEvaluator(script([NO, YES])), ConditionEvaluator(script([NO, YES])))),
        ]
    )
    assert [trigger.evaluate(clock.step()) for _ in range(2)] == [NO, YES]
    assert trigger.why == "value 2 at 0.1 s and value 2 at 0.1 s"


def test_reason_of_delayed_condition_has_the_earlier_values(clock: Any, script: Any) -> None:
    trigger = Trigger([ConditionGroup((ConditionEvaluator(script([NO, YES]), edge="rising", delay=0.2),))])
    assert [trigger.evaluate(clock.step()) for _ in range(4)] == [NO, NO, NO, YES]
    assert trigger.why == "value 2 at 0.1 s, 0.2 s ago"


def test_reason_of_lasting_condition_has_the_earlier_value(clock: Any, script: Any) -> None:
    """The condition is true from the start; with another one from 0.2 s on, the trigger fires 0.3 s later."""
    lasting, late = script([YES] * 6), script([NO, NO, YES, YES, YES, YES])
    trigger = Trigger([ConditionGroup((ConditionEvaluator(lasting, delay=0.3), ConditionEvaluator(late, delay=0.3)))])
    assert [trigger.evaluate(clock.step()) for _ in range(6)] == [NO, NO, NO, NO, NO, YES]
    assert trigger.why == "value 3 at 0.2 s, 0.3 s ago and value 3 at 0.2 s, 0.3 s ago"


@pytest.mark.parametrize("edge", ["falling", "risingOrFalling"])
def test_reason_of_falling_edge_names_the_edge(clock: Any, script: Any, edge: str) -> None:
    trigger = Trigger([ConditionGroup((ConditionEvaluator(script([YES, NO]), edge=edge),))])
    assert [trigger.evaluate(clock.step()) for _ in range(2)] == [NO, YES]
    assert trigger.why == "value 2 at 0.1 s (falling edge)"


def test_trigger_without_groups_never_fires(clock: Any) -> None:
    assert not Trigger([])
    assert not Trigger([]).evaluate(clock.step())


def test_leaf_runs_until_the_trigger_fires(clock: Any, script: Any, context: Any) -> None:
    leaf = WaitForTrigger("start", Trigger([ConditionGroup((ConditionEvaluator(script([NO, YES])),))]), context)
    clock.step()
    leaf.tick_once()
    assert leaf.status.name == "RUNNING"
    clock.step()
    leaf.tick_once()
    assert leaf.status.name == "SUCCESS"

"""Conditions on parameters and user-defined values, and comparisons by rules."""

from __future__ import annotations

import pytest
from eidrive_behaviors.conditions.values import satisfies
from recorded_scene import RunScene, first_start
from street_scene import NOTHING

from eidrive_scenario.api.actions import model, satisfies_rule


@pytest.mark.element("ParameterCondition")
def test_parameter_and_user_defined_value_conditions(scene: RunScene) -> None:
    value = "<ByValueCondition>{}</ByValueCondition>"
    level = value.format('<ParameterCondition parameterRef="Level" rule="greaterThan" value="1.5"/>')
    outside = value.format('<UserDefinedValueCondition name="button" rule="equalTo" value="pressed"/>')
    assert first_start(scene(0.2, ("Ego", NOTHING, level))) == 0.0
    assert first_start(scene(0.2, ("Ego", NOTHING, outside))) is None


@pytest.mark.parametrize(
    ("text", "rule", "limit", "expected"),
    [
        ("10", "greaterThan", "9", True),
        ("b", "greaterThan", "a", True),
        ("true", "equalTo", "1", True),
        ("2.0", "equalTo", "2", True),
        ("two", "notEqualTo", "2", True),
        (" 1e1 ", "equalTo", "+10.", True),
        ("1_0", "equalTo", "10", False),
        ("nan", "equalTo", "nan", True),
        ("INF", "greaterThan", "1e300", True),
        ("a", "lessOrEqual", "a", True),
        (None, "notEqualTo", "a", False),
        ("2026-01-01T12:00:00+10:00", "lessThan", "2026-01-01T03:00:00Z", True),
        ("2026-01-01T12:00:00Z", "equalTo", "2026-01-01T13:00:00.0+01:00", True),
        ("2026-01-01T12:00:00", "equalTo", "2026-01-01T12:00:00.000", True),
        ("2026-13-01T12:00:00", "greaterThan", "2026-01-01T12:00:00", True),
    ],
)
def test_satisfies_compares_numbers_and_instants_if_both_texts_are_such(
    text: str | None, rule: str, limit: str, expected: bool
) -> None:
    assert satisfies(text, model.Rule(rule), limit) is expected


@pytest.mark.parametrize(
    ("rule", "below", "same", "above"),
    [
        ("greaterThan", False, False, True),
        ("greaterOrEqual", False, True, True),
        ("lessThan", True, False, False),
        ("lessOrEqual", True, True, False),
        ("equalTo", False, True, False),
        ("notEqualTo", True, False, True),
    ],
)
def test_satisfies_rule_has_a_small_tolerance(rule: str, below: bool, same: bool, above: bool) -> None:
    answers = [satisfies_rule(value, model.Rule(rule), 3.0) for value in (2.9, 3.0 + 1e-9, 3.1)]
    assert answers == [below, same, above]
    assert not satisfies_rule(float("nan"), model.Rule(rule), 3.0)

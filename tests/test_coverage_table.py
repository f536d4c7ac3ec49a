"""Coverage table of docs/openscenario.md: agreement with registries and tests."""

from __future__ import annotations

import pytest
from coverage_table import PAGE, SECTIONS, WITHOUT_EFFECT, marked_tests, page, unread

from eidrive_scenario.extensions.registry import registry


@pytest.mark.exhaustive
def test_page_equals_generated_page() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert page(text) == text, "run `make docs`"


@pytest.mark.exhaustive
def test_rows_and_test_marks_match() -> None:
    names = {row.name for rows in SECTIONS.values() for row in rows}
    tests = marked_tests()
    assert names - set(tests) == set()
    assert set(tests) - names == set()


def test_registered_actions_and_conditions_have_rows() -> None:
    names = {row.name for rows in SECTIONS.values() for row in rows}
    registered = {name for name in (*registry("actions"), *registry("conditions")) if not name.startswith("eidrive.")}
    assert registered <= names
    assert {name for name in names if name.endswith(("Action", "Condition"))} <= registered


def test_without_effect_equals_unread_attributes() -> None:
    assert unread() == set(WITHOUT_EFFECT)
    assert list(WITHOUT_EFFECT) == sorted(WITHOUT_EFFECT)

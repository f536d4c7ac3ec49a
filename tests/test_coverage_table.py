"""The coverage table says what the registries and the tests say."""

from __future__ import annotations

import sys
from pathlib import Path

from eidrive_scenario.registry import registry

sys.path.insert(0, str(Path(__file__).parent))

from coverage_table import PAGE, SECTIONS, WITHOUT_EFFECT, marked_tests, page, unread


def test_the_page_is_what_the_generator_writes() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert page(text) == text, "run `make docs`"


def test_every_row_is_shown_by_a_test_and_every_mark_names_a_row() -> None:
    names = {row.name for rows in SECTIONS.values() for row in rows}
    tests = marked_tests()
    assert names - set(tests) == set()
    assert set(tests) - names == set()


def test_every_action_and_condition_has_a_row() -> None:
    names = {row.name for rows in SECTIONS.values() for row in rows}
    assert {*registry("actions"), *registry("conditions")} <= names
    wanted = {name for name in names if name.endswith(("Action", "Condition"))}
    assert wanted <= {*registry("actions"), *registry("conditions")}


def test_what_has_no_effect_is_what_nothing_reads() -> None:
    assert unread() == set(WITHOUT_EFFECT)
    assert list(WITHOUT_EFFECT) == sorted(WITHOUT_EFFECT)

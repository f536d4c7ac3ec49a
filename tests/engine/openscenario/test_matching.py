import itertools
import re

import pytest

from eidrive_scenario.openscenario.reading.matching import Automaton, Group, Leaf, automaton

SEQUENCE = Group((Leaf("a", 0, 1), Leaf("b", 1, None), Leaf("c", 1, 1)), exclusive=False)
CHOICE = Group((Leaf("a", 1, 1), Leaf("b", 2, None)), exclusive=True)
NESTED = Group((Leaf("a", 1, 1), Group((Leaf("b", 1, 1), Leaf("c", 1, 1)), True, optional=True)), exclusive=False)
REPEATED = Group((Leaf("a", 1, 1), Leaf("b", 1, 1)), exclusive=True, optional=True, repeated=True)


def accepts(machine: Automaton, word: str) -> bool:
    state = 0
    for name in word:
        if name not in machine.steps[state]:
            return False
        state = machine.steps[state][name]
    return state in machine.accepting


@pytest.mark.parametrize(
    ("model", "pattern"),
    [(SEQUENCE, "a?b+c"), (CHOICE, "a|bb+"), (NESTED, "a(b|c)?"), (REPEATED, "(a|b)*")],
)
def test_automaton_accepts_sequences_of_the_content_model(model: Group, pattern: str) -> None:
    machine = automaton(model)
    words = ("".join(word) for length in range(6) for word in itertools.product("abc", repeat=length))
    for word in words:
        assert accepts(machine, word) == bool(re.fullmatch(pattern, word)), word


def test_missing_returns_required_following_children() -> None:
    machine = automaton(SEQUENCE)
    assert machine.missing(0) == [("b",), ("c",)]
    assert automaton(NESTED).missing(0) == [("a",)]
    assert automaton(Group((Leaf("a", 1, 1), Leaf("b", 1, 1)), exclusive=True)).missing(0) == [("a", "b")]


def test_skipped_returns_required_preceding_children() -> None:
    machine = automaton(SEQUENCE)
    assert machine.skipped(0, "c") == ("b",)
    assert machine.skipped(0, "a") == ()
    assert machine.skipped(machine.steps[0]["b"], "a") is None

"""100,000 hostile texts as expressions and parameters: each gives a value or an ExpressionError, without Python code.

The audit hooks of Python (PEP 578) record: any import, opened file, executed code object or looked-up frame would be an
event. The seed is fixed; the texts are the same in every run.
"""

from __future__ import annotations

import math
import random
import resource
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from xml.sax.saxutils import quoteattr

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from openscenario_xml import parameters_xml, scenario_xml
from storyboard_xml import story_xml

from eidrive_scenario.errors import ScenarioError
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.openscenario.values.expressions import (
    MAX_LENGTH,
    REFERENCE,
    ExpressionError,
    concatenate,
    evaluate,
    joins_text,
)

HARMLESS = {"compile", "builtins.id"}
"""Audit events of parsing an expression and of traversing its tree; the execution of code is a different event."""


TEXTS = 40_000
LOADED = 4_000
SLOWEST = 0.5
"""Maximum processor time of one text [s]; a valid result takes less than 0.001 s, the slowest one 0.03 s."""
MEMORY = 64 * 2**20
PARAMETERS = {"a": 1, "b": 2.5, "c": True, "d": 10**300, "e2": -0.0}

BREAKOUTS = """
__import__('os').system('true')
().__class__.__bases__[0].__subclasses__()
(lambda: 0).__globals__
max.__self__.__dict__
$a.__class__
$a.real
getattr($a, 'real')
[x for x in ().__class__.__mro__]
{k: v for k, v in globals().items()}
f'{$a!r}'
'{0.__class__}'.format($a)
(y := $a)
$a if $b else $c
max(*[1, 2])
max(key=abs)
max(**{})
abs.__call__($a)
open('x')
eval('1')
exec('1')
compile('1', '', 'eval')
breakpoint()
input()
print(1)
exit()
vars()
dir()
type($a)
print
__builtins__
__name__
_
parameter_a
parameter_a.__class__
10 ** 10 ** 10
9 ** 9 ** 9 ** 9
1 << 99999
2 // 0
~1
1 @ 1
pow(9, 9999)
pow(-1, 0.5)
'a' * 99999999
(1,) * 99999999
[0] * 99999999
round(1e308) * round(1e308) * round(1e308)
floor(1e400)
1e999 - 1e999
0 * 1e999
sqrt(-1)
acos(2)
1 % 0
1 / 0
tan(pi / 2)
max()
min(1)
sign('a')
abs(None)
not
and and
1 if
lambda
await 1
yield
return 1
import os
a; b
1 # comment
1 \\
"unfinished
0x10 + 0b1 + 0o7
1_000
1j
\u0663 + \uff14
\uff4d\uff41\uff58(1, 2)
\ufb01
\U0001d7d9 + 1
\u221e
\x00
\ufeff1
\u202e1 + 2
\ud800
""".strip("\n").split("\n")
WORDS = ["$a", "$b", "$c", "$d", "$e2", "$nobody", "$", "${", "}", "1", "2.5", "1e308", "9" * 40, ".5", "5.", "true"]
WORDS += ["+", "-", "*", "/", "%", "**", "//", "(", ")", ",", ".", "not", "and", "or", "==", "<", "=", ":", ";", "@"]
WORDS += ["max(", "min(", "pow(", "sqrt(", "round(", "floor(", "sin(", "abs(", "sign(", "pi", "e", "word", "__class__"]
WORDS += [
    "[",
    "]",
    "{",
    "'",
    '"',
    "\\",
    "\n",
    "\t",
    " ",
    "\x00",
    "é",
    "\U0001d7d9",
    "\u200b",
    "lambda",
    "if",
    "else",
    "for",
    "in",
]


def hostile(count: int, seed: int) -> Iterator[str]:
    """Yield breakouts, complete, truncated and combined; random words; nested texts; growing numbers."""
    dice = random.Random(seed)
    kinds: list[Callable[[], str]] = [
        lambda: dice.choice(BREAKOUTS),
        lambda: cut(dice, dice.choice(BREAKOUTS)),
        lambda: (
            dice.choice(BREAKOUTS) + dice.choice([" + ", "*", ", ", ") + (", " and ", "\n"]) + dice.choice(BREAKOUTS)
        ),
        lambda: dice.choice(["", " "]).join(dice.choices(WORDS, k=dice.randrange(1, 25))),
        lambda: nested(dice),
        lambda: dice.choice("*+-/%").join(
            dice.choices(["$d", "9" * 60, "round(1e308)", "1e308"], k=dice.randrange(2, 60))
        ),
        lambda: "".join(chr(dice.choice([dice.randrange(32, 127), dice.randrange(0xD800)])) for _ in range(20)),
    ]
    yield from BREAKOUTS
    for _ in range(count - len(BREAKOUTS)):
        yield dice.choice(kinds)()


def cut(dice: random.Random, text: str) -> str:
    """Return a text with one part removed or one character changed."""
    start = dice.randrange(len(text))
    return text[:start] + dice.choice(["", chr(dice.randrange(32, 127))]) + text[start + dice.randrange(3) :]


def nested(dice: random.Random) -> str:
    opening, closing = dice.choice(
        [("(", ")"), ("-", ""), ("not ", ""), ("abs(", ")"), ("max(1,", ")"), ("[", "]"), ("$", "")]
    )
    depth = dice.choice([2, 20, 90, 150, 240, 500, 5000])
    return opening * depth + dice.choice(["1", "$a", "$d", ""]) + closing * (depth - dice.choice([0, 0, 0, 1]))


class AuditLog:
    """Audit events of Python while enabled. There is a single hook, as hooks cannot be removed."""

    def __init__(self) -> None:
        self.on = False
        self.events: set[str] = set()
        sys.addaudithook(self._note)

    def _note(self, event: str, arguments: tuple[object, ...]) -> None:
        # The stored part of an event must not keep frames alive.
        if self.on and event not in HARMLESS:
            self.events.add(event if event != "import" else f"import {arguments[0]}")


@pytest.fixture(scope="module")
def audit_log() -> AuditLog:
    return AuditLog()


def test_audit_hook_records_python_operations(audit_log: AuditLog) -> None:
    audit_log.on = True
    eval("__import__('this_module_is_nowhere') if 0 else open('/dev/null').close()")
    audit_log.on = False
    assert {"exec", "open"} <= audit_log.events
    audit_log.events.clear()


@pytest.mark.exhaustive
@pytest.mark.timeout(300)
def test_expressions_execute_no_python_code(audit_log: AuditLog) -> None:
    for text in BREAKOUTS:
        has_value(text)  # performs late imports of the evaluation
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    values = 0
    slowest = (0.0, "")
    audit_log.on = True
    try:
        for text in hostile(TEXTS, 1):
            started = time.thread_time()
            values += has_value(text)
            spent = time.thread_time() - started
            if spent >= SLOWEST:  # a garbage collection after other tests takes as long, but only once
                started = time.thread_time()
                has_value(text)
                spent = min(spent, time.thread_time() - started)
            slowest = max(slowest, (spent, text))
    finally:
        audit_log.on = False
    assert audit_log.events == set()
    assert slowest[0] < SLOWEST, slowest
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < MEMORY
    assert values > TEXTS / 100, "some are expressions after all"


@pytest.mark.parametrize("text", ["or2.5in 1", "'\\d'", "1 is 1", "(1)(2)"])
def test_expressions_emit_no_python_warnings(text: str) -> None:
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        assert not has_value(text)
    assert seen == []


def has_value(text: str) -> bool:
    """Whether the text has a value; the only other permitted result is ExpressionError."""
    try:
        result = evaluate(text, PARAMETERS)
    except ExpressionError:
        return False
    assert type(result) in (int, float, bool), text
    assert math.isfinite(result), text
    return True


def test_concatenation_accepts_only_texts() -> None:
    texts = {name: str(value) for name, value in PARAMETERS.items()}
    for text in hostile(TEXTS // 10, 2):
        assert joins_text(text, PARAMETERS) in (True, False)
        if set(REFERENCE.findall(text)) <= set(texts):
            assert len(concatenate(text, texts)) <= len(text) + 310 * text.count("$")


@pytest.mark.exhaustive
def test_scenario_expressions_execute_no_python_code(audit_log: AuditLog) -> None:
    """The texts are parameter defaults, assigned values and attributes."""
    dice = random.Random(3)
    kinds = ["double", "int", "string", "boolean", "dateTime", "unsignedShort", "integer"]
    load_scenario(scenario_xml(declarations=parameters_xml(P=("double", "1")), story=story_xml()))
    taken = refused = 0
    audit_log.on = True
    try:
        for text in hostile(LOADED, 3):
            written = quoteattr("".join(each for each in text if each in "\t\n" or " " <= each < "\ud800"))[1:-1]
            expression = dice.choice(["{}", "${{{}}}"]).format(written.replace('"', "&quot;"))
            place, kind = dice.choice(["default", "speed", "given"]), dice.choice(kinds)
            declared = parameters_xml(P=(kind, expression if place == "default" else "1"), a=("double", "1"))
            story = story_xml(speed=expression if place == "speed" else "${$a + 1}")
            try:
                load_scenario(scenario_xml(declarations=declared, story=story), {"P": text} if place == "given" else {})
                taken += 1
            except ScenarioError:
                refused += 1
    finally:
        audit_log.on = False
    assert audit_log.events == set()
    assert taken > LOADED / 20
    assert refused > LOADED / 4


@pytest.mark.exhaustive
@settings(deadline=None, max_examples=500)
@given(st.text(max_size=MAX_LENGTH + 50), st.dictionaries(st.text("abc_", min_size=1), st.floats() | st.integers()))
def test_parameter_values_execute_no_python_code(text: str, parameters: dict[str, float]) -> None:
    for expression in (
        text,
        *(f"${name} * 2 + sin(${name})" for name in parameters),
        " + ".join(f"${n}" for n in parameters),
    ):
        try:
            assert math.isfinite(evaluate(expression, parameters))
        except ExpressionError:
            continue

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eidrive_scenario.openscenario.values.expressions import (
    MAX_LENGTH,
    ExpressionError,
    concatenate,
    evaluate,
    joins_text,
)


@pytest.mark.element("${expression}")
@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * 3", 7),
        ("(1 + 2) * 3", 9),
        ("50 / 3.6", 50 / 3.6),
        ("-$a", -5),
        ("$a - $b", 3),
        ("7 % 4", 3),
        ("-7 % 4", -3),
        ("5.5 % 2", 1.5),
        ("round(2.5)", 3),
        ("round(-2.5)", -3),
        ("round(0.49999999999999994)", 0),
        ("round(4503599627370497.0)", 4503599627370497),
        ("floor(-1.5)", -2),
        ("ceil(1.2)", 2),
        ("sqrt(16)", 4),
        ("pow(2, 10)", 1024),
        ("abs(-3)", 3),
        ("sign(-0.1)", -1),
        ("min(3, $b, 7)", 2),
        ("max(3, 7)", 7),
        ("sin(pi / 2)", 1),
        ("atan(1) * 4", math.pi),
        ("not true", False),
        ("$flag and true", True),
        ("false or false", False),
    ],
)
def test_expression_has_expected_value(text: str, value: float) -> None:
    assert evaluate(text, {"a": 5, "b": 2, "flag": True}) == pytest.approx(value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1 +",
        "1 / 0",
        "5 % 0",
        "sqrt(-1)",
        "2 ** 3",
        "1 < 2",
        "1 if 1 else 2",
        "[1, 2]",
        "'a' * 9",
        "f'{1}'",
        "(1).real",
        "max.__class__",
        "max(x=1)",
        "max(*(1, 2))",
        "lambda: 1",
        "__import__('os')",
        "open('x')",
        "parameter_a",
        "a",
        "1; 2",
        "0x10",
        "1or 2",
        "1j",
        "pow(10, 400)",
        "1e400",
        "((((" * 200,
        "-" * 900 + "1",
        "9" * 999,
        "1+" * MAX_LENGTH + "1",
    ],
)
def test_invalid_expression_raises_error(text: str) -> None:
    with pytest.raises(ExpressionError):
        evaluate(text, {})


def test_misspelled_function_error_suggests_similar_name() -> None:
    with pytest.raises(ExpressionError) as caught:
        evaluate("squrt(4)", {})
    assert caught.value.hint == "did you mean 'sqrt'?"


def test_bare_word_error_suggests_dollar_sign() -> None:
    with pytest.raises(ExpressionError) as caught:
        evaluate("speed + 1", {"speed": 3})
    assert caught.value.hint == "a parameter begins with $"


def test_bare_words_are_concatenated() -> None:
    text = "BrakeCondition_HWT + _ + $HeadwayTime"
    assert joins_text(text, {"HeadwayTime": 1.5})
    assert concatenate(text, {"HeadwayTime": "1.5"}) == "BrakeCondition_HWT_1.5"
    assert not joins_text("sqrt($x) + 1", {"x": 4})


@given(st.text(alphabet="0123456789.+-*/%() ,eE_$abcxyzmaxinpowsqrtand'\"[]{}:;=<>!@\\\n", max_size=60))
def test_random_expressions_raise_only_expression_errors(text: str) -> None:
    try:
        result = evaluate(text, {"a": 1, "b": 2.5, "c": True})
    except ExpressionError:
        return
    assert math.isfinite(result)


@pytest.mark.exhaustive
@given(st.text(max_size=80))
def test_python_names_in_expressions_raise_error(text: str) -> None:
    try:
        assert isinstance(evaluate(text, {}), int | float)
    except ExpressionError:
        return

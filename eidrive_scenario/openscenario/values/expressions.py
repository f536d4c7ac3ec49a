"""Expressions in `${…}`: arithmetic and logic over parameters, without any other feature of Python.

Operators: + - * / % and the unary minus, not, and, or, brackets. Functions and constants: see FUNCTIONS and CONSTANTS.
"""

from __future__ import annotations

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import simpleeval

from eidrive_scenario.errors import quoted, suggestion

Value: TypeAlias = float | int | bool | str

MAX_LENGTH = 1000
"""Maximum number of characters of an expression."""

REFERENCE = re.compile(r"\$([A-Za-z_][A-Za-z0-9_]*)", re.ASCII)
"""Reference to a parameter."""
_WORD = re.compile(r"(?<![\w$.])[A-Za-z_]\w*", re.ASCII)
_NUMBER_BEFORE_WORD = re.compile(r"(?<![\w$.])(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?+[A-Za-z_]", re.ASCII)
_PREFIX = "parameter_"


class ExpressionError(Exception):
    """Invalid expression, with message and hint."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message, hint)
        self.message = message
        self.hint = hint


def _round(value: float) -> int:
    whole = math.floor(abs(value))
    # A sum with 0.5 would be rounded itself
    return int(math.copysign(whole + (abs(value) - whole >= 0.5), value))


def _sign(value: float) -> int:
    return (value > 0) - (value < 0)


def _remainder(left: float, right: float) -> float:
    rest = math.fmod(left, right)
    return int(rest) if isinstance(left, int) and isinstance(right, int) else rest


FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "abs": abs,
    "acos": math.acos,
    "asin": math.asin,
    "atan": math.atan,
    "ceil": math.ceil,
    "cos": math.cos,
    "floor": math.floor,
    "max": max,
    "min": min,
    "pow": math.pow,
    "round": _round,
    "sign": _sign,
    "sin": math.sin,
    "sqrt": math.sqrt,
    "tan": math.tan,
}
CONSTANTS: Mapping[str, Value] = {"pi": math.pi, "e": math.e, "true": True, "false": False}

_OPERATORS: Mapping[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: _remainder,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Not: operator.not_,
}
_NODES = (ast.Expression, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.boolop, ast.Call, ast.Name, ast.Constant, ast.Load)
HELP = "allowed are + - * / % not and or, brackets, and " + " ".join(FUNCTIONS)
_KEYWORDS = {"and", "or", "not"}


def evaluate(text: str, parameters: Mapping[str, Value]) -> float | int | bool:
    """Return the value of an expression without its `${` and `}`. Raise ExpressionError if it is invalid."""
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"the expression has {len(text)} characters", f"at most {MAX_LENGTH} are allowed")
    if _NUMBER_BEFORE_WORD.search(text):
        raise ExpressionError(f"{quoted(text)} is not an expression", "separate numbers from words")
    source = REFERENCE.sub(rf" {_PREFIX}\1 ", text).strip()
    names = {_PREFIX + name: _number(name, value) for name, value in parameters.items()}
    evaluator = simpleeval.SimpleEval(
        operators=dict(_OPERATORS), functions=dict(FUNCTIONS), names=names | dict(CONSTANTS)
    )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # Warnings of Python, such as for `1if`, are errors of the expression
            tree = ast.parse(source, mode="eval")
        _check(tree, text)
        result = evaluator.eval(source, previously_parsed=tree.body)
        if not isinstance(result, int | float) or not math.isfinite(result):
            raise ExpressionError(f"the expression {quoted(text)} has no finite value")
        return result
    except ExpressionError:
        raise
    except (ArithmeticError, ValueError) as error:
        raise ExpressionError(f"the expression {quoted(text)} has no value: {error}") from error
    except (SyntaxError, Warning, TypeError, simpleeval.InvalidExpression, RecursionError, MemoryError) as error:
        raise ExpressionError(f"{quoted(text)} is not an expression", HELP) from error


def concatenate(text: str, parameters: Mapping[str, str]) -> str:
    """Concatenate the words and parameter values of an expression such as `brake_ + $side`."""
    parts = [part.strip() for part in text.split("+")]
    return "".join(REFERENCE.sub(lambda match: parameters[match.group(1)], part) for part in parts)


def joins_text(text: str, parameters: Mapping[str, Value]) -> bool:
    """Whether an expression concatenates texts: it has a word that is not a function, or a text parameter."""
    words = set(_WORD.findall(text)) - _KEYWORDS - FUNCTIONS.keys() - CONSTANTS.keys()
    return bool(words) or any(isinstance(value, str) for value in parameters.values())


def _number(name: str, value: Value) -> float | int | bool:
    if isinstance(value, str):
        raise ExpressionError(f"${name} is {value!r}, which is not a number")
    return value


def _check(tree: ast.Expression, text: str) -> None:
    """Raise ExpressionError if the tree contains anything that the standard does not define."""
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    for node in ast.walk(tree):
        if isinstance(node, ast.operator | ast.unaryop):
            allowed = isinstance(node, tuple(_OPERATORS))
        elif isinstance(node, ast.Constant):
            allowed = type(node.value) in (int, float)
        elif isinstance(node, ast.Call):
            allowed = isinstance(node.func, ast.Name) and not node.keywords
        else:
            allowed = isinstance(node, _NODES)
        if not allowed:
            kind = type(node).__name__
            raise ExpressionError(f"{quoted(text)} is not an expression of the standard: {kind} is not allowed")
        if isinstance(node, ast.Name) and not node.id.startswith(_PREFIX):
            names = FUNCTIONS if id(node) in called else CONSTANTS
            if node.id not in names:
                kind = "function" if id(node) in called else "word"
                hint = suggestion(node.id, names) if kind == "function" else "a parameter begins with $"
                raise ExpressionError(f"unknown {kind} {node.id!r} in the expression {quoted(text)}", hint)

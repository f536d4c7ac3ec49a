"""Parameters: declaration with type and default, assignment from outside, and substitution of `$name`."""

from __future__ import annotations

import operator
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import msgspec

from eidrive_scenario.base.tolerances import EPSILON
from eidrive_scenario.errors import Diagnostic, SettingError, quoted, shortened, suggestion
from eidrive_scenario.openscenario.diagnostics import MAX_TEXT, Budget, BudgetError, DiagnosticCollector, Location
from eidrive_scenario.openscenario.model import ParameterDeclaration, ParameterType, Rule, ValueConstraintGroup
from eidrive_scenario.openscenario.model.declarations import Limits
from eidrive_scenario.openscenario.values import expressions
from eidrive_scenario.openscenario.values.expressions import REFERENCE, ExpressionError, Value
from eidrive_scenario.openscenario.values.scalars import (
    BOOLEAN,
    DATE_TIME,
    DOUBLE,
    INTEGER,
    STRING,
    Scalar,
    whole_number,
)

EXPRESSION = re.compile(r"\$\{[ A-Za-z0-9_+\-*/%$().,]*\}", re.ASCII)

TYPES: Mapping[ParameterType, Scalar] = {
    ParameterType.BOOLEAN: BOOLEAN,
    ParameterType.DATE_TIME: DATE_TIME,
    ParameterType.DOUBLE: DOUBLE,
    ParameterType.INT: INTEGER,
    ParameterType.INTEGER: INTEGER,
    ParameterType.STRING: STRING,
    ParameterType.UNSIGNED_INT: whole_number(Limits(0, 2**32 - 1)),
    ParameterType.UNSIGNED_SHORT: whole_number(Limits(0, 2**16 - 1)),
}

TEXTUAL = (STRING, DOUBLE, BOOLEAN, DATE_TIME)
"""Types whose texts are converted unchanged. Other types are integers, which may have a zero fraction, such as -5.0."""


class Parameter(msgspec.Struct, frozen=True):
    """Parameter with its value as a text and in its type."""

    name: str
    text: str
    value: Any
    declared: str
    """Text of its declaration; `text` may be an assigned one."""
    is_valid: bool = True
    """False if its declaration is invalid; consequential errors are not reported."""

    @property
    def operand(self) -> Value:
        """Return the value as an operand of expressions; a numeric text is a number."""
        if isinstance(self.value, int | float):
            return self.value
        try:
            number: float = DOUBLE.convert(self.text)
        except ValueError:
            return self.text
        return int(number) if number.is_integer() and "." not in self.text else number


@dataclass(frozen=True)
class Assignment:
    """Value of a parameter from outside the file, with its location if that is a file too."""

    text: str
    origin: Location | None = None


def as_assignments(values: Mapping[str, str | Assignment] | None) -> dict[str, Assignment]:
    """Return the values by parameter name, each as an Assignment. Raise SettingError for an object of another form."""
    if values is not None and not isinstance(values, Mapping):
        raise SettingError(Diagnostic(f"parameters is {quoted(values)}", "give a mapping of names to values"))
    return {
        name: value if isinstance(value, Assignment) else Assignment(_text_of(value))
        for name, value in (values or {}).items()
    }


def _text_of(value: object) -> str:
    """Return the text of a Python value in a file: `True` is `true`."""
    return format_value(value) if isinstance(value, bool) else str(value)


@dataclass
class Scope:
    """Parameters that are visible at an element, including those of the outer scopes."""

    outer: Scope | None = None
    parameters: dict[str, Parameter] = field(default_factory=dict)
    lent: set[str] | None = None
    """Names of the used parameters of a scope that belongs to another file; None for the own file."""
    budget: Budget = field(default_factory=Budget)
    """Limits of the texts of expressions."""
    awaited: set[str] = field(default_factory=set)
    """Names of the parameters whose declarations have not been read yet."""

    def inner(self) -> Scope:
        """Return a new inner scope."""
        return Scope(self, budget=self.budget)

    def find(self, name: str) -> Parameter:
        """Return the parameter of a name. Raise ExpressionError if it is unknown or invalid."""
        scope: Scope | None = self
        is_awaited = False
        while scope is not None:
            is_awaited |= name in scope.awaited
            parameter = scope.parameters.get(name)
            if parameter is not None:
                if not parameter.is_valid:
                    raise ExpressionError("")
                if scope.lent is not None:
                    scope.lent.add(name)
                return parameter
            scope = scope.outer
        if is_awaited:
            raise ExpressionError(f"parameter ${name} is used before its declaration", "declare it above this use")
        raise ExpressionError(f"unknown parameter ${shortened(name, 200)}", suggestion(name, self.names()))

    def declared(self, name: str) -> Parameter | None:
        """Return the innermost parameter of a name; None if it is unknown."""
        if name in self.parameters:
            return self.parameters[name]
        return self.outer.declared(name) if self.outer is not None else None

    def names(self) -> set[str]:
        """Return all visible names."""
        return set(self.parameters) | (self.outer.names() if self.outer else set())

    def resolve(self, text: str, scalar: Scalar) -> Any:
        """Return the value of an attribute that begins with `$`.

        Raise ExpressionError if it is invalid, or ValueError like `convert`.
        """
        match = REFERENCE.fullmatch(text)
        if match:
            parameter = self.find(match.group(1))
            result, subject = parameter.text, f"${parameter.name} is {quoted(parameter.text)}"
        elif text.startswith("${") and text.endswith("}") and scalar.takes_expressions:
            result = format_value(self._evaluate(text, as_text=scalar is STRING))
            subject = f"the expression {quoted(text[2:-1])} is {result}"
        else:
            return scalar.convert(text)
        try:
            return scalar.convert(result if scalar in TEXTUAL else _whole(result))
        except ValueError as error:
            raise ExpressionError(f"{subject}, which is not {scalar.name}", str(error)) from error

    def evaluate(self, text: str) -> Value:
        """Return the value of `$name` or `${expression}` in its own type, for texts outside of attributes.

        Raise ExpressionError if it is invalid.
        """
        match = REFERENCE.fullmatch(text)
        if match:
            parameter = self.find(match.group(1))
            return parameter.value if isinstance(parameter.value, bool | int | float | str) else parameter.text
        return self._evaluate(text, as_text=True)

    def _evaluate(self, text: str, *, as_text: bool) -> Value:
        """Return the value of `${expression}`; only if `as_text` is True may it concatenate texts."""
        body = text[2:-1]
        references = REFERENCE.findall(body)
        used = {name: self.find(name) for name in references}
        operands = {name: parameter.operand for name, parameter in used.items()}
        if as_text and expressions.joins_text(body, operands):
            try:
                self.budget.join(len(body) + sum(len(used[name].text) for name in references))
            except BudgetError as error:
                message = f"the expression {quoted(body)} is too long: {error}"
                raise ExpressionError(message, "concatenate less") from error
            return expressions.concatenate(body, {name: parameter.text for name, parameter in used.items()})
        if not EXPRESSION.fullmatch(text):
            raise ExpressionError(f"{quoted(text)} has characters that an expression may not have", expressions.HELP)
        return expressions.evaluate(body, operands)


def format_value(value: Value) -> str:
    """Return the text of a value in a file."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return value if isinstance(value, str) else repr(value)


def declare(
    scope: Scope, declaration: ParameterDeclaration, assignment: Assignment | None, collector: DiagnosticCollector
) -> None:
    """Add a parameter to its scope; report a value that does not match its type or its constraints."""
    scalar = TYPES[declaration.parameter_type]
    origin = (assignment and assignment.origin) or Location.of(declaration)
    # The line of the declaration does not have the value of an option
    is_unlocated = assignment is not None and assignment.origin is None
    elsewhere = f"; the value is assigned by an option, the file declares {quoted(declaration.value)}" * is_unlocated
    name, text = declaration.name, assignment.text if assignment else declaration.value
    text = _without_fraction(text, scalar)
    if not fits_type(_without_fraction(declaration.value, scalar), scalar):
        collector.warning(
            f"parameter {name!r} is declared as {declaration.parameter_type.value}, but its default is "
            f"{quoted(declaration.value)}",
            "the value is used as a text",
            at=declaration,
        )
        scalar = STRING
    try:
        if len(text) > MAX_TEXT:
            raise ValueError(f"at most {MAX_TEXT} characters are allowed")
        value = scalar.convert(text)
    except ValueError as error:
        collector.error(
            f"parameter {quoted(name)} is {quoted(text)}, which is not {scalar.name}", f"{error}{elsewhere}", at=origin
        )
        scope.parameters[name] = Parameter(name, text[:MAX_TEXT], text[:MAX_TEXT], declaration.value, is_valid=False)
        return
    scope.parameters[name] = Parameter(name, text, value, declaration.value)
    groups = declaration.constraint_group
    try:
        is_allowed = not groups or any(_holds(group, value, scalar) for group in groups)
    except ValueError as error:
        message = f"a constraint of parameter {name!r} is not {scalar.name}"
        collector.error(message, str(error), at=declaration)
        return
    if scalar is STRING and any(
        constraint.rule not in (Rule.EQUAL_TO, Rule.NOT_EQUAL_TO)
        for group in groups
        for constraint in group.value_constraint
    ):
        collector.warning(
            f"constraints of the text parameter {name!r} compare sizes",
            "use equalTo and notEqualTo, or declare a number",
            at=declaration,
        )
    if not is_allowed:
        allowed = " or ".join(
            " and ".join(f"{constraint.rule.value} {constraint.value}" for constraint in group.value_constraint)
            for group in groups
        )
        collector.constraint_error(
            f"parameter {name!r} is {quoted(text)}, outside its constraints",
            f"expected {allowed}{elsewhere}",
            at=origin,
        )


def fits_type(text: str, scalar: Scalar) -> bool:
    """Whether a text is a value of a type."""
    try:
        scalar.convert(text)
    except ValueError:
        return False
    return True


def satisfies_rule(value: float, rule: Rule, limit: float) -> bool:
    """Compare `value` with `limit` by a Rule of the standard; NaN fulfills no rule."""
    if value != value:
        return False
    match rule._value_:
        case "greaterThan":
            return value > limit + EPSILON
        case "greaterOrEqual":
            return value >= limit - EPSILON
        case "lessThan":
            return value < limit - EPSILON
        case "lessOrEqual":
            return value <= limit + EPSILON
        case "equalTo":
            return value == limit or abs(value - limit) <= EPSILON
        case "notEqualTo":
            return not (value == limit or abs(value - limit) <= EPSILON)
    raise ValueError(f"unknown rule {rule!r}")


def _holds(group: ValueConstraintGroup, value: Any, scalar: Scalar) -> bool:
    """Whether a value satisfies all constraints. As in conditions, numbers have a tolerance, and texts are compared as
    numbers if both are numbers: lane ids are texts.
    """
    for constraint in group.value_constraint:
        sides = value, scalar.convert(_without_fraction(constraint.value, scalar))
        if scalar is STRING and all(fits_type(side, DOUBLE) for side in sides):
            sides = DOUBLE.convert(sides[0]), DOUBLE.convert(sides[1])
        elif scalar is DATE_TIME:
            sides = _in_time_zone(sides[0]), _in_time_zone(sides[1])
        if all(isinstance(side, float) for side in sides):
            is_satisfied = satisfies_rule(sides[0], constraint.rule, sides[1])
        else:
            is_satisfied = _COMPARISONS[constraint.rule](*sides)
        if not is_satisfied:
            return False
    return True


def _in_time_zone(moment: datetime) -> datetime:
    """Return a moment as UTC if it has no time zone: Python does not order moments with and without one."""
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)


_COMPARISONS = {
    Rule.EQUAL_TO: operator.eq,
    Rule.NOT_EQUAL_TO: operator.ne,
    Rule.GREATER_THAN: operator.gt,
    Rule.GREATER_OR_EQUAL: operator.ge,
    Rule.LESS_THAN: operator.lt,
    Rule.LESS_OR_EQUAL: operator.le,
}


def _without_fraction(text: str, scalar: Scalar) -> str:
    """Remove a fraction of zero if a whole number is expected: -5.0 becomes -5."""
    return text if scalar in TEXTUAL or fits_type(text, scalar) else _whole(text)


def _whole(text: str) -> str:
    """Return a number without a fraction as a whole number; any other text unchanged."""
    try:
        number: float = DOUBLE.convert(text)
    except ValueError:
        return text
    return str(int(number)) if number.is_integer() else text


def is_reference(value: object) -> bool:
    """Whether a value is exactly the text `$name` or `${expression}`."""
    return isinstance(value, str) and (
        REFERENCE.fullmatch(value) is not None or (value.startswith("${") and value.endswith("}"))
    )


def resolve_references(
    data: Any,
    scope: Scope | None,
    *,
    source: str = "",
    line: int | None = None,
    lines: Mapping[str, int] | None = None,
    path: str = "",
) -> Any:
    """Return parsed settings with the values of the parameters to which they refer.

    data   mappings, lists and scalars from YAML; keys are not changed
    scope  visible parameters; None leaves the data unchanged
    line   line of the settings
    lines  lines of single keys, by their dotted path from `path` on, as returned by `load_yaml_text`

    Raise SettingError with one diagnostic per unknown parameter or invalid expression.
    """
    if scope is None:
        return data
    diagnostics: list[Diagnostic] = []

    def resolve(data: Any, path: str, line: int | None) -> Any:
        line = lines.get(path, line) if lines else line
        if isinstance(data, Mapping):
            return {key: resolve(value, _below(path, key), line) for key, value in data.items()}
        if isinstance(data, list | tuple):
            return [resolve(value, _below(path, index), line) for index, value in enumerate(data)]
        if not is_reference(data):
            return data
        try:
            return scope.evaluate(data)
        except ExpressionError as error:
            if error.message:
                message = f"setting {path!r}: {error.message}" if path else error.message
                diagnostics.append(Diagnostic(message, error.hint, source, line))
            return data

    resolved = resolve(data, path, line)
    if diagnostics:
        raise SettingError(diagnostics)
    return resolved


def parameter_hints(data: Any, scope: Scope | None, path: str = "") -> dict[str, str]:
    """Return a hint for each setting that refers to parameters, by its dotted path: their names and values.

    data, scope, path  as those of `resolve_references`, before the substitution
    """
    if scope is None:
        return {}
    if isinstance(data, Mapping | list | tuple):
        hints: dict[str, str] = {}
        for key, value in data.items() if isinstance(data, Mapping) else enumerate(data):
            hints |= parameter_hints(value, scope, _below(path, key))
        return hints
    if not is_reference(data):
        return {}
    texts = []
    for name in dict.fromkeys(REFERENCE.findall(data)):
        with suppress(ExpressionError):  # reported by `resolve_references`
            parameter = scope.find(name)
            assigned = "" if parameter.text == parameter.declared else f" instead of its declared {parameter.declared}"
            texts.append(f"parameter {name!r} is {quoted(parameter.text)}{assigned}")
    return {path: ", ".join(texts)} if texts else {}


def _below(path: str, key: object) -> str:
    return f"{path}.{key}" if path else str(key)


def hide_parameters(scope: Scope | None, names: Iterable[str]) -> Scope | None:
    """Return the scope without some parameters, such as those without a value yet."""
    if scope is None:
        return None
    hidden = set(names)
    outer = hide_parameters(scope.outer, hidden)
    visible = {name: parameter for name, parameter in scope.parameters.items() if name not in hidden}
    return Scope(outer, visible, scope.lent, scope.budget)

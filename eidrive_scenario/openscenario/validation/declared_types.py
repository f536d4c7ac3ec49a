"""Check of variable and parameter values against their declared types; deviating values are used as texts."""

from __future__ import annotations

from collections.abc import Iterable

from eidrive_scenario.openscenario.diagnostics import DiagnosticCollector
from eidrive_scenario.openscenario.model import (
    Element,
    ParameterAction,
    ParameterDeclaration,
    ParameterType,
    VariableAction,
    VariableDeclaration,
)
from eidrive_scenario.openscenario.values.parameters import TYPES, fits_type

_WITHOUT_NUMBERS = (ParameterType.BOOLEAN, ParameterType.DATE_TIME, ParameterType.STRING)
_TRUTH = ("true", "false")
"""Boolean texts, which are compared case-insensitively, as Python capitalizes them."""


def check_types(elements: Iterable[Element], collector: DiagnosticCollector) -> None:
    """Warn of values and calculations that contradict the declared type."""
    elements = tuple(elements)
    types: dict[tuple[str, str], set[ParameterType]] = {}
    for one in elements:
        if isinstance(one, VariableDeclaration):
            types.setdefault(("variable", one.name), set()).add(one.variable_type)
            if _misfits(one.value, one.variable_type):
                declared = one.variable_type.value
                message = f"variable {one.name!r} is declared as {declared}, but its value is {one.value!r}"
                collector.warning(message, "the value is used as a text", source=one.source, line=one.line)
        elif isinstance(one, ParameterDeclaration):
            types.setdefault(("parameter", one.name), set()).add(one.parameter_type)
    for one in elements:
        if isinstance(one, VariableAction):
            _check_action(one, "variable", one.variable_ref, types.get(("variable", one.variable_ref)), collector)
        elif isinstance(one, ParameterAction):
            _check_action(one, "parameter", one.parameter_ref, types.get(("parameter", one.parameter_ref)), collector)


def _check_action(
    action: VariableAction | ParameterAction,
    kind: str,
    name: str,
    types: set[ParameterType] | None,
    collector: DiagnosticCollector,
) -> None:
    """Check one action; the type is unknown if a name has several declarations with different types."""
    if types is None or len(types) != 1:
        return
    (declared,) = types
    setting = action.set_action
    if setting is not None and _misfits(setting.value, declared):
        message = f"{kind} {name!r} is declared as {declared.value}, but set to {setting.value!r}"
        collector.warning(message, "the value is used as a text", source=setting.source, line=setting.line)
    elif action.modify_action is not None and declared in _WITHOUT_NUMBERS:
        message = f"{kind} {name!r} is declared as {declared.value}, but modified as a number"
        collector.warning(message, "declare it as double", source=action.source, line=action.line)


def _misfits(text: object, declared: ParameterType) -> bool:
    """Whether a value is not of a type; values that could not be read are already reported."""
    if not isinstance(text, str) or not isinstance(declared, ParameterType):
        return False
    if declared is ParameterType.BOOLEAN and text.lower() in _TRUTH:
        return False
    return not fits_type(text, TYPES[declared])

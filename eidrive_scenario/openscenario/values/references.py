"""References to parameters inside settings: `{seconds: $Latency}`, `{seconds: ${$Latency * 2}}`.

A value is substituted after parsing, so it is always a single number, Boolean or text.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.openscenario.values.expressions import REFERENCE, ExpressionError
from eidrive_scenario.openscenario.values.parameters import Scope


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
    lines  lines of single keys, by their dotted path from `path` on, as returned by `key_lines`

    Raise SettingError with one diagnostic per unknown parameter or invalid expression.
    """
    if scope is None:
        return data
    diagnostics: list[Diagnostic] = []
    resolved = _resolve(data, scope, path, source, line, lines or {}, diagnostics)
    if diagnostics:
        raise SettingError(diagnostics)
    return resolved


def _resolve(
    data: Any,
    scope: Scope,
    path: str,
    source: str,
    line: int | None,
    lines: Mapping[str, int],
    diagnostics: list[Diagnostic],
) -> Any:
    line = lines.get(path, line)
    if isinstance(data, Mapping):
        return {
            key: _resolve(value, scope, _below(path, key), source, line, lines, diagnostics)
            for key, value in data.items()
        }
    if isinstance(data, list | tuple):
        return [
            _resolve(value, scope, _below(path, index), source, line, lines, diagnostics)
            for index, value in enumerate(data)
        ]
    if not is_reference(data):
        return data
    try:
        return scope.evaluate(data)
    except ExpressionError as error:
        if error.message:
            message = f"setting {path!r}: {error.message}" if path else error.message
            diagnostics.append(Diagnostic(message, error.hint, source, line))
        return data


def parameter_hints(data: Any, scope: Scope | None, path: str = "") -> dict[str, str]:
    """Return a hint for each setting that refers to parameters, by its dotted path: their names and values.

    data, scope, path  as those of `resolve_references`, before the substitution
    """
    if scope is None:
        return {}
    if isinstance(data, Mapping | list | tuple):
        entries = data.items() if isinstance(data, Mapping) else enumerate(data)
        found: dict[str, str] = {}
        for key, value in entries:
            found |= parameter_hints(value, scope, _below(path, key))
        return found
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
    return Scope(
        outer, {name: one for name, one in scope.parameters.items() if name not in hidden}, scope.lent, scope.budget
    )

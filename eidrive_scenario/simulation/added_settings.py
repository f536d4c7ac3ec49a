"""Values of the settings `drive` and `criteria` of a run, in one form for Python, pytest and the command line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from pathlib import Path
from typing import Any, TypeAlias

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.files.yaml_text import flow_yaml

YamlSource: TypeAlias = str | Path
"""YAML text, or path of a YAML file."""

_DRIVE_HINT = 'give a name, names, or a mapping such as {"Ego": {"detector": "lidar"}}'
_CRITERIA_HINT = 'give a mapping such as {"collision": {"of": "Ego"}}, a YAML text, a file, or a list of them'


def drive_sources(given: Any) -> dict[str, YamlSource | None]:
    """Return the properties of the driving stack by entity; None for a stack with the defaults.

    given  None, name, collection of names, or mapping of names to properties

    Raise SettingError for any other value.
    """
    if given is None:
        return {}
    entries = given.items() if isinstance(given, Mapping) else [(name, None) for name in _several(given)]
    found: dict[str, YamlSource | None] = {}
    for name, stack in entries:
        if not isinstance(name, str) or not name:
            raise SettingError(Diagnostic(f"drive has the entity {quoted(name)}", _DRIVE_HINT))
        if name in found:
            raise SettingError(Diagnostic(f"drive has the entity {name!r} twice", "give each entity once"))
        found[name] = None if stack is None else _source(f"drive[{name!r}]", stack, _DRIVE_HINT)
    return found


def criteria_sources(given: Any) -> tuple[YamlSource, ...]:
    """Return declarations of criteria as YAML texts and paths of files.

    given  None, YAML text, path of a file, mapping, or a collection of these

    Raise SettingError for any other value.
    """
    if given is None:
        return ()
    several = [given] if isinstance(given, Mapping) else _several(given)
    return tuple(_source("criteria", one, _CRITERIA_HINT) for one in several)


def parse_drive(option: str, entries: Iterable[str]) -> dict[str, str | None]:
    """Return the stacks of texts `NAME` and `NAME=STACK` by name. Raise SettingError for any other text."""
    found: dict[str, str | None] = {}
    for entry in entries:
        name, equals, stack = (part.strip() for part in entry.partition("="))
        if not name or (equals and not stack):
            message = f"{option}: no entity or stack is given (got {entry!r})"
            raise SettingError(Diagnostic(message, "expected NAME, NAME=FILE.yaml or NAME={key: value}"))
        if name in found:
            raise SettingError(Diagnostic(f"{option}: entity {name!r} is given twice", "give each entity once"))
        found[name] = stack if equals else None
    return found


def _several(given: Any) -> list[Any]:
    if isinstance(given, str | Path):
        return [given]
    if isinstance(given, Set):  # its order differs between processes
        return sorted(given, key=str)
    return list(given) if isinstance(given, Iterable) and not isinstance(given, bytes) else [given]


def _source(setting: str, value: Any, hint: str) -> YamlSource:
    if isinstance(value, Mapping):
        return flow_yaml(value, setting=setting)
    if isinstance(value, Path) or (isinstance(value, str) and value.strip()):
        return value
    raise SettingError(Diagnostic(f"{setting} is {quoted(value)}", hint))

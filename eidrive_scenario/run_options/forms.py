"""Forms of the values of options: names, senders, assignments, stacks, criteria, seconds and switches."""

from __future__ import annotations

import json
import math
import os
from argparse import ArgumentTypeError
from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass
from numbers import Number, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias, TypeGuard

from eidrive_scenario.errors import Diagnostic, SettingError, quoted
from eidrive_scenario.extensions.project import portable_path

if TYPE_CHECKING:
    from eidrive_scenario.openscenario.values.parameters import Assignment

YamlSource: TypeAlias = str | Path
"""YAML text, or path of a YAML file."""
NO_COOPERATION = "none"
"""Text for no channel, and for no senders."""


class Form:
    """Form of the values of an option: in Python, on the command line, as an axis of a sweep, and as text.

    parameter    type of the parameter of a command
    metavar      placeholder of a value in its help
    omitted      value of an omitted option that declares none
    has_axis     whether a sweep may vary the option
    is_repeated  whether it is given several times, each with a part of the value
    follows_seed  whether it follows the seed in the command of a run, as numbers and switches do
    """

    parameter: ClassVar[Any] = str | None
    metavar: ClassVar[str | None] = None
    omitted: ClassVar[Any] = None
    has_axis: ClassVar[bool] = False
    is_repeated: ClassVar[bool] = False
    follows_seed: ClassVar[bool] = False
    unit: ClassVar[str] = ""

    def check(self, name: str, value: Any) -> Any:
        """Return the value that RunSettings keeps for a value in Python. Raise SettingError for a wrong type."""
        return value

    def parse(self, flag: str, given: Any) -> Any:
        """Return the value of an option of the command line. Raise SettingError if it is invalid."""
        return given

    def parse_text(self, text: str) -> Any:
        """Return the value of one text in an option of pytest. Raise ArgumentTypeError if it is invalid."""
        if not text.strip():
            raise ArgumentTypeError(f"no value is given (got {text!r})")
        return text

    def from_axis(self, name: str, value: str | float) -> Any:
        """Return the value of an option whose axis has this value. Raise SettingError if it is invalid."""
        return str(value)

    def texts(self, value: Any) -> list[str]:
        """Return the texts that give a value on a command line in any folder; "" for a flag without a value."""
        return [str(value)]

    def recorded(self, value: Any) -> str | None:
        """Return the entry of a recording about a value that the caller gave; None without one."""
        return None if value is None else str(value)


@dataclass(frozen=True)
class Text(Form):
    """Name, file or mapping.

    types     types of the value in Python besides None
    expected  expected values in messages
    suffixes  suffixes of the texts that are files; None if each text that is the path of a file is one
    """

    types: tuple[type, ...]
    expected: str
    suffixes: tuple[str, ...] | None = ()
    has_axis: ClassVar[bool] = True

    def check(self, name: str, value: Any) -> Any:
        return _checked(name, value, (*self.types, type(None)), self.expected)

    def texts(self, value: Any) -> list[str]:
        if isinstance(value, Mapping):
            from eidrive_scenario.files.yaml_text import flow_yaml

            return [flow_yaml(value, setting="a setting")]
        is_file = os.path.isfile(value) and (self.suffixes is None or Path(value).suffix in self.suffixes)
        return [portable_path(value) if is_file else str(value)]


class Senders(Form):
    """Names of stations, or none."""

    has_axis = True

    def check(self, name: str, value: Any) -> tuple[str, ...] | None:
        if value is None:
            return None
        if isinstance(value, str):
            raise SettingError(Diagnostic(f"{name} is the text {value!r}", "give a tuple of station names"))
        given = sorted(value, key=str) if isinstance(value, Set) else value
        stations = tuple(given) if isinstance(given, Iterable) else (given,)
        if not all(isinstance(station, str) for station in stations):
            raise SettingError(Diagnostic(f"{name} is {quoted(value)}", "give a tuple of station names"))
        return tuple(dict.fromkeys(stations))

    def parse(self, flag: str, given: str | None) -> tuple[str, ...] | None:
        if given is None:
            return None
        stations = tuple(name.strip() for name in given.split(",") if name.strip())
        if not stations:
            raise SettingError(Diagnostic(f"{flag}: no station is listed (got {given!r}; expected A,B or none)"))
        return () if stations == (NO_COOPERATION,) else stations

    def from_axis(self, name: str, value: str | float) -> tuple[str, ...]:
        return () if value == NO_COOPERATION else tuple(str(value).split("+"))

    def texts(self, value: tuple[str, ...]) -> list[str]:
        return [",".join(value) or NO_COOPERATION]

    def recorded(self, value: tuple[str, ...] | None) -> str | None:
        return None if value is None else ",".join(value) or NO_COOPERATION


class _Repeated(Form):
    """Option that is given several times."""

    parameter = list[str] | None
    is_repeated = True

    def recorded(self, value: Any) -> str | None:
        return json.dumps(value, default=str) if value else None


@dataclass(frozen=True)
class Assignments(_Repeated):
    """Texts by name. An Assignment has the file and line of its text.

    expected  expected mapping in messages
    """

    expected: str
    metavar: ClassVar[str | None] = "K=V"
    omitted: ClassVar[Any] = {}

    def check(self, name: str, value: Any) -> dict[str, str | Assignment]:
        _checked(name, value, (Mapping,), self.expected)
        texts: dict[str, str | Assignment] = {}
        for key, text in value.items():
            if not isinstance(key, str) or not key or "=" in key:
                raise SettingError(Diagnostic(f"{name} has the name {quoted(key)}", "give a text without '='"))
            texts[key] = text if _is_assignment(text) else as_setting_text(f"{name}[{key!r}]", text)
        return texts

    def parse(self, flag: str, given: Iterable[str] | None) -> dict[str, str]:
        """Return the values of texts `NAME=VALUE` by name; each name has one value."""
        values: dict[str, str] = {}
        for assignment in given or ():
            name, equals, value = assignment.partition("=")
            if not equals or not name:
                text = f"{flag}: no value is assigned (got {assignment!r}; expected NAME=VALUE)"
                raise SettingError(Diagnostic(text))
            if name in values:
                text = f"{flag}: {quoted(name)} is given twice, as {quoted(values[name])} and {quoted(value)}"
                raise SettingError(Diagnostic(text, "give each name once"))
            values[name] = value
        return values

    def texts(self, value: Mapping[str, str | Assignment]) -> list[str]:
        return [f"{name}={text if isinstance(text, str) else text.text}" for name, text in value.items()]


class Stacks(_Repeated):
    """Properties of driving stacks by entity: YAML texts or files; None for a stack with the defaults."""

    _HINT = 'give a name, names, or a mapping such as {"Ego": {"detector": "lidar"}}'

    def check(self, name: str, value: Any) -> dict[str, YamlSource | None]:
        """Return the properties by entity of None, a name, a collection of names, or a mapping of names."""
        entries = value.items() if isinstance(value, Mapping) else [(entity, None) for entity in _several(value)]
        stacks: dict[str, YamlSource | None] = {}
        for entity, stack in entries:
            if not isinstance(entity, str) or not entity:
                raise SettingError(Diagnostic(f"{name} has the entity {quoted(entity)}", self._HINT))
            if entity in stacks:
                raise SettingError(Diagnostic(f"{name} has the entity {entity!r} twice", "give each entity once"))
            stacks[entity] = None if stack is None else _yaml_source(f"{name}[{entity!r}]", stack, self._HINT)
        return stacks

    def parse(self, flag: str, given: Iterable[str] | None) -> dict[str, str | None]:
        """Return the stacks of texts `NAME` and `NAME=STACK` by name."""
        stacks: dict[str, str | None] = {}
        for entry in given or ():
            entity, equals, stack = (part.strip() for part in entry.partition("="))
            if not entity or (equals and not stack):
                message = f"{flag}: no entity or stack is given (got {entry!r})"
                raise SettingError(Diagnostic(message, "expected NAME, NAME=FILE.yaml or NAME={key: value}"))
            if entity in stacks:
                raise SettingError(Diagnostic(f"{flag}: entity {entity!r} is given twice", "give each entity once"))
            stacks[entity] = stack if equals else None
        return stacks

    def texts(self, value: Mapping[str, YamlSource | None]) -> list[str]:
        return [name if stack is None else f"{name}={_file_or_text(stack)}" for name, stack in value.items()]


class Criteria(_Repeated):
    """Declarations of criteria: YAML texts and files."""

    _HINT = 'give a mapping such as {"collision": {"of": "Ego"}}, a YAML text, a file, or a list of them'

    def check(self, name: str, value: Any) -> tuple[YamlSource, ...]:
        """Return the declarations of None, a YAML text, a file, a mapping, or a collection of these."""
        several = [value] if isinstance(value, Mapping) else _several(value)
        return tuple(_yaml_source(name, source, self._HINT) for source in several)

    def texts(self, value: Iterable[YamlSource]) -> list[str]:
        return [_file_or_text(source) for source in value]


@dataclass(frozen=True)
class Seconds(Form):
    """Number of seconds.

    is_positive  whether other numbers are errors in Python, too
    """

    is_positive: bool = False
    parameter: ClassVar[Any] = float
    has_axis: ClassVar[bool] = True
    follows_seed: ClassVar[bool] = True
    unit: ClassVar[str] = "s"

    def check(self, name: str, value: Any) -> float:
        _checked(name, value, (Real,), "a number of seconds")
        try:
            seconds = float(value)
        except OverflowError:
            seconds = math.inf
        if self.is_positive and not 0.0 < seconds < math.inf:
            raise SettingError(Diagnostic(f"{name} is {value}", "give a positive number of seconds"))
        return seconds

    def parse(self, flag: str, given: float) -> float:
        check_seconds(flag, given)
        return given

    def parse_text(self, text: str) -> float:
        try:
            seconds = float(text)
        except ValueError:
            seconds = 0.0
        if not 0.0 < seconds < math.inf:
            raise ArgumentTypeError(f"not a positive number of seconds (got {text!r})")
        return seconds

    def from_axis(self, name: str, value: str | float) -> float:
        if isinstance(value, str):
            raise SettingError(Diagnostic(f"{name} is {quoted(value)}", "give a number of seconds"))
        return float(value)

    def texts(self, value: float) -> list[str]:
        return [repr(value)]


class Switch(Form):
    """True or False. A text such as "no" would be true to Python."""

    parameter = bool
    omitted = False
    follows_seed = True

    def check(self, name: str, value: Any) -> Any:
        return _checked(name, value, (bool,), "True or False")

    def parse_text(self, text: str) -> bool:
        if text not in ("true", "false"):
            raise ArgumentTypeError(f"not true or false (got {text!r})")
        return text == "true"

    def texts(self, value: bool) -> list[str]:
        return [""]


def check_seconds(flag: str, value: float) -> None:
    """Raise SettingError unless the value of an option is a positive number of seconds."""
    if not 0.0 < value < math.inf:
        raise SettingError(Diagnostic(f"{flag}: not a positive number of seconds (got {value})"))


def as_setting_text(what: str, value: object) -> str:
    """Return the value of a parameter or a user-defined value as the text in a file or on a command line.

    Raise SettingError unless it is a text, number, truth value or path.
    """
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Number | Path):
        return str(value)
    import numpy as np

    if isinstance(value, np.bool_):
        return "true" if value else "false"
    raise SettingError(Diagnostic(f"{what} is {quoted(value)}", "give a text, a number or a truth value"))


def _checked(name: str, value: Any, types: tuple[type, ...], expected: str) -> Any:
    # bool is a subclass of int, but True is not a number of seconds
    if not isinstance(value, types) or (isinstance(value, bool) and bool not in types):
        raise SettingError(Diagnostic(f"{name} is {quoted(value)}", f"give {expected}"))
    return Path(value) if isinstance(value, os.PathLike) else value


def _is_assignment(value: object) -> TypeGuard[Assignment]:
    if isinstance(value, str):
        return False
    from eidrive_scenario.openscenario.values.parameters import Assignment  # late, as help does without the engine

    return isinstance(value, Assignment)


def _several(given: Any) -> list[Any]:
    """Return the entries of a value that may be a single one."""
    if given is None:
        return []
    if isinstance(given, str | os.PathLike):
        return [given]
    if isinstance(given, Set):  # its order differs between processes
        return sorted(given, key=str)
    return list(given) if isinstance(given, Iterable) and not isinstance(given, bytes) else [given]


def _yaml_source(setting: str, value: Any, hint: str) -> YamlSource:
    if isinstance(value, Mapping):
        from eidrive_scenario.files.yaml_text import flow_yaml

        return flow_yaml(value, setting=setting)
    if isinstance(value, os.PathLike):
        return Path(value)
    if isinstance(value, str) and value.strip():
        return value
    raise SettingError(Diagnostic(f"RunSettings.{setting} is {quoted(value)}", hint))


def _file_or_text(source: YamlSource) -> str:
    """Return the path of a file, valid in any folder, or a YAML text unchanged."""
    return portable_path(source) if os.path.isfile(source) else str(source)

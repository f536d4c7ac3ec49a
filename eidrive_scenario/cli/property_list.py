"""Keys of all settings with type, default and unit, read from the settings models of the installed extensions."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.errors import RegistryError
from eidrive_scenario.extensions.registry import registry, singular

GROUPS = ("planners", "detectors", "fusion", "trackers", "vehicle_controllers", "sensors", "channels", "criteria")
"""Registries whose extensions may have settings, in the order of the list."""
LONGEST = 80
"""Maximum number of characters of a description."""
_ENTRY = re.compile(r"^(\w+(?:, *\w+)*)  +(.*)$")
"""Line of the documentation of a class: names of settings, two spaces, and their description."""
_UNIT = re.compile(r"\[([^\]]*)\]")
_UNITS = re.compile(rf" *{_UNIT.pattern}(?:, {_UNIT.pattern})+")
"""Units of several settings."""
_INLINE = re.compile(r"((?:\w+, )*\w+) \[([^\]]*)\]")
"""Names of settings in a sentence, followed by their unit."""
_SUFFIXES = {"_dbm": "dBm", "_dbi": "dBi", "_db": "dB", "_ghz": "GHz", "_mbps": "Mbit/s"}
"""Units with which names of settings end."""
_LIMITS = ("at_most", "at_least", "below")
"""Settings of criteria in the unit of the criterion, unless their documentation states another one."""


_TYPES = {Path: "file", float: "number", int: "integer", bool: "true | false", str: "text", NoneType: "none"}


class Property(NamedTuple):
    """Key of the settings of an owner, such as `planner behavior`, with its description."""

    owner: str
    key: str
    type: str
    default: str
    unit: str
    text: str


def properties(warn: Callable[[str], None]) -> Iterator[Property]:
    """Yield all keys: those of stations, then those of each extension.

    warn  function that gets a line for each extension that does not load; its keys are missing
    """
    yield from _of_model("station", AgentSettings)
    for group in GROUPS:
        names = registry(group)
        for name in names:
            try:
                extension = names.load(name)
            except RegistryError as error:
                warn(f"no keys of {singular(group)} {name}: {error}")
                continue
            model = getattr(extension, "settings_type", None)
            if isinstance(model, type) and issubclass(model, BaseModel):
                for entry in _of_model(f"{singular(group)} {name}", model):
                    is_limit = group == "criteria" and entry.key in _LIMITS and not entry.unit
                    yield entry._replace(unit=extension.unit) if is_limit else entry


def _of_model(owner: str, model: type[BaseModel], above: str = "") -> Iterator[Property]:
    texts = descriptions(model)
    for name, field in model.model_fields.items():
        key = f"{above}{field.alias or name}"
        text = texts.get(name, "")
        units = [*_UNIT.findall(text), *(unit for end, unit in _SUFFIXES.items() if name.endswith(end)), ""]
        words = re.sub(r" +([;,.])(?!\w)", r"\1", _UNIT.sub("", text)).lstrip(" ;").removesuffix(".")
        description = textwrap.shorten(words, LONGEST, placeholder=" …")
        yield Property(owner, key, type_text(field.annotation), _default(field), units[0], description)
        models = [nested for nested in _models(field.annotation) if nested is not model]
        for nested in models:
            # Keys of one of several models have its kind, as in error messages
            kind = nested.model_fields.get("kind") if len(models) > 1 else None
            yield from _of_model(owner, nested, f"{key}." if kind is None else f"{key}.{type_text(kind.annotation)}.")


def descriptions(model: type[BaseModel]) -> dict[str, str]:
    """Return what the documentation of a model and of its fields says about each setting, by name."""
    texts: dict[str, str] = {}
    for cls in reversed(model.__mro__):
        if issubclass(cls, BaseModel) and cls is not BaseModel:
            inline = _INLINE.findall(cls.__doc__ or "")
            texts |= {name: f"[{unit}]" for names, unit in inline for name in names.split(", ")}
            texts |= _documented(cls.__doc__ or "") | _field_texts(cls)
    return texts


def _documented(text: str) -> dict[str, str]:
    """Return the descriptions by name in the documentation of a class; further lines of one are indented.

    Several names in one line have one unit, or one each in this order.
    """
    texts: dict[str, str] = {}
    names: Sequence[str] = ()
    for line in inspect.cleandoc(text).splitlines():
        match = _ENTRY.match(line)
        if match:
            names = [name.strip() for name in match[1].split(",")]
            units = _UNIT.findall(match[2])
            texts |= dict.fromkeys(names, match[2])
            if len(units) == len(names):
                text = _UNITS.sub("", match[2])
                texts |= {name: f"[{unit}]{text}" for name, unit in zip(names, units, strict=True)}
        elif names and line.startswith("    "):
            texts |= {name: f"{texts[name]} {line.strip()}" for name in names}
        else:
            names = ()
    return texts


def _field_texts(model: type[BaseModel]) -> dict[str, str]:
    """Return the texts below the fields of a class."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(model)))
    except (OSError, TypeError, SyntaxError):
        return {}
    body = tree.body[0].body if isinstance(tree.body[0], ast.ClassDef) else []
    return {
        field.target.id: " ".join(below.value.value.split())
        for field, below in pairwise(body)
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant) and isinstance(below.value.value, str)
    }


def type_text(annotation: Any) -> str:
    """Return a type as text, such as `number`, `a | b`, `list of number` or `mapping`."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return type_text(arguments[0])
    if origin in (Union, UnionType):
        return " | ".join(dict.fromkeys(type_text(member) for member in arguments))
    if origin is Literal:
        return " | ".join(map(str, arguments))
    if origin is not None and isinstance(origin, type) and issubclass(origin, Mapping):
        return "mapping"
    if origin is not None and isinstance(origin, type) and issubclass(origin, Sequence | set | frozenset):
        members = [type_text(member) for member in arguments if member is not Ellipsis]
        return f"list of {' | '.join(dict.fromkeys(members))}"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "mapping"
    return _TYPES.get(annotation, "any")


def _default(field: FieldInfo) -> str:
    default = field.get_default(call_default_factory=True)
    if default is PydanticUndefined:
        return "required"
    if default is None:
        return "none"
    if isinstance(default, BaseModel):
        return str(getattr(default, "kind", "{…}" if type(default).model_fields else "{}"))
    if isinstance(default, bool):
        return str(default).lower()
    if isinstance(default, float):
        return f"{default:.6g}"
    if isinstance(default, tuple | list | set | frozenset):
        return f"[{', '.join(map(str, default))}]"
    return str(default)


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the models in an annotation, except in the values of mappings, whose keys the user chooses."""
    if isinstance(annotation, type) and get_origin(annotation) is None:
        if issubclass(annotation, BaseModel):
            yield annotation
        return
    origin = get_origin(annotation)
    if not (isinstance(origin, type) and issubclass(origin, Mapping)):
        for part in get_args(annotation):
            yield from _models(part)

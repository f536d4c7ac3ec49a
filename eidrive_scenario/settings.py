"""Settings that a person typed (YAML profiles, controller properties, criterion texts) into checked pydantic models."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from eidrive_scenario.errors import MAX_DIAGNOSTICS, Diagnostic, SettingError, quoted, suggestion
from eidrive_scenario.files.yaml_text import key_lines as key_lines
from eidrive_scenario.files.yaml_text import load_yaml as load_yaml
from eidrive_scenario.files.yaml_text import load_yaml_file as load_yaml_file

MAX_NUMBER = 1e12
"""Size of a number in settings: no length, time, rate or power comes near it."""


class Settings(BaseModel):
    """Base of all typed settings: frozen, and an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


S = TypeVar("S", bound=BaseModel)


def parse_settings(
    model: type[S],
    data: Mapping[str, Any],
    *,
    source: str = "",
    line: int | None = None,
    lines: Mapping[str, int] | None = None,
) -> S:
    """`data` as an instance of `model`.

    `lines` gives the line of single keys where they are known, those inside others as `key_lines` has them. Raises
    SettingError with one Problem per wrong key.
    """
    try:
        settings = model.model_validate(dict(data))
    except ValidationError as error:
        collector = error.errors(include_url=False)[:MAX_DIAGNOSTICS]
        diagnostics = [_diagnostic(model, data, finding, source, line, lines or {}) for finding in collector]
        raise SettingError(diagnostics) from error
    immense = next(_immense(settings), None)
    if immense is not None:
        place = _line_of(immense[0], lines or {}, line)
        path = _typed_path(immense[0], data)
        what = f"setting {quoted(path)} is {quoted(immense[1])}"
        raise SettingError(Diagnostic(what, f"give a number within {MAX_NUMBER:g}", source, place))
    return settings


def validate_nested(model: type[S], data: Any) -> S:
    """Return `data` as an instance of a model that a validator of other settings has selected by their content.

    Raise ValidationError with the hints for unknown keys, which the annotation of the outer settings cannot give.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        found: list[InitErrorDetails] = []
        for one in error.errors(include_url=False):
            details = InitErrorDetails(type=one["type"], loc=one["loc"], input=one["input"], ctx=one.get("ctx", {}))
            if one["type"] == "extra_forbidden" and "hint" not in details["ctx"]:
                hint = suggestion(str(one["loc"][-1]), _known_keys(model, one["loc"][:-1]))
                details["type"] = PydanticCustomError("extra_forbidden", "unknown setting", {"hint": hint})
            found.append(details)
        raise ValidationError.from_exception_data(error.title, found) from None


def _diagnostic(
    model: type[BaseModel],
    data: Mapping[str, Any],
    finding: ErrorDetails,
    source: str,
    line: int | None,
    lines: Mapping[str, int],
) -> Diagnostic:
    """What pydantic has found, with the keys as they were typed and the line of the innermost one that is known."""
    kind, loc = finding["type"], finding["loc"]
    path = _typed_path(loc, data)
    place = _line_of(loc, lines, line)
    if kind == "extra_forbidden":
        given = finding.get("ctx", {}).get("hint")
        hint = suggestion(str(loc[-1]), _known_keys(model, loc[:-1])) if given is None else given
        return Diagnostic(f"unknown setting {quoted(path)}", hint, source, place)
    if kind == "missing":
        return Diagnostic(f"setting {path!r} is missing", "add it", source, place)
    if kind == "union_tag_invalid":
        word, key = finding["ctx"]["tag"], finding["ctx"]["discriminator"].strip("'")
        hint = suggestion(word, re.findall(r"'([^']*)'", finding["ctx"]["expected_tags"]))
        place = _line_of((*loc, key), lines, line)
        return Diagnostic(f"setting {quoted(path + '.' + key)} is {quoted(word)}", hint, source, place)
    if kind == "union_tag_not_found":
        key = finding["ctx"]["discriminator"].strip("'")
        return Diagnostic(
            f"setting {path + '.' + key!r} is missing", suggestion("", _tags(model, loc, key)), source, place
        )
    message = f"setting {path!r} is {quoted(finding['input'])}"
    if kind in _NO_MAPPING:
        return Diagnostic(message, "a mapping is expected: {key: value, …}", source, place)
    own = kind == "value_error"
    hint = finding["msg"].removeprefix("Value error, ") if own else finding["msg"].lower()
    return Diagnostic(message if path else "settings do not fit together", hint, source, place)


def _immense(value: Any, path: tuple[int | str, ...] = ()) -> Iterator[tuple[tuple[int | str, ...], float]]:
    """The numbers beyond MAX_NUMBER in settings, with the keys that lead to them."""
    if isinstance(value, BaseModel):
        value = value.__dict__
    if isinstance(value, int | float):
        if not abs(value) <= MAX_NUMBER and not (isinstance(value, float) and math.isinf(value)):
            yield path, value
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _immense(inner, (*path, key if isinstance(key, int) else str(key)))
    elif isinstance(value, list | tuple):
        for place, inner in enumerate(value):
            yield from _immense(inner, (*path, place))


_NO_MAPPING = frozenset({"model_type", "model_attributes_type", "dict_type"})


def _typed_path(loc: tuple[int | str, ...], data: Any) -> str:
    """The keys on the way to `loc`, with the kind of what has one: `delay.constant.seconds`. Left out is what pydantic
    adds of its own: the types of a union, and a kind that has given its name to the thing."""
    found: list[str] = []
    for part in loc:
        inside = (
            part in data if isinstance(data, Mapping) else isinstance(data, (list, tuple)) and isinstance(part, int)
        )
        if inside or (isinstance(data, Mapping) and str(part) not in found[-1:]):
            found.append(str(part))
        if inside and (isinstance(data, Mapping) or int(part) < len(data)):
            data = data[part]
    return ".".join(found)


def _line_of(loc: tuple[int | str, ...], lines: Mapping[str, int], line: int | None) -> int | None:
    """The line of the innermost key on the way to `loc` that is known; what pydantic adds of its own is passed over."""
    path = ""
    for part in loc:
        longer = f"{path}.{part}" if path else str(part)
        if longer in lines:
            path, line = longer, lines[longer]
    return line


def _known_keys(model: type[BaseModel], path: tuple[int | str, ...]) -> list[str]:
    """The keys allowed at `path` inside `model`; none where the path leads to one of several models."""
    current = _at(model, path)
    models = [member for member in _members(current) if isinstance(member, type) and issubclass(member, BaseModel)]
    if len(models) == 1:
        current = models[0]
    if isinstance(current, type) and issubclass(current, BaseModel):
        return [name for name, field in current.model_fields.items()] + [
            field.alias for field in current.model_fields.values() if field.alias
        ]
    return []


def _tags(model: type[BaseModel], path: tuple[int | str, ...], key: str) -> list[str]:
    """The words that `key` may have in the union at `path` inside `model`."""
    fields = [getattr(member, "model_fields", {}).get(key) for member in _members(_at(model, path))]
    return [str(word) for field in fields if field is not None for word in get_args(field.annotation)]


def _at(model: type[BaseModel], path: tuple[int | str, ...]) -> Any:
    """The annotation at `path` inside `model`."""
    current: Any = model
    for part in path:
        if isinstance(current, type) and issubclass(current, BaseModel):
            field = current.model_fields.get(str(part))
            current = field.annotation if field is not None else current
        else:
            current = next((member for member in _members(current) if _tagged(member, part)), current)
    return current


def _members(annotation: Any) -> Iterator[Any]:
    """The models in a union, however deep it lies in a mapping or a sequence."""
    for part in get_args(annotation):
        yield part
        yield from _members(part)


def _tagged(member: Any, tag: int | str) -> bool:
    """Whether a member of a tagged union is the one of this tag."""
    fields = getattr(member, "model_fields", {})
    return any(tag in get_args(field.annotation) for field in fields.values())

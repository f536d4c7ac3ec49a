"""Settings of users and of extensions (YAML profiles, controller properties, criterion texts), checked by pydantic."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from eidrive_scenario.errors import MAX_DIAGNOSTICS, Diagnostic, RegistryError, SettingError, quoted, suggestion
from eidrive_scenario.extensions.registry import registry, singular

MAX_NUMBER = 1e12
"""Maximum absolute value of a number in settings; no length, time, rate or power comes near it."""


class Settings(BaseModel):
    """Base class of all typed settings: frozen, and an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


S = TypeVar("S", bound=BaseModel)


def parse_settings(
    model: type[S],
    data: Mapping[str, Any],
    *,
    source: str = "",
    line: int | None = None,
    lines: Mapping[str, int] | None = None,
    origins: Mapping[str, str] = MappingProxyType({}),
    paths: Mapping[str, str] = MappingProxyType({}),
) -> S:
    """Return `data` as an instance of `model`.

    lines    lines of single keys, with the paths of `load_yaml_text`; `line` applies to all others
    origins  origins of values from elsewhere, such as a parameter, by these paths; an error of the value names it
    paths    paths of keys for errors, if the user wrote them into another mapping; other keys are their own paths

    Raise SettingError with one diagnostic per invalid key.
    """
    try:
        settings = model.model_validate(dict(data))
    except ValidationError as error:
        details = _without_consequences(error.errors(include_url=False))[:MAX_DIAGNOSTICS]
        diagnostics = [
            _with_origins(
                _diagnostic(model, data, detail, source, line, lines or {}, paths), _value_path(detail, data), origins
            )
            for detail in details
        ]
        raise SettingError(diagnostics) from error
    for loc, number in _numbers(settings):
        given = _given(loc, data)
        is_immense = not abs(number) <= MAX_NUMBER and not (isinstance(number, float) and math.isinf(number))
        if is_immense or isinstance(given, bool):
            message = f"setting {quoted(_typed_path(loc, data, paths))} is {quoted(number if is_immense else given)}"
            hint = f"give a number within {MAX_NUMBER:g}" if is_immense else "give a number"
            diagnostic = Diagnostic(message, hint, source, _line_of(loc, lines or {}, line))
            raise SettingError(_with_origins(diagnostic, ".".join(_keys_of(loc, data)), origins))
    return settings


def validate_nested(model: type[S], data: Any) -> S:
    """Return `data` as an instance of a model that a validator of other settings has selected by their content.

    Raise ValidationError with the hints for unknown keys, which the annotation of the outer settings cannot give.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        errors: list[InitErrorDetails] = []
        for raw in error.errors(include_url=False):
            details = InitErrorDetails(type=raw["type"], loc=raw["loc"], input=raw["input"], ctx=raw.get("ctx", {}))
            if raw["type"] == "extra_forbidden" and "hint" not in details["ctx"]:
                hint = suggestion(str(raw["loc"][-1]), _known_keys(model, raw["loc"][:-1]))
                details["type"] = PydanticCustomError("extra_forbidden", "unknown setting", {"hint": hint})
            errors.append(details)
        raise ValidationError.from_exception_data(error.title, errors) from None


def _diagnostic(
    model: type[BaseModel],
    data: Mapping[str, Any],
    detail: ErrorDetails,
    source: str,
    line: int | None,
    lines: Mapping[str, int],
    paths: Mapping[str, str],
) -> Diagnostic:
    """Return the diagnostic of a pydantic error, with the keys of the user and the line of the innermost known one."""
    kind, loc = detail["type"], detail["loc"]
    path = _typed_path(loc, data, paths)
    key_line = _line_of(loc, lines, line)
    if kind == "extra_forbidden":
        known_hint = detail.get("ctx", {}).get("hint")
        hint = suggestion(str(loc[-1]), _known_keys(model, loc[:-1])) if known_hint is None else known_hint
        return Diagnostic(f"unknown setting {quoted(path)}", hint, source, key_line)
    if kind == "missing":
        return Diagnostic(f"setting {path!r} is missing", "add it", source, key_line)
    if kind == "union_tag_invalid":
        word, key = detail["ctx"]["tag"], detail["ctx"]["discriminator"].strip("'")
        hint = suggestion(word, re.findall(r"'([^']*)'", detail["ctx"]["expected_tags"]))
        key_line = _line_of((*loc, key), lines, line)
        return Diagnostic(f"setting {quoted(path + '.' + key)} is {quoted(word)}", hint, source, key_line)
    if kind == "union_tag_not_found":
        key = detail["ctx"]["discriminator"].strip("'")
        hint = suggestion("", _tags(model, loc, key))
        return Diagnostic(f"setting {path + '.' + key!r} is missing", hint, source, key_line)
    if kind == "invalid_key" or loc[-1:] == ("[key]",):
        hint = "put it in quotes: YAML reads on, off, yes, no and numbers as values"
        return Diagnostic(f"the name of a setting is {quoted(detail['input'])}", hint, source, key_line)
    message = f"setting {path!r} is {quoted(detail['input'])}"
    if kind in _COLLECTIONS:
        return Diagnostic(message, _COLLECTIONS[kind], source, key_line)
    text = detail["msg"]
    hint = text.removeprefix("Value error, ") if kind == "value_error" else text.lower()
    return Diagnostic(message if path else "settings contradict each other", hint, source, key_line)


def _without_consequences(details: list[ErrorDetails]) -> list[ErrorDetails]:
    """Return errors without those of lists that are too short only because pydantic leaves out their invalid values."""
    inner = {detail["loc"][:-1] for detail in details}
    return [detail for detail in details if detail["type"] != "too_short" or detail["loc"] not in inner]


def _with_origins(diagnostic: Diagnostic, path: str | None, origins: Mapping[str, str]) -> Diagnostic:
    """Return a diagnostic with the origins of the value at a path, or of the values below it; None for no value."""
    if path is None:
        return diagnostic
    named = [text for key, text in origins.items() if not path or key == path or key.startswith(f"{path}.")]
    return replace(diagnostic, hint="; ".join([diagnostic.hint, *dict.fromkeys(named)])) if named else diagnostic


def _value_path(detail: ErrorDetails, data: Any) -> str | None:
    """Return the path of the keys of the user to an invalid value; None for an error about keys."""
    if detail["type"] in ("missing", "extra_forbidden", "union_tag_not_found"):
        return None
    kind = [detail["ctx"]["discriminator"].strip("'")] if detail["type"] == "union_tag_invalid" else []
    return ".".join([*_keys_of(detail["loc"], data), *kind])


def _keys_of(loc: tuple[int | str, ...], data: Any) -> Iterator[str]:
    """Yield the keys in `loc`, without the parts that only pydantic adds."""
    for part in loc:
        with suppress(LookupError, TypeError):
            data = data[part]
            yield str(part)


def _given(loc: tuple[int | str, ...], data: Any) -> Any:
    """Return what the user gave at a path; None for a default value."""
    for part in loc:
        try:
            data = data[part]
        except (LookupError, TypeError):
            return None
    return data


def _numbers(value: object, path: tuple[int | str, ...] = ()) -> Iterator[tuple[tuple[int | str, ...], float]]:
    """Yield the numbers in settings, with their key paths."""
    if isinstance(value, BaseModel):
        value = value.__dict__
    if isinstance(value, int | float):
        if not isinstance(value, bool):
            yield path, value
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _numbers(inner, (*path, key if isinstance(key, int) else str(key)))
    elif isinstance(value, list | tuple):
        for index, inner in enumerate(value):
            yield from _numbers(inner, (*path, index))


_COLLECTIONS = {
    **dict.fromkeys(("model_type", "model_attributes_type", "dict_type"), "a mapping is expected: {key: value, …}"),
    **dict.fromkeys(("tuple_type", "list_type"), "a list is expected: [value, …]"),
}
"""Hints by the type of the error of a value that is no mapping or no list."""


def _typed_path(loc: tuple[int | str, ...], data: Any, paths: Mapping[str, str]) -> str:
    """Return the key path of `loc` with the kinds of tagged unions, such as `delay.constant.seconds`.

    Parts that only pydantic adds are omitted: the types of a union, and a kind that equals the key before it.
    """
    keys: list[str] = []
    for part in loc:
        is_key = (
            part in data if isinstance(data, Mapping) else isinstance(data, (list, tuple)) and isinstance(part, int)
        )
        if is_key or (isinstance(data, Mapping) and str(part) not in keys[-1:]):
            keys.append(str(part) if keys else paths.get(str(part), str(part)))
        if is_key and (isinstance(data, Mapping) or int(part) < len(data)):
            data = data[part]
    return ".".join(keys)


def _line_of(loc: tuple[int | str, ...], lines: Mapping[str, int], line: int | None) -> int | None:
    """Return the line of the innermost known key of `loc`; parts that only pydantic adds are skipped."""
    path = ""
    for part in loc:
        longer = f"{path}.{part}" if path else str(part)
        if longer in lines:
            path, line = longer, lines[longer]
    return line


def _known_keys(model: type[BaseModel], path: tuple[int | str, ...]) -> list[str]:
    """Return the keys allowed at `path` inside `model`; none if several models are allowed there."""
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
    """Return the values that `key` may have in the union at `path` inside `model`."""
    fields = [getattr(member, "model_fields", {}).get(key) for member in _members(_at(model, path))]
    return [str(word) for field in fields if field is not None for word in get_args(field.annotation)]


def _at(model: type[BaseModel], path: tuple[int | str, ...]) -> Any:
    """Return the annotation at `path` inside `model`."""
    current: Any = model
    for part in path:
        if isinstance(current, type) and issubclass(current, BaseModel):
            field = current.model_fields.get(str(part))
            current = field.annotation if field is not None else current
        else:
            current = next((member for member in _members(current) if _tagged(member, part)), current)
    return current


def _members(annotation: Any) -> Iterator[Any]:
    """Yield the models of a union, at any depth in mappings and sequences."""
    for part in get_args(annotation):
        yield part
        yield from _members(part)


def _tagged(member: Any, tag: int | str) -> bool:
    """Whether a member of a tagged union has this tag."""
    fields = getattr(member, "model_fields", {})
    return any(tag in get_args(field.annotation) for field in fields.values())


E = TypeVar("E", bound=Settings)


def settings_type_of(kind: str, name: str, extension: object, base: type[E]) -> type[E]:
    """Return the `settings_type` of an extension. Raise RegistryError if it is not derived from `base`.

    kind, name  registry and registered name of the extension
    """
    declared = getattr(extension, "settings_type", None)
    if isinstance(declared, type) and issubclass(declared, base):
        return declared
    described = registry(kind).describe(name)
    raise RegistryError(f"{described}: settings_type is {declared!r} (expected a class derived from {base.__name__})")


def parse_own_settings(
    kind: str,
    name: str,
    extension: object,
    given: Mapping[str, Any],
    *,
    setting: str,
    source: str = "",
    line: int | None = None,
) -> Settings | None:
    """Return the settings of an extension from the property `setting`; None if the extension has no settings.

    Raise SettingError with this location if they are invalid, or are given to an extension without settings.
    """
    if getattr(extension, "settings_type", None) is not None:
        model = settings_type_of(kind, name, extension, Settings)
        paths = {key: f"{setting}.{key}" for key in (*map(str, given), *model.model_fields)}
        return parse_settings(model, given, source=source, line=line, paths=paths)
    if given:
        message = f"{singular(kind)} {name!r} has no settings"
        raise SettingError(Diagnostic(message, f"remove the property {setting!r}", source, line))
    return None


def validate_by_kind(
    kind: str,
    value: Mapping[str, Any],
    base: type[E],
    extension_base: type | None = None,
    *,
    also: tuple[str, ...] = (),
) -> E:
    """Return settings as an instance of the `settings_type` of the extension that their key `kind` names.

    kind  registry of the extensions, classes derived from `extension_base`;  also  further names that hints list

    Raise ValidationError if the name is unknown or the settings are invalid.
    """
    extensions, name = registry(kind), value.get("kind")
    if not (isinstance(name, str) and name in extensions):
        hint = suggestion(str(name), [*extensions, *also])
        error = PydanticCustomError("value_error", "{hint}", {"hint": hint})
        raise ValidationError.from_exception_data(
            base.__name__, [InitErrorDetails(type=error, loc=("kind",), input=name)]
        )
    return validate_nested(settings_type_of(kind, name, extensions.load(name, extension_base), base), value)

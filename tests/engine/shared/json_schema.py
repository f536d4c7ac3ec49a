"""Check of values against a JSON schema of draft 7, as far as its keywords are used here."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

_TYPES: Mapping[str, Callable[[Any], bool]] = {
    "null": lambda value: value is None,
    "boolean": lambda value: isinstance(value, bool),
    "integer": lambda value: isinstance(value, int | float) and not isinstance(value, bool) and value == int(value),
    "number": lambda value: isinstance(value, int | float) and not isinstance(value, bool),
    "string": lambda value: isinstance(value, str),
    "array": lambda value: isinstance(value, list),
    "object": lambda value: isinstance(value, dict),
}
_BOUNDS: Mapping[str, tuple[str, Callable[[Any, Any], bool]]] = {
    "minimum": ("number", lambda value, bound: value >= bound),
    "maximum": ("number", lambda value, bound: value <= bound),
    "exclusiveMinimum": ("number", lambda value, bound: value > bound),
    "exclusiveMaximum": ("number", lambda value, bound: value < bound),
    "minItems": ("array", lambda value, bound: len(value) >= bound),
    "maxItems": ("array", lambda value, bound: len(value) <= bound),
    "minLength": ("string", lambda value, bound: len(value) >= bound),
    "pattern": ("string", lambda value, bound: re.search(bound, value) is not None),
    "minProperties": ("object", lambda value, bound: len(value) >= bound),
    "maxProperties": ("object", lambda value, bound: len(value) <= bound),
    "required": ("object", lambda value, bound: set(bound) <= value.keys()),
}
_ANNOTATIONS = {"$schema", "$defs", "title", "description", "default", "format", "then"}


def is_valid(schema: Any, value: Any, root: Any = None) -> bool:
    """Return whether a value is valid. Raise ValueError for an unknown keyword."""
    root = schema if root is None else root
    if isinstance(schema, bool):
        return schema
    if "$ref" in schema:  # its siblings are ignored
        return is_valid(_resolve(root, schema["$ref"]), value, root)
    return all(_check(keyword, schema, value, root) for keyword in schema)


def _resolve(root: Any, reference: str) -> Any:
    for key in reference.removeprefix("#/").split("/"):
        root = root[key]
    return root


def _check(keyword: str, schema: Mapping[str, Any], value: Any, root: Any) -> bool:
    given = schema[keyword]
    if keyword in _ANNOTATIONS:
        return True
    if keyword in _BOUNDS:
        kind, holds = _BOUNDS[keyword]
        return not _TYPES[kind](value) or holds(value, given)
    match keyword:
        case "type":
            return any(_TYPES[name](value) for name in ([given] if isinstance(given, str) else given))
        case "const":
            return bool(value == given) and isinstance(value, bool) == isinstance(given, bool)
        case "enum":
            return any(value == one and isinstance(value, bool) == isinstance(one, bool) for one in given)
        case "anyOf":
            return any(is_valid(one, value, root) for one in given)
        case "oneOf":
            return sum(is_valid(one, value, root) for one in given) == 1
        case "allOf":
            return all(is_valid(one, value, root) for one in given)
        case "if":
            return not is_valid(given, value, root) or is_valid(schema["then"], value, root)
        case "properties":
            return not isinstance(value, dict) or all(
                is_valid(one, value[name], root) for name, one in given.items() if name in value
            )
        case "additionalProperties":
            return not isinstance(value, dict) or all(
                is_valid(given, one, root) for name, one in value.items() if name not in schema.get("properties", {})
            )
        case "items":
            if not isinstance(value, list):
                return True
            parts = given if isinstance(given, list) else [given] * len(value)
            return all(is_valid(part, one, root) for part, one in zip(parts, value, strict=False))
    raise ValueError(f"unknown keyword {keyword!r}")

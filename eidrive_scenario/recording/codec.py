"""Lossless JSON encoding of records (frozen dataclasses and msgspec structs), derived from their field types.

Numbers keep all 64 bits: Python writes the shortest decimal that reads back the same. Non-finite numbers are written as
in protobuf's JSON mapping: "NaN", "Infinity", "-Infinity". Arrays are nested lists. An empty array is
{"shape": [0, 7]}, because a nested list would lose its shape.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from enum import Enum
from functools import cache
from operator import attrgetter
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np

Json = Any
Check = Callable[[Any], bool]
_SCALARS = {bool: "boolean", int: "integer", str: "string"}
_NUMBER = {"anyOf": [{"type": "number"}, {"enum": ["NaN", "Infinity", "-Infinity"]}]}


@dataclass(frozen=True)
class Codec:
    """Encoder, decoder and JSON schema of one type.

    is_plain  returns whether msgspec writes a value as `encode` does: all numbers outside of arrays are finite. None if
              it does so for all values
    """

    encode: Callable[[Any], Json]
    decode: Callable[[Json], Any]
    schema: Mapping[str, Json]
    is_plain: Check | None = None


@cache
def codec(kind: Any) -> Codec:
    """Return the codec of a type: scalar, enum, array, tuple, mapping, optional type, or a record of these.

    Raise TypeError for any other type, before anything is encoded.
    """
    origin, arguments = get_origin(kind), get_args(kind)
    if kind is float:
        return Codec(_encode_float, float, _NUMBER, math.isfinite)
    if kind in _SCALARS:
        return Codec(kind, kind, {"type": _SCALARS[kind]})
    if origin is Literal:
        return _literal(arguments)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return Codec(lambda member: member.value, kind, {"enum": [member.value for member in kind]})
    if origin is np.ndarray:
        return _array(np.dtype(get_args(arguments[1])[0]))
    if origin in (Union, types.UnionType) and type(None) in arguments and len(arguments) == 2:
        return _optional(codec(next(argument for argument in arguments if argument is not type(None))))
    if origin in (tuple, frozenset):
        return _sequence(origin, arguments)
    if origin is Sequence:
        return _sequence(tuple, (*arguments, ...))
    if isinstance(origin, type) and issubclass(origin, Mapping) and arguments[0] is str:
        return _mapping(codec(arguments[1]))
    if isinstance(kind, type) and (is_dataclass(kind) or issubclass(kind, msgspec.Struct)):
        return _record(kind)
    raise TypeError(f"{kind!r}: no JSON encoding is defined for this type")


def _literal(values: tuple[Any, ...]) -> Codec:
    def decode(data: Json) -> Any:
        if data not in values:
            raise ValueError(f"{str(data)[:80]!r} is none of {', '.join(map(str, values))}")
        return data

    return Codec(lambda value: value, decode, {"enum": list(values)})


def _encode_float(value: float) -> Json:
    if math.isfinite(value):
        return float(value)
    return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"


def encode_array(array: Any) -> Json:
    """Return an array as nested lists with spelled non-finite numbers, or the shape of an empty array."""
    if array.size == 0:
        return {"shape": list(array.shape)}
    nested = array.tolist()
    return nested if array.dtype.kind != "f" or math.isfinite(np.vdot(array, array)) else _spell(nested)


def _array(dtype: np.dtype[Any]) -> Codec:
    def decode(data: Json) -> Any:
        return _empty(data["shape"], dtype) if isinstance(data, dict) else np.array(data, dtype)

    empty = {"type": "object", "properties": {"shape": {"type": "array", "items": {"type": "integer"}}}}
    return Codec(encode_array, decode, {"anyOf": [{"type": "array"}, empty]})


def _empty(shape: Json, dtype: np.dtype[Any]) -> Any:
    """Return an empty array. Raise ValueError for any other shape, because its entries are not stored."""
    if not isinstance(shape, list) or 0 not in shape:
        raise ValueError(f"{str(shape)[:80]} is not the shape of an empty array")
    return np.empty(shape, dtype)


def _spell(nested: Any) -> Json:
    return [_spell(item) for item in nested] if isinstance(nested, list) else _encode_float(nested)


def _optional(inner: Codec) -> Codec:
    is_plain = inner.is_plain
    return Codec(
        lambda value: None if value is None else inner.encode(value),
        lambda data: None if data is None else inner.decode(data),
        {"anyOf": [inner.schema, {"type": "null"}]},
        is_plain and (lambda value: value is None or is_plain(value)),
    )


def _sequence(origin: type, arguments: tuple[Any, ...]) -> Codec:
    if origin is frozenset or arguments[-1] is Ellipsis:
        item = codec(arguments[0])
        order = sorted if origin is frozenset else list
        check = item.is_plain
        is_plain = check and (lambda values: all(map(check, values)))
        return Codec(
            lambda values: [item.encode(value) for value in order(values)],
            lambda data: origin(item.decode(value) for value in data),
            {"type": "array", "items": item.schema},
            (lambda values: False) if origin is frozenset else is_plain,  # msgspec does not sort
        )
    items = [codec(argument) for argument in arguments]
    checks = [item.is_plain for item in items]

    def are_plain(values: Any) -> bool:
        return all(check is None or check(value) for check, value in zip(checks, values, strict=True))

    return Codec(
        lambda values: [item.encode(value) for item, value in zip(items, values, strict=True)],
        lambda data: tuple(item.decode(value) for item, value in zip(items, data, strict=True)),
        {"type": "array", "prefixItems": [item.schema for item in items], "minItems": len(items)},
        are_plain if any(checks) else None,
    )


def _mapping(value_codec: Codec) -> Codec:
    check = value_codec.is_plain
    return Codec(
        lambda mapping: {key: value_codec.encode(value) for key, value in mapping.items()},
        lambda data: {key: value_codec.decode(value) for key, value in data.items()},
        {"type": "object", "additionalProperties": value_codec.schema},
        check and (lambda mapping: all(map(check, mapping.values()))),
    )


def _record(kind: type) -> Codec:
    hints = get_type_hints(kind)
    required = _required_by_field(kind)
    codecs = {name: codec(hints[name]) for name in required}

    def encode(record: Any) -> Json:
        return {name: field.encode(getattr(record, name)) for name, field in codecs.items()}

    def decode(data: Json) -> Any:
        return kind(**{name: codecs[name].decode(value) for name, value in data.items()})

    checks = [(attrgetter(name), field.is_plain) for name, field in codecs.items() if field.is_plain is not None]

    def is_plain(record: Any) -> bool:
        for field, check in checks:  # noqa: SIM110 - faster than all()
            if not check(field(record)):
                return False
        return True

    properties = {name: field.schema for name, field in codecs.items()}
    names = [name for name, is_required in required.items() if is_required]
    schema = {"type": "object", "properties": properties, "required": names}
    return Codec(encode, decode, schema, is_plain if checks else None)


def _required_by_field(kind: type) -> dict[str, bool]:
    """Return the fields of a record in order, and whether each one has no default."""
    if issubclass(kind, msgspec.Struct):
        return {field.name: field.required for field in msgspec.structs.fields(kind)}
    record_fields = fields(kind)  # type: ignore[arg-type]
    return {field.name: field.default is MISSING and field.default_factory is MISSING for field in record_fields}

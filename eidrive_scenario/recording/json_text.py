"""JSON text of records in the encoding of `codec`, written and read by msgspec where it agrees with that encoding.

msgspec writes non-finite numbers as null, and does not read spelled ones. Such numbers in arrays are spelled and read
by hooks. A record with a non-finite number outside of arrays is encoded and decoded by the codec.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from math import isfinite
from operator import attrgetter
from typing import Any, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.recording.codec import codec, encode_array

Check = Callable[[Any], bool]
"""Function that returns whether all numbers of a value outside of arrays are finite."""


class JsonText:
    """Encoder and decoder of records of one type as JSON text in UTF-8.

    Raise TypeError for a type without an encoding.
    """

    def __init__(self, kind: type) -> None:
        self._codec = codec(kind)
        self._is_finite = _check_of(kind)
        self._arrays: dict[int, tuple[Array, msgspec.Raw]] = {}
        """Text of each array of the record by its `id`, with the array, so that no other one gets this `id`."""
        self._encoder = msgspec.json.Encoder(enc_hook=self._plain)
        # The hook gets arrays: other types that msgspec does not support have no encoding
        self._decoder: msgspec.json.Decoder[Any] = msgspec.json.Decoder(
            kind, dec_hook=lambda array_kind, data: codec(array_kind).decode(data)
        )

    def decode(self, data: bytes) -> Any:
        """Return the record of a text. Sequences are lists or tuples, and unknown fields are ignored where possible.

        Raise ValueError, TypeError or LookupError for a text that is not of this type, and RecursionError for one that
        is nested too deeply.
        """
        try:
            return self._decoder.decode(data)
        except msgspec.ValidationError:
            return self._codec.decode(msgspec.json.decode(data))

    def encode(self, record: Any) -> bytes:
        """Return the text, which `codec(kind).decode` reads after parsing."""
        if self._is_finite is None or self._is_finite(record):
            self._arrays.clear()
            return self._encoder.encode(record)
        return msgspec.json.encode(self._codec.encode(record))

    def _plain(self, value: Any) -> Any:
        """Return a value of a type that msgspec does not support as one that it supports.

        Of arrays, most occur several times in a record: each is encoded once.
        """
        if type(value) is np.ndarray:
            stored = self._arrays.get(id(value))
            if stored is None:
                text = msgspec.Raw(msgspec.json.encode(encode_array(value)))
                stored = self._arrays[id(value)] = value, text
            return stored[1]
        if isinstance(value, np.generic):
            return value.item()
        if isinstance(value, Mapping):
            return dict(value)
        if isinstance(value, Sequence):
            return list(value)
        raise TypeError(f"{type(value).__name__}: no JSON encoding is defined for this type")


@cache
def _check_of(kind: Any) -> Check | None:
    """Return the check of a type; None if it contains no number outside of arrays."""
    origin, arguments = get_origin(kind), get_args(kind)
    if kind is float:
        return isfinite
    if origin in (Union, types.UnionType):
        check = next(filter(None, map(_check_of, arguments)), None)
        return check and (lambda value: value is None or check(value))
    if origin is frozenset:
        raise TypeError(f"{kind!r}: the order of its members is undefined")
    if origin is tuple and arguments[-1] is not Ellipsis:
        checks = list(map(_check_of, arguments))
        if not any(checks):
            return None
        return lambda values: all(each is None or each(value) for each, value in zip(checks, values, strict=True))
    if origin in (tuple, Sequence):
        of_entry = _check_of(arguments[0])
        return of_entry and (lambda values: all(map(of_entry, values)))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        of_value = _check_of(arguments[1])
        return of_value and (lambda mapping: all(map(of_value, mapping.values())))
    if isinstance(kind, type) and (is_dataclass(kind) or issubclass(kind, msgspec.Struct)):
        return _record(kind)
    return None


def _record(kind: type) -> Check | None:
    """Return the check of a record, which reads only the fields with numbers."""
    hints = get_type_hints(kind)
    names = msgspec.structs.fields(kind) if issubclass(kind, msgspec.Struct) else fields(kind)  # type: ignore[arg-type]
    checks = [(attrgetter(field.name), check) for field in names if (check := _check_of(hints[field.name])) is not None]

    def is_finite(record: Any) -> bool:
        for field, check in checks:  # noqa: SIM110 - faster than all()
            if not check(field(record)):
                return False
        return True

    return is_finite if checks else None

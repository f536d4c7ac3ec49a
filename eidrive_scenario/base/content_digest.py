"""Digests of values and of texts, and the versions of the packages: what makes two results comparable."""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Protocol

import numpy as np
import pydantic

from eidrive_scenario.base.installation import ENGINE

_PACKAGES = (ENGINE, "numpy", "pybullet")
_NUMBER = struct.Struct("<d")


def canonical_json(value: Any) -> str:
    """Return JSON with sorted keys, without white space, in ASCII: equal values give equal texts."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)


def sha256_of(content: bytes) -> str:
    """Return the SHA-256 as 64 hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


@cache
def package_versions() -> Mapping[str, str]:
    """Return the installed versions of the packages that affect the result."""
    versions = {}
    for name in _PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    return versions


class _Hash(Protocol):
    def update(self, data: bytes, /) -> object: ...


_Encoder = Callable[[_Hash, Any], object]


def content_digest(*values: object) -> bytes:
    """Return a digest (32 bytes) of the types and the content of values.

    Values are None, booleans, numbers, texts, bytes, enumerations, arrays, and mappings, sequences, dataclasses and
    pydantic models of them. Each field of a dataclass, named tuple or model counts. The order of mappings counts too.
    A class with a property `digest` (bytes) is represented by it. Raise TypeError for any other value.
    """
    hash_ = hashlib.sha256()
    for value in values:
        _encode(hash_, value)
    return hash_.digest()


def _encode(hash_: _Hash, value: object) -> None:
    kind: Any = type(value)
    _encoder(kind)(hash_, value)


@cache
def _encoder(kind: type[Any]) -> _Encoder:
    """Return the function that adds a value of this type to a hash."""
    if hasattr(kind, "digest"):
        return lambda hash_, value: hash_.update(b"#" + value.digest)
    for types, encoder in _ENCODERS:
        if issubclass(kind, types):
            return encoder
    if not is_dataclass(kind) and not issubclass(kind, pydantic.BaseModel):
        raise TypeError(f"{kind.__name__}: a value of this type has no digest")
    name = f"{kind.__module__}.{kind.__qualname__}".encode()
    names = [field.name for field in fields(kind)] if is_dataclass(kind) else [*kind.model_fields]

    def add_fields(hash_: _Hash, value: object) -> None:
        hash_.update(b"C%d %b%d " % (len(name), name, len(names)))
        for field in names:
            _encode(hash_, getattr(value, field))

    return add_fields


def _text(hash_: _Hash, value: str) -> None:
    data = value.encode()
    hash_.update(b"s%d " % len(data) + data)


def _array(hash_: _Hash, value: Any) -> None:
    array = np.asarray(value)
    if array.dtype.hasobject:
        raise TypeError("an array of objects has no digest")
    hash_.update(f"a{array.dtype.str} {array.shape} ".encode())
    hash_.update(array.tobytes())


def _mapping(hash_: _Hash, value: Mapping[object, object]) -> None:
    hash_.update(b"m%d " % len(value))
    for key, entry in value.items():
        _encode(hash_, key)
        _encode(hash_, entry)


def _sequence(hash_: _Hash, value: tuple[object, ...] | list[object]) -> None:
    hash_.update(b"q%d " % len(value))
    for entry in value:
        _encode(hash_, entry)


_ENCODERS: tuple[tuple[type | tuple[type, ...], _Encoder], ...] = (
    (type(None), lambda hash_, value: hash_.update(b"N")),
    (Enum, lambda hash_, value: _text(hash_, f"{type(value).__qualname__}.{value.name}")),
    (bool, lambda hash_, value: hash_.update(b"T" if value else b"F")),
    ((np.ndarray, np.generic), _array),
    (int, lambda hash_, value: hash_.update(b"i%d " % value)),
    (float, lambda hash_, value: hash_.update(b"d" + _NUMBER.pack(value))),
    (str, _text),
    (bytes, lambda hash_, value: hash_.update(b"b%d " % len(value) + value)),
    (Mapping, _mapping),
    ((tuple, list), _sequence),
)
"""Types in the order of the search: numpy's float64 is a float, and booleans are integers."""

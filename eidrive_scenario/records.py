"""Immutable records that are created in every tick: frozen dataclasses with a fast initializer."""

from __future__ import annotations

import inspect
from dataclasses import MISSING, fields
from typing import Any, TypeVar

T = TypeVar("T")


def fast_frozen(record: type[T]) -> type[T]:
    """Replace the initializer of a frozen dataclass by one that sets all fields in a single step, in half the time.

    The initializer of `dataclasses` calls `object.__setattr__` once per field. Order, defaults, `__post_init__` and
    immutability are preserved. Every field must be a parameter, and the class must not have `__slots__`.
    """
    own = fields(record)  # type: ignore[arg-type]
    signature = inspect.signature(record)
    if tuple(signature.parameters) != tuple(entry.name for entry in own):
        raise TypeError(f"{record.__name__} has fields that are not parameters")
    names: dict[str, Any] = {}
    parameters, values = [], []
    for entry in own:
        name, default = entry.name, signature.parameters[entry.name].default
        if default is inspect.Parameter.empty:
            parameters.append(name)
        else:
            names[f"_default_{name}"] = default
            parameters.append(f"{name}=_default_{name}")
        if entry.default_factory is MISSING:
            values.append(f"'{name}': {name}")
        else:
            names[f"_make_{name}"] = entry.default_factory
            values.append(f"'{name}': _make_{name}() if {name} is _default_{name} else {name}")
    lines = [f"def __init__(self, {', '.join(parameters)}):", f"    self.__dict__.update({{{', '.join(values)}}})"]
    if hasattr(record, "__post_init__"):
        lines.append("    self.__post_init__()")
    defined: dict[str, Any] = {}
    exec("\n".join(lines), names, defined)
    initializer = defined["__init__"]
    initializer.__signature__ = inspect.signature(record.__init__)
    initializer.__qualname__ = f"{record.__qualname__}.__init__"
    record.__init__ = initializer  # type: ignore[method-assign]
    return record


def replaced(record: T, **changes: Any) -> T:
    """Return a copy of a record of `fast_frozen` with new values of some fields.

    Faster than `dataclasses.replace`: names are not checked, and `__post_init__` is not called.
    """
    copy = object.__new__(type(record))
    copy.__dict__.update(record.__dict__)
    copy.__dict__.update(changes)
    return copy

"""Base classes of the model: elements, their content models, enumerations, and the versions of the standard.

The type of a field determines its XML form: numbers, texts and enumerations are attributes, other elements are
children, tuples are repeated children. A field without a default is required; one with the default None or () is
optional. `attribute`, `child` and `children` define differences between versions of the standard.

A content model is the order and number of the children of an element. A model without arguments applies to all child
fields of its class. Otherwise it lists fields or nested models. Versions are written as in the file header: "1.2" is
revMajor 1, revMinor 2.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, FrozenInstanceError, dataclass, field, fields
from enum import Enum
from reprlib import recursive_repr
from typing import Any, ClassVar, TypeAlias, dataclass_transform

import msgspec

Part: TypeAlias = "str | Sequence | Choice"


class Sequence(msgspec.Struct, frozen=True):
    """Sequence of the parts in their order."""

    parts: tuple[Part, ...] = ()


class Choice(msgspec.Struct, frozen=True):
    """Choice of one of the parts.

    minimum, maximum  number of repetitions; None for no limit
    empty_until       last version in which the schema allows an empty choice
    """

    parts: tuple[Part, ...] = ()
    minimum: int = 1
    maximum: int | None = 1
    empty_until: str = ""


class All(msgspec.Struct, frozen=True):
    """All children in any order, each at most once."""


class Changed(msgspec.Struct, frozen=True):
    """Content model that changes in a version."""

    before: Sequence | All
    since: str
    after: Choice


Content: TypeAlias = Sequence | Choice | All | Changed

SEQUENCE = Sequence()
ALL = All()
CHOICE = Choice()


def sequence(*parts: Part) -> Sequence:
    """Return a sequence of parts."""
    return Sequence(parts)


def choice(*parts: Part, empty_until: str = "") -> Choice:
    """Return a choice of parts."""
    return Choice(parts, empty_until=empty_until)


USAGE = "usage"

ABOUT = frozenset({"line", "source", "scope", "sibling_index"})
"""Fields with the location of an element, not with its content.

line, source   line and file
scope          parameters (a Scope) that are visible to the name of a parameter and to references inside a text of the
               element; None for a property without a reference, or with a single reference, which the reader resolves
sibling_index  place among the children of the parent, where elements of several classes are ordered
"""


class Usage(msgspec.Struct, frozen=True):
    """Versions in which a field or literal exists, is required or deprecated; bounds are inclusive, "" is open."""

    since: str = ""
    until: str = ""
    deprecated: str = ""
    required: bool = False
    required_since: str = ""
    required_until: str = ""
    single_until: str = ""
    minimum: int = 1
    name: str = ""
    """Name in the file if it does not follow from the name of the field."""
    text: bool = False


def attribute(**usage: Any) -> Any:
    """Define an optional field with the fields of its `Usage`; None if the file omits it."""
    return field(default=None, metadata={USAGE: Usage(**usage)})


child = attribute


def children(*, minimum: int = 0, **usage: Any) -> Any:
    """Define a field for at least `minimum` children with the fields of its `Usage`; () if the file has none."""
    metadata = {USAGE: Usage(required=minimum > 0, minimum=max(minimum, 1), **usage)}
    return field(default=() if minimum == 0 else MISSING, metadata=metadata)


def text() -> Any:
    """Define a field for the text content of an element."""
    return field(default="", metadata={USAGE: Usage(text=True)})


def about(default: Any) -> Any:
    """Define a field of `ABOUT`, which comparisons ignore."""
    return field(default=default, compare=False, repr=False)


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field,))
class _FrozenRecord:
    """Base that makes its subclasses frozen dataclasses with keyword arguments, whose methods are those of `Element`.

    `dataclass` compiles six methods for each class. For all classes of the standard this takes longer than a short run.
    """

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    content_model: ClassVar[Content]
    field_names: ClassVar[tuple[str, ...]]
    """Fields with XML content: all except `ABOUT`."""
    field_defaults: ClassVar[Mapping[str, Any]]
    """Default of each field, MISSING for a required field."""
    incomplete_values: ClassVar[Mapping[str, Any]]
    """Default of each field, None for a required field."""
    compared_fields: ClassVar[tuple[str, ...]]

    def __init_subclass__(cls, content: Content = SEQUENCE) -> None:
        dataclass(init=False, repr=False, eq=False, match_args=False, kw_only=True)(cls)
        cls.content_model = content
        cls.field_names = tuple(entry.name for entry in fields(cls) if entry.name not in ABOUT)
        cls.field_defaults = {entry.name: entry.default for entry in fields(cls)}
        cls.incomplete_values = {
            name: None if value is MISSING else value for name, value in cls.field_defaults.items()
        }
        cls.compared_fields = tuple(entry.name for entry in fields(cls) if entry.compare)


class Element(_FrozenRecord):
    """Element of a file. Comparisons ignore its location `line` and `source`."""

    line: int = about(0)
    source: str = about("")

    def __init__(self, **values: Any) -> None:
        """Set the fields. Raise TypeError for an unknown field, or if a field without a default is missing."""
        defaults = self.field_defaults
        if unknown := values.keys() - defaults.keys():
            raise TypeError(f"{type(self).__name__} has no field {', '.join(sorted(unknown))}")
        state = {**defaults, **values}
        if missing := [name for name, value in state.items() if value is MISSING]:
            raise TypeError(f"{type(self).__name__} requires {', '.join(missing)}")
        self.__dict__.update(state)

    def __setattr__(self, name: str, value: object) -> None:
        raise FrozenInstanceError(f"cannot assign to field {name!r}")

    def __delattr__(self, name: str) -> None:
        raise FrozenInstanceError(f"cannot delete field {name!r}")

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return _compared_values(self) == _compared_values(other)

    def __hash__(self) -> int:
        return hash(_compared_values(self))

    @recursive_repr()
    def __repr__(self) -> str:
        shown = (f"{entry.name}={getattr(self, entry.name)!r}" for entry in fields(self) if entry.repr)
        return f"{type(self).__qualname__}({', '.join(shown)})"

    def children(self) -> Iterator[Element]:
        """Yield the child elements in the order of the fields."""
        for value in vars(self).values():
            if isinstance(value, Element):
                yield value
            elif isinstance(value, tuple):
                yield from value

    def walk(self) -> Iterator[Element]:
        """Yield this element and its descendants, each before its children."""
        ahead: list[Element] = [self]
        while ahead:
            element = ahead.pop()
            yield element
            below = list(element.children())
            below.reverse()
            ahead += below

    def chosen(self) -> Element:
        """Return the alternative that is set in an element with a choice.

        Raise ValueError if none or several are set. Some versions allow this: a ControllerAction before 1.3, an empty
        AssignControllerAction, the steady state of a final speed, and overrides of brake and gear. Use the fields of
        these elements instead.
        """
        values = (getattr(self, name) for name in alternatives(type(self)))
        chosen = [value for value in values if isinstance(value, Element) or (isinstance(value, tuple) and value)]
        if len(chosen) != 1:
            location = f"{self.source}:{self.line}: {type(self).__name__}"
            raise ValueError(f"{location}: invalid number of alternatives (got {len(chosen)}; expected 1)")
        first = chosen[0]
        return first[0] if isinstance(first, tuple) else first


def incomplete_element(cls: type[Element], values: Mapping[str, Any]) -> Element:
    """Return an element with these values and its defaults, without a check: None for missing required fields."""
    element = object.__new__(cls)
    element.__dict__.update(cls.incomplete_values)
    element.__dict__.update(values)
    return element


def _compared_values(element: Element) -> tuple[Any, ...]:
    return tuple([getattr(element, name) for name in element.compared_fields])


def alternatives(cls: type[Element]) -> tuple[str, ...]:
    """Return the alternatives in the choice of a class."""
    model = cls.content_model
    if isinstance(model, Changed):
        model = model.after
    if isinstance(model, Sequence):
        model = next((part for part in model.parts if isinstance(part, Choice)), model)
    named = tuple(part for part in model.parts if isinstance(part, str)) if isinstance(model, Choice) else ()
    return named or cls.field_names


class Enumeration(Enum):
    """Enumeration of the standard; the value is the literal in the file."""

    _value_: str
    usage: Usage

    def __new__(cls, literal: str, usage: Usage = Usage()) -> Enumeration:  # noqa: B008
        member = object.__new__(cls)
        member._value_ = literal
        member.usage = usage
        return member

    def __str__(self) -> str:
        return self._value_


def since(version: str) -> Usage:
    """Return the usage of a literal that exists since a version."""
    return Usage(since=version)


def only(version: str) -> Usage:
    """Return the usage of a literal that exists in one version only."""
    return Usage(since=version, until=version)


def deprecated(version: str) -> Usage:
    """Return the usage of a literal that is deprecated since a version."""
    return Usage(deprecated=version)

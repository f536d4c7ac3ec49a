"""What every class of the model is, and how a field says what its type cannot.

A field's type tells what it is in the file: numbers, words and enumerations are attributes, other elements are
children, tuples are children that repeat. A field without a default is required; one that begins with None or ()
is optional. Where that differs between versions of the standard, `attribute`, `child` and `children` say so.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

from eidrive_scenario.openscenario.model.content import SEQUENCE, Changed, Choice, Content, Sequence

USAGE = "usage"

ABOUT = frozenset({"line", "source", "scope"})
"""Fields that say where an element stands instead of what it holds."""


@dataclass(frozen=True)
class Usage:
    """In which versions a field or a word is there, is required, is deprecated; bounds are inclusive, "" is open."""

    since: str = ""
    until: str = ""
    deprecated: str = ""
    required: bool = False
    required_since: str = ""
    required_until: str = ""
    single_until: str = ""
    minimum: int = 1
    name: str = ""
    """The spelling in the file, where it does not follow from the field's name."""
    text: bool = False


def attribute(
    *,
    since: str = "",
    until: str = "",
    deprecated: str = "",
    required: bool = False,
    required_since: str = "",
    required_until: str = "",
    name: str = "",
) -> Any:
    """A field that some versions know, require or deprecate; None where the file does not have it."""
    usage = Usage(
        since=since,
        until=until,
        deprecated=deprecated,
        required=required,
        required_since=required_since,
        required_until=required_until,
        name=name,
    )
    return field(default=None, metadata={USAGE: usage})


child = attribute


def children(
    *,
    minimum: int = 0,
    since: str = "",
    until: str = "",
    required_until: str = "",
    single_until: str = "",
    name: str = "",
) -> Any:
    """A field that holds any number of children, but at least `minimum`; () where the file has none."""
    usage = Usage(
        since=since,
        until=until,
        required=minimum > 0,
        required_until=required_until,
        single_until=single_until,
        minimum=max(minimum, 1),
        name=name,
    )
    return field(default=(), metadata={USAGE: usage}) if minimum == 0 else field(metadata={USAGE: usage})


def text() -> Any:
    """A field that holds the text between an element's tags."""
    return field(default="", metadata={USAGE: Usage(text=True)})


def visible_parameters() -> Any:
    """A field for the parameters (a Scope) that are visible to the references inside a text of the element.

    None where a property has no reference, or is one as a whole, which is resolved when the file is read.
    """
    return field(default=None, compare=False, repr=False)


@dataclass(frozen=True, kw_only=True)
class Element:
    """An element of a file. `line` and `source` say where it stands; they do not count when elements are compared."""

    line: int = field(default=0, compare=False, repr=False)
    source: str = field(default="", compare=False, repr=False)

    content_model: ClassVar[Content] = SEQUENCE

    def __init_subclass__(cls, content: Content = SEQUENCE) -> None:
        cls.content_model = content

    def children(self) -> Iterator[Element]:
        """The elements directly below, in the order of the class's fields."""
        for name in field_names(type(self)):
            value = getattr(self, name)
            if isinstance(value, Element):
                yield value
            elif isinstance(value, tuple):
                yield from value

    def walk(self) -> Iterator[Element]:
        """This element and all below."""
        yield self
        for below in self.children():
            yield from below.walk()

    def chosen(self) -> Element:
        """The one alternative that is set, where the standard lets the file choose.

        Raises ValueError if none is or several are. That happens only where some version lets an element be empty
        or full: a ControllerAction before 1.3, an AssignControllerAction that assigns nothing, the steady state of
        a final speed, an override that says how a brake or a gear is meant. Ask those for their fields.
        """
        values = (getattr(self, name) for name in alternatives(type(self)))
        found = [value for value in values if isinstance(value, Element) or (isinstance(value, tuple) and value)]
        if len(found) != 1:
            what = "one alternative is expected" if not found else "only one alternative is expected"
            raise ValueError(f"{self.source}:{self.line}: {type(self).__name__}: {what}, found {len(found)}")
        first = found[0]
        return first[0] if isinstance(first, tuple) else first


def field_names(cls: type[Element]) -> tuple[str, ...]:
    """The fields of a class that stand in a file: all but those of `ABOUT`."""
    known = _FIELD_NAMES.get(cls)
    if known is None:
        known = tuple(entry.name for entry in fields(cls) if entry.name not in ABOUT)
        _FIELD_NAMES[cls] = known
    return known


def alternatives(cls: type[Element]) -> tuple[str, ...]:
    """The fields among which an element of this class chooses."""
    model = cls.content_model
    if isinstance(model, Changed):
        model = model.after
    if isinstance(model, Sequence):
        model = next((part for part in model.parts if isinstance(part, Choice)), model)
    named = tuple(part for part in model.parts if isinstance(part, str)) if isinstance(model, Choice) else ()
    return named or field_names(cls)


_FIELD_NAMES: dict[type[Element], tuple[str, ...]] = {}

"""Content models of the schema: order and number of the children of an element.

A model without arguments applies to all child fields of its class. Otherwise it lists fields or nested models.
Versions are written as in the file header: "1.2" is revMajor 1, revMinor 2.
"""

from __future__ import annotations

from typing import TypeAlias

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

"""In which order and how often the children of an element may stand: the schema's content models.

Without arguments a model speaks of all child fields of its class. Otherwise it names fields, or nests further models.
Versions are written as in the file header: "1.2" is revMajor 1, revMinor 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

Part: TypeAlias = "str | Sequence | Choice"


@dataclass(frozen=True)
class Sequence:
    """One after the other, in the order of the parts."""

    parts: tuple[Part, ...] = ()


@dataclass(frozen=True)
class Choice:
    """One of the parts.

    minimum, maximum  how often one may be chosen; None is without limit
    empty_until       up to this version the schema let the choice be empty
    """

    parts: tuple[Part, ...] = ()
    minimum: int = 1
    maximum: int | None = 1
    empty_until: str = ""


@dataclass(frozen=True)
class All:
    """Every child at most once, in any order."""


@dataclass(frozen=True)
class Changed:
    """Another model since a version."""

    before: Sequence | All
    since: str
    after: Choice


Content: TypeAlias = Sequence | Choice | All | Changed

SEQUENCE = Sequence()
ALL = All()
CHOICE = Choice()


def sequence(*parts: Part) -> Sequence:
    """The given parts, one after the other."""
    return Sequence(parts)


def choice(*parts: Part, empty_until: str = "") -> Choice:
    """One of the given parts."""
    return Choice(parts, empty_until=empty_until)

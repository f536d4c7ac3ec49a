"""The base of the standard's enumerations: members know in which versions they are there."""

from __future__ import annotations

from enum import Enum

from eidrive_scenario.openscenario.model.element import Usage


class Enumeration(Enum):
    """An enumeration of the standard: the value is the word in the file."""

    _value_: str
    usage: Usage

    def __new__(cls, word: str, usage: Usage = Usage()) -> Enumeration:  # noqa: B008
        member = object.__new__(cls)
        member._value_ = word
        member.usage = usage
        return member

    def __str__(self) -> str:
        return self._value_


def since(version: str) -> Usage:
    """The word is there since this version."""
    return Usage(since=version)


def only(version: str) -> Usage:
    """The word is there in this version only."""
    return Usage(since=version, until=version)


def deprecated(version: str) -> Usage:
    """The word is deprecated since this version."""
    return Usage(deprecated=version)

"""Base class of the enumerations of the standard, whose members have versions."""

from __future__ import annotations

from enum import Enum

from eidrive_scenario.openscenario.model.element import Usage


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

"""Conversion of texts to values by the simple types of XML Schema."""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any

import msgspec

from eidrive_scenario.errors import suggestion
from eidrive_scenario.openscenario.model import Enumeration
from eidrive_scenario.openscenario.model.declarations import INT, Limits
from eidrive_scenario.openscenario.model.element import Usage

Version = tuple[int, int]

_DOUBLE = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?|-?INF|NaN", re.ASCII)
_INTEGER = re.compile(r"[+-]?\d+", re.ASCII)
_DATE_TIME = re.compile(
    r"(-?\d{4,})-(\d\d)-(\d\d)T(\d\d):(\d\d):(\d\d)(?:\.(\d+))?(Z|[+-](?:0\d|1[0-3]):[0-5]\d|[+-]14:00)?", re.ASCII
)
_WHITE_SPACE = " \t\r\n"
_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}


class Scalar(msgspec.Struct, frozen=True):
    """Simple type. `convert` raises ValueError with a hint if a text is invalid."""

    name: str
    """Noun for messages, such as "a number"."""
    convert: Callable[[str], Any]
    takes_expressions: bool = False
    deprecated: frozenset[Any] = frozenset()
    """Values that the version deprecates."""


def _double(text: str) -> float:
    text = text.strip(_WHITE_SPACE)
    if not _DOUBLE.fullmatch(text):
        raise ValueError("write it as 12.5 or 1e-3")
    return float(text)


def whole_number(limits: Limits) -> Scalar:
    """Return the type of whole numbers within limits."""

    def convert(text: str) -> int:
        text = text.strip(_WHITE_SPACE)
        if not _INTEGER.fullmatch(text):
            raise ValueError("write digits without a decimal point")
        value = int(text) if len(text) < 64 else limits.highest + 1
        if not limits.lowest <= value <= limits.highest:
            raise ValueError(f"expected a number between {limits.lowest} and {limits.highest}")
        return value

    return Scalar("a whole number", convert, True)


def lane_number(text: str) -> int | None:
    """Return the number of a lane that a text names; None if it is no integer of 32 bits."""
    try:
        return int(whole_number(INT).convert(text))
    except ValueError:
        return None


def _boolean(text: str) -> bool:
    value = _BOOLEANS.get(text.strip(_WHITE_SPACE))
    if value is None:
        raise ValueError("write true or false")
    return value


def _date_time(text: str) -> datetime:
    match = _DATE_TIME.fullmatch(text.strip(_WHITE_SPACE))
    if match is None:
        raise ValueError("write it as 2026-01-31T12:00:00")
    year, month, day, hour, minute, second = (int(part) for part in match.groups()[:6])
    fraction, zone = match.group(7) or "", match.group(8) or ""
    midnight = hour == 24 and minute == second == 0 and not fraction.strip("0")
    try:
        moment = datetime(year, month, day, 0 if midnight else hour, minute, second, int(fraction[:6].ljust(6, "0")))
        zoned = datetime.fromisoformat(moment.isoformat() + zone)
        return zoned + timedelta(days=1) if midnight else zoned
    except (ValueError, OverflowError) as error:
        raise ValueError(str(error)) from error


DOUBLE = Scalar("a number", _double, True)
INTEGER = whole_number(INT)
BOOLEAN = Scalar("a truth value", _boolean, True)
STRING = Scalar("a text", str, True)
DATE_TIME = Scalar("a date and time", _date_time)


def enumeration(cls: type[Enumeration], version: Version) -> Scalar:
    """Return the type of the literals of an enumeration that a version has."""
    literals = {member.value: member for member in cls if is_known(member.usage, version)}

    def convert(text: str) -> Enumeration:
        member = literals.get(text)
        if member is None:
            try:
                other = cls(text)
            except ValueError:
                raise ValueError(suggestion(text, literals)) from None
            raise ValueError(availability(other.usage, version))
        return member

    deprecated = frozenset(member for member in literals.values() if is_deprecated(member.usage, version))
    return Scalar(f"a literal of {cls.__name__}", convert, deprecated=deprecated)


def parse_version(version: str) -> Version:
    """Return the numbers of a version such as "1.2"."""
    major, minor = version.split(".")
    return int(major), int(minor)


def is_known(usage: Usage, version: Version) -> bool:
    """Whether a version has the literal, attribute or element."""
    return not _is_later(usage, version) and not (usage.until and version > parse_version(usage.until))


def is_deprecated(usage: Usage, version: Version) -> bool:
    """Whether a version deprecates the literal, attribute or element."""
    return bool(usage.deprecated) and version >= parse_version(usage.deprecated)


def availability(usage: Usage, version: Version) -> str:
    """Describe the versions that have a literal, attribute or element, and the version of the file."""
    span = f"since {usage.since}" if _is_later(usage, version) else f"up to {usage.until} only"
    return f"part of OpenSCENARIO {span}; the version of the file is {version[0]}.{version[1]}"


def _is_later(usage: Usage, version: Version) -> bool:
    """Whether a literal, attribute or element exists only in later versions."""
    return bool(usage.since) and version < parse_version(usage.since)

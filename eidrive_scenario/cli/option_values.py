"""Parsing and checks of the values of options."""

from __future__ import annotations

import math
from collections.abc import Iterable

from eidrive_scenario.errors import Diagnostic, SettingError, quoted


def parse_senders(text: str | None) -> tuple[str, ...] | None:
    """Return the stations of `--cooperate`; () for none, None without the option."""
    if text is None:
        return None
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    if not names:
        raise SettingError(Diagnostic(f"--cooperate: no station is listed (got {text!r}; expected A,B or none)"))
    return () if names == ("none",) else names


def parse_assignments(option: str, assignments: Iterable[str]) -> dict[str, str]:
    """Return the values of texts `NAME=VALUE` by name.

    Raise SettingError for any other text, and for a name with two values.
    """
    values: dict[str, str] = {}
    for assignment in assignments:
        name, equals, value = assignment.partition("=")
        if not equals or not name:
            raise SettingError(Diagnostic(f"{option}: no value is assigned (got {assignment!r}; expected NAME=VALUE)"))
        if name in values:
            message = f"{option}: {quoted(name)} is given twice, as {quoted(values[name])} and {quoted(value)}"
            raise SettingError(Diagnostic(message, "give each name once"))
        values[name] = value
    return values


def check_seconds(option: str, value: float) -> None:
    """Raise SettingError unless a value is a positive number of seconds."""
    if not 0.0 < value < math.inf:
        raise SettingError(Diagnostic(f"{option}: not a positive number of seconds (got {value})"))

"""Parsing and checks of the values of options."""

from __future__ import annotations

import math
from collections.abc import Iterable

from eidrive_scenario.errors import Diagnostic, SettingError, quoted

MOST_SEEDS = 1_000_000
"""Maximum number of seeds of an option."""


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


def parse_seeds(option: str, text: str) -> list[int]:
    """Return the seeds of a text such as `1-10`, `3` or `1,2,5-8`. Raise SettingError for another text."""
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()) or (dash and int(last) < int(first)):
            raise SettingError(Diagnostic(f"{option}: no seeds (got {quoted(text)}; expected 1-10 or 1,2,5)"))
        if dash and int(last) - int(first) >= MOST_SEEDS:
            raise SettingError(Diagnostic(f"{option}: more than {MOST_SEEDS} seeds (got {quoted(text)})"))
        found += range(int(first), int(last or first) + 1)
    return found


def parse_shard(text: str) -> tuple[int, int]:
    """Return number and count of `2/8`. Raise SettingError unless the number is within 1 … count."""
    number, slash, count = text.partition("/")
    if not (slash and number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count)):
        raise SettingError(
            Diagnostic(f"--shard: no part of a whole (got {quoted(text)}; expected I/N, from 1/N to N/N)")
        )
    return int(number), int(count)


def check_seconds(option: str, value: float) -> None:
    """Raise SettingError unless a value is a positive number of seconds."""
    if not 0.0 < value < math.inf:
        raise SettingError(Diagnostic(f"{option}: not a positive number of seconds (got {value})"))

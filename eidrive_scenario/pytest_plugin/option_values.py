"""Parsers of the values of options and ini options."""

from __future__ import annotations

from argparse import ArgumentTypeError
from typing import Any

NO_LIMIT = "none"
"""Value of the wall limit for no limit."""
RECORD = ("always", "on-failure", "never")
"""Runs whose recording is kept."""
WITHOUT_CRITERIA = ("error", "warn", "pass")
"""Outcomes of a test whose run no criterion judges."""
TOPICS = ("foxglove", "osi")
"""Tools whose topics a recording can contain."""
_MOST_DIGITS = 18


def parse_count(text: str) -> int:
    """Return a positive integer. Raise ArgumentTypeError for another text."""
    if not text.isdecimal() or len(text) > _MOST_DIGITS or int(text) < 1:
        raise ArgumentTypeError(f"not a positive integer (got {text!r})")
    return int(text)


def parse_count_or_all(text: str) -> int | str:
    """Return a positive integer or `all`. Raise ArgumentTypeError for another text."""
    return text if text == "all" else parse_count(text)


def parse_rate(text: str) -> Any:
    """Return the test of a success rate, a RatioTest. Raise ArgumentTypeError for another text."""
    from eidrive_scenario.experiments.statistics.sequential import success_rate

    try:
        return success_rate(float(text))
    except ValueError as error:
        raise ArgumentTypeError(f"not a rate between 0 and 1 (got {text!r})") from error


def parse_entity(text: str) -> str:
    """Return the text of an entity, with a stack after an equals sign. Raise ArgumentTypeError for another text."""
    name, equals, stack = text.partition("=")
    if not name.strip() or (equals and not stack.strip()):
        raise ArgumentTypeError(f"no entity or stack is given (got {text!r})")
    return text


def parse_listed_channels(text: str) -> str:
    """Return a text that lists at least one channel. Raise ArgumentTypeError for another text."""
    if not split_channels(text):
        raise ArgumentTypeError(f"no channel is listed (got {text!r})")
    return text


def parse_record(text: str) -> str:
    """Return the runs whose recording is kept. Raise ArgumentTypeError for an unknown text."""
    if text not in RECORD:
        raise ArgumentTypeError(f"not one of {', '.join(RECORD)} (got {text!r})")
    return text


def parse_without_criteria(text: str) -> str:
    """Return the outcome of a test without criteria. Raise ArgumentTypeError for an unknown text."""
    if text not in WITHOUT_CRITERIA:
        raise ArgumentTypeError(f"not one of {', '.join(WITHOUT_CRITERIA)} (got {text!r})")
    return text


def parse_topics(text: str) -> tuple[str, ...]:
    """Return the listed tools. Raise ArgumentTypeError for an unknown one."""
    names = tuple(name.strip() for name in text.split(","))
    if not set(names) <= set(TOPICS):
        raise ArgumentTypeError(f"not some of {', '.join(TOPICS)} (got {text!r})")
    return names


def parse_given(text: str) -> str:
    """Return a text that is not blank. Raise ArgumentTypeError for another text."""
    if not text.strip():
        raise ArgumentTypeError(f"no value is given (got {text!r})")
    return text


def parse_seconds(text: str) -> float:
    """Return a positive number of seconds. Raise ArgumentTypeError for another text."""
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0.0 < seconds < float("inf"):
        raise ArgumentTypeError(f"not a positive number of seconds (got {text!r})")
    return seconds


def parse_seconds_or_none(text: str) -> float | str:
    """Return a positive number of seconds or `none`. Raise ArgumentTypeError for another text."""
    if text.strip() == NO_LIMIT:
        return NO_LIMIT
    try:
        return parse_seconds(text)
    except ArgumentTypeError:
        raise ArgumentTypeError(f"not a positive number of seconds or none (got {text!r})") from None


def split_channels(text: str) -> list[str]:
    """Split a text at commas outside of braces and brackets, without empty and duplicate parts."""
    parts, depth = [""], 0
    for character in text:
        depth += (character in "{[") - (character in "}]")
        if character == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return [name for name in dict.fromkeys(part.strip() for part in parts) if name]

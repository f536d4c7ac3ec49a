"""Values of options and ini options: their parsers, checks before the first test, and paths beside a file."""

from __future__ import annotations

import os
from argparse import ArgumentTypeError
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from eidrive_scenario.errors import InputError, SettingError, quoted
from eidrive_scenario.run_options import NO_COOPERATION, Seconds, option_of

NO_LIMIT = "none"
"""Value of the wall limit for no limit."""
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


def parse_listed_channels(text: str) -> str:
    """Return a text that lists at least one channel. Raise ArgumentTypeError for another text."""
    if not split_channels(text):
        raise ArgumentTypeError(f"no channel is listed (got {text!r})")
    return text


def parse_choice(choices: tuple[str, ...]) -> Callable[[str], str]:
    """Return the parser of an option with these values."""

    def parse(text: str) -> str:
        if text not in choices:
            raise ArgumentTypeError(f"not one of {', '.join(choices)} (got {text!r})")
        return text

    return parse


def parse_topics(text: str) -> tuple[str, ...]:
    """Return the listed tools. Raise ArgumentTypeError for an unknown one."""
    names = tuple(name.strip() for name in text.split(","))
    if not set(names) <= set(TOPICS):
        raise ArgumentTypeError(f"not some of {', '.join(TOPICS)} (got {text!r})")
    return names


def parse_seconds_or_none(text: str) -> float | str:
    """Return a positive number of seconds or `none`. Raise ArgumentTypeError for another text."""
    if text.strip() == NO_LIMIT:
        return NO_LIMIT
    try:
        return Seconds().parse_text(text)
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


def path_beside(source: Any, folder: Path) -> Any:
    """Return the path of a file relative to a folder, or any other value unchanged."""
    # Unlike `Path.is_file`, the function returns False for a YAML text that no file name can be
    return folder / source if isinstance(source, str | Path) and os.path.isfile(folder / source) else source


def check_values(name: str, option: str, value: Any, folder: Path) -> None:
    """Raise UsageError if the value of an option names an unknown extension or profile, or is not valid YAML.

    option  command-line or ini option, for the message
    folder  folder of relative paths
    """
    check = _CHECKS.get(name)
    if check is None or value is None:
        return
    try:
        check(option, value, folder)
    except InputError as error:
        messages = [_with_option(option, str(diagnostic)) for diagnostic in error.diagnostics]
        raise pytest.UsageError("\n".join(messages)) from None


def _with_option(option: str, message: str) -> str:
    return message if message.startswith(f"{option}: ") else f"{option}: {message}"


def _check_channels(option: str, value: list[str], folder: Path) -> None:
    """Check that profiles exist and that inline profiles are YAML; their settings are checked when a run loads them."""
    from eidrive_scenario.extensions.library import library_path, resolve
    from eidrive_scenario.files.yaml_text import load_yaml

    for channel in split_channels(",".join(value)):
        if "{" in channel:
            load_yaml(channel, source=option)
        elif channel != NO_COOPERATION and not (library_path() / "channels" / channel).is_file():
            resolve("channels", path_beside(channel, folder))


def _check_extension(group: str) -> Callable[[str, str, Path], None]:
    def check(option: str, value: str, folder: Path) -> None:
        from eidrive_scenario.extensions.registry import registry

        if value not in registry(group):
            raise SettingError(registry(group).unknown(value, source=option))

    return check


def _check_drive(option: str, value: list[str], folder: Path) -> None:
    from eidrive_scenario.files.yaml_text import read_yaml_source

    for stack in option_of("drive").form.parse(option, value).values():
        if stack is not None:
            read_yaml_source(path_beside(stack, folder), option=option)


def _check_criteria(option: str, value: list[str], folder: Path) -> None:
    from eidrive_scenario.evaluation.criteria_parser import declare_criteria
    from eidrive_scenario.files.yaml_text import read_yaml_source

    for text in value:
        content = read_yaml_source(path_beside(text, folder), option=option)
        shown = quoted(content.data)
        if "$" not in shown:  # the parameters of the scenario are not known yet
            declare_criteria(content.data, content.lines, source=content.source, shown=shown)


_CHECKS: dict[str, Callable[[str, Any, Path], None]] = {
    "channel": _check_channels,
    "detector": _check_extension("detectors"),
    "fusion": _check_extension("fusion"),
    "planner": _check_extension("planners"),
    "drive": _check_drive,
    "criterion": _check_criteria,
}

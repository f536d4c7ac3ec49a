"""Checks of the names and mappings in options, before the first test."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from eidrive_scenario.errors import InputError
from eidrive_scenario.pytest_plugin.option_values import split_channels
from eidrive_scenario.pytest_plugin.relative_paths import path_beside

_NO_COOPERATION = "none"


def check_values(name: str, place: str, value: Any, folder: Path) -> None:
    """Raise UsageError if the value of an option names an unknown extension or profile, or is not valid YAML.

    place   option or ini option, for the message
    folder  folder of relative paths
    """
    check = _CHECKS.get(name)
    if check is None or value is None:
        return
    try:
        check(place, value, folder)
    except InputError as error:
        raise pytest.UsageError("\n".join(_with_place(place, str(one)) for one in error.diagnostics)) from None


def _with_place(place: str, message: str) -> str:
    return message if message.startswith(f"{place}: ") else f"{place}: {message}"


def _check_channels(place: str, value: list[str], folder: Path) -> None:
    """Check that profiles exist and that inline profiles are YAML; their settings are checked when a run loads them."""
    from eidrive_scenario.files.yaml_text import load_yaml
    from eidrive_scenario.library import library_path, resolve

    for channel in split_channels(",".join(value)):
        if "{" in channel:
            load_yaml(channel, source=place)
        elif channel != _NO_COOPERATION and not (library_path() / "channels" / channel).is_file():
            resolve("channels", path_beside(channel, folder))


def _check_extension(group: str) -> Callable[[str, str, Path], None]:
    def check(place: str, value: str, folder: Path) -> None:
        from eidrive_scenario.errors import SettingError
        from eidrive_scenario.registry import registry

        if value not in registry(group):
            raise SettingError(registry(group).unknown(value, source=place))

    return check


def _check_drive(place: str, value: list[str], folder: Path) -> None:
    from eidrive_scenario.files.yaml_text import read_yaml_source
    from eidrive_scenario.simulation.added_settings import parse_drive

    for stack in parse_drive(place, value).values():
        if stack is not None:
            read_yaml_source(path_beside(stack, folder), option=place)


def _check_criteria(place: str, value: list[str], folder: Path) -> None:
    from eidrive_scenario.errors import quoted
    from eidrive_scenario.evaluation.criteria_parser import declare_criteria
    from eidrive_scenario.files.yaml_text import read_yaml_source

    for text in value:
        content = read_yaml_source(path_beside(text, folder), option=place)
        shown = quoted(content.data)
        if "$" not in shown:  # the parameters of the scenario are not known yet
            declare_criteria(content.data, content.lines, source=content.source, shown=shown)


_CHECKS: dict[str, Callable[[str, Any, Path], None]] = {
    "channel": _check_channels,
    "detector": _check_extension("detectors"),
    "planner": _check_extension("planners"),
    "drive": _check_drive,
    "criterion": _check_criteria,
}

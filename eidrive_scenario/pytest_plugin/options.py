"""Options of the plugin: one `--eidrive-NAME` and one ini option `eidrive_NAME` for each setting."""

from __future__ import annotations

import os
from argparse import ArgumentTypeError
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import pytest

from eidrive_scenario.pytest_plugin.option_values import (
    NO_LIMIT,
    WITHOUT_CRITERIA,
    check_values,
    parse_choice,
    parse_count,
    parse_count_or_all,
    parse_listed_channels,
    parse_rate,
    parse_seconds_or_none,
    parse_topics,
)
from eidrive_scenario.recording.run_files import RecordMode
from eidrive_scenario.run_options import OPTIONS as RUN_OPTIONS
from eidrive_scenario.run_options import Form, PytestForm, RunOption

RUNS = "runs"
"""Folder of the files of runs beside the report, without --eidrive-out."""
USUAL_LIMIT = 1800.0
"""Default wall limit of each run [s]."""
_DEFAULT_MAX_RUNS = 100
_HIDDEN = ("max_runs", "wall_limit")
"""Options that the header of a report omits."""
_SHOWN_LAST = ("seeds", "success_rate", "time_limit", "out", "record", "topics", "report")
"""Options at the end of this header."""
_EXCLUSIVE = ("seeds", "success_rate")
"""Options of which one place gives at most one."""
_EXCLUDE = " exclude each other (expected one of them)"
_OF_FILES = ("record", "topics")
"""Options that have an effect on kept files of runs only."""
_GIVEN = pytest.StashKey[tuple[Path, ...]]()
_INI = pytest.StashKey[dict[str, Any]]()
"""Parsed values of the ini options with a value, by name."""
_WORKER_KEY = "eidrive_given"
_INI_TYPES: dict[bool, Literal["linelist", "string"]] = {True: "linelist", False: "string"}


@dataclass(frozen=True)
class Option:
    """Option `--eidrive-NAME`, with the ini option `eidrive_NAME`.

    parse       returns the value of a text; raises ArgumentTypeError for an invalid one
    repeatable  given several times on the command line, one per line in the ini file
    combined    whether values of the command line are added to those of the ini file
    setting     field of RunSettings that it gives; "" for an option of the session
    """

    name: str
    metavar: str
    help: str
    parse: Callable[[str], Any] = Form().parse_text
    repeatable: bool = False
    combined: bool = False
    setting: str = ""

    @classmethod
    def of(cls, option: RunOption) -> Option:
        """Return the option of pytest of an option of a run."""
        given = option.pytest or PytestForm()
        text = given.help or f"{option.help[:1].lower()}{option.help[1:].rstrip('.')}"
        repeated = option.form.is_repeated
        metavar = given.metavar or option.metavar or "VALUE"
        return cls(
            given.name or option.name, metavar, text, option.form.parse_text, repeated, repeated, setting=option.name
        )

    @property
    def flag(self) -> str:
        """Option of the command line."""
        return f"--{self.key.replace('_', '-')}"

    @property
    def key(self) -> str:
        """Ini option."""
        return f"eidrive_{self.name}"


_OF_RUN = {option.name: Option.of(option) for option in RUN_OPTIONS if option.pytest is not None}
"""Options of pytest by the option of a run that they give."""

OPTIONS = (
    replace(_OF_RUN.pop("channel"), parse=parse_listed_channels, repeatable=True),
    Option("seeds", "N", "run each scenario with the seeds 1 to N (default: 1)", parse_count),
    Option(
        "success_rate",
        "RATE",
        "run each scenario with the seeds 1, 2, 3 … until they show whether its success rate is at least RATE with a "
        "confidence of 95 %%; a test is undecided and fails after 500 runs",
        parse_rate,
    ),
    _OF_RUN.pop("drive"),
    _OF_RUN.pop("criteria"),
    Option(
        "without_criteria",
        "error|warn|pass",
        "outcome of a run that no criterion judges: an error of the test, a warning, or neither (default: error)",
        parse_choice(WITHOUT_CRITERIA),
    ),
    _OF_RUN.pop("detector"),
    _OF_RUN.pop("fusion"),
    _OF_RUN.pop("planner"),
    Option(
        "max_runs",
        "N|all",
        f"maximum runs of a distribution, spread over its values (default: {_DEFAULT_MAX_RUNS})",
        parse_count_or_all,
    ),
    Option("out", "DIR", "keep recording.mcap and result.json of every run below DIR"),
    Option(
        "record",
        "always|on-failure|never",
        "runs whose recording and camera images --eidrive-out keeps (default: always)",
        parse_choice(tuple(RecordMode)),
    ),
    Option(
        "topics",
        "A,B",
        "tools whose topics the recordings get, too: foxglove, osi; needs the extra `export`",
        parse_topics,
    ),
    Option(
        "report",
        "FILE|DIR",
        "write the page of `eidrive report` about the runs of the session, with a replay of each recorded run; without "
        "--eidrive-out their files are kept in the folder `runs` beside it",
    ),
    *_OF_RUN.values(),
    Option(
        "wall_limit",
        "SECONDS|none",
        f"maximum wall time of each run; an error if reached (default: {USUAL_LIMIT:g})",
        parse_seconds_or_none,
    ),
)


def add_options(parser: pytest.Parser) -> None:
    """Add the options `--eidrive-…` and the ini options."""
    group = parser.getgroup("eidrive", "OpenSCENARIO files")
    for option in OPTIONS:
        group.addoption(
            option.flag,
            metavar=option.metavar,
            action="append" if option.repeatable else "store",
            type=option.parse,
            help=f"{option.help}; ini option: {option.key}",
        )
        several = ", one per line" if option.repeatable else ""
        parser.addini(
            option.key,
            f"value of {option.flag} without that option{several}",
            type=_INI_TYPES[option.repeatable],
            default=None,
        )
    parser.addini(
        "eidrive_paths",
        "folders whose .xosc files are tests (default: folders of the command line)",
        type="paths",
        default=None,
    )


def read_options(config: pytest.Config) -> None:
    """Check the values of all options, and store the paths of the command line. Raise UsageError."""
    config.stash[_INI] = {option.name: value for option in OPTIONS if (value := _ini_value(config, option)) is not None}
    config.stash[_GIVEN] = _given(config)
    _check_exclusive(config)
    for name in _OF_FILES:
        if command_line_value(config, name) is not None and runs_folder(config) is None:
            raise pytest.UsageError(
                f"--eidrive-{name} without --eidrive-out has no effect (expected --eidrive-out DIR)"
            )
    if not hasattr(config, "workerinput"):  # its controller has checked them
        for option in OPTIONS:
            check_values(option.name, option.flag, command_line_value(config, option.name), Path())
            listed = config.stash[_INI].get(option.name)
            check_values(option.name, f"ini option {option.key}", listed, config.rootpath)
        for folder in config.getini("eidrive_paths") or ():
            if not folder.exists():
                raise pytest.UsageError(f"ini option eidrive_paths: no folder '{folder}'; quote a path with spaces")


def send_paths(node: Any) -> None:
    """Send the paths of the command line to a worker of pytest-xdist, whose own arguments omit them."""
    node.workerinput[_WORKER_KEY] = [str(path) for path in node.config.stash[_GIVEN]]


def _check_exclusive(config: pytest.Config) -> None:
    """Raise UsageError if the command line or the ini file gives a number of seeds beside a success rate."""
    if all(command_line_value(config, name) is not None for name in _EXCLUSIVE):
        raise pytest.UsageError(" and ".join(f"--eidrive-{name.replace('_', '-')}" for name in _EXCLUSIVE) + _EXCLUDE)
    if all(name in config.stash[_INI] for name in _EXCLUSIVE):
        raise pytest.UsageError("ini options " + " and ".join(f"eidrive_{name}" for name in _EXCLUSIVE) + _EXCLUDE)


def _ini_value(config: pytest.Config, option: Option) -> Any:
    """Return the parsed value of an ini option; None without a value, and if the command line replaces it.

    Raise UsageError for an invalid value.
    """
    if not option.combined and command_line_value(config, option.name) is not None:
        return None
    given = config.getini(option.key)
    texts = [str(text) for text in (given if isinstance(given, list) else [given])] if given is not None else []
    try:
        values = [option.parse(text.strip()) for text in texts if text.strip()]
    except ArgumentTypeError as error:
        raise pytest.UsageError(f"ini option {option.key}: {error}") from None
    return (values if option.repeatable else values[0]) if values else None


def command_line_value(config: pytest.Config, name: str) -> Any:
    """Return the value of an option on the command line, or None; a list for a repeatable option."""
    return config.getoption(f"eidrive_{name}")


def listed_value(config: pytest.Config, name: str) -> list[str]:
    """Return the values of the ini option of a repeatable option."""
    return list(config.stash[_INI].get(name, ()))


def option_value(config: pytest.Config, name: str) -> Any:
    """Return the value of an option: of the command line, else of the ini option, else None."""
    given = command_line_value(config, name)
    return config.stash[_INI].get(name) if given is None else given


def max_runs(config: pytest.Config) -> int | None:
    """Return the maximum number of runs of a distribution, or None for all."""
    given = option_value(config, "max_runs")
    return None if given == "all" else given or _DEFAULT_MAX_RUNS


def wall_limit(config: pytest.Config) -> float | None:
    """Return the limit of the wall time of each run [s], or None."""
    given = option_value(config, "wall_limit")
    return None if given == NO_LIMIT else given or USUAL_LIMIT


def path_value(config: pytest.Config, name: str) -> Path | None:
    """Return the path of an option: relative to the current folder, that of an ini option to the root."""
    if (given := command_line_value(config, name)) is not None:
        return Path(config.invocation_params.dir, given)
    listed = option_value(config, name)
    return None if listed is None else config.rootpath / listed


def runs_folder(config: pytest.Config) -> Path | None:
    """Return the folder below which the files of runs are kept, or None."""
    below = path_value(config, "out")
    if below is not None:
        return below
    page = path_value(config, "report")
    return None if page is None else (page.parent if page.suffix == ".html" else page) / RUNS


def pytest_report_header(config: pytest.Config) -> str | None:
    """Return the options with a value, or None."""
    names = dict.fromkeys([*(option.name for option in OPTIONS if option.name not in _SHOWN_LAST), *_SHOWN_LAST])
    values = {name: option_value(config, name) for name in names if name not in _HIDDEN}
    given = [f"{name} {_shown(value)}" for name, value in values.items() if value is not None]
    return f"eidrive: {', '.join(given)}" if given else None


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return ",".join(value)
    if isinstance(value, float):
        return f"{value:g}"
    return f"{value.bad:g}" if hasattr(value, "bad") else str(value)


def is_selected(config: pytest.Config, path: Path) -> bool:
    """Whether a scenario file becomes tests.

    A file on the command line is always selected. Other files are selected by the folders of the ini option
    `eidrive_paths`, or without that option by the folders of the command line.
    """
    given = config.stash[_GIVEN]
    if path in given:
        return True
    listed = config.getini("eidrive_paths")
    return any(path.is_relative_to(folder) for folder in (given if listed is None else listed))


def _given(config: pytest.Config) -> tuple[Path, ...]:
    """Return files and folders of the command line; a worker of pytest-xdist receives them from its controller."""
    if hasattr(config, "workerinput"):
        return tuple(map(Path, config.workerinput[_WORKER_KEY]))
    if config.args_source is not pytest.Config.ArgsSource.ARGS:
        return ()
    paths = (Path(config.invocation_params.dir, argument.split("::")[0]) for argument in config.args)
    return tuple(Path(os.path.abspath(path)) for path in paths)  # as pytest, which does not resolve links

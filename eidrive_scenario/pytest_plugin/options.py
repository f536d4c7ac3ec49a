"""Options of the plugin, and the runs of a scenario that they select."""

from __future__ import annotations

import re
from argparse import ArgumentTypeError
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from eidrive_scenario.pytest_plugin import hung_runs

MARKER = (
    "scenario(pattern, channel=None, seeds=None, success_rate=None, drive=None, criteria=None): run the test once for "
    "every scenario that matches the pattern (beside the test file, below the root, or in the library), channel and "
    "seed, through the fixture run_scenario; success_rate: run seeds until a sequential test decides; drive and "
    "criteria are those of RunSettings"
)
_DEFAULT_MAX_RUNS = 100
_MAX_LENGTH = 80
"""Maximum number of characters of a channel in the name of a test."""
_SHOWN = ("channel", "drive", "criterion", "detector", "planner", "seeds", "success_rate", "out")
"""Options that the header of a report lists."""
_GIVEN = pytest.StashKey[tuple[Path, ...]]()
_WORKER_KEY = "eidrive_given"


@dataclass(frozen=True)
class MarkerSettings:
    """Settings `drive` and `criteria` of a marker, as in RunSettings."""

    drive: Any = None
    criteria: Any = None

    @property
    def driven(self) -> list[str]:
        """Names of the entities that get a driving stack."""
        names = [self.drive] if isinstance(self.drive, str) else self.drive
        return [name for name in names if isinstance(name, str)] if isinstance(names, Iterable) else []


_NOTHING = MarkerSettings()


@dataclass(frozen=True)
class RunVariant:
    """Channel and seed of one run of a scenario; the channel None is the channel of the file.

    replaced  warnings about options that replace lists of the marker of the test
    label     channel in the name of the test, if its short name is not unique
    added     driving stacks and criteria of the marker of the test
    rate      sequential test of the success rate over seeds, a RatioTest; None for a single run
    """

    channel: str | None
    seed: int
    replaced: tuple[str, ...] = ()
    label: str = ""
    added: MarkerSettings = _NOTHING
    rate: Any = None

    def __str__(self) -> str:
        channel = [] if self.channel is None else [self.label or _short(self.channel)]
        return "-".join([*channel, f"seed{self.seed}" if self.rate is None else f"rate{self.rate.bad:g}"])


def _short(channel: str) -> str:
    """Return the name of a profile without folder and suffix, or an inline profile with characters of a file name."""
    return re.sub(r"[^\w.]+", "_", channel).strip("_")[:_MAX_LENGTH] if "{" in channel else Path(channel).stem


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options `--eidrive-…` and the ini option `eidrive_paths`."""
    group = parser.getgroup("eidrive", "OpenSCENARIO files")
    group.addoption(
        "--eidrive-channel",
        metavar="A,B",
        action="append",
        type=_listed_channels,
        help="run each scenario with each of these channel profiles (default: the file's own); none: no cooperation; "
        "repeatable",
    )
    group.addoption(
        "--eidrive-seeds", metavar="N", type=_count, help="run each scenario with the seeds 1 to N (default: 1)"
    )
    group.addoption(
        "--eidrive-success-rate",
        metavar="RATE",
        type=_rate,
        help="run each scenario with the seeds 1, 2, 3 … until they show whether its success rate is at least RATE "
        "with a confidence of 95 %%; a test is undecided and fails after 500 runs",
    )
    group.addoption(
        "--eidrive-drive",
        metavar="NAME[=STACK]",
        action="append",
        type=_entity,
        help="give entity NAME a driving stack, with the properties in a YAML file or mapping STACK; repeatable",
    )
    group.addoption(
        "--eidrive-criterion",
        metavar="YAML|FILE",
        action="append",
        help="add criteria to those of each scenario, such as '{collision: {of: Ego}}', or those of a file; repeatable",
    )
    group.addoption("--eidrive-detector", metavar="NAME", help="detector of all stations (default: the file's own)")
    group.addoption(
        "--eidrive-planner", metavar="NAME", help="planner of all driven stations (default: the file's own)"
    )
    group.addoption(
        "--eidrive-max-runs",
        metavar="N|all",
        type=_count_or_all,
        default=_DEFAULT_MAX_RUNS,
        help=f"maximum runs of a distribution, spread over its values (default: {_DEFAULT_MAX_RUNS})",
    )
    group.addoption("--eidrive-out", metavar="DIR", help="keep recording.mcap and result.json of every run below DIR")
    hung_runs.pytest_addoption(parser)
    parser.addini("eidrive_drive", "values of --eidrive-drive for all scenarios, one per line", type="linelist")
    parser.addini("eidrive_criteria", "values of --eidrive-criterion for all scenarios, one per line", type="linelist")
    parser.addini(
        "eidrive_paths",
        "folders whose .xosc files are tests (default: folders of the command line)",
        type="paths",
        default=None,
    )


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise ArgumentTypeError(f"not a positive integer (got {text!r})")
    return int(text)


def _rate(text: str) -> Any:
    """Return the test of a success rate."""
    from eidrive_scenario.experiments.statistics.sequential import success_rate

    try:
        return success_rate(float(text))
    except ValueError as error:
        raise ArgumentTypeError(f"not a rate between 0 and 1 (got {text!r})") from error


def _count_or_all(text: str) -> int | None:
    return None if text == "all" else _count(text)


def _entity(text: str) -> str:
    """Return the text of an option with an entity, and a stack after an equals sign."""
    name, equals, stack = text.partition("=")
    if not name.strip() or (equals and not stack.strip()):
        raise ArgumentTypeError(f"no entity or stack is given (got {text!r})")
    return text


def _listed_channels(text: str) -> str:
    """Return the text of an option with at least one channel."""
    if not _channels(text):
        raise ArgumentTypeError(f"no channel is listed (got {text!r})")
    return text


def _channels(text: str) -> list[str]:
    """Split a text at commas outside of braces and brackets, without empty and duplicate parts."""
    parts, depth = [""], 0
    for character in text:
        depth += (character in "{[") - (character in "}]")
        if character == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return [name for name in dict.fromkeys(part.strip() for part in parts) if name]


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker and store the paths of the command line."""
    config.addinivalue_line("markers", MARKER)
    config.stash[_GIVEN] = _given(config)
    hung_runs.pytest_configure(config)


def pytest_report_header(config: pytest.Config) -> str | None:
    """Return the options with a value, or None."""
    options = {name: config.getoption(f"eidrive_{name}") for name in _SHOWN}
    options = {name: ",".join(value) if isinstance(value, list) else value for name, value in options.items()}
    if options["success_rate"] is not None:
        options["success_rate"] = f"{options['success_rate'].bad:g}"
    given = [f"{name} {value}" for name, value in options.items() if value is not None]
    return f"eidrive: {', '.join(given)}" if given else None


def run_variants(
    config: pytest.Config,
    channels: Sequence[str] | None = None,
    seeds: int | None = None,
    added: MarkerSettings = _NOTHING,
    rate: Any = None,
) -> Iterator[RunVariant]:
    """Yield every channel with every seed, or once with a sequential test of the success rate.

    The command line overrides `channels`, `seeds` and `rate` of the marker.
    """
    given = config.getoption("eidrive_channel")
    names: Sequence[str | None] = _channels(",".join(given)) if given else []
    option = config.getoption("eidrive_seeds")
    replaced = []
    if names and channels is not None and list(names) != list(channels):
        listed = ", ".join(map(repr, channels))
        replaced.append(f"--eidrive-channel {','.join(map(str, names))} replaces the marker's channel=[{listed}]")
    if option and seeds is not None and option != seeds:
        replaced.append(f"--eidrive-seeds {option} replaces the marker's seeds={seeds}")
    driven = [text.partition("=")[0].strip() for text in config.getoption("eidrive_drive") or ()]
    for name in driven:
        if name in added.driven:
            replaced.append(f"--eidrive-drive {name} replaces the driving stack of {name!r} in the marker")
    chosen = names or channels or (None,)
    tested = config.getoption("eidrive_success_rate") or rate
    for channel, label in zip(chosen, _labels(chosen), strict=True):
        if tested is not None:
            yield RunVariant(channel, 1, tuple(replaced), label, added, tested)
            continue
        for seed in range(1, (option or seeds or 1) + 1):
            yield RunVariant(channel, seed, tuple(replaced), label, added)


def _labels(channels: Sequence[str | None]) -> list[str]:
    """Return unique labels: profiles of two folders may have equal names, and long profiles equal beginnings."""
    labels: list[str] = []
    for channel in channels:
        name = label = "" if channel is None else _short(channel)
        number = 1
        while label in labels:
            number += 1
            label = f"{name}_{number}"
        labels.append(label)
    return labels


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
    return tuple(Path(config.invocation_params.dir, argument.split("::")[0]).resolve() for argument in config.args)


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Send the paths of the command line to a worker of pytest-xdist, whose own arguments omit them."""
    hung_runs.pytest_configure_node(node)
    node.workerinput[_WORKER_KEY] = [str(path) for path in node.config.stash[_GIVEN]]

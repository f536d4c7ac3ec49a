"""Options of the plugin, and what they mean for the runs of one scenario."""

from __future__ import annotations

import re
from argparse import ArgumentTypeError
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from eidrive_scenario.pytest_plugin import hung_runs

MARKER = (
    "scenario(pattern, channel=None, seeds=None): run the test once for every scenario that matches the pattern "
    "(beside the test file, below the root, or in the library), channel and seed, through the fixture run_scenario"
)
_MOST_RUNS = 100
_LONGEST = 80
"""Characters of a channel in the name of a test."""
_GIVEN = pytest.StashKey[tuple[Path, ...]]()
_WORKER_KEY = "eidrive_given"


@dataclass(frozen=True)
class RunVariant:
    """One way to run a scenario; the channel None is the one that the file itself names.

    replaced  warnings of options that replaced what the marker of the test lists
    label     channel in the name of the test, where its own short name is that of another channel too
    """

    channel: str | None
    seed: int
    replaced: tuple[str, ...] = ()
    label: str = ""

    def __str__(self) -> str:
        channel = [] if self.channel is None else [self.label or _short(self.channel)]
        return "-".join([*channel, f"seed{self.seed}"])


def _short(channel: str) -> str:
    """A profile's name without folder and suffix; one that is written out, in words that fit a file's name."""
    return re.sub(r"[^\w.]+", "_", channel).strip("_")[:_LONGEST] if "{" in channel else Path(channel).stem


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options `--eidrive-…` and the ini option `eidrive_paths`."""
    group = parser.getgroup("eidrive", "OpenSCENARIO files")
    group.addoption(
        "--eidrive-channel",
        metavar="A,B",
        action="append",
        help="run each scenario with each of these channel profiles (default: the file's own); none: no cooperation; "
        "may be given several times",
    )
    group.addoption(
        "--eidrive-seeds", metavar="N", type=_count, help="run each scenario with the seeds 1 to N (default: 1)"
    )
    group.addoption("--eidrive-detector", metavar="NAME", help="detector of all stations (default: the file's own)")
    group.addoption(
        "--eidrive-max-runs",
        metavar="N|all",
        type=_count_or_all,
        default=_MOST_RUNS,
        help=f"most runs of a distribution that become tests, spread over its values (default: {_MOST_RUNS})",
    )
    group.addoption("--eidrive-out", metavar="DIR", help="keep recording.mcap and result.json of every run below DIR")
    hung_runs.pytest_addoption(parser)
    parser.addini(
        "eidrive_paths",
        "folders whose .xosc files are tests (default: those given on the command line)",
        type="paths",
        default=None,
    )


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise ArgumentTypeError(f"{text!r} is no number from 1 on")
    return int(text)


def _count_or_all(text: str) -> int | None:
    return None if text == "all" else _count(text)


def _channels(text: str) -> list[str]:
    """What stands between the commas, but for those within braces; each once."""
    parts, depth = [""], 0
    for sign in text:
        depth += (sign in "{[") - (sign in "}]")
        if sign == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += sign
    return [name for name in dict.fromkeys(part.strip() for part in parts) if name]


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker; note what was named on the command line."""
    config.addinivalue_line("markers", MARKER)
    config.stash[_GIVEN] = _given(config)
    hung_runs.pytest_configure(config)


def pytest_report_header(config: pytest.Config) -> str | None:
    """Say what the options ask for, where they ask for something."""
    options = {name: config.getoption(f"eidrive_{name}") for name in ("channel", "detector", "seeds", "out")}
    options["channel"] = ",".join(options["channel"]) if options["channel"] is not None else None
    asked = [f"{name} {value}" for name, value in options.items() if value is not None]
    return f"eidrive: {', '.join(asked)}" if asked else None


def arms(
    config: pytest.Config, channels: Sequence[str] | None = None, seeds: int | None = None
) -> Iterator[RunVariant]:
    """Every channel with every seed; the command line wins over `channels` and `seeds`, those of the marker."""
    given = config.getoption("eidrive_channel")
    names: Sequence[str | None] = _channels(",".join(given)) if given else []
    option = config.getoption("eidrive_seeds")
    replaced = []
    if names and channels is not None and list(names) != list(channels):
        listed = ", ".join(map(repr, channels))
        replaced.append(f"--eidrive-channel {','.join(map(str, names))} replaces the marker's channel=[{listed}]")
    if option and seeds is not None and option != seeds:
        replaced.append(f"--eidrive-seeds {option} replaces the marker's seeds={seeds}")
    chosen = names or channels or (None,)
    for channel, label in zip(chosen, _labels(chosen), strict=True):
        for seed in range(1, (option or seeds or 1) + 1):
            yield RunVariant(channel, seed, tuple(replaced), label)


def _labels(channels: Sequence[str | None]) -> list[str]:
    """A name of its own for each channel: profiles of two folders may have one name, and long ones one beginning."""
    labels: list[str] = []
    for channel in channels:
        name = label = "" if channel is None else _short(channel)
        number = 1
        while label in labels:
            number += 1
            label = f"{name}_{number}"
        labels.append(label)
    return labels


def wanted(config: pytest.Config, path: Path) -> bool:
    """Whether a scenario file is to become tests.

    One that is named itself always is. One in a folder is where the ini option `eidrive_paths` lists the folder or one
    above; where the project does not set that option, where the folder or one above was given on the command line.
    """
    given = config.stash[_GIVEN]
    if path in given:
        return True
    listed = config.getini("eidrive_paths")
    return any(path.is_relative_to(folder) for folder in (given if listed is None else listed))


def _given(config: pytest.Config) -> tuple[Path, ...]:
    """Files and folders that were named on the command line; a worker of pytest-xdist asks its controller."""
    if hasattr(config, "workerinput"):
        return tuple(map(Path, config.workerinput[_WORKER_KEY]))
    if config.args_source is not pytest.Config.ArgsSource.ARGS:
        return ()
    return tuple(Path(config.invocation_params.dir, argument.split("::")[0]).resolve() for argument in config.args)


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Tell a worker of pytest-xdist what was named on the command line: its own arguments do not say."""
    hung_runs.pytest_configure_node(node)
    node.workerinput[_WORKER_KEY] = [str(path) for path in node.config.stash[_GIVEN]]

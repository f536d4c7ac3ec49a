"""Runs of a scenario that options and markers select, and their part of the test name."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from eidrive_scenario.pytest_plugin.option_values import split_channels
from eidrive_scenario.pytest_plugin.options import command_line_value, listed_value, option_value
from eidrive_scenario.run_options import OPTIONS

_MAX_LENGTH = 80
"""Maximum number of characters of a channel in the name of a test."""
_NAMED = tuple(option.name for option in OPTIONS if option.pytest is not None and option.pytest.is_named)
"""Options with one value that the name of a test contains."""


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
    options   detector, fusion method and planner of options, by name
    """

    channel: str | None
    seed: int
    replaced: tuple[str, ...] = ()
    label: str = ""
    added: MarkerSettings = _NOTHING
    rate: Any = None
    options: Mapping[str, str] = field(default_factory=dict)

    @property
    def selectors(self) -> dict[str, str | int]:
        """Settings of the run by name, as in the name of the test."""
        channel = {} if self.channel is None else {"channel": self.label or _short(self.channel)}
        last: dict[str, str | int] = {"seed": self.seed} if self.rate is None else {"rate": f"{self.rate.bad:g}"}
        return {**channel, **self.options, **last}

    def __str__(self) -> str:
        return "-".join(f"{name}={value}" for name, value in self.selectors.items())


def _short(channel: str) -> str:
    """Return the name of a profile without folder and suffix, or an inline profile with characters of a file name."""
    name = channel if "{" in channel else Path(channel).stem
    return re.sub(r"[^\w.]+", "_", name).strip("_")[:_MAX_LENGTH]


def run_variants(
    config: pytest.Config,
    channels: Sequence[str] | None = None,
    seeds: int | None = None,
    added: MarkerSettings = _NOTHING,
    rate: Any = None,
) -> Iterator[RunVariant]:
    """Yield every channel with every seed, or once with a sequential test of the success rate.

    The command line overrides `channels`, `seeds` and `rate` of the marker, and these override the ini options.
    """
    given = command_line_value(config, "channel")
    names: Sequence[str | None] = split_channels(",".join(given)) if given else []
    option = command_line_value(config, "seeds")
    replaced = []
    if names and channels is not None and list(names) != list(channels):
        listed = ", ".join(map(repr, channels))
        replaced.append(f"--eidrive-channel {','.join(map(str, names))} replaces the marker's channel=[{listed}]")
    if option and seeds is not None and option != seeds:
        replaced.append(f"--eidrive-seeds {option} replaces the marker's seeds={seeds}")
    if option and rate is not None:
        replaced.append(f"--eidrive-seeds {option} replaces the marker's success_rate")
    driven = [text.partition("=")[0].strip() for text in command_line_value(config, "drive") or ()]
    for name in driven:
        if name in added.driven:
            replaced.append(f"--eidrive-drive {name} replaces the driving stack of {name!r} in the marker")
    chosen = names or channels or split_channels(",".join(listed_value(config, "channel"))) or (None,)
    number = option or seeds or option_value(config, "seeds") or 1
    tested = command_line_value(config, "success_rate") or (None if option else rate)
    if tested is None and option is None and seeds is None:
        tested = option_value(config, "success_rate")
    named = {name: _short(value) for name in _NAMED if (value := option_value(config, name)) is not None}
    for channel, label in zip(chosen, _labels(chosen), strict=True):
        for seed in range(1, 2 if tested is not None else number + 1):
            yield RunVariant(channel, seed, tuple(replaced), label, added, tested, named)


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

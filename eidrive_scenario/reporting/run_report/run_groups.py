"""Groups of runs of a report, by all settings in which they differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from eidrive_scenario.reporting.run_report.reported_run import ReportedRun
from eidrive_scenario.reporting.run_report.settings_text import channel_text, flatten, shorten

_LEFT_OUT = ("seed", "run", "drawn", "varied", "scenario", "channel", "detector", "planner", "cooperate")
"""Settings that differ within a group, and options that the settings of channel and stations contain."""
_NAMES = ("channel_profile.name", "channel_profile.description")
_SHOWN = 200
"""Maximum number of characters of a value in a heading."""


@dataclass(frozen=True)
class RunGroup:
    """Runs with equal settings, except for the seed and values derived from it.

    differing  values of the settings in which the groups of this scenario differ
    content    content of the channel
    """

    scenario: str
    channel: str
    differing: Mapping[str, str]
    content: str
    runs: tuple[ReportedRun, ...]

    @property
    def distinct(self) -> tuple[ReportedRun, ...]:
        """Runs for statistics: a run in several folders counts once."""
        found: dict[object, ReportedRun] = {}
        for index, run in enumerate(self.runs):
            found.setdefault((run.settings_sha256, run.trace_hash) if run.settings_sha256 else index, run)
        return tuple(found.values())


def group_runs(runs: Sequence[ReportedRun]) -> list[RunGroup]:
    """Return groups ordered by scenario, channel and settings, each with its runs ordered by number and seed."""
    by_scenario: dict[str, list[ReportedRun]] = {}
    for run in sorted(runs, key=lambda run: (run.scenario, run.channel, run.run or 0, run.seed)):
        by_scenario.setdefault(run.scenario, []).append(run)
    groups: list[RunGroup] = []
    for scenario, members in by_scenario.items():
        groups += _groups_of(scenario, members)
    return groups


def _groups_of(scenario: str, runs: Sequence[ReportedRun]) -> list[RunGroup]:
    settings = [_comparable(run) for run in runs]
    names = dict.fromkeys(name for one in settings for name in one)
    differing = [name for name in names if len({one.get(name, "") for one in settings}) > 1]
    found: dict[tuple[str, ...], list[ReportedRun]] = {}
    for run, one in zip(runs, settings, strict=True):
        found.setdefault((run.channel, *(one.get(name, "") for name in differing)), []).append(run)
    return [
        RunGroup(
            scenario,
            channel,
            {
                name.replace("channel_profile.", "channel."): shorten(value, _SHOWN)
                for name, value in zip(differing, values, strict=True)
                if value and name not in _NAMES
            },
            channel_text(members[0].settings),
            tuple(members),
        )
        for (channel, *values), members in found.items()
    ]


def _comparable(run: ReportedRun) -> dict[str, str]:
    """Return the settings of a run that its group shares, by path."""
    settings: dict[str, Any] = {key: value for key, value in run.settings.items() if key not in _LEFT_OUT}
    own = {name for key in ("drawn", "varied") for name in _names(run.settings.get(key))}
    if isinstance(settings.get("parameters"), Mapping):
        settings["parameters"] = {name: value for name, value in settings["parameters"].items() if name not in own}
    if isinstance(settings.get("files"), list):
        settings["files"] = _files(settings["files"])
    return flatten(settings)


def _files(files: Sequence[Any]) -> dict[str, Any]:
    """Return the digests of files by role and name."""
    return {
        f"{entry.get('role')} {entry.get('name')}": str(entry.get("sha256"))[:12]
        for entry in files
        if isinstance(entry, Mapping)
    }


def _names(value: Any) -> list[str]:
    return [str(name) for name in value] if isinstance(value, list | tuple) else []

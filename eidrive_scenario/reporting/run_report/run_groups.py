"""Groups of runs of a report, by all settings in which they differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from eidrive_scenario.experiments.reported_run import ReportedRun
from eidrive_scenario.experiments.sweeps.axes import PARAMETER, is_setting
from eidrive_scenario.reporting.run_report.settings_text import channel_text, flatten, flow_text, shorten
from eidrive_scenario.run_options import OPTIONS

_LEFT_OUT = {"seed", "run", "strings", "drawn", "varied", "scenario"} | {
    option.name for option in OPTIONS if option.detail in ("channel_profile", "stations")
}
"""Settings that differ within a group, and options that the settings of channel and stations contain."""
_NAMES = ("channel_profile.name", "channel_profile.description", "channel_profile")
"""Settings that the name of the channel states."""
_EMPTY = ("", "[]", "{}", "null")
"""Texts of settings without a value, which headings omit."""
_OPTIONS = [option.name for option in OPTIONS if option.detail and option.name != "channel"]
"""Options of a run that change many of its settings; the channel is in each heading."""
_SCENARIO_FILE = "files.scenario "
"""Start of the path of the digest of a scenario file, which no axis and no number of a run changes."""
_SHOWN = 200
"""Maximum number of characters of a value in a heading."""


@dataclass(frozen=True)
class RunGroup:
    """Runs with equal settings, except for the seed and values derived from it.

    differing  values of the settings in which the groups of this scenario differ; only those of options and of axes
               of a sweep if they distinguish the groups
    content    content of the channel
    axes       axes of a sweep with numbers, whose values differ within the group
    """

    scenario: str
    channel: str
    differing: Mapping[str, str]
    content: str
    runs: tuple[ReportedRun, ...]
    axes: tuple[str, ...] = ()

    @property
    def varied(self) -> tuple[str, ...]:
        """Axes of a sweep with numbers, or parameters of a distribution, whose values differ."""
        names = dict.fromkeys(self.axes)
        for run in self.runs:
            if run.run is not None:
                names.update(dict.fromkeys(_names(run.settings.get("varied")) or run.parameters))
        return tuple(name for name in names if len({run.value_of(name) for run in self.runs}) > 1)

    @property
    def numbers(self) -> tuple[str, ...]:
        """Those of `varied` whose values are numbers."""
        return tuple(
            name for name in self.varied if all(isinstance(run.value_of(name), int | float) for run in self.runs)
        )


def run_key(run: ReportedRun, index: int) -> object:
    """Return a key that copies of a run have in common: its index if its settings are unknown."""
    return (run.settings_sha256, run.trace_hash) if run.settings_sha256 else index


def distinct_runs(runs: Sequence[ReportedRun]) -> list[ReportedRun]:
    """Return runs each once, whether it is in several folders or in the store and the folder of a sweep.

    It is the first one of a sweep, or the first with a replay, else the first.
    """
    distinct: dict[object, ReportedRun] = {}
    for index, run in enumerate(runs):
        key = run_key(run, index)
        kept = distinct.setdefault(key, run)
        if (run.is_swept, bool(run.replay)) > (kept.is_swept, bool(kept.replay)):
            distinct[key] = run if run.replay else run.model_copy(update={"replay": kept.replay})
    return list(distinct.values())


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
    axes = _numeric_axes(runs)
    settings = [_comparable(run, axes) for run in runs]
    names = dict.fromkeys(name for of_run in settings for name in of_run)
    values = {name: [of_run.get(name, "") for of_run in settings] for name in names}
    differing = [
        name
        for name in names
        if len(set(values[name])) > 1
        and (name.startswith(_SCENARIO_FILE) or not _depends_on_axes(values[name], runs, axes))
    ]
    grouped: dict[tuple[str, ...], list[ReportedRun]] = {}
    for run, of_run in zip(runs, settings, strict=True):
        grouped.setdefault((run.channel, *(of_run.get(name, "") for name in differing)), []).append(run)
    chosen = _differing_options([(channel, members[0]) for (channel, *_), members in grouped.items()])
    short = len({(key[0], *options.items()) for key, options in zip(grouped, chosen, strict=True)}) == len(grouped)
    groups = []
    for ((channel, *of_group), members), options in zip(grouped.items(), chosen, strict=True):
        others = {
            name.replace("channel_profile.", "channel."): shorten(value, _SHOWN)
            for name, value in zip(differing, of_group, strict=True)
            if value not in _EMPTY and name not in _NAMES and name not in options
        }
        content = channel_text(*(run.settings for run in members))
        groups.append(RunGroup(scenario, channel, options | ({} if short else others), content, tuple(members), axes))
    return groups


def _depends_on_axes(values: Sequence[str], runs: Sequence[ReportedRun], axes: Sequence[str]) -> bool:
    """Whether the values of a setting follow from the axes with numbers, or from the number of the run.

    Examples are a parameter that is an expression of another one, and a property with the value `$name`. The values
    change along the axes within a sweep, and other sweeps have the same value at the same point.
    """
    at_point: dict[object, str] = {}
    in_sweep: dict[object, set[str]] = {}
    for run, value in zip(runs, values, strict=True):
        texts = tuple(sorted((name, text) for name, text in run.axes.items() if name not in axes))
        numbers = run.run, *(run.axes.get(name) for name in axes)
        if at_point.setdefault((texts, numbers), value) != value:
            return False
        in_sweep.setdefault((run.sweep, texts), set()).add(value)
    return any(len(distinct) > 1 for distinct in in_sweep.values())


def _differing_options(first: Sequence[tuple[str, ReportedRun]]) -> list[dict[str, str]]:
    """Return the options and text axes in which groups differ, by the channel and the first run of each."""
    options = []
    for channel, run in first:
        given = {name: text for name in _OPTIONS if (text := flow_text(run.settings.get(name, []))) not in _EMPTY}
        swept = {name: value for name, value in run.axes.items() if isinstance(value, str) and value != channel}
        options.append({**given, **swept})
    names = dict.fromkeys(name for of_group in options for name in of_group)
    differing = [name for name in names if len({of_group.get(name, "") for of_group in options}) > 1]
    return [{name: shorten(of_group[name], _SHOWN) for name in differing if name in of_group} for of_group in options]


def _numeric_axes(runs: Sequence[ReportedRun]) -> tuple[str, ...]:
    """Return the axes of sweeps over several numbers."""
    values: dict[str, set[object]] = {}
    for run in runs:
        for name, value in run.axes.items():
            values.setdefault(name, set()).add(value)
    return tuple(
        name
        for name, distinct in values.items()
        if len(distinct) > 1 and all(isinstance(value, int | float) for value in distinct)
    )


def _comparable(run: ReportedRun, axes: Sequence[str] = ()) -> dict[str, str]:
    """Return the settings of a run that its group shares, by path: without those of its axes with numbers."""
    settings: dict[str, Any] = {key: value for key, value in run.settings.items() if key not in _LEFT_OUT}
    swept = {name.removeprefix(PARAMETER) for name in axes if name in run.axes}
    own = {name for key in ("drawn", "varied") for name in _names(run.settings.get(key))} | swept
    if isinstance(settings.get("parameters"), Mapping):
        settings["parameters"] = {name: value for name, value in settings["parameters"].items() if name not in own}
    if isinstance(settings.get("files"), list):
        # The digests of files by role and name
        files = settings["files"]
        settings["files"] = {
            f"{entry.get('role')} {entry.get('name')}": str(entry.get("sha256"))[:12]
            for entry in files
            if isinstance(entry, Mapping)
        }
    paths = {name.replace("channel.", "channel_profile.", 1) for name in axes if name in run.axes and is_setting(name)}
    return {name: value for name, value in flatten(settings).items() if name not in paths}


def _names(value: Any) -> list[str]:
    return [str(name) for name in value] if isinstance(value, list | tuple) else []

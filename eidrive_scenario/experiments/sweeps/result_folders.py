"""Results of `eidrive run --out` and of pytest as runs of a sweep: the settings that vary among them are its axes."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec

from eidrive_scenario.base.content_digest import canonical_json, sha256_of
from eidrive_scenario.errors import Diagnostic, InputError, SettingError
from eidrive_scenario.experiments.reported_run import parse_run
from eidrive_scenario.experiments.sweeps.axes import (
    CHANNEL,
    DESCRIPTIVE,
    PARAMETER,
    SETTINGS,
    Scalar,
    axis_identity,
    is_setting,
    text_of_value,
)
from eidrive_scenario.experiments.sweeps.store import ABORTED, FAILED, NOT_JUDGED, PASSED, StoredRun
from eidrive_scenario.files.bounded import load_json
from eidrive_scenario.recording.recording import open_recording
from eidrive_scenario.recording.run_files import MAX_DEPTH, RESULT, read_result, result_paths, unfinished_runs
from eidrive_scenario.run_options import NO_COOPERATION, OPTIONS
from eidrive_scenario.simulation.result import typed_parameters

SCENARIO = "scenario"
"""Name of the axis over the scenarios of a folder."""
_PROFILES = {CHANNEL: "channel_profile", "weather": "weather_profile"}
"""Axes whose values may be paths of profiles, and the resolved settings with the content of the profiles."""


class _Settings(msgspec.Struct):
    """Resolved settings of a run that may be values of axes."""

    scenario: str
    seed: int
    run: int | None = None
    parameters: dict[str, str] = {}
    strings: tuple[str, ...] = ()
    drawn: tuple[str, ...] = ()
    varied: tuple[str, ...] = ()

    @property
    def typed_parameters(self) -> dict[str, str | int | float]:
        return typed_parameters(self.parameters, self.strings)


def folder_runs(locations: Sequence[Path], warn: Callable[[str], None]) -> list[StoredRun]:
    """Return the runs whose results are in these files and folders, and the interrupted ones, which are aborted.

    They are numbered in the order of their paths. Their points have all settings that a sweep could vary (see
    `with_axes`). A damaged result below a folder is omitted, with a line for `warn`. Raise InputError for a damaged
    result that `locations` names, and for a location without runs.
    """
    runs: list[StoredRun] = []
    for location in locations:
        if not os.path.exists(location):
            raise SettingError(
                Diagnostic("no such file or folder", "give a store or a folder of results", str(location))
            )
        before, damaged = len(runs), list[Diagnostic]()
        for path in result_paths([location]):
            try:
                runs.append(_finished(path, len(runs)))
            except InputError as error:
                damaged += error.diagnostics
        runs += _interrupted(location, len(runs))
        if damaged and len(runs) == before:
            raise InputError(damaged)
        for diagnostic in damaged:
            warn(f"{diagnostic.source}: {diagnostic.message}, it is omitted")
        if len(runs) == before:
            hint = "give a store of a sweep, or a folder that eidrive run --out or pytest --eidrive-out wrote"
            raise SettingError(Diagnostic(f"no {RESULT} in this folder", hint, str(location)))
    return runs


def varying(runs: Iterable[StoredRun]) -> list[str]:
    """Return the names of the settings with several values among runs of folders.

    A setting `channel.KEY` is one of them if it has several values in profiles of one name, such as `custom`.
    """
    values: dict[str, dict[Scalar, set[Scalar]]] = {}
    for run in runs:
        for name, value in run.point.items():
            profile = run.point.get(CHANNEL, "") if name.startswith(f"{CHANNEL}.") else ""
            values.setdefault(name, {}).setdefault(profile, set()).add(value)
    return [name for name, by_profile in values.items() if any(len(several) > 1 for several in by_profile.values())]


def with_axes(runs: Iterable[StoredRun], axes: Mapping[str, str]) -> Iterator[StoredRun]:
    """Yield runs with these axes only. The settings of a run have the values of axes that its sweep lacks.

    Values of string parameters are texts, also of runs that did not start. A profile has the text of the first axis
    that selects it, such as its path, in place of its name.

    axes  names of the axes by `axis_identity`
    """
    runs = list(runs)
    texts: dict[tuple[str, str], Scalar] = {}
    for run in runs:
        for key, profile in _profiles_of(run, axes):
            if run.point.get(key[0], profile) != profile:
                texts.setdefault(key, run.point[key[0]])
    strings = {(run.scenario, name) for run in runs for name in _strings_of(run)}
    for run in runs:
        values = {axis_identity(name): value for name, value in run.point.items()}
        if run.settings and not axes.keys() <= values.keys():
            with suppress(ValueError, RecursionError):  # settings of another form
                values = {**_point(json.loads(run.settings)), **values}
        for key, profile in _profiles_of(run, axes):
            if values.get(key[0]) == profile:  # texts stay as they are: combinations with `channel.KEY` may be equal
                values[key[0]] = texts.get(key, profile)
        point = {name: values[key] for key, name in axes.items() if key in values}
        for name, value in point.items():
            if not is_setting(name) and (run.scenario, name.removeprefix(PARAMETER)) in strings:
                point[name] = text_of_value(value)
        yield msgspec.structs.replace(run, point=point)


def _profiles_of(run: StoredRun, axes: Mapping[str, str]) -> Iterator[tuple[tuple[str, str], str]]:
    """Yield axis and content, and the name, of the profiles of a run; none without settings, or with those of another
    form."""
    names = [name for name in _PROFILES if name in axes]
    with suppress(ValueError, RecursionError):
        settings = json.loads(run.settings) if names and run.settings else {}
        for name in names:
            if profile := settings.get(_PROFILES[name]):
                yield (name, canonical_json([settings.get(name), profile])), str(settings.get(name))


def _strings_of(run: StoredRun) -> tuple[str, ...]:
    """Return the names of the string parameters of a run; () if it did not start, or has settings of another form."""
    try:
        return msgspec.json.decode(run.settings, type=_Settings).strings
    except (ValueError, RecursionError):
        return ()


def _finished(path: Path, number: int) -> StoredRun:
    result = parse_run(read_result(path), path)
    try:
        settings, point = msgspec.convert(result.settings, _Settings), _point(result.settings)
    except msgspec.ValidationError as error:
        raise InputError(
            Diagnostic(f"not the result of a run: {error}", f"give another {RESULT}", str(path))
        ) from error
    verdicts = {
        f"{verdict.name}.{key}": getattr(verdict, key)
        for verdict in result.criteria
        for key in ("passed", "value", "limit")
    }
    row = {
        **{name: getattr(result, name) for name in ("channel", "passed", "end_reason", "simulated_s", "wall_s")},
        "warnings": len(result.warnings),
        **{option.name: result.settings.get(option.name) for option in OPTIONS if option.in_row},
        **{f"parameter.{name}": value for name, value in settings.typed_parameters.items()},
        **verdicts,
        "settings_sha256": result.settings_sha256,
        "trace_hash": result.trace_hash,
    }
    row.update((name, value) for name, value in result.metrics.items() if name not in row)
    return StoredRun(
        result.settings_sha256 or str(path),
        number,
        result.scenario,
        result.run,
        result.seed,
        PASSED if result.passed else FAILED if result.is_judged else NOT_JUDGED,
        point,
        row,
        "" if result.is_judged else "no criterion judges the run",
        result.command,
        result.wall_s,
        json.dumps(result.settings),
    )


def _interrupted(location: Path, first: int) -> Iterator[StoredRun]:
    """Yield the runs with a partial recording only, numbered from `first` on, unless it ends before their settings."""
    for number, path in enumerate(unfinished_runs([location]), first):
        try:
            metadata = open_recording(path).metadata
            text = metadata["settings"]
            given = load_json(text.encode(), max_depth=MAX_DEPTH)
            settings, point = msgspec.convert(given, _Settings), _point(given)
        except (InputError, LookupError, ValueError):
            continue
        yield StoredRun(
            sha256_of(text.encode()),
            number,
            settings.scenario,
            settings.run,
            settings.seed,
            ABORTED,
            point,
            {},
            f"{path}: the run did not end",
            metadata.get("command", ""),
            0.0,
            text,
        )


def _point(settings: Mapping[str, Any]) -> dict[str, Scalar]:
    """Return the settings of a run that a sweep could vary, without those that its seed or a distribution assigns."""
    resolved = msgspec.convert(settings, _Settings)
    point: dict[str, Scalar] = {SCENARIO: resolved.scenario}
    for name in SETTINGS:
        value = settings.get(name)
        if isinstance(value, list):  # the senders of `cooperate`
            value = "+".join(map(str, value)) or NO_COOPERATION
        if isinstance(value, str | int | float):
            point[name] = value
    point.update(_channel_settings(settings.get("channel_profile"), CHANNEL))
    for name, value in resolved.typed_parameters.items():
        if name not in (*resolved.drawn, *resolved.varied):
            point[f"{PARAMETER}{name}" if is_setting(name) or name == SCENARIO else name] = value
    return point


def _channel_settings(profile: Any, path: str) -> Iterator[tuple[str, Scalar]]:
    """Yield the settings of a channel profile by the names of their axes, without those that only describe it."""
    for key, value in profile.items() if isinstance(profile, Mapping) else ():
        name = f"{path}.{key}"
        if isinstance(value, bool):
            yield name, str(value).lower()
        elif isinstance(value, str | int | float) and key not in DESCRIPTIVE:
            yield name, value
        else:
            yield from _channel_settings(value, name)

"""Settings of a run after options, scenario, driving stack and random draws are combined, with their JSON form."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from eidrive_scenario.base.content_digest import canonical_json, package_versions, sha256_of
from eidrive_scenario.extensions.library import name_of
from eidrive_scenario.extensions.registry import distributions
from eidrive_scenario.files.bounded import is_regular_file, read_regular_file, reason_of
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.model import ParameterType
from eidrive_scenario.openscenario.variation import drawn_parameters
from eidrive_scenario.roads.reading.document import read_road_text
from eidrive_scenario.run_options import NO_COOPERATION, OPTIONS, RunSettings
from eidrive_scenario.simulation.commands import CHANNEL, channel_profile
from eidrive_scenario.simulation.run_setup import RunSetup

_FILE_KEYS = frozenset({"file", "weights", "asn1_files"})
"""Settings that name a file, in a channel profile, controller properties or a weather preset."""
_SHORT = 10
_LARGEST = 1024 * 2**20
"""Maximum size of a file whose digest is computed [bytes]."""
_HIDDEN = frozenset(option.name for option in OPTIONS if not option.in_result)
"""Options that do not determine the result of a run."""


@dataclass(frozen=True)
class ResolvedSettings(RunSettings):
    """All settings that determine the result of one run: the options, of which some are resolved, and further ones.

    scenario         name in the library, or of the file
    seed             seed of all random numbers
    run              number of the run in a parameter value distribution
    channel          name of the initial profile; `custom` for one without a name, `none` for no cooperation
    channel_profile  its content with all defaults; None for no cooperation
    later_channels   profiles that events of the scenario select, in the order of the file
    detector, planner, cooperate   the options that override the scenario; None if the scenario applies
    stations         settings of each station, by name: detector, its settings, cooperation, sensors and all others
    traffic_stations  share and settings of the stations of background traffic, of each command in the order of the file
    weather          name of the preset that overrides the scenario; None if the scenario applies
    weather_profile  its content
    parameters       parameters of the scenario, with their final values
    strings          names of the parameters of type string, whose values are no numbers
    drawn            names of the parameters whose values this seed has drawn
    varied           names of the parameters that a parameter value distribution assigns
    controllers      controller models, by name of the controller
    user_values      values of UserDefinedValueConditions, by name
    drive            entities that an option gives a driving stack, sorted; its settings are in `stations`
    criteria         criteria that an option adds, each a mapping of its name to its settings
    dt, time_limit   time step and maximum simulated time [s]
    files            role, name and SHA-256 of each input file; the scenario is the first
    versions         versions of the packages that affect the result
    extensions       package, version and entry point of each third-party extension, by kind and name
    """

    channel: str = NO_COOPERATION
    weather: str | None = None
    parameters: Mapping[str, str] = field(default_factory=dict)
    drive: tuple[str, ...] = ()
    criteria: tuple[Mapping[str, Any], ...] = ()
    scenario: str = ""
    seed: int = 0
    run: int | None = None
    channel_profile: Mapping[str, Any] | None = None
    later_channels: tuple[Mapping[str, Any] | None, ...] = ()
    stations: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    traffic_stations: tuple[Mapping[str, Any], ...] = ()
    weather_profile: Mapping[str, Any] | None = None
    strings: tuple[str, ...] = ()
    drawn: tuple[str, ...] = ()
    varied: tuple[str, ...] = ()
    files: tuple[tuple[str, str, str], ...] = ()
    versions: Mapping[str, str] = field(default_factory=dict)
    extensions: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Keep the values: they are results of checked settings."""

    def as_json(self) -> dict[str, Any]:
        """Return the settings as JSON values."""
        content = {field.name: plain(getattr(self, field.name)) for field in fields(self) if field.name not in _HIDDEN}
        first = {name: content[name] for name in ("scenario", "seed", "run")}
        files = [{"role": role, "name": name, "sha256": digest} for role, name, digest in self.files]
        return {**first, **content, "files": files}

    @property
    def canonical(self) -> str:
        """Return the JSON form that is hashed: sorted keys, no white space, ASCII."""
        return canonical_json(self.as_json())

    @cached_property
    def digest(self) -> str:
        """Return the SHA-256 of the canonical form, 64 hexadecimal digits."""
        return sha256_of(self.canonical.encode())

    @property
    def short_digest(self) -> str:
        """Return the first digits of the digest, which distinguish the folders of runs."""
        return self.digest[:_SHORT]

    def of_distribution(self, run: int | None, varied: Iterable[str]) -> ResolvedSettings:
        """Return these settings with the number and the assigned parameters of a run of a distribution."""
        return replace(self, run=run, varied=tuple(sorted(varied)))


def resolve_settings(setup: RunSetup, seed: int, settings: RunSettings) -> ResolvedSettings:
    """Return all settings that determine a run, before its first tick."""
    scenario, weather, added = setup.scenario, setup.weather, setup.added_criteria
    resolved = setup.stack.resolved_settings()
    profile, stations, traffic = resolved.channel_profile, dict(resolved.stations), resolved.traffic_stations
    later = () if settings.channel is not None else tuple(_later_channels(scenario))
    files = [*_scenario_files(scenario), *_setting_files((profile, *later, *stations.values(), *traffic), scenario)]
    declared = [declaration for of_source in setup.declared_criteria.values() for declaration in of_source]
    models = distributions(
        [
            *setup.storyboard.extensions,
            *(("controllers", name) for name in settings.controllers.values()),
            *(("criteria", declaration.kind) for declaration in [*declared, *added]),
        ]
    )
    values: dict[str, Any] = {option.name: getattr(settings, option.name) for option in OPTIONS}
    values |= {
        "channel": resolved.channel,
        "weather": weather.name if weather is not None else None,
        "parameters": dict(scenario.parameters),
        "drive": tuple(sorted(scenario.driven)),
        "criteria": tuple({declaration.kind: _without_folders(_dump(declaration.settings))} for declaration in added),
    }
    return ResolvedSettings(
        **values,
        scenario=name_of(scenario.path) if scenario.path is not None else scenario.name,
        seed=seed,
        channel_profile=_without_folders(profile),
        later_channels=tuple(_without_folders(channel) for channel in later),
        stations=_without_folders(stations),
        traffic_stations=tuple(map(_without_folders, traffic)),
        weather_profile=_without_folders(_dump(weather)),
        strings=tuple(sorted(name for name, kind in scenario.parameter_types.items() if kind is ParameterType.STRING)),
        drawn=_drawn(scenario, seed, settings),
        files=tuple(dict.fromkeys(files)),
        versions={**package_versions(), **resolved.versions},
        extensions=dict(sorted({**resolved.extensions, **models}.items())),
    )


def _drawn(scenario: Scenario, seed: int, settings: RunSettings) -> tuple[str, ...]:
    """Return the names of the parameters whose value is drawn for this seed."""
    given = {*settings.parameters, *scenario.assigned}
    drawn = drawn_parameters(scenario, seed).items()
    return tuple(sorted(name for name, value in drawn if name not in given and scenario.parameters.get(name) == value))


def _dump(model: BaseModel | None) -> dict[str, Any] | None:
    return None if model is None else model.model_dump(mode="json")


def _later_channels(scenario: Scenario) -> Iterator[dict[str, Any] | None]:
    """Yield the profiles of the channel commands in events."""
    at_start = {id(action.custom_command_action) for action in scenario.storyboard.init.actions.user_defined_action}
    for command in scenario.custom_commands:
        if command.type == CHANNEL and id(command) not in at_start:
            yield _dump(channel_profile(command))


def _scenario_files(scenario: Scenario) -> Iterator[tuple[str, str, str]]:
    name = scenario.path.name if scenario.path is not None else scenario.name
    yield "scenario", name, scenario.digest
    for path, digest in sorted(scenario.catalogs.items()):
        yield "catalog", Path(path).name, digest
    if scenario.road_file is not None:
        yield "road", scenario.road_file.name, sha256_of(read_road_text(scenario.road_file))


def _setting_files(values: tuple[Mapping[str, Any] | None, ...], scenario: Scenario) -> Iterator[tuple[str, str, str]]:
    """Yield kind, name and digest of the files that settings refer to: delay traces, weights, ASN.1 modules."""
    folder = scenario.path.parent if scenario.path is not None else Path()
    names: list[str | Path] = []
    _with_files(values, names.append)
    for name in names:
        file = next((path for path in (folder / name, Path(name)) if is_regular_file(path)), None)
        if file is not None:
            yield "setting", file.name, _digest(file)


def _digest(path: Path) -> str:
    try:
        return sha256_of(read_regular_file(path, _LARGEST))
    except OSError as error:
        return f"unknown: {reason_of(error)}"


def _without_folders(value: Any) -> Any:
    """Return settings with file names without folders, so that equal settings are equal on any machine."""
    return _with_files(value, lambda name: Path(name).name)


def _with_files(value: Any, convert: Callable[[str | Path], Any], *, is_file: bool = False) -> Any:
    """Return settings with converted file names.

    is_file  whether the value names one or several files
    """
    if isinstance(value, Mapping):
        return {key: _with_files(part, convert, is_file=key in _FILE_KEYS) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_with_files(part, convert, is_file=is_file) for part in value]
    return convert(value) if is_file and isinstance(value, str | Path) else value


def plain(value: Any) -> Any:
    """Return a value of JSON types; numbers that JSON lacks and all other types become texts."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, frozenset | set):
        return sorted((plain(item) for item in value), key=str)
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    return value if value is None or isinstance(value, bool | int | str) else str(value)

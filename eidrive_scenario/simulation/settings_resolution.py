"""The resolved settings of a run, from the scenario as loaded, the caller's settings and the stations as built."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.driving.stations import Stations
from eidrive_scenario.files.bounded import is_regular_file, read_regular_file, reason_of
from eidrive_scenario.library import library_path, name_of
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.variation import drawn_parameters
from eidrive_scenario.registry import registry
from eidrive_scenario.resolved_settings import (
    ResolvedSettings,
    named_files,
    package_versions,
    sha256_of,
    without_folders,
)
from eidrive_scenario.roads.reading.document import read_road_text
from eidrive_scenario.simulation.commands import CHANNEL
from eidrive_scenario.simulation.run import RunSettings
from eidrive_scenario.v2x.profile import ChannelProfile, load_profile
from eidrive_scenario.world.weather import Weather

_LARGEST = 1024 * 2**20
"""Maximum size of a file that a setting names and whose digest is taken [bytes]."""


def resolve_settings(
    scenario: Scenario, seed: int, settings: RunSettings, stations: Stations, weather: Weather | None
) -> ResolvedSettings:
    """Return all settings that determine a run whose stations and channel are those of its start."""
    profile = _dump(stations.channel_profile)
    later = () if settings.channel is not None else tuple(_later_channels(scenario))
    declared = {name: _station(station) for name, station in sorted(stations.settings.items())}
    files = [*_scenario_files(scenario), *_setting_files((profile, *later, *declared.values()), scenario)]
    return ResolvedSettings(
        scenario=name_of(scenario.path) if scenario.path is not None else scenario.name,
        seed=seed,
        channel=stations.channel_name,
        channel_profile=without_folders(profile),
        later_channels=tuple(without_folders(one) for one in later),
        detector=settings.detector,
        cooperate=settings.cooperate,
        stations=without_folders(declared),
        weather=weather.name if weather is not None else None,
        weather_profile=without_folders(_dump(weather)),
        parameters=dict(scenario.parameters),
        drawn=_drawn(scenario, seed, settings),
        controllers=dict(settings.controllers),
        user_values=dict(settings.user_values),
        dt=float(settings.dt),
        time_limit=float(settings.time_limit),
        files=tuple(dict.fromkeys(files)),
        versions={**package_versions(), **stations.library_versions},
        extensions=_extensions(stations, settings),
    )


def _drawn(scenario: Scenario, seed: int, settings: RunSettings) -> tuple[str, ...]:
    """The parameters that have the value which this seed draws."""
    given = {*settings.parameters, *scenario.assigned}
    drawn = drawn_parameters(scenario, seed).items()
    return tuple(sorted(name for name, value in drawn if name not in given and scenario.parameters.get(name) == value))


def _station(settings: AgentSettings) -> dict[str, Any]:
    """The settings of a station, those of its detector and its fusion method with their defaults."""
    found = settings.model_dump(mode="json")
    for kind, name in (("detectors", "detector"), ("fusion", "fusion")):
        model = getattr(registry(kind).load(found[name]), "settings_type", None)
        if isinstance(model, type) and issubclass(model, BaseModel):
            found[f"{name}_settings"] = model.model_validate(found[f"{name}_settings"]).model_dump(mode="json")
    return found


def _extensions(stations: Stations, settings: RunSettings) -> dict[str, str]:
    """The detectors, fusion methods, planners, channel and controller models of third parties that are used."""
    profile = stations.channel_profile
    used = {("channels", profile.model)} if profile is not None else set()
    used |= {("controllers", name) for name in settings.controllers.values()}
    for station in stations.settings.values():
        used |= {("detectors", station.detector), ("fusion", station.fusion), ("planners", station.planner or "")}
    found = {f"{kind}.{name}": registry(kind).distribution(name) for kind, name in sorted(used)}
    return {name: distribution for name, distribution in found.items() if distribution is not None}


def _dump(model: BaseModel | None) -> dict[str, Any] | None:
    return None if model is None else model.model_dump(mode="json")


def _later_channels(scenario: Scenario) -> Iterator[dict[str, Any] | None]:
    """The profiles of the commands that stand in events."""
    at_start = {id(one.custom_command_action) for one in scenario.storyboard.init.actions.user_defined_action}
    for command in scenario.custom_commands:
        if command.type == CHANNEL and id(command) not in at_start:
            profile: ChannelProfile | None = load_profile(
                command.content,
                (library_path() / "channels",),
                origin=command.source,
                line=command.line,
                scope=command.scope,
            )
            yield _dump(profile)


def _scenario_files(scenario: Scenario) -> Iterator[tuple[str, str, str]]:
    name = scenario.path.name if scenario.path is not None else scenario.name
    yield "scenario", name, scenario.digest
    for path, digest in sorted(scenario.catalogs.items()):
        yield "catalog", Path(path).name, digest
    if scenario.road_file is not None:
        yield "road", scenario.road_file.name, sha256_of(read_road_text(scenario.road_file))


def _setting_files(values: tuple[Mapping[str, Any] | None, ...], scenario: Scenario) -> Iterator[tuple[str, str, str]]:
    """Delay traces, weights and ASN.1 modules that settings name, where there is such a file."""
    folder = scenario.path.parent if scenario.path is not None else Path()
    for value in values:
        for name in named_files(value):
            place = next((path for path in (folder / name, Path(name)) if is_regular_file(path)), None)
            if place is not None:
                yield "setting", place.name, _digest(place)


def _digest(path: Path) -> str:
    try:
        return sha256_of(read_regular_file(path, _LARGEST))
    except OSError as error:
        return f"unknown: {reason_of(error)}"

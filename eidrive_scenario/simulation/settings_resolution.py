"""Resolved settings of a run: those of the loaded scenario, of the options, and of the driving stack."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from eidrive_scenario.files.bounded import is_regular_file, read_regular_file, reason_of
from eidrive_scenario.library import name_of
from eidrive_scenario.openscenario import Scenario
from eidrive_scenario.openscenario.variation import drawn_parameters
from eidrive_scenario.registry import distributions
from eidrive_scenario.resolved_settings import (
    ResolvedSettings,
    named_files,
    package_versions,
    sha256_of,
    without_folders,
)
from eidrive_scenario.roads.reading.document import read_road_text
from eidrive_scenario.simulation.commands import CHANNEL, channel_profile
from eidrive_scenario.simulation.run import RunSettings
from eidrive_scenario.simulation.run_setup import RunSetup

_LARGEST = 1024 * 2**20
"""Maximum size of a file whose digest is computed [bytes]."""


def resolve_settings(setup: RunSetup, seed: int, settings: RunSettings) -> ResolvedSettings:
    """Return all settings that determine a run, before its first tick."""
    scenario, weather, added = setup.scenario, setup.weather, setup.added_criteria
    resolved = setup.stack.resolved_settings()
    profile, stations = resolved.channel_profile, dict(resolved.stations)
    later = () if settings.channel is not None else tuple(_later_channels(scenario))
    files = [*_scenario_files(scenario), *_setting_files((profile, *later, *stations.values()), scenario)]
    declared = [one for several in setup.declared_criteria.values() for one in several]
    models = distributions(
        [
            *setup.storyboard.extensions,
            *(("controllers", name) for name in settings.controllers.values()),
            *(("criteria", one.kind) for one in [*declared, *added]),
        ]
    )
    return ResolvedSettings(
        scenario=name_of(scenario.path) if scenario.path is not None else scenario.name,
        seed=seed,
        channel=resolved.channel,
        channel_profile=without_folders(profile),
        later_channels=tuple(without_folders(one) for one in later),
        detector=settings.detector,
        planner=settings.planner,
        cooperate=settings.cooperate,
        stations=without_folders(stations),
        weather=weather.name if weather is not None else None,
        weather_profile=without_folders(_dump(weather)),
        parameters=dict(scenario.parameters),
        drawn=_drawn(scenario, seed, settings),
        controllers=dict(settings.controllers),
        user_values=dict(settings.user_values),
        drive=tuple(sorted(scenario.driven)),
        criteria=tuple({one.kind: without_folders(_dump(one.settings))} for one in added),
        dt=float(settings.dt),
        time_limit=float(settings.time_limit),
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
    at_start = {id(one.custom_command_action) for one in scenario.storyboard.init.actions.user_defined_action}
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

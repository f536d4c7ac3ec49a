"""Setup of a run: everything that takes part in it, built from a scenario, a seed and the caller's settings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from eidrive_scenario.driving.planning.area_checks import areas_off_road
from eidrive_scenario.driving.stations import Stations
from eidrive_scenario.driving.step_checks import short_channel_delay, short_detector_latencies
from eidrive_scenario.errors import Diagnostic, ErrorCollector
from eidrive_scenario.evaluation.criteria_parser import stop_trigger_criteria, unsupported_criteria
from eidrive_scenario.evaluation.criterion import Criterion
from eidrive_scenario.openscenario import ConcreteRun, Scenario, Source
from eidrive_scenario.openscenario.loading import load_for_run
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation.commands import DeclaredCriteria, check_commands
from eidrive_scenario.simulation.run import RunSettings
from eidrive_scenario.storyboard.storyboard import Storyboard
from eidrive_scenario.world import World
from eidrive_scenario.world.weather import Weather, load_weather


@dataclass(frozen=True)
class RunSetup:
    """All parts of a run before its first tick.

    criteria           criteria of the StopTrigger; commands of the storyboard add the others
    declared_criteria  criteria that commands of the storyboard declare
    weather            weather option, which overrides the scenario; None for the weather of the scenario
    warnings           warnings that are known before the run
    """

    scenario: Scenario
    roads: RoadNetwork | None
    storyboard: Storyboard
    stations: Stations
    criteria: tuple[Criterion, ...]
    declared_criteria: DeclaredCriteria
    weather: Weather | None
    world: World
    warnings: tuple[str, ...]


def set_up_run(
    source: Scenario | Source | ConcreteRun, seed: int, settings: RunSettings, *, load_weights: bool
) -> RunSetup:
    """Load a scenario for a seed and build all parts of its run. Raise InputError with everything that is wrong."""
    together = ErrorCollector()
    scenario = load_for_run(source, seed, settings.parameters, together)
    roads = RoadNetwork.load(scenario.road_file) if scenario.road_file else None
    criteria: tuple[Criterion, ...] = ()
    declared: DeclaredCriteria = {}
    weather: Weather | None = None
    with together:
        declared = check_commands(scenario)
    with together:
        storyboard = Storyboard(scenario, roads, dt=settings.dt, seed=seed, controllers=settings.controllers)
    with together:
        stations = Stations(
            scenario,
            roads,
            seed=seed,
            dt=settings.dt,
            channel=settings.channel,
            detector=settings.detector,
            cooperate=settings.cooperate,
            load_weights=load_weights,
            allow_torchscript=settings.allow_torchscript,
        )
    with together:
        criteria = tuple(stop_trigger_criteria(scenario))
    with together:
        if settings.weather is not None:
            weather = load_weather(settings.weather, origin="--weather")
    together.raise_if_any()
    warnings = tuple(map(str, _warnings(scenario, roads, stations, settings)))
    world = World(roads, dt=settings.dt, entities=storyboard.road_objects)
    if weather is not None:
        world.set_weather(weather)
    return RunSetup(scenario, roads, storyboard, stations, criteria, declared, weather, world, warnings)


def _warnings(
    scenario: Scenario, roads: RoadNetwork | None, stations: Stations, settings: RunSettings
) -> Iterator[Diagnostic]:
    """Everything that is doubtful about a run and known before it."""
    yield from scenario.warnings
    yield from unsupported_criteria(scenario)
    yield from roads.map_warnings if roads is not None else ()
    yield from areas_off_road(scenario, stations.settings, roads)
    yield from short_detector_latencies(stations.settings, settings.dt)
    if settings.channel is not None:
        yield from short_channel_delay(stations.channel_profile, settings.dt, "--channel")

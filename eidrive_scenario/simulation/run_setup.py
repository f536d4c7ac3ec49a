"""Setup of a run: all its parts, built from a scenario, a seed and the settings of the run."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.driving.stack import DrivingStack, StackContext, StackFactory, build_stack
from eidrive_scenario.driving.stations import Stations
from eidrive_scenario.errors import Diagnostic, ErrorCollector
from eidrive_scenario.evaluation.criteria_parser import (
    EXITS,
    CriterionDeclaration,
    progress_warnings,
    stop_trigger_declarations,
    unsupported_criteria,
)
from eidrive_scenario.openscenario import ConcreteRun, Scenario, Source
from eidrive_scenario.openscenario.loading import load_for_run
from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.run_options import RunSettings
from eidrive_scenario.simulation.commands import DeclaredCriteria, RunState, check_added_criteria, check_commands
from eidrive_scenario.simulation.scenario_options import drive_entities, select_planner
from eidrive_scenario.storyboard.storyboard import Storyboard
from eidrive_scenario.world import World
from eidrive_scenario.world.weather import Weather, load_weather

LONGEST_STEP = 0.1
"""Time step above which a run has a warning [s]: the shortest interval between messages of ETSI's generation rules."""


class RunSetup(msgspec.Struct, frozen=True):
    """All parts of a run before its first tick.

    criteria           criteria of the StopTrigger; commands of the storyboard add the others
    declared_criteria  criteria that commands of the storyboard declare
    added_criteria     criteria that the settings of the run add to those of the scenario
    weather            option that overrides the scenario; None uses the weather of the scenario
    warnings           warnings that are known before the run
    progress_warnings  those about criteria that demand no progress
    can_be_judged      whether there are criteria, or commands that end the run with a verdict
    """

    scenario: Scenario
    roads: RoadNetwork | None
    storyboard: Storyboard
    stack: DrivingStack
    criteria: tuple[CriterionDeclaration, ...]
    declared_criteria: DeclaredCriteria
    added_criteria: tuple[CriterionDeclaration, ...]
    weather: Weather | None
    world: World
    warnings: tuple[str, ...]
    progress_warnings: tuple[Diagnostic, ...] = ()
    can_be_judged: bool = True

    def state(self) -> RunState:
        """Return the state of the run before its first tick."""
        return RunState(
            self.scenario,
            self.roads,
            self.world,
            self.stack,
            weather_fixed=self.weather is not None,
            declared=self.declared_criteria,
            criteria=[],
            warnings=list(self.warnings),
        )


def set_up_run(
    source: Scenario | Source | ConcreteRun,
    seed: int,
    settings: RunSettings,
    *,
    load_weights: bool,
    stack: StackFactory = Stations,
) -> RunSetup:
    """Load a scenario for a seed and build all parts of its run.

    stack  builds the driving stack

    Raise InputError with the diagnostics of all parts: an error of one does not hide those of the others.
    """
    errors = ErrorCollector()
    scenario = load_for_run(source, seed, settings.parameters, errors)
    replaced: tuple[Diagnostic, ...] = ()
    with errors:
        scenario, replaced = drive_entities(scenario, settings.stacks)
        scenario = select_planner(scenario, settings.planner)
    roads = RoadNetwork.load(scenario.road_file) if scenario.road_file else None
    declared: DeclaredCriteria = {}
    added: tuple[CriterionDeclaration, ...] = ()
    criteria: tuple[CriterionDeclaration, ...] = ()
    weather: Weather | None = None
    with errors:
        declared = check_commands(scenario)
    with errors:
        added = check_added_criteria(scenario, settings.criteria_sources)
    with errors:
        storyboard = Storyboard(scenario, roads, dt=settings.dt, seed=seed, controllers=settings.controllers)
    with errors:
        context = StackContext(
            scenario,
            roads,
            seed,
            settings.dt,
            channel=settings.channel,
            detector=settings.detector,
            fusion=settings.fusion,
            cooperate=settings.cooperate,
            load_weights=load_weights,
            allow_torchscript=settings.allow_torchscript,
        )
        driving = build_stack(stack, context)
    with errors:
        criteria = tuple(stop_trigger_declarations(scenario))
    with errors:
        if settings.weather is not None:
            weather = load_weather(settings.weather, origin="RunSettings.weather")
    errors.raise_if_any()
    declarations = [*criteria, *(declaration for of_source in declared.values() for declaration in of_source), *added]
    all_criteria = [declaration.build() for declaration in declarations]
    progress = progress_warnings(scenario, all_criteria, frozenset(driving.possible_drivers))
    warnings = [*replaced, *_warnings(scenario, roads, driving), *progress, *_step_warnings(settings.dt)]
    can_be_judged = bool(declarations) or any(command.type in EXITS for command in scenario.custom_commands)
    world = World(roads, dt=settings.dt, entities=storyboard.road_objects, picture_maker=picture_maker)
    if weather is not None:
        world.set_weather(weather)
    return RunSetup(
        scenario,
        roads,
        storyboard,
        driving,
        criteria,
        declared,
        added,
        weather,
        world,
        tuple(map(str, warnings)),
        progress,
        can_be_judged,
    )


def _warnings(scenario: Scenario, roads: RoadNetwork | None, stack: DrivingStack) -> Iterator[Diagnostic]:
    """Yield all warnings that are known before the run."""
    yield from scenario.warnings
    yield from unsupported_criteria(scenario)
    yield from roads.map_warnings if roads is not None else ()
    yield from stack.warnings()


def _step_warnings(dt: float) -> Iterator[Diagnostic]:
    """Yield a warning if the time step [s] is longer than the functions of a station need."""
    if dt > LONGEST_STEP + TIME_TOLERANCE:
        yield Diagnostic(
            f"the time step is {dt:g} s: stations perceive, plan and send at most once per step, and contacts of "
            "scripted actors between two steps are not detected",
            f"give a dt of at most {LONGEST_STEP:g} s",
        )

"""One run: building and ticking of world, driving stack, storyboard and criteria."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from contextlib import ExitStack
from types import FrameType, MappingProxyType
from typing import Self

from msgspec.structs import replace

from eidrive_scenario.base.randomness import checked_seed
from eidrive_scenario.base.wall_limit import limit_wall_time, raise_if_limit_reached
from eidrive_scenario.driving.stack import StackFactory
from eidrive_scenario.driving.stations import Stations
from eidrive_scenario.driving.step import StationAction
from eidrive_scenario.errors import Diagnostic, ErrorCollector, SimulationError, WallLimitError
from eidrive_scenario.evaluation.criterion import CriteriaObserver
from eidrive_scenario.openscenario import ConcreteRun, Scenario, Source
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.roads import Pose
from eidrive_scenario.run_options import DEFAULT_SEED, RunSettings, as_setting_text, checked_settings
from eidrive_scenario.simulation.attribution import attributed, report_extension, wall_limit_error
from eidrive_scenario.simulation.commands import add_criteria, execute
from eidrive_scenario.simulation.observers import Observer, Observers, checked_observers
from eidrive_scenario.simulation.resolved_settings import ResolvedSettings, resolve_settings
from eidrive_scenario.simulation.result import RunResult
from eidrive_scenario.simulation.run_outcome import (
    RunEnd,
    RunMeasures,
    build_result,
    end_reason,
    late_warnings,
    scheduled_end,
)
from eidrive_scenario.simulation.run_setup import set_up_run
from eidrive_scenario.simulation.start_checks import check_destinations, check_spawns, spawn_warnings
from eidrive_scenario.simulation.tick import OutsideInputs, Tick, TickStart, check_action
from eidrive_scenario.storyboard.state.commands import Commands, ExternalPose
from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.world import World
from eidrive_scenario.world.environment import Environment
from eidrive_scenario.world.view import WorldView


class Simulation:
    """One run of one scenario with one seed. A second run needs a second Simulation.

    source     a loaded Scenario, or a source that `load_for_seed` accepts
    seed       of all randomness; varied parameters are drawn for it
    settings   its parameters override those with which the Scenario was loaded, and these override drawn ones
    stack      builds the driving stack: perception, communication and control of the stations

    Raise InputError if the scenario, its roads or the settings are invalid.
    """

    @attributed
    def __init__(
        self,
        source: Scenario | Source | ConcreteRun,
        *,
        seed: int = DEFAULT_SEED,
        settings: RunSettings | None = None,
        observers: Sequence[Observer] = (),
        load_weights: bool = True,
        stack: StackFactory = Stations,
    ) -> None:
        self._observers = Observers()
        self._is_closed = False
        self.seed = seed = checked_seed(seed)
        self.settings = checked_settings(settings)
        self._observers.add(*checked_observers(observers))
        setup = set_up_run(source, seed, self.settings, load_weights=load_weights, stack=stack)
        self.scenario, self.roads = setup.scenario, setup.roads
        self.storyboard, self.stack, self.world = setup.storyboard, setup.stack, setup.world
        self.progress_warnings = setup.progress_warnings
        """Warnings about criteria that demand no progress; they are warnings of the result as well."""
        self.can_be_judged = setup.can_be_judged
        """Whether the run may get a verdict: by a criterion, or by a command that ends it."""
        self._state = setup.state()
        self.criteria = self._state.criteria
        self._criteria_observer = CriteriaObserver(self.criteria)
        self._measures = RunMeasures(self.stack)
        self._outside = OutsideInputs(dict(self.settings.user_values))
        self._begun: Tick | None = None
        self._is_within_tick = False
        """Whether a tick, or the first half of one, was started and has not returned."""
        self._links: Sequence[LinkEvent] = ()
        try:
            add_criteria(setup.criteria, self._state)
            commands = self.storyboard.initial()
            self._environment: Environment | None = commands.environment
            execute(commands, self._state)
            drivers = commands.driven & {*self.stack.possible_drivers}
            self.start_warnings = self._check_start(commands, drivers)
            """Warnings about starts and destinations; they are warnings of the result as well."""
            self._state.warnings += map(str, self.start_warnings)
            add_criteria(setup.added_criteria, self._state)
            resolved = resolve_settings(setup, seed, self.settings)
        except BaseException:
            self._free()
            raise
        if isinstance(source, ConcreteRun):
            resolved = resolved.of_distribution(source.number, source.assignments)
        self.resolved: ResolvedSettings = resolved
        """All settings of this run."""
        self._ended: RunEnd | None = None
        self._started = time.perf_counter()

    def _check_start(self, commands: Commands, drivers: Collection[str]) -> tuple[Diagnostic, ...]:
        """Return the warnings about the state after Init. Raise InputError with all errors of it."""
        collector = ErrorCollector()
        warnings: list[Diagnostic] = []
        with collector:
            check_spawns(self.scenario, self.roads, self.world, drivers)
            warnings += spawn_warnings(self.scenario, self.roads, self.world, drivers)
        with collector:
            warnings += check_destinations(self.scenario, self.stack.undirected, self.world.poses(), commands)
        collector.raise_if_any()
        return tuple(warnings)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:  # an exception of close() would hide the one that ended the run
            self._observers.close_silently()
        self.close()

    def add_observer(self, observer: Observer) -> None:
        """Add an observer of all frames from now on; it is closed with the run.

        Raise SimulationError if the simulation is closed.
        """
        if self._is_closed:
            raise SimulationError("the simulation is closed; an observer of it would see no frame")
        self._observers.add(observer)

    @attributed
    def close(self) -> None:
        """Free the world and close the observers, each once, even if another raises. No tick can follow."""
        with ExitStack() as stack:
            self._observers.close(stack)
            self._free()
        self._is_closed = True

    def _free(self) -> None:
        """Free the world and the traffic of SUMO."""
        self.storyboard.context.close()
        self.world.close()

    def set_user_value(self, name: str, value: str) -> None:
        """Set the value of the UserDefinedValueConditions of this name from the next tick on.

        Raise SettingError if the value is not a text, number or truth value.
        """
        self._outside.user_values[name] = as_setting_text(f"the user-defined value {name!r}", value)

    def set_pose(self, name: str, pose: Pose, speed: float = 0.0) -> None:
        """Set the pose of an entity in the next view, and its speed [m/s].

        It applies to entities whose controller has the controller model `external`, while that controller is active.
        Raise SettingError if no controller of the entity has that model.
        """
        self.storyboard.check_accepts_external_poses(name)
        self._outside.poses[name] = ExternalPose(pose, speed)

    def set_action(self, name: str, action: StationAction) -> None:
        """Set the decisions of a station for the next tick, or for the second half of a begun one.

        Raise SettingError if there is no such station, or if it does not drive and the action does.
        """
        check_action(name, action, self.stack)
        self._outside.actions[name] = action

    @attributed
    def run(self, *, wall_limit: float | None = None) -> RunResult:
        """Run to the end, for at most `wall_limit` seconds of wall time.

        Raise ExtensionError for a fault of an extension, WallLimitError if the limit is reached.
        """
        self._started = time.perf_counter()
        with limit_wall_time(wall_limit), self:
            while self._ended is None:
                self.tick()
            raise_if_limit_reached()
            result = self.result()
            self._observers.conclude(result)
            return result

    @attributed
    def tick(self) -> tuple[Frame, str | None]:
        """Execute one time step; return its frame, and the reason if the run ends with it.

        Raise ExtensionError if an extension raises an exception or returns an invalid result, SimulationError after
        the end.
        """
        self._check_continues()
        raise_if_limit_reached()
        self._is_within_tick = True
        frame, end = self._tick()
        self._is_within_tick = False
        return frame, end

    def _check_continues(self) -> None:
        states = (
            (self._ended is not None, "the run has ended"),
            (self._is_closed, "the simulation is closed"),
            (self._is_within_tick, "the run was aborted within a tick"),
        )
        for applies, state in states:
            if applies:
                raise SimulationError(f"{state}; a second run needs a second Simulation")
        self._observers.begin(self)

    @attributed
    def begin_tick(self) -> TickStart:
        """Execute the first half of a time step, before the stations decide; `tick` executes the second half.

        It is optional. Between both halves `set_action` gives stations decisions that depend on what they perceive now.
        Values that are set by other methods apply from the next tick on. Raise the errors of `tick`.
        """
        self._check_continues()
        raise_if_limit_reached()
        if self._begun is None:
            self._is_within_tick = True
            view = self.world.view()
            perceived = self.stack.perceive(self.world, view, self._state.inputs)
            commands = self._tick_storyboard(view)
            end = self._state.exit or scheduled_end(self.storyboard, view.time, self.settings.time_limit)
            self._begun = Tick(view, perceived, end is not None, commands)
            self._is_within_tick = False
        return self._begun

    def _tick_storyboard(self, view: WorldView) -> Commands:
        outside = self._outside
        return self.storyboard.tick(view, user_values=outside.user_values, external_poses=outside.take_poses())

    def _tick(self) -> tuple[Frame, str | None]:
        begun, self._begun = self._begun, None
        view = self.world.view() if begun is None else begun.view
        inputs = self._state.inputs
        if actions := self._outside.take_actions():
            inputs = replace(inputs, actions=actions)
        steps = self.stack.act(self.world, view, inputs)
        commands = self._tick_storyboard(view) if begun is None else begun.commands
        self._environment = commands.environment or self._environment
        frame = Frame(
            view,
            MappingProxyType(steps),
            self.storyboard.changes,
            self._links,
            commands.signals,
            MappingProxyType(commands.appearances),
            self._environment,
            MappingProxyType(commands.monitors),
            commands.routes,
            self._state.take_executed(),
            MappingProxyType(self._state.trailers_in(view)),
        )
        self._measures.observe(frame, commands.driven)
        self._observers.observe(frame)
        self._criteria_observer.observe(frame)
        end = end_reason(self._state, self.storyboard, view.time, self.settings.time_limit)
        if end is None:
            self._links = self.stack.send(steps, view.time)
            execute(commands, self._state)
            self.world.step(commands.placements, self.stack.controls(steps, commands.overrides))
        else:
            self._ended = RunEnd.of(self._state, frame, end, time.perf_counter() - self._started)
        return frame, end

    @attributed
    def result(self) -> RunResult:
        """Return the result of a run that has ended. Raise SimulationError before the end."""
        if self._ended is None:
            raise SimulationError("the run has not ended; call tick until it gives a reason for the end, or run")
        values = self._outside.user_values, self.settings.user_values
        return build_result(
            self._state,
            self._ended,
            settings=self.resolved,
            measures=self._measures,
            observer=self._criteria_observer,
            late_warnings=late_warnings(self.scenario, self.storyboard, self._measures.motionless, values, self._ended),
            no_criteria=self.settings.no_criteria,
        )

    def describe_state(self) -> tuple[str, ...]:
        """Return the state of the storyboard and the decisions of the stations in the last tick, as lines of text."""
        return self._measures.final_state.lines()

    def attribute(self, error: BaseException) -> None:
        """Raise ExtensionError from an error that an extension of this run raised; return otherwise."""
        # It may be raised before the constructor has set any attribute.
        world: World | None = getattr(self, "world", None)
        observers: Collection[Observer] = getattr(self, "_observers", ())
        report_extension(error, time=None if world is None else world.time, observers=tuple(observers))

    def describe_hang(self, limit: float, frame: FrameType | None) -> WallLimitError:
        """Return the error of this run, which hangs in `frame`; close the observers to complete their files."""
        self._observers.close_silently()
        return wall_limit_error(frame, limit, time=self.world.time, observers=tuple(self._observers))


def run_file(
    source: Scenario | Source | ConcreteRun,
    *,
    seed: int = DEFAULT_SEED,
    settings: RunSettings | None = None,
    observers: Sequence[Observer] = (),
    wall_limit: float | None = None,
    stack: StackFactory = Stations,
) -> RunResult:
    """Run a scenario to its end, as `eidrive run` and the pytest plugin do.

    source      accepted by `load_for_seed`: a path, a library name such as `coop/scenario_1`, one run of a distribution
    wall_limit  of loading and run together [s]; see `limit_wall_time`
    stack       builds the driving stack

    Raise InputError for an invalid file or setting, ExtensionError for a fault of an extension, WallLimitError if the
    limit is reached.
    """
    with limit_wall_time(wall_limit):
        return Simulation(source, seed=seed, settings=settings, observers=observers, stack=stack).run()

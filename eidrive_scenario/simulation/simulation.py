"""One run: the tick that ties world, stations, radio and storyboard together."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from types import FrameType
from typing import Self

from eidrive_scenario.driving.motionless import MotionlessStations
from eidrive_scenario.driving.station_declarations import possible_drivers
from eidrive_scenario.errors import SimulationError, WallLimitError
from eidrive_scenario.evaluation.criterion import Criterion, checked_verdict
from eidrive_scenario.evaluation.false_tracks import FalseTracks
from eidrive_scenario.library import name_of
from eidrive_scenario.openscenario import ConcreteRun, Scenario, Source
from eidrive_scenario.recording.frame import Frame
from eidrive_scenario.recording.trace_hash import TraceHash
from eidrive_scenario.resolved_settings import ResolvedSettings
from eidrive_scenario.roads import Pose
from eidrive_scenario.simulation.attribution import attributed, report_extension, wall_limit_error
from eidrive_scenario.simulation.custom_commands import CustomCommands
from eidrive_scenario.simulation.run import (
    DEFAULT_SEED,
    PASSED,
    Observer,
    RunResult,
    RunSettings,
    as_setting_text,
    checked_observer,
    checked_seed,
)
from eidrive_scenario.simulation.run_outcome import (
    TIME_LIMIT,
    criteria_metrics,
    exit_code_of,
    final_verdicts,
    late_warnings,
)
from eidrive_scenario.simulation.run_setup import set_up_run
from eidrive_scenario.simulation.settings_resolution import resolve_settings
from eidrive_scenario.storyboard.state.commands import Commands
from eidrive_scenario.storyboard.state.external_inputs import ExternalPose
from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.wall_limit import limit_wall_time
from eidrive_scenario.world import World
from eidrive_scenario.world.environment import Environment
from eidrive_scenario.world.environment_weather import weather_from_environment
from eidrive_scenario.world.specs import actor_spec


class Simulation:
    """One scenario, one seed, one run. A second run needs a second Simulation.

    source     a loaded Scenario, or whatever `load_for_seed` takes
    seed       of all randomness; parameters that the file varies are drawn for it
    settings   its parameters win over those that the Scenario was loaded with, and these over drawn ones

    Raises InputError while it is built if the scenario, its roads or the settings are wrong.
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
    ) -> None:
        self._observers: tuple[Observer, ...] = ()
        self._unclosed: list[Observer] = []
        self._is_closed = False
        self.seed = seed = checked_seed(seed)
        self.settings = settings or RunSettings()
        for observer in observers:
            self.add_observer(observer)
        self._run = source.number if isinstance(source, ConcreteRun) else None
        setup = set_up_run(source, seed, self.settings, load_weights=load_weights)
        self.scenario, self.roads = setup.scenario, setup.roads
        self.storyboard, self.stations, self.world = setup.storyboard, setup.stations, setup.world
        self.criteria: list[Criterion] = list(setup.criteria)
        self._weather = setup.weather
        self._warnings = list(setup.warnings)
        self._trace = TraceHash()
        self._false_tracks = FalseTracks()
        self._motionless = MotionlessStations(possible_drivers(self.scenario, self.stations.settings))
        self._commands = CustomCommands(
            self.scenario, self.stations, self.settings, setup.declared_criteria, self.criteria, self._warnings
        )
        self._user_values = dict(self.settings.user_values)
        self._external_poses: dict[str, ExternalPose] = {}
        self._environment: Environment | None = None
        try:
            self._apply(self.storyboard.initial())
            resolved = resolve_settings(self.scenario, seed, self.settings, self.stations, self._weather)
        except BaseException:
            self.world.close()
            raise
        if isinstance(source, ConcreteRun):
            resolved = resolved.of_distribution(source.number, source.assignments)
        self.resolved: ResolvedSettings = resolved
        """All settings of this run."""
        self._last: tuple[Frame, str, float] | None = None
        """The last frame, the reason for the end, and the wall time until then [s]."""
        self._started = time.perf_counter()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add_observer(self, observer: Observer) -> None:
        """Show the frames of all ticks from now on to this observer too, and close it with the run.

        Raises SimulationError if the simulation is closed.
        """
        if self._is_closed:
            raise SimulationError("the simulation is closed; an observer of it would see no frame")
        self._observers = (*self._observers, checked_observer(observer))
        self._unclosed.append(observer)

    @attributed
    def close(self) -> None:
        """Free the world and close the observers, each once and whatever another one raises; no tick can follow."""
        with ExitStack() as stack:
            while self._unclosed:
                stack.callback(self._unclosed.pop().close)
            self.world.close()
        self._is_closed = True

    def set_user_value(self, name: str, value: str) -> None:
        """Give a value to the UserDefinedValueConditions of this name, from the next tick on.

        Raises SettingError if the value is neither a text nor a number or truth value.
        """
        self._user_values[name] = as_setting_text(f"the user-defined value {name!r}", value)

    def set_pose(self, name: str, pose: Pose, speed: float = 0.0) -> None:
        """Say where an entity is in the next view, and its speed [m/s].

        It counts for entities whose controller the stand-in `external` plays, while that controller is active.
        Raises SettingError if no `external` plays a controller of that entity.
        """
        self.storyboard.check_accepts_external_poses(name)
        self._external_poses[name] = ExternalPose(pose, speed)

    @attributed
    def run(self, *, wall_limit: float | None = None) -> RunResult:
        """Run to the end, for at most `wall_limit` seconds of wall time.

        Raises ExtensionError for a fault of an extension, WallLimitError if the limit is reached.
        """
        self._started = time.perf_counter()
        with limit_wall_time(wall_limit), self:
            while self._last is None:
                self.tick()
            return self.result()

    def result(self) -> RunResult:
        """Return the result of a run that `tick` has brought to its end. Raise SimulationError before that."""
        if self._last is None:
            raise SimulationError("the run has not ended; call tick until it gives a reason for the end, or run")
        return self._result(*self._last)

    def tick(self) -> tuple[Frame, str | None]:
        """One step of the loop: the frame of this instant, and why the run ends with it (None: it goes on).

        Raises ExtensionError if an extension raises an exception or returns something invalid, SimulationError after
        the end.
        """
        if self._last is not None or self._is_closed:
            what = "the simulation is closed" if self._last is None else "the run has ended"
            raise SimulationError(f"{what}; a second run needs a second Simulation")
        try:
            return self._tick()
        except BaseException as error:
            self.attribute(error)
            raise

    def attribute(self, error: BaseException) -> None:
        """Raise ExtensionError from an error that an extension of this run raised; return otherwise."""
        world: World | None = getattr(self, "world", None)
        report_extension(error, time=None if world is None else world.time, observers=self._observers)

    def describe_hang(self, limit: float, frame: FrameType | None) -> WallLimitError:
        """Return the error of this run, which executes this frame; its observers are closed, so that files end well."""
        while self._unclosed:
            with suppress(Exception):
                self._unclosed.pop(0).close()
        return wall_limit_error(frame, limit, time=self.world.time, observers=self._observers)

    def _tick(self) -> tuple[Frame, str | None]:
        view = self.world.view()
        steps = self.stations.step(self.world, view)
        commands = self.storyboard.tick(view, user_values=self._user_values, external_poses=self._external_poses)
        self._external_poses = {}
        self._environment = commands.environment or self._environment
        frame = Frame(
            view,
            steps,
            self.storyboard.changes,
            self.stations.links,
            commands.signals,
            commands.appearances,
            self._environment,
            commands.monitors,
        )

        if self._motionless.watching:
            self._motionless.observe(view, commands.driven)
        self._trace.observe(frame)
        if self.stations.min_existence:
            self._false_tracks.observe(frame, self.stations.min_existence)
        for observer in self._observers:
            observer.observe(frame)
        for criterion in self.criteria:
            criterion.observe(frame)
        end = self._end(frame)
        if end is None:
            self.stations.send(steps, view.time)
            self._apply(commands)
            self.world.step(commands.placements, self.stations.controls(steps, commands.overrides))
        else:
            self._last = frame, end, time.perf_counter() - self._started
        return frame, end

    def _end(self, frame: Frame) -> str | None:
        if self._commands.exit is not None:
            return f"command: {self._commands.exit.name}"
        for criterion in self.criteria:
            if criterion.fatal and (verdict := checked_verdict(criterion)).fatal and not verdict.passed:
                return f"criterion: {criterion.name}"
        if self.storyboard.ended is not None:
            return self.storyboard.ended
        return TIME_LIMIT if frame.view.time >= self.settings.time_limit - TIME_TOLERANCE else None

    def _apply(self, commands: Commands) -> None:
        """Carry out what the storyboard decided, except the placements, which are the world's step."""
        for name in sorted(commands.removals):
            self.world.remove(name)
            self.stations.remove(name)
        for name, placement in commands.spawns.items():
            spec = commands.actor_specs.get(name) or actor_spec(name, self.scenario.entities[name])
            self.world.add(spec, placement)
            self.stations.add(spec)
        for name in sorted(self.stations.drivers):
            self.world.set_driven(name, name in commands.driven)
        self.stations.goals = commands.goals
        self.world.set_display_state(commands.signals, commands.appearances)
        self.stations.signals = commands.signals
        if commands.environment is not None:
            self._environment = commands.environment
            if self._weather is None:
                self.world.set_weather(weather_from_environment(commands.environment, self.world.time))
        for command in commands.custom:
            self._commands.execute(command, self.world.time)

    @attributed
    def _result(self, frame: Frame, end: str, wall_s: float) -> RunResult:
        verdicts = final_verdicts(self.criteria, self._commands.exit)
        exit_code = exit_code_of(verdicts, end)
        metrics = criteria_metrics(self.criteria)
        metrics.update(self.stations.metrics(frame.view.time))
        metrics.update(self._false_tracks.metrics())
        metrics.update({f"monitor.{name}": float(value) for name, value in frame.monitors.items()})
        given = self._user_values, self.settings.user_values
        late = late_warnings(self.scenario, self.storyboard, self._motionless, given, frame.view.time, end)
        return RunResult(
            scenario=name_of(self.scenario.path) if self.scenario.path is not None else self.scenario.name,
            seed=self.seed,
            channel=self.stations.channel_name,
            passed=exit_code == PASSED,
            end_reason=end,
            exit_code=exit_code,
            criteria=verdicts,
            metrics=metrics,
            trace_hash=self._trace.hexdigest(),
            simulated_s=frame.view.time,
            wall_s=wall_s,
            warnings=tuple(dict.fromkeys([*self._warnings, *late])),
            parameters=dict(self.scenario.parameters),
            run=self._run,
            links=dict(self.stations.link_statistics(frame.view.time)),
            settings=self.resolved,
        )


def run_file(
    source: Scenario | Source | ConcreteRun,
    *,
    seed: int = DEFAULT_SEED,
    settings: RunSettings | None = None,
    observers: Sequence[Observer] = (),
    wall_limit: float | None = None,
) -> RunResult:
    """Run a scenario to its end: the same run as `eidrive run` and the pytest plugin make of file, seed and settings.

    source      what `load_for_seed` takes: a path, a library name such as `coop/scenario_1`, one run of a distribution
    wall_limit  of loading and run together [s]; see `limit_wall_time`

    Raises InputError for a wrong file or setting, ExtensionError for a fault of an extension, WallLimitError if the
    limit is reached.
    """
    with limit_wall_time(wall_limit):
        return Simulation(source, seed=seed, settings=settings, observers=observers).run()

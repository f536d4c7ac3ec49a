"""Runs of an environment: its scenario, settings of the run, and the start of episodes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypedDict

from eidrive_scenario.errors import Diagnostic, SettingError, SimulationError, quoted, suggestion
from eidrive_scenario.evaluation.criteria_parser import EXITS
from eidrive_scenario.gym.episode import Episode
from eidrive_scenario.gym.libraries import gymnasium
from eidrive_scenario.gym.settings import METADATA, RENDER_MODES, ActionSettings, ObservationSettings, RenderSettings
from eidrive_scenario.gym.station_interface import InterfaceSettings, RewardSettings, StationInterface, parse_mapping
from eidrive_scenario.openscenario import ConcreteRun, Scenario, Source, load_scenario
from eidrive_scenario.run_options import checked_settings
from eidrive_scenario.simulation import DEFAULT_SEED, RunSettings, Simulation

if TYPE_CHECKING:
    from eidrive_scenario.gym.rendering import Renderer


MAX_SEED = 2**31
"""Exclusive bound of the seeds that an environment draws for its runs."""
OPTIONS = ("seed", "parameters")
"""Options of `reset`."""


class Runs:
    """Source of the episodes of an environment, with the interfaces of its stations.

    stations          controlled stations; None: the default of the environment
    max_steps         maximum number of steps of an episode; None for the time limit of the settings only
    ticks_per_step    number of ticks for which an action applies

    Raise InputError if the scenario or a setting is invalid, or if it has no such station.
    """

    def __init__(
        self,
        source: Scenario | Source | ConcreteRun,
        stations: Sequence[str] | None,
        interfaces: InterfaceSettings,
        settings: RunSettings | None,
        *,
        single: bool,
        max_steps: int | None,
        ticks_per_step: int,
        terminate_on_collision: bool,
    ) -> None:
        self._source = source if isinstance(source, Scenario | ConcreteRun) else load_scenario(source)
        _check_steps(max_steps, ticks_per_step)
        self.settings = checked_settings(settings)
        self.ticks_per_step = ticks_per_step
        self._duration = None if max_steps is None else max_steps * ticks_per_step * self.settings.dt
        with Simulation(self._source, settings=self.settings, load_weights=False) as simulation:
            controllable, drivers = tuple(simulation.stack.controllable), tuple(simulation.stack.possible_drivers)
            names = _stations(stations, controllable, drivers, single=single)
            self.interfaces = {name: StationInterface(name, interfaces, simulation) for name in names}
        self._planners = {
            name: interface.planner for name, interface in self.interfaces.items() if interface.planner is not None
        }
        self._colliding = [name for name in names if terminate_on_collision and name in drivers]
        self._episode(DEFAULT_SEED, self.settings, load_weights=False).close()

    def start(self, drawn_seed: int, options: Mapping[str, Any] | None) -> Episode:
        """Return an episode at the first tick in which a controlled station is present, or that has ended.

        drawn_seed  seed of the run, unless the options contain one

        The steps are counted from that tick on. Raise SettingError for unknown options, and for the reward of a
        criterion that the run does not have.
        """
        given = options or {}
        unknown = next((key for key in given if key not in OPTIONS), None)
        if unknown is not None:
            raise SettingError(Diagnostic(f"reset has the option {quoted(unknown)}", suggestion(str(unknown), OPTIONS)))
        settings, parameters = self.settings, given.get("parameters", {})
        if not isinstance(parameters, Mapping):
            raise SettingError(Diagnostic(f"parameters is {quoted(parameters)}", "give a mapping of names to values"))
        if parameters:
            settings = replace(settings, parameters={**settings.parameters, **parameters})
        episode = self._episode(given.get("seed", drawn_seed), settings)
        try:
            criteria = [*EXITS, *(criterion.name for criterion in episode.simulation.criteria)]
            for interface in self.interfaces.values():
                interface.rewards.check_criteria(criteria)
            episode.begin()
            while episode.result is None and not any(name in episode.perceived for name in self.interfaces):
                episode.advance(lambda perceived: {})
            if self._duration is not None and episode.result is None:
                episode.limit_time(self._duration)
        except BaseException:
            episode.close()
            raise
        return episode

    def _episode(self, seed: int, settings: RunSettings, *, load_weights: bool = True) -> Episode:
        return Episode(
            self._source,
            seed,
            settings,
            planners=self._planners,
            colliding=self._colliding,
            load_weights=load_weights,
        )


def _check_steps(max_steps: int | None, ticks_per_step: int) -> None:
    """Raise SettingError unless both are positive integers."""
    for name, value in (("max_steps", max_steps), ("ticks_per_step", ticks_per_step)):
        if value is not None and (isinstance(value, bool) or not isinstance(value, int) or value < 1):
            raise SettingError(Diagnostic(f"{name} is {quoted(value)}", "give a positive integer"))


def _stations(
    chosen: Sequence[str] | None, controllable: Sequence[str], drivers: Sequence[str], *, single: bool
) -> tuple[str, ...]:
    """Return the controlled stations. Raise SettingError if there is none, or if one does not exist."""
    if not controllable:
        message = "the scenario has no station"
        raise SettingError(Diagnostic(message, "give an entity a driving stack: RunSettings(drive='Ego')"))
    if chosen is not None:
        unknown = next((name for name in chosen if name not in controllable), None)
        if unknown is not None:
            message = f"the scenario has no station {quoted(unknown)}"
            raise SettingError(Diagnostic(message, suggestion(str(unknown), controllable)))
        if not chosen:
            raise SettingError(Diagnostic("no station is selected", f"give stations of {', '.join(controllable)}"))
        return tuple(dict.fromkeys(chosen))
    candidates = drivers or (controllable if single else ())
    if not candidates:
        raise SettingError(Diagnostic("the scenario has no station that drives", "name the stations"))
    if single and len(candidates) > 1:
        if "Ego" in candidates:
            return ("Ego",)
        message = f"the scenario has the stations {', '.join(candidates)}"
        raise SettingError(Diagnostic(message, "select one by station=NAME"))
    return tuple(candidates) if not single else (candidates[0],)


class EnvironmentOptions(TypedDict, total=False):
    """Arguments that the environments of one and of several stations share; see EidriveEnv."""

    observation: ObservationSettings | Mapping[str, Any] | None
    action: str | ActionSettings | Mapping[str, Any] | tuple[Any, ...] | list[Any] | None
    reward: RewardSettings | Mapping[str, Any] | None
    settings: RunSettings | None
    max_steps: int | None
    ticks_per_step: int
    terminate_on_collision: bool
    render_mode: str | None
    render: RenderSettings | Mapping[str, Any] | None


class ScenarioEnvironment:
    """Part of an environment that does not depend on the number of its controlled stations."""

    metadata: dict[str, Any] = METADATA

    def _set_up(
        self,
        scenario: Scenario | Source | ConcreteRun,
        stations: Sequence[str] | None,
        *,
        single: bool,
        observation: Any = None,
        action: Any = None,
        reward: Any = None,
        settings: RunSettings | None = None,
        max_steps: int | None = None,
        ticks_per_step: int = 1,
        terminate_on_collision: bool = True,
        render_mode: str | None = None,
        render: Any = None,
    ) -> None:
        """Build the runs and the renderer. The arguments are those of EidriveEnv."""
        self._runs = Runs(
            scenario,
            stations,
            InterfaceSettings.parse(observation, action, reward),
            settings,
            single=single,
            max_steps=max_steps,
            ticks_per_step=ticks_per_step,
            terminate_on_collision=terminate_on_collision,
        )
        self.render_mode = render_mode
        self._renderer = build_renderer(render_mode, render, next(iter(self._runs.interfaces)))
        self.metadata = {**self.metadata, "render_fps": 1.0 / (self._runs.settings.dt * ticks_per_step)}
        self._episode: Episode | None = None

    def _begin(self, episode: Episode, names: Iterable[str]) -> dict[str, Any]:
        """Begin an episode for these stations; return its seed, time [s] and parameters."""
        for name in names:
            self._runs.interfaces[name].begin(episode)
        if self._renderer is not None:
            self._renderer.begin(episode)
        simulation = episode.simulation
        info = {"seed": simulation.seed, "time": episode.start.view.time}
        return {**info, "parameters": dict(simulation.scenario.parameters)}

    def render(self) -> Any:
        """Return the picture (height, width, 3) of the current instant, uint8 in the order red, green, blue.

        It is that of `eidrive view --png`, around the first controlled station. Return None with a warning without a
        render mode. Raise SimulationError before `reset`.
        """
        if self._renderer is None:
            gymnasium.logger.warn("the environment has no render mode; create it with render_mode='rgb_array'")
            return None
        if self._episode is None:
            raise SimulationError("the environment has no episode; call reset")
        return self._renderer.picture()

    def close(self) -> None:
        """Free the world of the running episode."""
        if self._episode is not None:
            self._episode.close()
            self._episode = None


def build_renderer(mode: str | None, settings: Any, station: str) -> Renderer | None:
    """Return the renderer of a mode with RenderSettings or a mapping of them; None without a mode.

    station  station that the pictures follow

    Raise SettingError for an unknown mode or an invalid setting.
    """
    parsed = parse_mapping(RenderSettings, settings, "render")
    if mode is None:
        return None
    if mode not in RENDER_MODES:
        raise SettingError(Diagnostic(f"render_mode is {quoted(mode)}", f"give {' or '.join(RENDER_MODES)}, or None"))
    from eidrive_scenario.gym.rendering import Renderer  # imports OpenCV

    return Renderer(station, parsed)

"""Environment of Gymnasium over a scenario, and its part that does not depend on the number of controlled stations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from eidrive_scenario.driving.step import StationAction, StationPerception
from eidrive_scenario.errors import Diagnostic, SettingError, SimulationError, quoted, suggestion
from eidrive_scenario.evaluation.criteria_parser import EXITS
from eidrive_scenario.gym.episode import Decide, Episode, Transition
from eidrive_scenario.gym.libraries import gymnasium
from eidrive_scenario.gym.settings import (
    METADATA,
    RENDER_MODES,
    ActionSettings,
    ObservationSettings,
    RenderSettings,
    parse_actions,
)
from eidrive_scenario.gym.station_interface import RewardSettings, StationInterface, parse_mapping, sum_terms
from eidrive_scenario.openscenario import ConcreteRun, Scenario, Source, load_scenario
from eidrive_scenario.recording.frame import MAX_TICK
from eidrive_scenario.run_options import Switch, checked_settings
from eidrive_scenario.simulation import DEFAULT_SEED, RunSettings, Simulation
from eidrive_scenario.simulation.run_outcome import TIME_LIMIT

if TYPE_CHECKING:
    from eidrive_scenario.gym.rendering import Renderer


MAX_SEED = 2**31
"""Exclusive bound of the seeds that an environment draws for its runs."""
OPTIONS = ("seed", "parameters")
"""Options of `reset`."""
Outcome = tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]
"""Observations, rewards, terminated, truncated and information, each by agent."""


def _check_steps(max_steps: int | None, ticks_per_step: int) -> None:
    """Raise SettingError unless both are positive integers of at most `MAX_TICK`."""
    for name, value in (("max_steps", max_steps), ("ticks_per_step", ticks_per_step)):
        if value is not None and (isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MAX_TICK):
            hint = f"give a positive integer of at most {MAX_TICK}"
            raise SettingError(Diagnostic(f"{name} is {quoted(value)}", hint))


def checked_mapping(name: str, value: Any) -> Mapping[str, Any]:
    """Return an argument that is a mapping; an empty one for None. Raise SettingError for another object."""
    if value is not None and not isinstance(value, Mapping):
        raise SettingError(Diagnostic(f"{name} is {quoted(value)}", "give a mapping of names to values"))
    return {} if value is None else value


def _stations(
    chosen: Sequence[str] | None, controllable: Sequence[str], drivers: Sequence[str], *, single: bool
) -> tuple[str, ...]:
    """Return the controlled stations. Raise SettingError if there is none, or if one does not exist."""
    if not controllable:
        message = "the scenario has no station"
        raise SettingError(Diagnostic(message, "give an entity a driving stack: RunSettings(drive='Ego')"))
    if chosen is not None:
        if not isinstance(chosen, Sequence):
            raise SettingError(Diagnostic(f"stations is {quoted(chosen)}", "give a list of station names"))
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
    """Environment over a scenario, of any number of controlled stations."""

    metadata: dict[str, Any] = METADATA
    agents: list[str]
    """Controlled stations in the world, which need an action in the next step."""

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
        """Load the scenario, and build the interfaces of its stations and the renderer.

        stations  controlled stations; None: the default of the environment

        The other arguments are those of EidriveEnv. Raise InputError if the scenario or a setting is invalid, or if it
        has no such station.
        """
        observed = parse_mapping(ObservationSettings, observation, "observation")
        actions = None if action is None else parse_actions(action)
        rewarded = parse_mapping(RewardSettings, reward, "reward")
        self._source = scenario if isinstance(scenario, Scenario | ConcreteRun) else load_scenario(scenario)
        _check_steps(max_steps, ticks_per_step)
        Switch().check("terminate_on_collision", terminate_on_collision)
        self._settings = checked_settings(settings)
        self._ticks_per_step = ticks_per_step
        self._duration = None if max_steps is None else max_steps * ticks_per_step * self._settings.dt
        with Simulation(self._source, settings=self._settings, load_weights=False) as simulation:
            controllable, drivers = tuple(simulation.stack.controllable), tuple(simulation.stack.possible_drivers)
            names = _stations(stations, controllable, drivers, single=single)
            self._interfaces = {name: StationInterface(name, observed, actions, rewarded, simulation) for name in names}
        self._planners = {
            name: interface.planner for name, interface in self._interfaces.items() if interface.planner is not None
        }
        self._colliding = [name for name in names if terminate_on_collision and name in drivers]
        self._new_episode(DEFAULT_SEED, self._settings, load_weights=False).close()
        self.render_mode = render_mode
        pictures = parse_mapping(RenderSettings, render, "render")
        self._renderer: Renderer | None = None
        if render_mode is not None:
            if render_mode not in RENDER_MODES:
                hint = f"give {' or '.join(RENDER_MODES)}, or None"
                raise SettingError(Diagnostic(f"render_mode is {quoted(render_mode)}", hint))
            from eidrive_scenario.gym.rendering import Renderer  # imports OpenCV

            self._renderer = Renderer(names[0], pictures)
        self.metadata = {**self.metadata, "render_fps": 1.0 / (self._settings.dt * ticks_per_step)}
        self._episode: Episode | None = None
        self.agents = []
        self._left = set[str]()
        """Stations that have left the world in this episode, and may have returned without an agent."""

    def _new_episode(self, seed: int, settings: RunSettings, *, load_weights: bool = True) -> Episode:
        return Episode(
            self._source,
            seed,
            settings,
            planners=self._planners,
            colliding=self._colliding,
            load_weights=load_weights,
        )

    def _start(
        self, drawn_seed: int, options: Mapping[str, Any] | None, absent: Diagnostic
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Start an episode at the first tick in which a controlled station is present.

        drawn_seed  seed of the run, unless the options contain one
        absent      error if no controlled station is present before the last tick

        Return the first observations by agent; and seed, time [s] and parameters. The steps are counted from that tick
        on. Raise SettingError for unknown options, and for the reward of a criterion that the run does not have.
        """
        given = checked_mapping("options", options)
        parameters = checked_mapping("parameters", given.get("parameters"))
        self.close()
        self._left = set()
        unknown = next((key for key in given if key not in OPTIONS), None)
        if unknown is not None:
            raise SettingError(Diagnostic(f"reset has the option {quoted(unknown)}", suggestion(str(unknown), OPTIONS)))
        settings = replace(self._settings, parameters={**self._settings.parameters, **parameters})
        episode = self._new_episode(given.get("seed", drawn_seed), settings)
        try:
            criteria = [*EXITS, *(criterion.name for criterion in episode.simulation.criteria)]
            for interface in self._interfaces.values():
                interface.rewards.check_criteria(criteria)
            episode.begin()
            for interface in self._interfaces.values():
                interface.encoder.reset()
                interface.receive(episode)
            while episode.result is None and not self._present(episode):
                self._advance(episode, lambda perceived: {})
            if self._duration is not None and episode.result is None:
                episode.limit_time(self._duration)
        except BaseException:
            episode.close()
            raise
        if episode.result is not None:  # also if a station enters with the last tick, after which there is no step
            raise SettingError(absent)
        self._episode, self.agents = episode, self._present(episode)
        for name in self.agents:
            self._interfaces[name].begin(episode)
        if self._renderer is not None:
            self._renderer.begin(episode)
        observations = {name: self._interfaces[name].observe(episode) for name in self.agents}
        seed, parameters = episode.simulation.seed, dict(episode.simulation.scenario.parameters)
        return observations, {"seed": seed, "time": episode.start.view.time, "parameters": parameters}

    def _present(self, episode: Episode) -> list[str]:
        """Return the agents of the current tick."""
        return [name for name in self._interfaces if name in episode.perceived and name not in self._left]

    def _step(self, actions: Mapping[str, Any]) -> Outcome:
        """Apply the actions of the agents for one step; return its outcome by agent.

        Raise SettingError if an agent has no action or one that its space does not contain, SimulationError before
        `reset` and after the end.
        """
        episode = self._episode
        if episode is None or not self.agents:
            raise SimulationError("the environment has no running episode; call reset")
        self._check_agents(actions)
        acting = self.agents
        decoders = {name: self._interfaces[name].decoder for name in acting}
        decided = {name: decoder.decode(actions[name], episode.perceived[name]) for name, decoder in decoders.items()}
        for name, decoder in decoders.items():  # only now that the actions of all agents are valid
            decoder.begin_step(decided[name])

        def decide(perceived: Mapping[str, StationPerception]) -> Mapping[str, StationAction]:
            live = [name for name in acting if name in perceived and name not in self._left]
            return {name: decoders[name].select_again(decided[name], perceived[name]) for name in live}

        terms: dict[str, list[dict[str, float]]] = {name: [] for name in acting}
        for _ in range(self._ticks_per_step):
            live = [name for name in acting if name in episode.perceived and name not in self._left]
            routes = {name: self._interfaces[name].route(episode.perceived[name]) for name in live}
            transition = self._advance(episode, decide)
            for name in live:
                terms[name].append(self._interfaces[name].reward_terms(transition, routes[name], episode))
            self._left.update(name for name in acting if name not in episode.perceived)
            if episode.result is not None:
                break
        while episode.result is None and not self._present(episode):
            self._advance(episode, lambda perceived: {})
        return self._outcome(episode, acting, terms)

    def _advance(self, episode: Episode, decide: Decide) -> Transition:
        """Execute one tick; stations that enter within a step receive the messages of its later ticks, too."""
        transition = episode.advance(decide)
        for interface in self._interfaces.values():
            interface.receive(episode)
        return transition

    def _check_agents(self, actions: Mapping[str, Any]) -> None:
        """Raise SettingError unless the actions are those of the agents."""
        checked_mapping("actions", actions)
        missing = next((name for name in self.agents if name not in actions), None)
        if missing is not None:
            raise SettingError(Diagnostic(f"agent {missing!r} has no action", "give an action of each agent"))
        unknown = next((name for name in actions if name not in self.agents), None)
        if unknown is not None:
            raise SettingError(Diagnostic(f"{unknown!r} is not an agent", suggestion(str(unknown), self.agents)))

    def _outcome(self, episode: Episode, acting: list[str], terms: Mapping[str, list[dict[str, float]]]) -> Outcome:
        """Return the outcome of a step for the agents that acted, and for those that entered the world in it."""
        result = episode.result
        self.agents = [] if result is not None else self._present(episode)
        entering = [name for name in self.agents if name not in acting]
        for name in entering:
            self._interfaces[name].begin(episode)
        outcome: Outcome = {}, {}, {}, {}, {}
        observations, rewards, ends, limits, infos = outcome
        for name in [*acting, *entering]:
            interface, has_left = self._interfaces[name], name in self._left
            reward_terms = [*terms.get(name, ())]
            info: dict[str, Any] = {"time": episode.start.view.time}
            if result is not None:
                reward_terms.append(interface.rewards.terms_of_end(result))
                info |= {
                    "result": result,
                    "end_reason": result.end_reason,
                    "passed": result.passed,
                    "trace_hash": result.trace_hash,
                    "criteria": {verdict.name: verdict.passed for verdict in result.criteria},
                }
            info["reward_terms"] = summed = sum_terms(reward_terms)
            truncated = result is not None and result.end_reason == TIME_LIMIT and not has_left
            terminated = not truncated and (result is not None or has_left)
            observations[name] = interface.encoder.zeros() if has_left else interface.observe(episode)
            rewards[name], ends[name], limits[name], infos[name] = sum(summed.values()), terminated, truncated, info
        return outcome

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
        """Free the world of the running episode, and end its agents."""
        self.agents = []
        if self._episode is not None:
            self._episode.close()
            self._episode = None


class EidriveEnv(ScenarioEnvironment, gymnasium.Env[Any, Any]):
    """Environment in which a policy controls one station of a scenario.

    scenario      a path, a library name such as `coop/scenario_1`, or any other source of `Simulation`
    station       controlled station; None: the only driving one, or Ego
    observation   ObservationSettings, or a mapping of its fields
    action        kind of action, its settings or a mapping of them, or a sequence with one that drives and one that
                  concerns messages; None: `target_speed`, or `send` for a station that does not drive
    reward        RewardSettings, or a mapping of its fields
    settings      settings of the run
    max_steps     maximum number of steps; the episode is then truncated
    ticks_per_step          number of ticks for which an action applies
    terminate_on_collision  whether the first contact of a driving station ends the episode
    render_mode             `rgb_array` for pictures by `render`; None for none
    render                  RenderSettings, or a mapping of its fields

    `reset` draws the seed of the run from the generator of the environment, or takes it from `options["seed"]`;
    `options["parameters"]` sets parameters of the scenario. Raise InputError if the scenario or a setting is invalid,
    or if the scenario has no station.
    """

    def __init__(
        self,
        scenario: Scenario | Source | ConcreteRun,
        *,
        station: str | None = None,
        **options: Unpack[EnvironmentOptions],
    ) -> None:
        self._set_up(scenario, None if station is None else (station,), single=True, **options)
        ((self.station, interface),) = self._interfaces.items()
        self.observation_space, self.action_space = interface.encoder.space, interface.decoder.space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; return its first observation, and its seed, time [s] and parameters.

        If the station enters the world later, the run advances until then. Raise SettingError if it never does.
        """
        super().reset(seed=seed)
        absent = Diagnostic(f"station {self.station!r} never enters the world before the last tick", "select another")
        observations, info = self._start(int(self.np_random.integers(MAX_SEED)), options, absent)
        return observations[self.station], info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Apply an action for one step; return observation, reward, terminated, truncated and information.

        terminated  by a collision, the storyboard, a fatal criterion, or because the station has left the world
        truncated   by the limit of time or steps

        Raise SettingError if the action is not in the space, SimulationError before `reset` and after the end.
        """
        name = self.station
        observations, rewards, ends, limits, infos = self._step({name: action})
        return observations[name], rewards[name], ends[name], limits[name], infos[name]

"""Environment of PettingZoo over a scenario: several stations are controlled at the same time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Unpack

from eidrive_scenario.driving.step import StationAction, StationPerception
from eidrive_scenario.errors import Diagnostic, SettingError, SimulationError, suggestion
from eidrive_scenario.gym.environment import final_info
from eidrive_scenario.gym.episode import Episode
from eidrive_scenario.gym.libraries import INSTALL, gymnasium, spaces
from eidrive_scenario.gym.runs import MAX_SEED, OPTIONS, EnvironmentOptions, ScenarioEnvironment
from eidrive_scenario.gym.settings import METADATA
from eidrive_scenario.gym.station_interface import sum_terms
from eidrive_scenario.openscenario import ConcreteRun, Scenario, Source

try:
    from pettingzoo import ParallelEnv
except ImportError as error:
    raise SettingError(Diagnostic("PettingZoo is not installed", INSTALL)) from error

Outcome = tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]
"""Observations, rewards, terminated, truncated and information, each by agent."""


_METADATA = {**METADATA, "name": "eidrive_scenario_v0", "is_parallelizable": True}


class EidriveParallelEnv(ScenarioEnvironment, ParallelEnv[str, Any, Any]):  # type: ignore[misc]
    """Environment in which policies control several stations of a scenario. The agents are the stations.

    stations  controlled stations; None: all that drive

    The other arguments are those of `EidriveEnv`, and apply to each station. An agent exists from the entry of its
    station until it leaves the world, and does not return. All agents end with the run: at the first contact of any of
    them unless `terminate_on_collision` is off. Pictures follow the first station.
    """

    metadata = _METADATA

    def __init__(
        self,
        scenario: Scenario | Source | ConcreteRun,
        *,
        stations: Sequence[str] | None = None,
        **options: Unpack[EnvironmentOptions],
    ) -> None:
        self._set_up(scenario, (stations,) if isinstance(stations, str) else stations, single=False, **options)
        self._interfaces = self._runs.interfaces
        self.possible_agents = list(self._interfaces)
        self.agents: list[str] = []
        self._left = set[str]()
        """Stations that have left the world in this episode, and may have returned without an agent."""
        self._generator, _ = gymnasium.utils.seeding.np_random()

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of the observations of an agent."""
        return self._interfaces[agent].encoder.space

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of the actions of an agent."""
        return self._interfaces[agent].decoder.space

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Begin an episode; return the first observations, and seed, time [s] and parameters, by agent.

        Unknown options are ignored, as PettingZoo demands. The run advances until a controlled station is in the
        world. Raise SettingError if none ever is.
        """
        if seed is not None:
            self._generator, _ = gymnasium.utils.seeding.np_random(seed)
        self.close()
        self._left = set()
        supported = {key: value for key, value in (options or {}).items() if key in OPTIONS}
        episode = self._episode = self._runs.start(int(self._generator.integers(MAX_SEED)), supported)
        self.agents = self._present(episode)
        if not self.agents:
            raise SettingError(Diagnostic("no controlled station enters the world", "select other stations"))
        info = self._begin(episode, self.agents)
        return {name: self._interfaces[name].observe(episode) for name in self.agents}, {
            name: dict(info) for name in self.agents
        }

    def step(self, actions: Mapping[str, Any]) -> Outcome:
        """Apply the actions for one step; return its outcome by agent. The values are those of `EidriveEnv.step`.

        Raise SettingError if an agent has no action or one that its space does not contain, SimulationError before
        `reset` and after the end.
        """
        episode = self._episode
        if episode is None or not self.agents:
            raise SimulationError("the environment has no running episode; call reset")
        self._check_agents(actions)
        acting, decided = list(self.agents), dict[str, StationAction]()

        def decide(perceived: Mapping[str, StationPerception]) -> Mapping[str, StationAction]:
            live = [name for name in acting if name in perceived and name not in self._left]
            for name in live:
                if name not in decided or decided[name].share is not None:
                    decided[name] = self._interfaces[name].decode(actions[name], perceived[name])
            return {name: decided[name] for name in live}

        terms: dict[str, list[dict[str, float]]] = {name: [] for name in acting}
        for _ in range(self._runs.ticks_per_step):
            live = [name for name in acting if name in self._present(episode)]
            routes = {name: self._interfaces[name].route(episode.perceived[name]) for name in live}
            transition = episode.advance(decide)
            for name in live:
                terms[name].append(self._interfaces[name].reward_terms(transition, routes[name], episode))
            self._left.update(name for name in acting if name not in episode.perceived)
            if episode.result is not None:
                break
        return self._outcome(episode, acting, terms)

    def _outcome(self, episode: Episode, acting: list[str], terms: Mapping[str, list[dict[str, float]]]) -> Outcome:
        while episode.result is None and not self._present(episode):
            episode.advance(lambda perceived: {})
        result = episode.result
        present = [] if result is not None else self._present(episode)
        entering = [name for name in present if name not in acting]
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
                info |= final_info(result)
            info["reward_terms"] = summed = sum_terms(reward_terms)
            truncated = episode.is_truncated and not has_left
            terminated = not truncated and (result is not None or has_left)
            observations[name] = interface.encoder.zeros() if has_left else interface.observe(episode)
            rewards[name], ends[name], limits[name], infos[name] = sum(summed.values()), terminated, truncated, info
        self.agents = present
        return outcome

    def _check_agents(self, actions: Mapping[str, Any]) -> None:
        """Raise SettingError unless the actions are those of the agents."""
        missing = next((name for name in self.agents if name not in actions), None)
        if missing is not None:
            raise SettingError(Diagnostic(f"agent {missing!r} has no action", "give an action of each agent"))
        unknown = next((name for name in actions if name not in self.agents), None)
        if unknown is not None:
            raise SettingError(Diagnostic(f"{unknown!r} is not an agent", suggestion(str(unknown), self.agents)))

    def _present(self, episode: Episode) -> list[str]:
        """Return the agents of the current tick."""
        return [name for name in self.possible_agents if name in episode.perceived and name not in self._left]

    def close(self) -> None:
        """Free the world of the running episode, and end its agents."""
        self.agents = []
        super().close()

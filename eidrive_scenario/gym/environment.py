"""Environment of Gymnasium over a scenario: one station is controlled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Unpack

from eidrive_scenario.driving.step import StationAction, StationPerception
from eidrive_scenario.errors import Diagnostic, SettingError, SimulationError
from eidrive_scenario.gym.episode import Episode
from eidrive_scenario.gym.libraries import gymnasium
from eidrive_scenario.gym.runs import MAX_SEED, EnvironmentOptions, ScenarioEnvironment
from eidrive_scenario.gym.station_interface import sum_terms
from eidrive_scenario.openscenario import ConcreteRun, Scenario, Source
from eidrive_scenario.simulation import RunResult


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
        ((self.station, self._interface),) = self._runs.interfaces.items()
        self.observation_space = self._interface.encoder.space
        self.action_space = self._interface.decoder.space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; return its first observation, and its seed, time [s] and parameters.

        If the station enters the world later, the run advances until then. Raise SettingError if it never does.
        """
        super().reset(seed=seed)
        self.close()
        drawn = int(self.np_random.integers(MAX_SEED))
        episode = self._episode = self._runs.start(drawn, options)
        if self.station not in episode.perceived:
            raise SettingError(Diagnostic(f"station {self.station!r} never enters the world", "select another one"))
        info = self._begin(episode, [self.station])
        return self._interface.observe(episode), info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Apply an action for one step; return observation, reward, terminated, truncated and information.

        terminated  by a collision, the storyboard, a fatal criterion, or because the station has left the world
        truncated   by the limit of time or steps

        Raise SettingError if the action is not in the space, SimulationError before `reset` and after the end.
        """
        episode = self._running_episode()
        interface, name = self._interface, self.station
        decided: StationAction | None = None

        def decide(perceived: Mapping[str, StationPerception]) -> Mapping[str, StationAction]:
            # The rows of shared objects belong to one tick: they are selected again in each.
            nonlocal decided
            if name not in perceived:
                return {}
            if decided is None or decided.share is not None:
                decided = interface.decode(action, perceived[name])
            return {name: decided}

        terms = []
        for _ in range(self._runs.ticks_per_step):
            route = interface.route(episode.perceived[name])
            transition = episode.advance(decide)
            terms.append(interface.reward_terms(transition, route, episode))
            if episode.result is not None or name not in episode.perceived:
                break
        observation = interface.observe(episode)
        has_left = episode.result is None and name not in episode.perceived
        while has_left and episode.result is None:
            episode.advance(lambda perceived: {})
        info: dict[str, Any] = {"time": episode.start.view.time}
        if episode.result is not None:
            terms.append(interface.rewards.terms_of_end(episode.result))
            info |= final_info(episode.result)
        info["reward_terms"] = summed = sum_terms(terms)
        ended = episode.result is not None
        truncated = episode.is_truncated and not has_left
        return observation, sum(summed.values()), ended and not truncated, truncated, info

    def _running_episode(self) -> Episode:
        if self._episode is None or self._episode.result is not None:
            raise SimulationError("the environment has no running episode; call reset")
        return self._episode


def final_info(result: RunResult) -> dict[str, Any]:
    """Return the information about the end of an episode: the result of its run, and parts of it."""
    return {
        "result": result,
        "end_reason": result.end_reason,
        "passed": result.passed,
        "trace_hash": result.trace_hash,
        "criteria": {verdict.name: verdict.passed for verdict in result.criteria},
    }

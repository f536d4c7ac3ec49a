"""Environment of PettingZoo over a scenario: several stations are controlled at the same time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Unpack

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.gym.environment import (
    MAX_SEED,
    OPTIONS,
    EnvironmentOptions,
    Outcome,
    ScenarioEnvironment,
    checked_mapping,
)
from eidrive_scenario.gym.libraries import INSTALL, gymnasium, spaces
from eidrive_scenario.gym.settings import METADATA
from eidrive_scenario.openscenario import ConcreteRun, Scenario, Source

try:
    from pettingzoo import ParallelEnv
except ImportError as error:
    raise SettingError(Diagnostic("PettingZoo is not installed", INSTALL)) from error

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
        self.possible_agents = list(self._interfaces)
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
        supported = {key: value for key, value in checked_mapping("options", options).items() if key in OPTIONS}
        absent = Diagnostic("no controlled station enters the world before the last tick", "select other stations")
        observations, info = self._start(int(self._generator.integers(MAX_SEED)), supported, absent)
        return observations, {name: dict(info) for name in observations}

    def step(self, actions: Mapping[str, Any]) -> Outcome:
        """Apply the actions for one step; return its outcome by agent. The values are those of `EidriveEnv.step`.

        Raise SettingError if an agent has no action or one that its space does not contain, SimulationError before
        `reset` and after the end.
        """
        return self._step(actions)

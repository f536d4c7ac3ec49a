"""The environment of PettingZoo for several stations."""

from __future__ import annotations

import pytest
from lone_car import lone_car
from pettingzoo.test import parallel_api_test, parallel_seed_test

from eidrive_scenario.errors import SettingError, SimulationError
from eidrive_scenario.gym import EidriveEnv, EidriveParallelEnv

SEVERAL = "coop/scenario_1"


def test_checks_of_pettingzoo_accept_the_environment() -> None:
    env = EidriveParallelEnv(SEVERAL, stations=["Ego", "RSU"], action="send", max_steps=30)
    parallel_api_test(env, num_cycles=70)
    parallel_seed_test(lambda: EidriveParallelEnv(SEVERAL, max_steps=30), num_cycles=40)


def test_agents_are_the_driving_stations_by_default() -> None:
    assert EidriveParallelEnv(SEVERAL).possible_agents == ["Ego"]
    with pytest.raises(SettingError, match="the scenario has no station 'Bus'"):
        EidriveParallelEnv(SEVERAL, stations=["Bus"])
    with pytest.raises(SettingError, match="stations is 5; give a list of station names"):
        EidriveParallelEnv(SEVERAL, stations=5)  # type: ignore[arg-type]


def test_episode_of_one_agent_is_that_of_the_single_environment() -> None:
    single, parallel = EidriveEnv(lone_car(2.0)), EidriveParallelEnv(lone_car(2.0))
    single.reset(seed=4)
    parallel.reset(seed=4)
    ended = False
    while not ended:
        _, reward, terminated, truncated, info = single.step([0.5])
        _, rewards, *ends, infos = parallel.step({"Ego": [0.5]})
        assert (rewards["Ego"], ends) == (reward, [{"Ego": terminated}, {"Ego": truncated}])
        ended = terminated or truncated
    assert infos["Ego"]["trace_hash"] == info["trace_hash"]
    assert parallel.agents == []
    with pytest.raises(SimulationError, match="no running episode"):
        parallel.step({"Ego": [0.5]})


def test_actions_of_other_agents_are_errors() -> None:
    env = EidriveParallelEnv(SEVERAL)
    env.reset(seed=1)
    with pytest.raises(SettingError, match="agent 'Ego' has no action"):
        env.step({})
    with pytest.raises(SettingError, match="'RSU' is not an agent"):
        env.step({"Ego": [0.0], "RSU": 1})
    with pytest.raises(SettingError, match="actions is 1; give a mapping"):
        env.step(1)  # type: ignore[arg-type]
    with pytest.raises(SettingError, match="options is 1; give a mapping"):
        env.reset(options=1)  # type: ignore[arg-type]
    env.close()

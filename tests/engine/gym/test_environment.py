"""The environment of Gymnasium: its contract, episodes, and their relation to runs of the engine."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pybullet
import pytest
from gymnasium.utils.env_checker import check_env
from lone_car import car_behind_parked_car, lone_car

from eidrive_scenario.errors import FAILED, NOT_JUDGED, PASSED, InputError, SettingError, SimulationError
from eidrive_scenario.gym import ENVIRONMENT_ID, EidriveEnv
from eidrive_scenario.simulation import RunResult, RunSettings, run_file

ONE = "coop/scenario_1"
Episode = tuple[list[Any], list[float], dict[str, Any]]


def play(env: EidriveEnv, action: Any, seed: int | None = None, **options: Any) -> Episode:
    """Return observations, rewards and the last information of an episode with one action."""
    observation, _ = env.reset(seed=seed, options=options)
    observations, rewards, ended = [observation], [], False
    info: dict[str, Any] = {}
    while not ended:
        observation, reward, terminated, truncated, info = env.step(action)
        ended = terminated or truncated
        observations.append(observation)
        rewards.append(reward)
    return observations, rewards, info


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "arguments",
    [
        {},
        {"observation": {"flat": True, "own": True, "senders": True}, "action": "pedals"},
        {"observation": {"grid": True, "normalized": False}, "action": ["meta_speed", "send"]},
        {"station": "RSU", "action": {"kind": "share", "count": 4}, "observation": {"own": {"count": 4}}},
    ],
)
def test_checker_of_gymnasium_accepts_the_environment(arguments: dict[str, Any]) -> None:
    made = gymnasium.make(f"eidrive_scenario.gym:{ENVIRONMENT_ID}", scenario=ONE, max_steps=40, **arguments)
    check_env(made.unwrapped)
    made.close()


@pytest.mark.parametrize("speed", [4.0, 8.0])
def test_constant_target_speed_equals_run_of_route_planner_at_that_speed(speed: float) -> None:
    env = EidriveEnv(lone_car(), action={"kind": "target_speed", "max_speed": 10.0})
    _, _, info = play(env, [speed / 5.0 - 1.0], seed=3)
    criteria = {"collision": {"of": "Ego", "fatal": True}}
    expected = run_file(lone_car(target_speed=speed), settings=RunSettings(criteria=criteria))
    assert info["trace_hash"] == expected.trace_hash
    assert info["end_reason"] == expected.end_reason == "stop trigger"


@pytest.mark.process
def test_same_seed_gives_the_same_episode_in_another_process() -> None:
    env = EidriveEnv(ONE, max_steps=80)
    observations, rewards, info = play(env, [0.2], seed=11)
    again, rewards_again, info_again = play(env, [0.2], seed=11)
    assert (info["trace_hash"], rewards) == (info_again["trace_hash"], rewards_again)
    for first, second in zip(observations, again, strict=True):
        assert all(np.array_equal(first[key], second[key]) for key in first)
    program = (
        "from eidrive_scenario.gym import EidriveEnv\n"
        f"env = EidriveEnv({ONE!r}, max_steps=80)\n"
        "env.reset(seed=11)\n"
        "ended = False\n"
        "while not ended:\n"
        "    *_, terminated, truncated, info = env.step([0.2])\n"
        "    ended = terminated or truncated\n"
        "print(info['trace_hash'])\n"
    )
    printed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == info["trace_hash"]


def test_seed_varies_the_parameters_of_the_scenario() -> None:
    env = EidriveEnv(ONE)
    offsets = {env.reset(seed=seed)[1]["parameters"]["EgoOffset"] for seed in range(3)}
    assert len(offsets) == 3
    first, second = (env.reset()[1]["seed"] for _ in range(2))
    assert first != second
    env.close()


def test_options_of_reset_select_seed_and_parameters_of_the_run() -> None:
    env = EidriveEnv(ONE)
    _, info = env.reset(options={"seed": 7, "parameters": {"EgoOffset": 0.25}})
    assert (info["seed"], info["parameters"]["EgoOffset"]) == (7, "0.25")
    with pytest.raises(SettingError, match="reset has the option 'sed'; did you mean 'seed'"):
        env.reset(options={"sed": 7})
    with pytest.raises(SettingError, match="options is 5; give a mapping"):
        env.reset(options=5)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="EgoOfset"):
        env.reset(options={"parameters": {"EgoOfset": 0.25}})
    env.close()


def test_limit_of_steps_truncates_after_that_number() -> None:
    env = EidriveEnv(lone_car(60.0), max_steps=7, ticks_per_step=3)
    _, rewards, info = play(env, [0.0], seed=1)
    assert (len(rewards), info["end_reason"]) == (7, "time limit")
    assert info["time"] == pytest.approx(7 * 3 * 0.05)
    env.reset(seed=1)
    outcomes = [env.step([0.0])[2:4] for _ in range(7)]
    assert outcomes == [(False, False)] * 6 + [(False, True)]
    with pytest.raises(SimulationError, match="no running episode; call reset"):
        env.step([0.0])


def test_collision_terminates_in_the_step_in_which_it_happens() -> None:
    env = EidriveEnv(ONE, action="target_speed", settings=RunSettings(channel="none"))
    for seed in range(4):
        *_, info = play(env, [0.1], seed=seed)
        if info["end_reason"].startswith("criterion: collision"):
            break
    assert info["reward_terms"]["collision"] == -10.0
    assert not info["passed"]
    assert isinstance(info["result"], RunResult)
    violation = next(one.first_violation for one in info["result"].criteria if one.name == "collision")
    assert violation == pytest.approx(info["time"])


def test_resets_free_their_physics_clients() -> None:
    env = EidriveEnv(lone_car(), max_steps=5)
    for _ in range(40):
        env.reset(seed=1)
        env.step([0.0])
    env.close()
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.disconnect(client)
    assert client < 5


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_vectorized_episodes_are_those_of_single_environments(mode: str) -> None:
    vector = gymnasium.make_vec(
        f"eidrive_scenario.gym:{ENVIRONMENT_ID}",
        num_envs=2,
        vectorization_mode=mode,
        scenario=ONE,
        max_steps=4,
    )
    vector.reset(seed=[5, 6])  # type: ignore[arg-type]
    for _ in range(4):
        *_, truncated, info = vector.step(np.zeros((2, 1), np.float32))
    expected = [play(EidriveEnv(ONE, max_steps=4), [0.0], seed=seed)[2]["trace_hash"] for seed in (5, 6)]
    assert truncated.tolist() == [True, True]
    assert list(info["trace_hash"]) == expected
    # The step after the end resets (autoreset mode NEXT_STEP), and its reward is 0.
    _, reward, _, truncated, info = vector.step(np.zeros((2, 1), np.float32))
    assert (reward.tolist(), truncated.tolist(), info["time"].tolist()) == ([0.0, 0.0], [False, False], [0.0, 0.0])
    vector.close()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"station": "Eg"}, "the scenario has no station 'Eg'; did you mean 'Ego'"),
        ({"station": "RSU", "action": "pedals"}, "action 'pedals' drives, and the station 'RSU' does not"),
        ({"action": "pedal"}, "action has the kind 'pedal'; did you mean 'pedals'"),
        ({"action": ["pedals", "target_speed"]}, "action has the kinds pedals, target_speed"),
        ({"action": {"kind": "meta_speed", "speeds": [3.0, 1.0]}}, "speeds are not ascending"),
        ({"action": {"kind": "target_speed", "planner": "rout"}}, "rout"),
        ({"observation": {"track": True}}, "unknown setting 'track'; did you mean 'tracks'"),
        ({"observation": {"route": {"points": 30}}}, "points x spacing is above 59 m"),
        ({"reward": 3}, "reward is 3; give a mapping or RewardSettings"),
        ({"max_steps": 0}, "max_steps is 0; give a positive integer"),
        ({"ticks_per_step": 10**400}, "ticks_per_step is .*; give a positive integer of at most 4294967295"),
        ({"terminate_on_collision": "no"}, "terminate_on_collision is 'no'; give True or False"),
        ({"render_mode": "human"}, "render_mode is 'human'"),
        ({"settings": RunSettings(channel="idel")}, "idel"),
    ],
)
def test_invalid_settings_of_the_environment_are_errors(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        EidriveEnv(ONE, **arguments)


def test_scenario_without_station_is_an_error() -> None:
    with pytest.raises(SettingError, match=r"the scenario has no station; give an entity a driving stack"):
        EidriveEnv(lone_car().replace(b'value="eidrive"', b'value="other"'))


@pytest.mark.parametrize(
    ("action", "given", "message"),
    [
        ("target_speed", [1.5], "give 1 number from -1 to 1"),
        ("target_speed", [float("nan")], "give 1 number from -1 to 1"),
        ("target_speed", ["0.5"], "give 1 number from -1 to 1"),
        ("pedals", [0.0], "give 2 numbers from -1 to 1"),
        ("meta_speed", 3, "give an integer from 0 to 2"),
        ("meta_speed", 0.5, "give an integer from 0 to 2"),
        ("meta_speed", [[1], [1, 2]], "give an integer from 0 to 2"),
        ("target_speed", [10**400], "give 1 number from -1 to 1"),
        (["pedals", "send"], {"pedals": [0, 0]}, "give a mapping with the keys pedals, send"),
        (["pedals", "send"], {"pedals": [0, 0], "send": 1, "share": 1}, "give a mapping with the keys pedals, send"),
        ({"kind": "share", "count": 2}, [0, 1, 1], "give 2 numbers out of 0 and 1"),
        ({"kind": "share", "count": 2}, [[0], [0, 1]], "give 2 numbers out of 0 and 1"),
    ],
)
def test_actions_outside_of_the_space_are_errors(action: Any, given: Any, message: str) -> None:
    env = EidriveEnv(lone_car(), action=action)
    env.reset(seed=1)
    with pytest.raises(SettingError, match=message):
        env.step(given)
    env.close()


def test_invalid_action_does_not_change_the_relative_speed() -> None:
    """The car stands at the lowest speed, so that `faster` and `keep` select the second one."""
    env = EidriveEnv(lone_car(), action=[{"kind": "meta_speed", "speeds": [0.0, 4.0, 8.0]}, "send"])
    env.reset(seed=1)
    with pytest.raises(SettingError, match="the action is 2; give an integer from 0 to 1"):
        env.step({"meta_speed": 2, "send": 2})
    env.step({"meta_speed": 2, "send": 1})
    *_, end, limit, _ = env.step({"meta_speed": 1, "send": 1})
    assert (end, limit) == (False, False)
    assert env._episode is not None
    frame = env._episode.last_frame
    assert frame is not None
    plan = frame.steps["Ego"].plan
    assert plan is not None
    assert max(plan.speeds) == pytest.approx(4.0)
    env.close()


@pytest.mark.parametrize("terminate", [True, False])
@pytest.mark.parametrize(("max_steps", "end"), [(None, "stop trigger"), (3, "time limit")])
def test_episode_without_criteria_neither_passes_nor_fails(terminate: bool, max_steps: int | None, end: str) -> None:
    rewards = {"passed": 1.0, "failed": -1.0}
    env = EidriveEnv(lone_car(0.5), terminate_on_collision=terminate, max_steps=max_steps, reward=rewards)
    *_, info = play(env, [0.0], seed=1)
    assert (info["end_reason"], info["passed"], info["result"].exit_code) == (end, False, NOT_JUDGED)
    assert (info["reward_terms"]["passed"], info["reward_terms"]["failed"]) == (0.0, 0.0)


@pytest.mark.parametrize("name", ["exitSuccess", "exitFailure"])
def test_reward_of_exit_command_that_is_not_executed_is_zero(name: str) -> None:
    env = EidriveEnv(lone_car(0.5), reward={"criteria": {name: 10.0}})
    *_, info = play(env, [0.0], seed=1)
    assert info["reward_terms"][f"criteria.{name}"] == 0.0


def test_episode_with_own_criterion_passes() -> None:
    env = EidriveEnv(lone_car(0.5), settings=RunSettings(criteria={"time_limit": {"within": 60}}))
    *_, info = play(env, [0.0], seed=1)
    assert (info["passed"], info["reward_terms"]["passed"]) == (True, 5.0)


@pytest.mark.parametrize(("at_least", "passed"), [(5, True), (50, False)])
def test_added_collision_criterion_ends_the_episode_without_judging_it(at_least: int, passed: bool) -> None:
    criteria = {"driven_distance": {"of": "Ego", "at_least": at_least}}
    env = EidriveEnv(car_behind_parked_car(), settings=RunSettings(criteria=criteria))
    *_, info = play(env, [0.5], seed=1)
    assert info["end_reason"] == "criterion: collision"
    assert info["criteria"] == {"driven_distance": passed, "collision": False}
    assert (info["passed"], info["reward_terms"]["passed"]) == (passed, 5.0 * passed)
    assert info["result"].exit_code == (PASSED if passed else FAILED)


@pytest.mark.parametrize("name", ["colision", "no such"])
def test_reward_of_unknown_criterion_is_refused_by_reset(name: str) -> None:
    env = EidriveEnv(lone_car(), reward={"criteria": {name: 1.0}})
    with pytest.raises(SettingError, match=f"reward: the run has no criterion '{name}'.*collision"):
        env.reset(seed=1)
    env.close()

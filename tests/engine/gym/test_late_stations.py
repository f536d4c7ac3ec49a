"""Stations that enter the world late, leave it, and return."""

from __future__ import annotations

import numpy as np
import pytest
from openscenario_xml import agent_xml, road_file_xml, round_car_xml, scenario_xml
from pettingzoo.test import parallel_api_test
from storyboard_xml import (
    act_xml,
    acts_xml,
    condition_xml,
    end_xml,
    event_xml,
    global_xml,
    group_xml,
    init_xml,
    lane_position_xml,
    maneuver_xml,
    teleport_xml,
    time_xml,
    trigger_xml,
)

from eidrive_scenario.errors import SettingError
from eidrive_scenario.gym import EidriveEnv, EidriveParallelEnv
from eidrive_scenario.simulation import RunSettings

ADDED, DELETED, RETURNED = 1.0, 2.0, 2.5
"""Times of the actions on Ego [s]; it is in the views of the following time steps."""
DT = 0.05


def visits(seconds: float = 4.0) -> bytes:
    """Return a scenario in which Ego enters the world twice, behind another car that stands."""
    add = f"<AddEntityAction><Position>{lane_position_xml(-1, 20.0)}</Position></AddEntityAction>"
    events = [
        event_xml(name, global_xml(f'<EntityAction entityRef="Ego">{action}</EntityAction>'), trigger_xml(at(time)))
        for name, action, time in (
            ("add", add, ADDED),
            ("delete", "<DeleteEntityAction/>", DELETED),
            ("return", add, RETURNED),
        )
    ]
    return scenario_xml(
        road=road_file_xml("eidrive_library/roads/two_lane_road.xodr"),
        entities=round_car_xml("Ego", agent_xml(planner="route", target_speed=10)),
        story=acts_xml(act_xml(group_xml(maneuver_xml("".join(events))))),
        stop=end_xml(seconds),
    )


def at(time: float) -> str:
    return condition_xml(time_xml(time, "greaterOrEqual"))


def test_limit_of_steps_counts_from_the_entry_of_the_station() -> None:
    env = EidriveEnv(visits(), max_steps=6, ticks_per_step=2)
    _, info = env.reset(seed=1)
    start = info["time"]
    assert start == pytest.approx(ADDED + DT)
    outcomes = [env.step([0.0]) for _ in range(6)]
    assert [outcome[2:4] for outcome in outcomes] == [(False, False)] * 5 + [(False, True)]
    info = outcomes[-1][-1]
    assert info["time"] == pytest.approx(start + 12 * DT)
    assert info["result"].settings.time_limit == pytest.approx(info["time"])


@pytest.mark.parametrize("environment", [EidriveEnv, EidriveParallelEnv])
def test_entry_with_the_last_tick_is_an_error(environment: type[EidriveEnv | EidriveParallelEnv]) -> None:
    env = environment(visits(ADDED + DT))
    with pytest.raises(SettingError, match="enters the world before the last tick"):
        env.reset(seed=1)


@pytest.mark.parametrize(("max_steps", "end_reason"), [(None, "stop trigger"), (40, "time limit")])
def test_departure_terminates_although_the_station_returns(max_steps: int | None, end_reason: str) -> None:
    env = EidriveEnv(visits(), max_steps=max_steps)
    _, info = env.reset(seed=1)
    start, count, ended = info["time"], 0, False
    while not ended:
        observation, _, terminated, truncated, info = env.step([0.0])
        ended, count = terminated or truncated, count + 1
    assert (terminated, truncated, info["end_reason"]) == (True, False, end_reason)
    assert count == round((DELETED + DT - start) / DT)
    assert not any(np.any(part) for part in observation.values())


@pytest.mark.parametrize("ticks_per_step", [1, 40])
def test_agent_does_not_return_with_its_station(ticks_per_step: int) -> None:
    """PettingZoo: an agent cannot be revived. One of the steps of 40 ticks contains departure and return."""
    single = EidriveEnv(visits(), ticks_per_step=ticks_per_step)
    env = EidriveParallelEnv(visits(), ticks_per_step=ticks_per_step)
    single.reset(seed=1)
    env.reset(seed=1)
    terminated = False
    while not terminated:
        _, reward, terminated, _, info = single.step([1.0])
        observations, rewards, ends, limits, infos = env.step({"Ego": [1.0]})
        assert (rewards["Ego"], ends["Ego"], limits["Ego"]) == (reward, terminated, False)
    assert (env.agents, infos["Ego"]["trace_hash"]) == ([], info["trace_hash"])
    assert not any(np.any(part) for part in observations["Ego"].values())


def two_stations() -> bytes:
    """Return the visits of Ego with a car that is always present, which stands at s = 60 m."""
    other = round_car_xml("Other", agent_xml(planner="route", target_speed=10))
    parts = visits().replace(b"</Entities>", other.encode() + b"</Entities>")
    start = init_xml("Other", teleport_xml(lane_position_xml(-1, 60.0))).encode()
    return parts.replace(b"<Actions></Actions>", b"<Actions>" + start + b"</Actions>")


def test_entry_within_a_step_keeps_messages_of_all_its_ticks() -> None:
    """Other sends twice per second; an environment with one tick per step registers each message."""
    station = b'<Property name="detector" value="oracle"/><Property name="message_rate" value="2"/></Properties>'
    ages: dict[int, dict[float, list[list[float]]]] = {1: {}, 16: {}}
    for ticks, of_time in ages.items():
        env = EidriveParallelEnv(
            two_stations().replace(b"</Properties>", station),
            observation={"senders": True},
            settings=RunSettings(channel="ideal"),
            ticks_per_step=ticks,
        )
        env.reset(seed=1)
        for _ in range(32 // ticks):
            observations, *_, infos = env.step({name: [-1.0] for name in env.agents})
            if "Ego" in observations:
                of_time[infos["Ego"]["time"]] = observations["Ego"]["senders"].tolist()
        env.close()
    ((time, seen),) = ages[16].items()
    assert (seen, seen[0][0]) == (ages[1][time], 1.0)


def test_checks_of_pettingzoo_accept_departure_and_return() -> None:
    env = EidriveParallelEnv(two_stations())
    assert env.possible_agents == ["Ego", "Other"]
    parallel_api_test(env, num_cycles=100)


def test_picture_before_entry_of_its_station_shows_a_present_one() -> None:
    """The road begins at x = -80 m, and the center of the box is 1.5 m ahead of the rear axle."""
    env = EidriveParallelEnv(two_stations(), render_mode="rgb_array")
    env.reset(seed=1)
    assert env._renderer is not None
    assert env._renderer._center == pytest.approx((60.0 - 80.0 + 1.5, 0.0))
    env.close()

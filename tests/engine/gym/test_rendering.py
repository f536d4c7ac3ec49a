"""Pictures of the environments."""

from __future__ import annotations

import math
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import AddRenderObservation
from lone_car import lone_car
from numpy.typing import NDArray

from eidrive_scenario.errors import SettingError, SimulationError
from eidrive_scenario.gym import ENVIRONMENT_ID, EidriveEnv, EidriveParallelEnv
from eidrive_scenario.reporting.drawing.top_view import STATION
from eidrive_scenario.simulation import RunSettings

ONE = "coop/scenario_1"
SMALL = {"width": 320, "height": 180, "extent": 80.0}
EGO_COLOR = [int(STATION[start : start + 2], 16) for start in (1, 3, 5)]


def make(**arguments: Any) -> gymnasium.Env[Any, Any]:
    return gymnasium.make(f"eidrive_scenario.gym:{ENVIRONMENT_ID}", scenario=ONE, **arguments)


def ego_pixels(picture: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return the pixels (height, width) in the color of the controlled station."""
    return np.asarray((picture == EGO_COLOR).all(axis=-1))


def test_checker_of_gymnasium_accepts_the_pictures() -> None:
    env = make(max_steps=10, render_mode="rgb_array", render=SMALL)
    check_env(env.unwrapped, skip_render_check=False)
    env.close()


def test_station_is_drawn_in_the_middle_with_its_size() -> None:
    env = EidriveEnv(lone_car(), action="pedals", render_mode="rgb_array", render=SMALL)
    env.reset(seed=1)
    for _ in range(30):
        env.step([0.5, 0.0])
        picture = env.render()
        assert (picture.shape, picture.dtype) == ((180, 320, 3), np.uint8)
        rows, columns = ego_pixels(picture[60:120, 120:200]).nonzero()
        # The view is 80 m wide: 4 pixels per meter. The road leads along x.
        assert columns.mean() == pytest.approx(40.0, abs=3.0)
        assert rows.mean() == pytest.approx(30.0, abs=3.0)
        assert 8 <= np.ptp(columns) <= 24
        assert 3 <= np.ptp(rows) <= 10


def test_actors_are_drawn_at_their_positions_of_the_current_instant() -> None:
    env = EidriveEnv(ONE, render_mode="rgb_array", render={**SMALL, "extent": 160.0})
    env.reset(seed=1)
    for _ in range(60):
        env.step([0.0])
    assert env._episode is not None
    view, picture = env._episode.start.view, env.render()
    # The incoming car starts at (29.5, 36.5) m and speeds up by 3.5 m/s²; the picture is centered on the ego.
    ego, incoming = (view.centers[view.row(name)] for name in ("Ego", "Incoming"))
    assert incoming[1] == pytest.approx(36.5 - 3.5 * 3.0**2 / 2.0, abs=1.0)
    column, row = 160 + (incoming[0] - ego[0]) * 2.0, 90 - (incoming[1] - ego[1]) * 2.0
    around = picture[round(row) - 2 : round(row) + 3, round(column) - 2 : round(column) + 3].astype(float)
    road = picture[round(row) - 12, round(column) - 2 : round(column) + 3].astype(float)
    assert math.dist(around.mean(axis=(0, 1)), road.mean(axis=0)) > 20.0


def test_list_of_pictures_has_one_per_step_and_reset() -> None:
    env = make(max_steps=5, render_mode="rgb_array_list", render=SMALL)
    env.reset(seed=1)
    for _ in range(4):
        env.step(np.zeros(1, np.float32))
    pictures: Any = env.render()
    assert len(pictures) == 5
    assert all(picture.shape == (180, 320, 3) for picture in pictures)
    env.close()


def test_pictures_can_be_observations() -> None:
    env = AddRenderObservation(make(max_steps=3, render_mode="rgb_array", render=SMALL), render_only=True)
    observation, _ = env.reset(seed=1)
    assert env.observation_space.contains(observation)
    assert ego_pixels(np.asarray(observation)).any()
    env.close()


def test_frame_rate_is_that_of_the_steps() -> None:
    assert EidriveEnv(ONE).metadata["render_fps"] == pytest.approx(20.0)
    env = EidriveEnv(ONE, settings=RunSettings(dt=0.1), ticks_per_step=5, render_mode="rgb_array")
    assert env.metadata["render_fps"] == pytest.approx(2.0)
    assert EidriveParallelEnv(ONE, ticks_per_step=2).metadata["render_fps"] == pytest.approx(10.0)


def test_pictures_leave_the_run_unchanged() -> None:
    hashes = []
    for mode in (None, "rgb_array"):
        env = EidriveEnv(lone_car(2.0), render_mode=mode, render=SMALL)
        env.reset(seed=4)
        ended = False
        while not ended:
            *_, terminated, truncated, info = env.step([0.0])
            ended = terminated or truncated
            if mode is not None:
                env.render()
        hashes.append(info["trace_hash"])
    assert hashes[0] == hashes[1]


def test_pictures_of_several_stations_follow_the_first() -> None:
    env = EidriveParallelEnv(ONE, stations=["Ego", "RSU"], action="send", render_mode="rgb_array", render=SMALL)
    with pytest.raises(SimulationError, match="no episode"):
        env.render()
    env.reset(seed=1)
    env.step({"Ego": 1, "RSU": 1})
    assert ego_pixels(env.render()[80:100, 140:180]).any()
    env.close()


def test_invalid_render_modes_and_sizes_are_errors() -> None:
    with pytest.raises(SettingError, match="render_mode is 'ansi'"):
        EidriveEnv(ONE, render_mode="ansi")
    with pytest.raises(SettingError, match="width"):
        EidriveEnv(ONE, render_mode="rgb_array", render={"width": 10})
    with pytest.raises(SimulationError, match="no episode"):
        EidriveEnv(ONE, render_mode="rgb_array").render()


def test_rendering_without_a_mode_is_a_warning() -> None:
    env = EidriveEnv(ONE)
    with pytest.warns(UserWarning, match="no render mode"):
        assert env.render() is None

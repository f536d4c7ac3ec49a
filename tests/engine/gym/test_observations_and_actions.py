"""Observations and effects of actions of the environment."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
from lone_car import lone_car
from openscenario_xml import agent_xml, parameters_xml, road_file_xml, round_car_xml, scenario_xml
from storyboard_xml import end_xml, init_xml, lane_position_xml, teleport_xml

from eidrive_scenario.base.detections import CLASSES, Detections
from eidrive_scenario.driving.planning.path import PlannedPath
from eidrive_scenario.evaluation.nearest_actor import min_time_to_collision
from eidrive_scenario.gym import EidriveEnv, GridSettings, RewardSettings
from eidrive_scenario.gym.observations import (
    COLUMNS,
    nearest_rows,
    object_values,
    occupancy_grid,
    points_ahead,
)
from eidrive_scenario.gym.settings import RouteSettings
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.simulation import RunSettings

ALL_PARTS = {"own": True, "senders": True, "grid": True}


@pytest.mark.exhaustive
@pytest.mark.parametrize("normalized", [True, False])
@pytest.mark.parametrize("scenario", ["coop/scenario_5", "driving/roundabout", "corner_cases/wrong_clock"])
def test_spaces_contain_all_observations_of_an_episode(scenario: str, normalized: bool) -> None:
    observed = {**ALL_PARTS, "normalized": normalized}
    env = EidriveEnv(scenario, observation=observed, action="pedals", max_steps=60, ticks_per_step=2)
    observation, _ = env.reset(seed=5)
    env.action_space.seed(5)
    ended = False
    while not ended:
        assert env.observation_space.contains(observation)
        assert all(np.isfinite(part).all() for part in observation.values())
        observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
        ended = terminated or truncated
    assert env.observation_space.contains(observation)


def test_observation_of_lone_car_states_its_motion_and_route() -> None:
    env = EidriveEnv(lone_car(), observation={"normalized": False}, action="pedals")
    env.reset(seed=1)
    for _ in range(20):
        observation, *_ = env.step([0.3, 0.0])
    speed, acceleration, yaw_rate, _, _, throttle, brake, steering = observation["ego"].tolist()
    # 30 % of 10 m/s² for 1 s; air drag and rolling resistance take at most 0.2 m/s².
    assert (speed, acceleration, yaw_rate) == pytest.approx((3.0, 3.0, 0.0), abs=0.2)
    assert (throttle, brake, steering) == pytest.approx((0.3, 0.0, 0.0))
    # The lane is straight: the route is ahead, in steps of 5 m.
    expected = [[1.0, 5.0 * step, 0.0] for step in range(1, 11)]
    assert observation["route"] == pytest.approx(np.array(expected), abs=0.05)
    assert not observation["tracks"].any()


def test_route_points_are_on_the_path_from_the_point_at_the_vehicle() -> None:
    """On a circle of 50 m around the origin, 2 m right of it, and heading along it at its angle 0.3."""
    angles = np.linspace(0.0, 2.0, 500)
    path = PlannedPath(50.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1), ends=True)
    x, y = 52.0 * math.cos(0.3), 52.0 * math.sin(0.3)
    vehicle = EgoState(0.0, np.array([x, y, 0.0]), 0.3 + math.pi / 2.0, 0.0, 0.0, 4.0, 0.0, 0.0)
    found = points_ahead(path.part(path.project(x, y), 60), vehicle, RouteSettings(points=4, spacing=10.0))
    turned = [step * 10.0 / 50.0 for step in range(1, 5)]
    expected = [value for turn in turned for value in (1.0, 50.0 * math.sin(turn), 52.0 - 50.0 * math.cos(turn))]
    assert found == pytest.approx(expected, abs=0.05)


def test_route_points_end_with_the_path() -> None:
    """The path is 20 m long; from 3 m before its beginning, points of 8 m are at 8 m and 16 m of it."""
    path = PlannedPath(np.array([[0.0, 0.0], [20.0, 0.0]]), ends=True)
    vehicle = EgoState(0.0, np.array([-3.0, 1.0, 0.0]), 0.0, 0.0, 0.0, 4.0, 0.0, 0.0)
    found = points_ahead(path.part(0, 60), vehicle, RouteSettings(points=5, spacing=8.0))
    assert found == pytest.approx([1.0, 11.0, -1.0, 1.0, 19.0, -1.0])
    beyond = EgoState(0.0, np.array([30.0, 0.0, 0.0]), 0.0, 0.0, 0.0, 4.0, 0.0, 0.0)
    assert points_ahead(path.part(19, 60), beyond, RouteSettings(points=5, spacing=8.0)) == []


def test_left_steering_turns_left_with_the_radius_of_the_wheelbase() -> None:
    env = EidriveEnv(lone_car(), observation={"normalized": False}, action="pedals")
    env.reset(seed=1)
    for _ in range(30):
        observation, *_ = env.step([0.15, 0.1])
    speed, _, yaw_rate, *_, steering = observation["ego"].tolist()
    # Kinematic single-track model: yaw rate = v tan(steering) / wheelbase, and a wheelbase of 3 m.
    assert steering > 0.0
    assert yaw_rate == pytest.approx(speed * math.tan(steering) / 3.0, rel=0.05)


def test_normalized_observation_is_that_in_si_units_by_its_bounds() -> None:
    plain = EidriveEnv("coop/scenario_1", observation={"normalized": False, "own": True})
    scaled = EidriveEnv("coop/scenario_1", observation={"own": True})
    flat = EidriveEnv("coop/scenario_1", observation={"own": True, "flat": True})
    for env in (plain, scaled, flat):
        env.reset(seed=2)
    for _ in range(30):
        in_units, normalized, vector = (env.step([0.0])[0] for env in (plain, scaled, flat))
    for key, values in in_units.items():
        assert normalized[key] == pytest.approx(values / plain.observation_space[key].high, abs=1e-6)  # type: ignore[index]
    assert np.array_equal(vector, np.concatenate([normalized[key].reshape(-1) for key in sorted(normalized)]))
    assert in_units["tracks"][:, 0].sum() > 0


@pytest.mark.parametrize("messages", [{}, {"share": [1]}])
def test_meta_speeds_move_along_their_list(messages: dict[str, Any]) -> None:
    """By one entry per step, which lasts several ticks; also beside an action that concerns messages."""
    drive = {"kind": "meta_speed", "speeds": [0.0, 3.0, 6.0]}
    env = EidriveEnv(
        lone_car(30.0), action=[drive, *({"kind": kind, "count": 1} for kind in messages)], ticks_per_step=60
    )
    env.reset(seed=1)
    speeds = []
    for action in (2, 2, 2, 1, 0):
        env.step({"meta_speed": action, **messages} if messages else action)
        assert env._episode is not None
        speeds.append(float(env._episode.start.view.speed[0]))
    assert speeds == pytest.approx([3.0, 6.0, 6.0, 6.0, 3.0], abs=0.1)


def test_withheld_messages_leave_the_receiver_without_the_sender() -> None:
    results = {}
    for name, action in (("sent", 1), ("withheld", 0)):
        env = EidriveEnv("coop/scenario_1", station="RSU", action="send", settings=RunSettings(time_limit=3.0))
        env.reset(seed=1)
        ended, info = False, dict[str, Any]()
        while not ended:
            *_, terminated, truncated, info = env.step(action)
            ended = terminated or truncated
        results[name] = info["result"].metrics["messages.sent"]
    assert results["withheld"] == 0
    assert results["sent"] > 0


def two_objects() -> Detections:
    return Detections(
        9.5,
        np.array([[10.0, 24.0, 0.7, 4.0, 2.0, 1.5, math.pi / 2], [10.0, 30.0, 0.7, 1.0, 0.5, 1.8, 0.0]]),
        np.array([0.9, 0.4]),
        ("car", "pedestrian"),
        np.array([[0.0, 5.0], [math.nan, math.nan]]),
        np.array([np.diag([1.0, 4.0]), np.full((2, 2), math.nan)]),
    )


EGO = EgoState(10.0, np.array([10.0, 20.0, 0.0]), math.pi / 2, 0.0, 0.0, 3.0, 0.0, 0.0)
"""A car at (10, 20) that heads north: x of its frame is north, y is west."""


def test_table_rows_are_in_the_frame_of_the_vehicle() -> None:
    rows = np.reshape(object_values(two_objects(), EGO, 10.0, count=3, reach=50.0), (2, -1))
    car, walker = (dict(zip(COLUMNS, row, strict=True)) for row in rows.tolist())
    named: dict[str, Any] = {"present": 1.0, "x": 4.0, "y": 0.0, "velocity_x": 5.0, "velocity_y": 0.0, "cos": 1.0}
    # The deviation is 1 m to the east, which is across the vehicle, and 2 m along it.
    named |= {"existence": 0.9, "deviation_x": 2.0, "deviation_y": 1.0, "age": 0.5, "car": 1.0, "velocity_known": 1.0}
    assert {name: car[name] for name in named} == pytest.approx(named, abs=1e-12)
    assert [walker[name] for name in ("x", "velocity_known", "covariance_known", "pedestrian")] == [10.0, 0.0, 0.0, 1.0]
    assert walker["sin"] == pytest.approx(-1.0)
    assert sum(car[name] for name in CLASSES) == 1.0
    assert list(object_values(two_objects(), EGO, 10.0, count=3, reach=5.0)) == rows[0].tolist()
    assert list(object_values(two_objects(), EGO, 10.0, count=1, reach=50.0)) == rows[0].tolist()
    assert not len(object_values(two_objects(), EGO, 10.0, count=3, reach=1.0))


def test_grid_cells_of_an_object_contain_its_existence_and_velocity() -> None:
    settings = GridSettings(length=40, width=20, resolution=0.5, behind=5.0)
    grid = occupancy_grid(two_objects(), np.array([[0.0, 0.0], [14.0, 0.0]]), EGO, settings)
    # Car from x = 2 m to 6 m and y = -1 m to 1 m: rows 14 to 21, columns 8 to 11.
    assert grid[:, 18, 10].tolist() == pytest.approx([0.9, 5.0, 0.0, 1.0])
    assert np.count_nonzero(grid[1]) == pytest.approx(8 * 4, abs=14)
    occupied = np.argwhere(grid[1] > 0.0)
    assert (occupied.min(axis=0) >= [13, 7]).all()
    assert (occupied.max(axis=0) <= [22, 12]).all()
    # The route begins at the reference point, with a round end of half its width of 3.5 m.
    assert not grid[3, :5].any()


def test_reward_terms_are_weights_by_quantities() -> None:
    weights = RewardSettings(progress=1.0, comfort=0.0, time_to_collision=0.0, time=-0.5, passed=7.0)
    settings = RunSettings(criteria={"time_limit": {"within": 60}})
    env = EidriveEnv(lone_car(2.0), reward=weights, action="pedals", settings=settings)
    env.reset(seed=1)
    assert env._episode is not None
    start = env._episode.start.view.position[0, 0]
    total, ended, info = {"progress": 0.0, "time": 0.0}, False, dict[str, Any]()
    while not ended:
        _, reward, terminated, truncated, info = env.step([0.3, 0.0])
        ended = terminated or truncated
        total = {name: value + info["reward_terms"][name] for name, value in total.items()}
        assert reward == pytest.approx(sum(info["reward_terms"].values()))
    assert total["progress"] == pytest.approx(env._episode.start.view.position[0, 0] - start, rel=1e-6)
    assert total["time"] == pytest.approx(-0.5 * info["time"])
    assert info["reward_terms"]["passed"] == 7.0


def test_time_to_collision_concerns_the_actor_on_the_own_course_only() -> None:
    env = EidriveEnv("driving/lead_stopped", action="target_speed")
    env.reset(seed=1)
    for _ in range(40):
        env.step([0.0])
    assert env._episode is not None
    view = env._episode.start.view
    # The truck stands in the lane of the car; nearer cars come towards it in the other lane.
    ego, truck = view.row("Ego"), view.row("Truck")
    gap = view.centers[truck, 0] - view.centers[ego, 0] - (view.size[truck, 0] + view.size[ego, 0]) / 2.0
    expected = gap / view.speed[ego]
    assert min_time_to_collision(view, "Ego", 60.0) == pytest.approx(expected, rel=1e-9)
    assert min_time_to_collision(view, "Ego", expected - 0.1) == math.inf
    env.close()


@pytest.mark.parametrize("count", [1, 3, 30])
def test_table_rows_of_random_objects_are_rotated_by_matrices(count: int) -> None:
    draws = np.random.default_rng(count)
    roots = draws.normal(size=(count, 2, 2))
    covariance, velocity = roots @ roots.transpose(0, 2, 1), draws.normal(0.0, 9.0, (count, 2))
    covariance[::3], velocity[1::3] = np.nan, np.nan
    classes = tuple(draws.choice(CLASSES, count).tolist())
    boxes = draws.normal(0.0, 20.0, (count, 7))
    objects = Detections(1.0, boxes, draws.random(count), classes, velocity, covariance)
    ego = EgoState(1.5, np.array([3.0, -2.0, 0.0]), 2.5, 0.0, 0.0, 4.0, 0.0, 0.0)
    rows = np.array(nearest_rows(objects, ego))
    table = np.reshape(object_values(objects, ego, 1.5, count=count, reach=1e3), (count, len(COLUMNS)))
    column = dict(zip(COLUMNS, table.T, strict=True))
    world_from_vehicle = np.array([[math.cos(2.5), -math.sin(2.5)], [math.sin(2.5), math.cos(2.5)]])
    for names, expected in (
        (("x", "y"), (boxes[rows, :2] - [3.0, -2.0]) @ world_from_vehicle),
        (("velocity_x", "velocity_y"), np.nan_to_num(velocity[rows]) @ world_from_vehicle),
        (("length", "width"), boxes[rows, 3:5]),
    ):
        np.testing.assert_allclose(np.stack([column[name] for name in names], axis=1), expected, atol=1e-12)
    variance = world_from_vehicle.T @ np.nan_to_num(covariance[rows]) @ world_from_vehicle
    np.testing.assert_allclose(column["deviation_x"] ** 2, variance[:, 0, 0], atol=1e-12)
    np.testing.assert_allclose(column["deviation_y"] ** 2, variance[:, 1, 1], atol=1e-12)
    np.testing.assert_allclose(np.arctan2(column["sin"], column["cos"]), _turned(boxes[rows, 6] - 2.5), atol=1e-12)
    assert column["velocity_known"].tolist() == np.isfinite(velocity[rows, 0]).tolist()
    assert column["covariance_known"].tolist() == np.isfinite(covariance[rows, 0, 0]).tolist()
    assert [CLASSES[index] for index in table[:, -len(CLASSES) :].argmax(axis=1)] == [classes[row] for row in rows]


def _turned(angle: Any) -> Any:
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@pytest.mark.parametrize("count", [5, 40])
def test_nearest_rows_are_ordered_by_distance_then_row(count: int) -> None:
    draws = np.random.default_rng(count)
    boxes = np.zeros((count, 7))
    boxes[:, 0] = draws.integers(-5, 6, count)
    objects = Detections(0.0, boxes, np.ones(count), ("car",) * count, np.zeros((count, 2)), np.zeros((count, 2, 2)))
    ego = EgoState(0.0, np.zeros(3), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    expected = sorted((abs(x), row) for row, x in enumerate(boxes[:, 0].tolist()) if abs(x) <= 4.0)
    assert nearest_rows(objects, ego, 4.0) == [row for _, row in expected]


def test_time_to_collision_of_reward_ignores_the_own_trailer() -> None:
    """The box of the car ends at the hitch; that of the trailer begins 1 m ahead of its coupler."""
    car = round_car_xml("Ego", agent_xml(planner="route", target_speed=10))
    towing = '<TrailerHitch dx="-1"/><Trailer><TrailerRef entityRef="Box"/></Trailer></Vehicle>'
    box = round_car_xml("Box").replace("</Vehicle>", '<TrailerCoupler dx="3"/></Vehicle>')
    scenario = scenario_xml(
        road=road_file_xml("eidrive_library/roads/two_lane_road.xodr"),
        entities=car.replace("</Vehicle>", towing) + box.replace('vehicleCategory="car"', 'vehicleCategory="trailer"'),
        init=init_xml("Ego", teleport_xml(lane_position_xml(-1, 40.0))),
        stop=end_xml(2.0),
    )
    env = EidriveEnv(scenario)
    env.reset(seed=1)
    *_, info = env.step([0.0])
    assert info["reward_terms"]["time_to_collision"] == 0.0
    env.close()


def test_steering_is_a_share_of_the_maximum_of_the_episode() -> None:
    declared = parameters_xml(Steering=("double", "0.5"))
    parameter = re.sub(rb'maxSteering="0?[.]\d+"', b'maxSteering="$Steering"', lone_car(), count=1)
    env = EidriveEnv(parameter.replace(b"<CatalogLocations", declared.encode() + b"<CatalogLocations"), action="pedals")
    for angle in (0.25, 0.5):
        env.reset(seed=1, options={"parameters": {"Steering": angle}})
        env.step([0.0, -1.0])
        assert env._episode is not None
        assert env._episode.last_frame is not None
        control = env._episode.last_frame.steps["Ego"].control
        assert control is not None
        assert control.steering == -angle
    env.close()

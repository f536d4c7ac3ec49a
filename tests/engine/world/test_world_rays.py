"""Tests of ray casts."""

from __future__ import annotations

import numpy as np
import pytest
from sample_car import CarFactory

from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Placement
from eidrive_scenario.world.appearance import Appearance, Visibility


def test_ray_hits_the_first_box(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(10.0, 0.0))
    world.add(car("B"), Placement(30.0, 0.0))
    hits = world.raycast(
        [[0, 0, 0.7], [0, 0, 0.7], [0, 0, 5.0], [0, 0, 2.0]], [[50, 0, 0.7], [0, 50, 0.7], [50, 0, 5.0], [0, 5, -2.0]]
    )
    assert hits.rows.tolist() == [0, -2, -2, -1]
    # The rear of A is 0.9 m behind its rear axle.
    assert hits.position[0] == pytest.approx((9.1, 0.0, 0.7), abs=1e-3)
    assert hits.fraction[0] == pytest.approx(9.1 / 50, abs=1e-4)
    assert hits.normal[0] == pytest.approx((-1.0, 0.0, 0.0), abs=1e-6)
    assert hits.position[3] == pytest.approx((0.0, 2.5, 0.0), abs=1e-6)
    assert hits.position[1].tolist() == [0, 50, 0.7]


def test_rays_pass_ignored_actors(world: World, car: CarFactory) -> None:
    for index in range(3):
        world.add(car(f"C{index}"), Placement(10.0 + 10.0 * index, 0.0))
    assert world.raycast([[0, 0, 0.7]], [[60, 0, 0.7]], ignore=("C0", "C1")).rows.tolist() == [2]
    hits = world.raycast([[0, 0, 0.7]], [[60, 0, 0.7]], ignore=("C0", "C1", "C2"))
    assert (hits.rows.tolist(), hits.fraction.tolist()) == ([-2], [1.0])
    assert world.raycast([[0, 0, 0.7]], [[60, 0, 0.7]], ignore=("C0",)).position[0, 0] == pytest.approx(19.1, abs=1e-3)


def test_rays_pass_ignored_actors_in_all_directions(world: World, car: CarFactory) -> None:
    """Rays pass in any direction, also along a wall, and hit the body behind."""
    rng = np.random.default_rng(4)
    world.add(car("Hidden"), Placement(100.0, -70.0, yaw=0.7))
    world.add(car("Behind"), Placement(100.0, -30.0, yaw=2.0))
    hidden, behind = world.view().boxes[:, :3]
    direction = rng.normal(size=(3000, 3)) * (1.0, 1.0, 0.3)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    begin, end = hidden - 20.0 * direction, hidden + rng.normal(size=(3000, 3)) * 0.6 + 15.0 * direction
    assert np.count_nonzero(world.raycast(begin, end).rows == 0) > 1500
    assert not np.any(world.raycast(begin, end, ignore=("Hidden",)).rows == 0)
    through = hidden + (hidden - behind) + rng.uniform(-0.3, 0.3, size=(500, 3))
    assert world.raycast(through, np.broadcast_to(behind, (500, 3)), ignore=("Hidden",)).rows.tolist() == [1] * 500


def test_line_of_sight_behind_a_truck_is_blocked(world: World, car: CarFactory) -> None:
    world.add(car("Truck"), Placement(10.0, 0.0))
    clear = world.raycast((0, 0, 1.0), [[20, 0, 1.0], [20, 0, 4.0], [8.0, 0, 1.0], [20, 3, 1.0]]).fraction >= 1.0
    assert clear.tolist() == [False, True, True, True]


def test_rays_hit_actors_at_current_positions(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(10.0, 0.0))
    assert world.raycast([[0, 0, 0.7]], [[50, 0, 0.7]]).rows.tolist() == [0]
    world.step({"A": Placement(10.0, 5.0)}, {})
    assert world.raycast([[0, 0, 0.7]], [[50, 0, 0.7]]).rows.tolist() == [-2]
    world.step({"A": Placement(30.0, 0.0, teleport=True)}, {})
    assert world.raycast([[0, 0, 0.7]], [[50, 0, 0.7]]).position[0, 0] == pytest.approx(29.1, abs=1e-3)
    world.remove("A")
    assert world.raycast([[0, 0, 0.7]], [[50, 0, 0.7]]).rows.tolist() == [-2]


def test_ray_hits_moving_driven_car_at_its_position(world: World, car: CarFactory) -> None:
    world.add(car("Ego"), Placement(0.0, 0.0, speed=30.0), driven=True)
    for _ in range(5):
        world.step({}, {})
        x = float(world.view().position[0, 0])
        hits = world.raycast([[100.0, 0.0, 0.7]], [[-100.0, 0.0, 0.7]])
        assert hits.position[0, 0] == pytest.approx(x + 3.6, abs=1e-3)


def test_buildings_block_rays_as_ground(world: World) -> None:
    world.add_building("House", (20.0, 0.0, 4.0), (10.0, 10.0, 8.0), yaw=0.3)
    assert world.raycast([[0, 0, 2.0]], [[40, 0, 2.0]]).rows.tolist() == [-1]
    assert world.raycast((0, 0, 2.0), [[40, 0, 2.0]]).fraction[0] < 1.0


def test_many_rays_equal_geometry(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(10.0, 0.0))
    targets = np.column_stack([np.full(20_000, 30.0), np.linspace(-10, 10, 20_000), np.full(20_000, 0.7)])
    hits = world.raycast([[0.0, 0.0, 0.7]], targets)
    assert hits.rows.shape == (20_000,)
    # From the origin the rear of the box covers |y| / 30 up to 0.9 / 9.1; its sides are in that shadow.
    assert (hits.rows == 0).mean() == pytest.approx(2 * 30 * 0.9 / 9.1 / 20, abs=0.002)


def test_rays_pass_actor_hidden_from_sensors(world: World, car: CarFactory) -> None:
    world.add(car(), Placement(8.0, 0.0))
    world.set_display_state({}, {"Ego": Appearance(visibility=Visibility(sensors=False))})
    assert world.raycast((0.0, 0.0, 0.5), [(20.0, 0.0, 0.5)]).rows[0] == -2
    assert world.view().unseen == ("Ego",)
    world.set_display_state({}, {})
    assert world.view().unseen == ()
    assert world.raycast((0.0, 0.0, 0.5), [(20.0, 0.0, 0.5)]).rows[0] == 0

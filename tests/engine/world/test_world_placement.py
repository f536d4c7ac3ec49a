"""Tests of scripted actors, views, and names in the world."""

from __future__ import annotations

import math

import numpy as np
import pytest
from camera_image import camera_image
from sample_car import CarFactory

from eidrive_scenario.errors import SettingError, SimulationError
from eidrive_scenario.rendering import picture_maker
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Control, Placement
from eidrive_scenario.world.physics.engine import substeps_per_tick


def test_scripted_actors_have_exactly_their_placements(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(1.1, 2.2, 0.3, 0.4, 0.01, -0.02, speed=7.0))
    placement = Placement(1.3, 2.25, 0.3, 0.5, 0.02, -0.01, speed=6.5)
    world.step({"A": placement}, {})
    view = world.view()
    assert view.position[0].tolist() == [1.3, 2.25, 0.3]
    assert (view.yaw[0], view.pitch[0], view.roll[0]) == (0.5, 0.02, -0.01)
    assert view.speed[0] == 6.5
    assert (view.time, view.tick) == (0.05, 1)


def test_velocity_follows_speed_and_displacement(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(0.0, 0.0, speed=10.0))
    first = world.view()
    assert first.velocity[0].tolist() == [10.0, 0.0, 0.0]
    assert first.acceleration[0].tolist() == [0.0, 0.0, 0.0]
    world.step({"A": Placement(0.51, 0.05, speed=10.4)}, {})
    view = world.view()
    # The velocity along the heading is the stated speed, the lateral one the distance over dt.
    assert view.velocity[0] == pytest.approx((10.4, 1.0, 0.0))
    assert view.acceleration[0] == pytest.approx((8.0, 20.0, 0.0))


def test_placement_without_lateral_motion_has_tangential_velocity(world: World, car: CarFactory) -> None:
    """A circle of 50 m at 10 m/s has 0.2 rad/s and 2 m/s² to the center; the chord of a step lags by half of it."""
    world.add(car("A"), Placement(0.0, 0.0, speed=10.0))
    for number in (1, 2):
        angle = 0.01 * number
        x, y = 50.0 * math.sin(angle), 50.0 * (1.0 - math.cos(angle))
        world.step({"A": Placement(x, y, yaw=angle, speed=10.0, across=False)}, {})
        view = world.view()
        assert view.velocity[0] == pytest.approx((10.0 * math.cos(angle), 10.0 * math.sin(angle), 0.0))
        assert np.hypot(*view.acceleration[0, :2]) == pytest.approx(2.0, rel=1e-4)


def test_yaw_rate_wraps(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(0.0, 0.0, yaw=math.pi - 0.01))
    world.step({"A": Placement(0.0, 0.0, yaw=-math.pi + 0.01)}, {})
    assert world.view().yaw_rate[0] == pytest.approx(0.02 / 0.05)


def test_teleport_does_not_affect_velocity(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(0.0, 0.0, speed=5.0))
    world.step({"A": Placement(100.0, 50.0, yaw=math.pi / 2, speed=3.0, teleport=True)}, {})
    view = world.view()
    assert view.velocity[0] == pytest.approx((0.0, 3.0, 0.0))
    assert view.acceleration[0].tolist() == [0.0, 0.0, 0.0]
    assert view.yaw_rate[0] == 0.0


def test_scripted_actor_without_placement_stands(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(1.0, 2.0, speed=5.0))
    world.step({}, {})
    view = world.view()
    assert view.position[0].tolist() == [1.0, 2.0, 0.0]
    assert view.speed[0] == 0.0


def test_rows_follow_the_order_of_addition(world: World, car: CarFactory) -> None:
    for name in ("C", "A", "B"):
        world.add(car(name), Placement(10.0 * ord(name), 0.0))
    world.remove("A")
    world.add(car("A"), Placement(0.0, 0.0))
    view = world.view()
    assert view.names == ("C", "B", "A")
    assert view.row("A") == 2
    assert view.categories == ("car", "car", "car")
    assert view.size.shape == view.offset.shape == (3, 3)


def test_empty_world_has_an_empty_view(world: World) -> None:
    world.step({}, {})
    assert world.view().position.shape == (0, 3)
    assert len(world.view().names) == 0


def test_view_is_immutable(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(0.0, 0.0))
    with pytest.raises(ValueError, match="read-only"):
        world.view().position[0, 0] = 1.0


def test_unknown_and_duplicate_names_are_errors(world: World, car: CarFactory) -> None:
    world.add(car("Ego"), Placement(0.0, 0.0))
    with pytest.raises(SimulationError, match="already"):
        world.add(car("Ego"), Placement(9.0, 0.0))
    with pytest.raises(SimulationError, match="did you mean 'Ego'"):
        world.step({"ego": Placement(0.0, 0.0)}, {})


@pytest.mark.parametrize(("dt", "rate", "count"), [(0.05, 200.0, 10), (0.01, 200.0, 2), (0.03, 200.0, 6), (0.1, 60, 6)])
def test_substeps_per_tick_of_a_multiple(dt: float, rate: float, count: int) -> None:
    assert substeps_per_tick(dt, rate) == count


@pytest.mark.parametrize(("dt", "rate"), [(0.033, 200.0), (0.001, 200.0), (0.0, 200.0)])
def test_substeps_per_tick_of_a_fraction_is_an_error(dt: float, rate: float) -> None:
    with pytest.raises(SettingError, match=r"is a multiple of 0\.005 s"):
        World(dt=dt, physics_rate=rate)


def test_error_of_a_time_step_shows_the_digits_of_its_cause() -> None:
    """The nearest number to 0.05 of 32 bits is 0.0500000007450580597, of which 200 Hz has 10.0000001490116119 steps."""
    with pytest.raises(SettingError, match=r"a tick of 0\.05000000075 s is 10\.00000015 physics steps"):
        substeps_per_tick(float(np.float32(0.05)), 200.0)


def test_set_driven_keeps_motion_and_row(world: World, car: CarFactory) -> None:
    world.add(car("Ego"), Placement(0.0, 0.0, speed=10.0))
    world.add(car("B"), Placement(0.0, 50.0))
    world.set_driven("Ego", True)
    for _ in range(20):
        world.step({}, {"Ego": Control()})
    view = world.view()
    assert view.names == ("Ego", "B")
    assert 9.0 < view.speed[0] < 10.0
    assert view.position[0, 0] == pytest.approx(9.9, abs=0.2)
    world.set_driven("Ego", False)
    world.step({"Ego": Placement(20.0, 0.0, speed=10.0)}, {})
    assert world.view().position[0].tolist() == [20.0, 0.0, 0.0]


def test_distance_is_measured_between_boxes(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(0.0, 0.0))
    world.add(car("B"), Placement(10.0, 0.0))
    world.add(car("C"), Placement(10.0, 4.8, yaw=math.pi))
    assert world.distance("A", "B") == pytest.approx(10.0 - 4.5)
    assert world.distance("B", "C") == pytest.approx(4.8 - 1.8)


def run(seed_speed: float, car: CarFactory, worlds: int) -> list[np.ndarray]:
    """Return the last positions of a scene with collisions in several worlds that are stepped alternately."""
    opened = [World(dt=0.05) for _ in range(worlds)]
    for world in opened:
        world.add(car("Ego"), Placement(0.0, 0.0, speed=seed_speed), driven=True)
        world.add(car("Other"), Placement(30.0, 0.6), driven=True)
        world.add(car("Wall"), Placement(40.0, -3.0, yaw=0.4))
    for tick in range(120):
        for world in opened:
            world.step(
                {"Wall": Placement(40.0 - 0.02 * tick, -3.0, yaw=0.4, speed=-0.4)}, {"Ego": Control(throttle=0.4)}
            )
    results = [np.concatenate([world.view().position.ravel(), world.view().velocity.ravel()]) for world in opened]
    for world in opened:
        world.close()
    return results


def test_concurrent_worlds_are_identical_and_independent(car: CarFactory) -> None:
    alone = run(15.0, car, 1)[0]
    for result in run(15.0, car, 3):
        assert result.tobytes() == alone.tobytes()
    assert run(15.1, car, 1)[0].tobytes() != alone.tobytes()


def test_views_rays_and_images_do_not_change_the_run(car: CarFactory) -> None:
    def play(look: bool) -> bytes:
        with World(dt=0.05, picture_maker=picture_maker) as world:
            world.add(car("Ego"), Placement(0.0, 0.0, speed=12.0), driven=True)
            world.add(car("Other"), Placement(12.0, 0.5), driven=True)
            for _ in range(60):
                if look:
                    world.raycast([[-10.0, 0.0, 0.5]], [[50.0, 0.0, 0.5]])
                    camera_image(world, np.eye(4), 16, 12, 1.0)
                world.step({}, {"Ego": Control(throttle=0.5, steering=0.02)})
            return world.view().position.tobytes()

    assert play(True) == play(False)


@pytest.mark.parametrize("dt", [100.005, 1e300, 1e308, math.inf, math.nan, -1e300])
def test_substeps_per_tick_of_an_immense_tick_is_an_error(dt: float) -> None:
    """All steps are computed in one call, so that the run would not return."""
    with pytest.raises(SettingError, match="give a dt of at most 100 s"):
        substeps_per_tick(dt, 200.0)


def test_view_without_some_actors(world: World, car: CarFactory) -> None:
    for number, name in enumerate(("A", "B", "C")):
        world.add(car(name), Placement(10.0 * number, 0.0))
    less = world.view().without({"B", "nobody"})
    assert (less.names, less.position[:, 0].tolist(), less.rows["C"]) == (("A", "C"), [0.0, 20.0], 1)
    assert world.view().without(()) is world.view()

"""Rays of a rotating sensor: `scan` has the results of `raycast`, bit by bit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from opendrive_xml import elevation_xml, map_xml, road_xml
from sample_car import CarFactory

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.crossing import crossing
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Placement
from eidrive_scenario.world.appearance import Appearance, Visibility
from eidrive_scenario.world.physics import free_space

OBJECTS = "<objects>{}</objects>"
POLE = (
    '<object type="{kind}" id="{number}" name="" s="{s}" t="{t}" zOffset="0" length="{length}" width="{width}" '
    'height="{height}" orientation="none" hdg="{hdg}"/>'
)


def roads(rng: np.random.Generator, profiles: str = "") -> RoadNetwork:
    """Return a road with posts, trees, long barriers and buildings."""
    objects = ""
    for number in range(30):
        kind = ("pole", "tree", "barrier", "building", "vegetation")[number % 5]
        length = rng.uniform(20.0, 60.0) if kind == "barrier" else rng.uniform(0.2, 12.0)
        objects += POLE.format(
            kind=kind, number=number, s=rng.uniform(5.0, 195.0), t=rng.choice([-1, 1]) * rng.uniform(5.0, 40.0),
            length=length, width=rng.uniform(0.2, 4.0), height=rng.uniform(0.5, 12.0), hdg=rng.uniform(-3.0, 3.0),
        )  # fmt: skip
    return RoadNetwork.parse(map_xml(road_xml(length=200.0, extra=OBJECTS.format(objects), profiles=profiles)))


def directions(columns: int = 90, low: float = -40.0, high: float = 25.0) -> Array:
    """Return unit vectors (M, 3) of the rays of a rotating sensor with 16 rings."""
    azimuth, elevation = np.meshgrid(
        np.linspace(-math.pi, math.pi, columns, endpoint=False), np.radians(np.linspace(low, high, 16)), indexing="ij"
    )
    flat = np.cos(elevation)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=2).reshape(-1, 3)


def compare(world: World, apex: Array, reach: float, begin: float = 0.0, sensor: str = "") -> float:
    """Compare both kinds of casts from above the first actor, and return the share of rays that may meet an object."""
    rays = directions()
    origins, targets = apex + begin * rays, apex + reach * rays
    around = world.view().boxes[:1] + np.array([0.0, 0.0, 0.0, 0.04, 0.04, 0.04, 0.0])
    enter, leave = crossing(origins[None], targets[None], around)
    near = ((enter < leave) & (leave > 0.0))[0]
    found = world.scan(0, apex, origins, targets, near, sensor=sensor)
    expected = world.raycast(origins, targets, sensor=sensor)
    for name in ("rows", "fraction", "position", "normal"):
        assert np.array_equal(getattr(found, name), getattr(expected, name)), name
    cast = world._free_space.may_meet(world.view(), 0, apex, targets)
    return float(cast.mean())


@pytest.mark.parametrize("seed", range(8))
def test_scan_equals_ray_casts(car: CarFactory, seed: int) -> None:
    rng = np.random.default_rng(seed)
    shares = []
    with World(roads(rng)) as world:
        for number in range(12):
            x, y, yaw = rng.uniform(0.0, 200.0), rng.uniform(-20.0, 20.0), rng.uniform(-4.0, 4.0)
            world.add(car(f"Car {number}"), Placement(x, y, yaw=yaw))
        for _ in range(6):
            apex = np.array([*world.view().position[0, :2], rng.uniform(1.6, 6.0)])
            shares.append(compare(world, apex, float(rng.uniform(20.0, 120.0)), begin=float(rng.choice([0.0, 0.8]))))
            steps = {
                name: Placement(state.x + rng.uniform(-9.0, 9.0), state.y + rng.uniform(-3.0, 3.0), yaw=state.yaw)
                for name, state in zip(world.names, world.view().states, strict=True)
            }
            world.step(steps, {})
    assert min(shares) < 0.9


def test_scan_in_an_empty_world_casts_no_ray(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(3.0, 4.0))
    assert compare(world, np.array([3.0, 4.0, 2.0]), 80.0) == 0.0


@pytest.mark.parametrize("height", [2.0, 0.0, -1.0])
def test_scan_from_any_height_and_inside_a_building(world: World, car: CarFactory, height: float) -> None:
    world.add(car("A"), Placement(0.0, 0.0))
    world.add_building("Hall", (5.0, 0.0, 5.0), (40.0, 40.0, 10.0))
    world.add_building("Tower", (60.0, 30.0, 50.0), (10.0, 10.0, 100.0))
    compare(world, np.array([0.0, 0.0, height]), 100.0)


def test_all_rays_are_cast_on_slopes_and_beside_tilted_actors(car: CarFactory) -> None:
    rng = np.random.default_rng(3)
    with World(roads(rng, elevation_xml(slope=0.03))) as world:
        world.add(car("A"), Placement(10.0, 0.0))
        assert compare(world, np.array([10.0, 0.0, 3.0]), 60.0) == 1.0
    with World(roads(rng)) as world:
        world.add(car("A"), Placement(10.0, 0.0))
        world.add(car("B"), Placement(30.0, 0.0, pitch=-0.4))
        assert compare(world, np.array([10.0, 0.0, 3.0]), 60.0) == 1.0


@pytest.mark.parametrize("sensor", ["", "lidar"])
def test_scan_skips_hidden_actors(world: World, car: CarFactory, sensor: str) -> None:
    for number in range(4):
        world.add(car(f"Car {number}"), Placement(10.0 * number, 2.0 * number))
    hidden = Visibility(sensors=bool(sensor), named={"lidar": False} if sensor else {})
    world.set_display_state({}, {"Car 2": Appearance(visibility=hidden)})
    compare(world, np.array([0.0, 0.0, 1.8]), 70.0, sensor=sensor)


def test_few_rays_are_all_cast(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(0.0, 0.0))
    targets = 50.0 * directions()[: free_space.FEW - 1]
    assert world._free_space.may_meet(world.view(), 0, np.array([0.0, 0.0, 2.0]), targets).all()
    none = np.empty((0, 3))
    assert len(world.scan(0, np.array([0.0, 0.0, 2.0]), none, none, np.empty(0, dtype=bool)).rows) == 0

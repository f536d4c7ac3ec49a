"""Free space between actors: rays through it meet nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from opendrive_xml import elevation_xml, map_xml, road_xml
from sample_car import CarFactory

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.settings import Mount, TruthSettings
from eidrive_scenario.sensing.truth import TruthSensor, few_visibilities
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Placement

POLES = (
    '<objects><object type="{kind}" id="1" name="" s="40" t="0.5" zOffset="0" length="0.4" width="0.4" height="5" '
    'orientation="none" hdg="0"/></objects>'
)


def sight(world: World, own: int = 0, target: int = 1) -> bool:
    """Return whether the space from 1 m above the center of an actor to another is free."""
    x, y, *_ = world.view().plain_boxes[own]
    return world.is_free(own, (x, y, 1.0), target)


def rays_meet(world: World, own: int, target: int) -> set[int]:
    """Return what rays from 1 m above the center of an actor to points in the box of another meet, except both."""
    boxes = world.view().boxes
    begin = np.array([*boxes[own, :2], 1.0])
    local = np.random.default_rng(5).uniform(-0.49, 0.49, (60, 3)) * boxes[target, 3:6]
    cos, sin = math.cos(boxes[target, 6]), math.sin(boxes[target, 6])
    ends = boxes[target, :3] + local @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    names = world.names
    rows = world.raycast(begin, ends, ignore=(names[own], names[target])).rows
    return set(rows.tolist()) - {-2}


@pytest.mark.statistical
@pytest.mark.parametrize("seed", range(6))
def test_rays_through_free_space_meet_nothing(car: CarFactory, seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = {True: 0, False: 0}
    with World() as world:
        for number in range(12):
            (x, y), yaw = rng.uniform(-120.0, 120.0, 2), rng.uniform(-4.0, 4.0)
            world.add_building(
                f"House {number}", (x, y, 4.0), (*rng.uniform(3.0, 30.0, 2), 8.0), rng.uniform(-4.0, 4.0)
            )
        for number in range(8):
            x, y, yaw = rng.uniform(-80.0, 80.0, 3)
            world.add(car(f"Car {number}"), Placement(x, y, yaw=yaw))
        for tick in range(12):
            for own in range(8):
                for target in range(8):
                    if own == target:
                        continue
                    free = sight(world, own, target)
                    found[free] += 1
                    assert not free or not rays_meet(world, own, target), (tick, own, target)
            turns = rng.uniform(-0.3, 0.3, 8)
            step = 2.0 if tick < 8 else 60.0
            placements = {}
            for name, state, turn in zip(world.names, world.view().states, turns, strict=True):
                yaw = state.yaw + turn
                at = state.x + step * math.cos(yaw), state.y + step * math.sin(yaw)
                placements[name] = Placement(*at, yaw=yaw, speed=20.0 * step)
            world.step(placements, {})
    assert min(found.values()) > 20


def test_an_actor_and_a_building_between_two_block_the_space(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(0.0, 0.0))
    world.add(car("B"), Placement(50.0, 0.0))
    assert sight(world)
    world.add(car("Truck"), Placement(25.0, 1.0))
    assert not sight(world)
    assert not sight(world, 1, 0)
    world.remove("Truck")
    assert sight(world)
    world.add_building("House", (25.0, 6.0, 2.0), (4.0, 10.0, 4.0))
    assert not sight(world)


def test_a_target_behind_a_building_is_not_in_free_space(world: World, car: CarFactory) -> None:
    world.add_building("House", (60.0, -20.0, 4.0), (10.0, 20.0, 8.0))
    world.add(car("A"), Placement(0.0, 0.0))
    world.add(car("B"), Placement(90.0, 30.0, yaw=-math.pi / 2))
    seen, blocked = [], []
    for tick in range(160):
        world.step({"B": Placement(90.0, 30.0 - 0.5 * tick, yaw=-math.pi / 2, speed=10.0)}, {})
        seen.append(sight(world))
        blocked.append(bool(rays_meet(world, 0, 1)))
    assert seen[0]
    assert not seen[-1]
    assert not any(free and met for free, met in zip(seen, blocked, strict=True))
    assert sum(seen) > 0.5 * blocked.index(True)


class RaysOnly:
    """World without knowledge of free space."""

    def __init__(self, world: World) -> None:
        self.first_hit = world.first_hit

    def is_free(self, own: int, origin: tuple[float, float, float], target: int) -> bool:
        return False


@pytest.mark.parametrize("seed", range(20))
def test_visibility_is_that_of_rays_alone(car: CarFactory, seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    reach = float(rng.choice([20.0, 60.0, 120.0]))
    with World() as world:
        for number in range(int(rng.choice([0, 3, 20]))):
            (x, y), yaw = rng.uniform(-reach, reach, 2), rng.uniform(-4.0, 4.0)
            world.add_building(f"House {number}", (x, y, 4.0), (*rng.uniform(1.0, 20.0, 2), 8.0), yaw)
        for number in range(7):
            (x, y), yaw = rng.uniform(-reach, reach, 2), rng.choice([0.0, math.pi / 2.0, rng.uniform(-4.0, 4.0)])
            world.add(car(f"Car {number}"), Placement(x, y, yaw=yaw))
        view = world.view()
        sensors = [
            TruthSensor(TruthSettings(mount=Mount(x=1.35, y=0.0, z=float(z))), world.spec(name))
            for name, z in zip(world.names, rng.choice([0.4, 1.0, 1.5], 7), strict=True)
        ]
        own = list(range(7))
        targets = [[row for row in own if row != station] for station in own]
        shares = few_visibilities(sensors, own, targets, world, view)
        assert shares == few_visibilities(sensors, own, targets, RaysOnly(world), view)  # type: ignore[arg-type]
    assert 0.0 < sum(shares) < len(shares)


@pytest.mark.parametrize("kind", ["pole", "tree", "vegetation"])
def test_road_objects_block_the_space(car: CarFactory, kind: str) -> None:
    for objects, free in (("", True), (POLES.format(kind=kind), False)):
        with World(RoadNetwork.parse(map_xml(road_xml(length=200.0, extra=objects)))) as world:
            world.add(car("A"), Placement(10.0, 0.0))
            world.add(car("B"), Placement(80.0, 0.0))
            assert sight(world) is free


def test_there_is_no_free_space_on_slopes_or_beside_tilted_actors(car: CarFactory) -> None:
    hill = RoadNetwork.parse(map_xml(road_xml(length=200.0, profiles=elevation_xml(slope=0.02))))
    with World(hill) as world:
        world.add(car("A"), Placement(10.0, 0.0))
        world.add(car("B"), Placement(80.0, 0.0))
        assert not sight(world)
    with World() as world:
        world.add(car("A"), Placement(10.0, 0.0))
        world.add(car("B"), Placement(80.0, 0.0))
        world.add(car("C"), Placement(50.0, 30.0, roll=0.5))
        assert not sight(world)


@pytest.mark.parametrize(("gap", "free"), [(0.0, False), (1.0, False), (9.0, True)])
def test_neighbors_have_no_free_space_between_them(world: World, car: CarFactory, gap: float, free: bool) -> None:
    world.add(car("A"), Placement(0.0, 0.0))
    world.add(car("B"), Placement(4.5 + gap, 0.0))
    assert sight(world) is free

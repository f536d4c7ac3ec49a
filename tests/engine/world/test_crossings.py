"""Actors and static objects that lines cross, compared with points along the lines and with rays of pybullet."""

from __future__ import annotations

import numpy as np
import pytest
from opendrive_xml import elevation_xml, map_xml, road_xml
from sample_car import CarFactory

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import rotation_matrix
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Placement

STEPS = 4001


def random_lines(rng: np.random.Generator, count: int, height: tuple[float, float]) -> tuple[Array, Array]:
    """Return starts and ends of lines in a square of 120 m between two heights."""
    low, high = (-60.0, -60.0, height[0]), (60.0, 60.0, height[1])
    return rng.uniform(low, high, (count, 3)), rng.uniform(low, high, (count, 3))


def inside(world: World, begin: Array, end: Array, row: int, shrunk: float) -> bool:
    """Return whether one of many points of a line is inside a box that is smaller on all sides."""
    view = world.view()
    rotation = rotation_matrix(view.yaw[row], view.pitch[row], view.roll[row])
    first, last = ((point - view.position[row]) @ rotation - view.offset[row] for point in (begin, end))
    points = first[:, None] + np.linspace(0.0, 1.0, STEPS) * (last - first)[:, None]
    return bool((np.abs(points) < (view.size[row] / 2.0 - shrunk)[:, None]).all(axis=0).any())


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_crossed_actors_contain_points_of_the_line(car: CarFactory, seed: int, tilt: float) -> None:
    rng = np.random.default_rng(seed)
    found = 0
    with World() as world:
        for number in range(12):
            x, y, yaw = rng.uniform((-50.0, -50.0, -4.0), (50.0, 50.0, 4.0))
            pitch, roll = rng.uniform(-tilt, tilt, 2)
            world.add(car(f"Car {number}"), Placement(x, y, 1.0, yaw, pitch, roll))
        begins, ends = random_lines(rng, 250, (0.8, 3.0))
        crossed = world.crossings(begins, ends, 12)
        pairs = set(zip(crossed.lines.tolist(), crossed.rows.tolist(), strict=True))
        for line in range(len(begins)):
            for row in range(12):
                if inside(world, begins[line], ends[line], row, 0.05):
                    assert (line, row) in pairs
                    found += 1
                elif (line, row) in pairs:
                    assert inside(world, begins[line], ends[line], row, -0.05)
    assert found > 20
    assert crossed.lines.tolist() == sorted(crossed.lines.tolist())


def test_crossed_actors_are_in_order_along_the_line(world: World, car: CarFactory) -> None:
    for name, x in (("Far", 30.0), ("Near", 10.0), ("Middle", 20.0)):
        world.add(car(name), Placement(x, 0.0))
    crossed = world.crossings(
        np.array([[0.0, 0.0, 1.0], [50.0, 0.0, 1.0]]), np.array([[50.0, 0.0, 1.0], [0, 0, 1.0]]), 3
    )
    assert crossed.lines.tolist() == [0, 0, 0, 1, 1, 1]
    assert [world.names[row] for row in crossed.rows] == ["Near", "Middle", "Far", "Far", "Middle", "Near"]
    # The boxes begin 0.9 m behind the reference point and end 3.6 m before it.
    assert crossed.shares * 50.0 == pytest.approx([9.1, 19.1, 29.1, 50.0 - 33.6, 50.0 - 23.6, 50.0 - 13.6], abs=1e-5)


@pytest.mark.parametrize("yaw", [0.0, 0.4, 2.0, -3.0])
def test_line_along_the_roof_does_not_cross_the_box(world: World, car: CarFactory, yaw: float) -> None:
    world.add(car("A"), Placement(20.0, 0.0, yaw=yaw))
    begins = np.array([[0.0, 0.0, 1.5], [0.0, 0.0, 1.4999]])
    crossed = world.crossings(begins, begins + np.array([40.0, 0.0, 0.0]), 1)
    assert crossed.lines.tolist() == [1]


def test_line_that_begins_inside_enters_at_share_zero(world: World, car: CarFactory) -> None:
    world.add(car("A"), Placement(0.0, 0.0))
    inward, outward = np.array([[-20.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 1.0]])
    assert world.crossings(outward, inward, 1).shares.tolist() == [0.0]
    assert world.crossings(inward, outward, 1).shares == pytest.approx([19.1 / 21.0], abs=1e-5)
    point = world.crossings(outward, outward, 1)
    assert (point.rows.tolist(), point.shares.tolist(), point.scenery.tolist()) == ([0], [0.0], [1.0])


def test_no_lines_and_no_actors(world: World) -> None:
    nothing = np.zeros((0, 3))
    assert world.crossings(nothing, nothing, 1).scenery.tolist() == []
    crossed = world.crossings(np.array([[0.0, 0.0, 1.0]]), np.array([[9.0, 0.0, -1.0]]), 1)
    assert (crossed.lines.tolist(), crossed.scenery.tolist()) == ([], [0.5])


@pytest.mark.parametrize("slope", [0.0, 0.05])
def test_scenery_is_met_where_rays_meet_it(car: CarFactory, slope: float) -> None:
    rng = np.random.default_rng(3)
    posts = "".join(
        f'<object type="pole" id="{number}" name="" s="{30 + 20 * number}" t="{number - 3}" zOffset="0" length="0.5" '
        f'width="0.5" height="{2 + number}" orientation="none" hdg="0"/>'
        for number in range(6)
    )
    profile = elevation_xml(slope=slope) if slope else ""
    road = road_xml(length=300.0, x=-150.0, extra=f"<objects>{posts}</objects>", profiles=profile)
    with World(RoadNetwork.parse(map_xml(road))) as world:
        for number in range(14):
            x, y, yaw = rng.uniform((-60.0, -60.0, -4.0), (60.0, 60.0, 4.0))
            size = rng.uniform((3.0, 3.0, 2.0), (15.0, 15.0, 12.0))
            world.add_building(f"House {number}", (x, y, size[2] / 2.0), tuple(size), yaw)
        before = random_lines(rng, 1500, (0.3, 14.0))
        expected = world.raycast(*before)
        world.add(car("A"), Placement(0.0, 0.0))
        shares = world.crossings(*before, 1).scenery
    assert shares == pytest.approx(expected.fraction, abs=1e-12)
    assert 100 < np.count_nonzero(shares < 1.0) < 1400


def test_lines_below_the_roof_of_the_nearest_car_only(world: World, car: CarFactory) -> None:
    """A line that falls from a high antenna crosses the cars before its end, and no car below its high part."""
    for number in range(5):
        world.add(car(f"Car {number}"), Placement(10.0 + 10.0 * number, 0.0))
    crossed = world.crossings(np.array([[0.0, 0.0, 6.0]]), np.array([[60.0, 0.0, 0.7]]), 9)
    # Heights above the ends of the boxes of Car 3 and Car 4: 6 - 5.3 * 43.6 / 60 = 2.15 m, 6 - 5.3 * 53.6 / 60 = 1.27 m
    assert crossed.rows.tolist() == [4]
    assert crossed.shares == pytest.approx([(6.0 - 1.5) / 5.3], abs=1e-6)


@pytest.mark.parametrize("most", [1, 5, 30])
def test_many_lines_are_compared_in_parts(
    world: World, car: CarFactory, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(30):
        world.add(car(f"Car {number}"), Placement(10.0 * number, 0.0))
    begins = np.array([[10.0 * number - 5.0, 0.0, 1.0] for number in range(25)])
    ends = np.full((25, 3), (400.0, 0.0, 1.0))
    whole = world.crossings(begins, ends, most)
    assert whole.lines.tolist() == [line for line in range(25) for _ in range(min(most, 30 - line))]
    assert whole.rows.tolist() == [row for line in range(25) for row in range(line, min(line + most, 30))]
    monkeypatch.setattr("eidrive_scenario.world.physics.rays._MOST_CANDIDATES", 100)
    parts = world.crossings(begins, ends, most)
    assert (parts.lines.tolist(), parts.rows.tolist()) == (whole.lines.tolist(), whole.rows.tolist())
    assert parts.shares.tolist() == whole.shares.tolist()

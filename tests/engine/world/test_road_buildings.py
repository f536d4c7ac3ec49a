"""Buildings of a road network, several of which have one body in pybullet."""

from __future__ import annotations

import math

import numpy as np
import pytest
from opendrive_xml import map_xml, road_xml
from sample_car import CarFactory

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.world import World
from eidrive_scenario.world.actor import Control, Placement

COUNT = 40


def houses() -> Array:
    """Return boxes (N, 7) of houses of random sizes and headings beside a road along x."""
    rng = np.random.default_rng(7)
    x = 20.0 * np.arange(COUNT) + rng.uniform(0.0, 5.0, COUNT)
    y = np.where(np.arange(COUNT) % 2, 15.0, -15.0)
    size = rng.uniform(4.0, 12.0, (COUNT, 3))
    return np.column_stack([x, y, size[:, 2] / 2, size, rng.uniform(-4.0, 4.0, COUNT)])


def network(boxes: Array) -> RoadNetwork:
    rows = "".join(
        f'<object type="building" id="{row}" name="House {row}" s="{box[0]}" t="{box[1]}" zOffset="0" '
        f'length="{box[3]}" width="{box[4]}" height="{box[5]}" hdg="{box[6]}" orientation="none"/>'
        for row, box in enumerate(boxes.tolist())
    )
    return RoadNetwork.parse(map_xml(road_xml(length=900.0, extra=f"<objects>{rows}</objects>")))


def first_entry(begin: Array, end: Array, boxes: Array) -> Array:
    """Return the share (M,) of the way of each ray to the first box by the slab method, 1 without a hit."""
    share = np.ones(len(begin))
    for box in boxes:
        cos, sin = math.cos(box[6]), math.sin(box[6])
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        start, way = (begin - box[:3]) @ turn, (end - begin) @ turn
        with np.errstate(divide="ignore"):
            low, high = (-box[3:6] / 2 - start) / way, (box[3:6] / 2 - start) / way
        enter, leave = np.minimum(low, high).max(axis=1), np.maximum(low, high).min(axis=1)
        hit = (enter <= leave) & (enter > 0.0) & (enter < share)
        share[hit] = enter[hit]
    return share


def test_rays_hit_buildings_where_the_closed_form_does() -> None:
    boxes = houses()
    rng = np.random.default_rng(8)
    begin = np.column_stack([rng.uniform(0.0, 800.0, 3000), rng.uniform(-4.0, 4.0, 3000), rng.uniform(0.5, 3.0, 3000)])
    end = begin + np.column_stack([rng.uniform(-90.0, 90.0, (3000, 2)), rng.uniform(0.0, 2.0, 3000)])
    with World(network(boxes)) as world:
        hits = world.raycast(begin, end)
    expected = first_entry(begin, end, boxes)
    assert np.count_nonzero(expected < 1.0) > 1000
    # A ray may touch an edge of a building in one of both only.
    equal = np.abs(hits.fraction - expected) < 1e-3
    assert np.count_nonzero(~equal) <= 3
    assert (hits.rows[equal & (expected < 1.0)] == -1).all()


@pytest.mark.parametrize("row", [0, 15, 16, 31, 39])
def test_contact_names_the_building(car: CarFactory, row: int) -> None:
    boxes = houses()
    x, y = boxes[row, :2].tolist()
    with World(network(boxes)) as world:
        side = math.copysign(1.0, y)
        world.add(car("Ego"), Placement(x, y - side * 14.0, yaw=side * math.pi / 2, speed=12.0), driven=True)
        met: list[str] = []
        while world.time < 2.0:
            world.step({}, {"Ego": Control()})
            met += [contact.second for contact in world.view().contacts]
    assert met == [f"House {row}"]


def test_buildings_that_are_actors_have_no_second_body(car: CarFactory) -> None:
    boxes = houses()
    roads = network(boxes)
    x, y = boxes[3, :2].tolist()
    ray = [[x, 0.0, 1.0]], [[x, y, 1.0]]
    for entities, rows in (((), [-1]), (("3",), [-2]), ((), [-1])):
        with World(roads, entities=entities) as world:
            assert world.raycast(*ray).rows.tolist() == rows

"""Tests of the obstacles of a fleet over time: actors that rest, set off, stop, and disappear."""

from __future__ import annotations

import numpy as np
import pytest
from fleet_scene import LENGTH, REAR_AXLE, car, street, view_of

from eidrive_scenario.base.car_following import IntelligentDriver
from eidrive_scenario.roads import LaneKey
from eidrive_scenario.traffic import Fleet, Participant, SpawnSites
from eidrive_scenario.traffic.lanes import TrafficLanes
from eidrive_scenario.traffic.occupancy import Occupancy
from eidrive_scenario.traffic.spawning.sites import is_unoccupied, leaders_ahead
from eidrive_scenario.world.actor import Placement

LANE = -1.75
"""y of the center of the lane along x [m]; its progress is x."""
FRONT, REAR = REAR_AXLE + LENGTH / 2.0, REAR_AXLE - LENGTH / 2.0


def parked(x: float) -> Placement:
    return Placement(x, LANE)


def moving(x: float) -> Placement:
    return Placement(x, LANE, speed=4.0)


def places_of(occupancy: Occupancy) -> list[float]:
    """Return the progress of rear, middle and front of all obstacles on the street, in ascending order."""
    return sorted(set(occupancy.foreign.key.round(6).tolist()))


def outline(*places: float) -> list[float]:
    return [x + part for x in places for part in (REAR, REAR_AXLE, FRONT)]


def test_obstacles_are_where_the_actors_are_in_every_view() -> None:
    occupancy = Occupancy(TrafficLanes(street(1, 1)))
    views = [
        {"a": parked(100.0), "b": moving(50.0)},
        {"a": parked(100.0), "b": moving(52.0)},
        {"a": parked(100.0), "b": moving(54.0)},
        {"a": parked(100.0), "b": parked(54.0)},
        {"a": parked(100.0), "b": parked(54.0)},
        {"a": moving(100.0), "b": parked(54.0)},
        {"a": moving(102.0), "b": parked(54.0)},
        {"b": parked(54.0)},
        {"b": parked(54.0), "a": parked(100.0)},
        {},
    ]
    for placements in views:
        occupancy.observe(view_of(placements), frozenset())
        expected = outline(*sorted(placement.x for placement in placements.values()))
        assert places_of(occupancy) == pytest.approx(expected)
        speeds = {placement.speed for placement in placements.values()}
        assert set(occupancy.foreign.speed.tolist()) == speeds
        assert bool(occupancy.moving) == (4.0 in speeds)


def test_actor_above_the_tallest_vehicles_occupies_no_lane() -> None:
    """Such as a sign gantry; vehicles are at most 4 m high (Directive 96/53/EC)."""
    occupancy = Occupancy(TrafficLanes(street(1, 1)))
    views = {"low": Placement(100.0, LANE, 3.9), "high": Placement(200.0, LANE, 4.1)}
    occupancy.observe(view_of(views), frozenset())
    assert places_of(occupancy) == pytest.approx(outline(100.0))


@pytest.mark.parametrize(("base", "is_free"), [(0.0, False), (3.9, False), (4.1, True), (-1.4, False), (-1.6, True)])
def test_site_is_free_below_and_above_other_levels(base: float, is_free: bool) -> None:
    """The box is 1.5 m high; vehicles are at most 4 m high (Directive 96/53/EC)."""
    fleet, participant = Fleet(street(1, 1)), Participant(car("new"), IntelligentDriver())
    sites = SpawnSites.at(fleet.lanes, np.array([fleet.lanes.row_of(LaneKey("1", 0, -1))]), np.array([100.0]))
    boxes = np.array([[100.0, LANE, base + 0.75, 4.6, 1.9, 1.5, 0.0]])
    speed, leaders = np.array([5.0]), leaders_ahead(fleet, sites, participant)
    assert is_unoccupied(fleet, sites, participant, speed, leaders, boxes).tolist() == [is_free]


def test_resting_actor_out_of_sight_is_ignored_until_a_car_is_near() -> None:
    occupancy = Occupancy(TrafficLanes(street(1, 1)))
    view = view_of({"a": parked(100.0), "far": parked(600.0)})
    for near, places in (([100.0], [100.0]), ([100.0, 500.0], [100.0, 600.0]), ([500.0], [600.0]), ([], [])):
        occupancy.observe(view, frozenset(), np.array([(x, LANE) for x in near]).reshape(-1, 2))
        assert places_of(occupancy) == pytest.approx(outline(*places))


def test_cars_of_the_fleet_are_no_obstacles() -> None:
    occupancy = Occupancy(TrafficLanes(street(1, 1)))
    for own, places in ((frozenset({"b"}), [100.0]), (frozenset({"a", "b"}), [])):
        occupancy.observe(view_of({"a": parked(100.0), "b": parked(50.0)}), own)
        assert places_of(occupancy) == pytest.approx(outline(*places))

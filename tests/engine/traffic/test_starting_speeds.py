"""Tests of the speeds at which cars enter background traffic."""

from __future__ import annotations

import math

import numpy as np
import pytest
from fleet_scene import LENGTH, REAR_AXLE, add_car, car, street

from eidrive_scenario.base.car_following import IntelligentDriver
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.traffic import Fleet, Participant, SpawnSites
from eidrive_scenario.traffic.spawning.sites import comfortable_speeds, leaders_ahead

FRONT = REAR_AXLE + LENGTH / 2.0
"""Distance from the reference point to the front bumper [m]."""


def speed_at(fleet: Fleet, roads: RoadNetwork, lane: int, s: float) -> float:
    number, progress = fleet.lanes.of(roads.location("1", lane, s))
    sites = SpawnSites.at(fleet.lanes, np.array([number]), np.array([progress]))
    participant = Participant(car("new"), IntelligentDriver())
    leaders = leaders_ahead(fleet, sites, participant)
    return float(comfortable_speeds(fleet.lanes, sites, participant, leaders)[0])


def test_car_can_stop_before_the_junction_ahead(library_roads: RoadNetwork) -> None:
    """With 4 m/s² in the 10 m to a point 1 m before the junction: √(2·4·10) m/s."""
    fleet = Fleet(library_roads)
    length = library_roads.roads["1"].length
    assert speed_at(fleet, library_roads, -1, length - 11.0 - FRONT) == pytest.approx(math.sqrt(80.0), abs=1e-5)
    assert speed_at(fleet, library_roads, -1, length - 0.5) == 0.0


def test_car_brakes_comfortably_for_its_leader() -> None:
    """With b = 1.5 m/s² behind a standing car at a gap of 30 m: ((2 + v + v²/(2·√1.5)) / 30)² = 1.5."""
    roads = street()
    fleet = Fleet(roads)
    add_car(fleet, car("standing"), roads.location("1", -1, 400.0))
    v = speed_at(fleet, roads, -1, 400.0 - LENGTH - 30.0)
    assert ((2.0 + v + v * v / (2.0 * math.sqrt(1.5))) / 30.0) ** 2 == pytest.approx(1.5, abs=1e-5)
    assert speed_at(fleet, roads, -2, 400.0) == math.inf

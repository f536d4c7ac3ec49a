"""Oncoming traffic that is not in view: occlusion, range and time of waiting."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec.structs import replace

from eidrive_scenario.driving.planning.behavior.proposals import LateralProfile, inside_way
from eidrive_scenario.driving.planning.behavior.reference import LanesBeside
from eidrive_scenario.driving.planning.behavior.scoring import PAUSE, OncomingTraffic, first_oncoming, meets_oncoming
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings

UNKNOWN = math.inf
BESIDE = LanesBeside(oncoming=3.5)
TIMES = np.arange(0.0, 8.01, 0.25)
PASSING = LateralProfile("pass", (0.0, 20.0, 50.0, 70.0), (0.0, 3.0, 3.0, 0.0), side=1, uses_oncoming=True)


def first(objects: Surroundings) -> int:
    """Return the index of the first time at which objects are in the way of a vehicle of 1.8 m width; K if never."""
    return first_oncoming(inside_way(objects, PASSING, 0.9), 0.0, objects)


def scene(*objects: tuple[float, float, float]) -> Surroundings:
    """Return objects with s, d and speed along the line, 5 m by 2 m."""
    count, steps = len(objects), len(TIMES)
    s, d, speed = np.array(objects, dtype=float).reshape(-1, 3).T
    ones = np.ones((count, steps))
    return Surroundings(
        s[:, None] + speed[:, None] * TIMES,
        d[:, None] * ones,
        2.5 * ones,
        1.0 * ones,
        speed[:, None] * ones,
        np.full(count, 0.4),
        tuple(range(count)),
        np.ones(count, dtype=bool),
        np.zeros(count),
        np.zeros((count, steps), dtype=bool),
        np.zeros(count, dtype=bool),
        np.zeros(count, dtype=bool),
    )


def test_free_view_ends_at_its_range() -> None:
    traffic = OncomingTraffic(100.0)
    assert traffic.first_hidden(scene(), BESIDE, (0.0, 0.0), 0.0) == pytest.approx(100.0, abs=4.0)


@pytest.mark.parametrize("gap", [10.0, 20.0])
def test_truck_ahead_hides_the_lane_beyond_the_line_of_sight(gap: float) -> None:
    # The line of sight over the rear left corner, at (gap, 1.0), reaches the center of the next lane at 3.5 gap.
    traffic = OncomingTraffic(100.0)
    found = traffic.first_hidden(scene((gap + 2.5, 0.0, 0.0)), BESIDE, (0.0, 0.0), 0.0)
    assert found == pytest.approx(3.5 * gap, abs=2.0)


def test_waiting_without_traffic_makes_the_hidden_lane_free() -> None:
    traffic = OncomingTraffic(50.0)
    empty = scene()
    traffic.observe(empty, 0.0, 0.0, held_up=True)
    assert math.isfinite(traffic.first_hidden(empty, BESIDE, (0.0, 0.0), PAUSE - 0.1))
    assert traffic.first_hidden(empty, BESIDE, (0.0, 0.0), PAUSE) == math.inf


def test_oncoming_vehicle_restarts_the_time_of_waiting() -> None:
    traffic = OncomingTraffic(50.0)
    traffic.observe(scene(), 0.0, 0.0, held_up=True)
    traffic.observe(scene((30.0, 3.5, -8.0)), 0.0, 4.0, held_up=True)
    assert math.isfinite(traffic.first_hidden(scene(), BESIDE, (0.0, 0.0), PAUSE + 1.0))
    assert traffic.first_hidden(scene(), BESIDE, (0.0, 0.0), PAUSE + 4.0) == math.inf


def test_without_a_lane_of_the_opposite_direction_nothing_is_expected() -> None:
    assert OncomingTraffic(50.0).first_hidden(scene(), LanesBeside(), (0.0, 0.0), 0.0) == math.inf


@pytest.mark.parametrize(("start", "meets"), [(200.0, False), (100.0, True)])
def test_meeting_before_the_return(start: float, meets: bool) -> None:
    # At 10 m/s the return begins after 5 s at 50 m; at -10 m/s an object from 100 m is there at the same time.
    there = scene((start, 3.5, -10.0))
    assert meets_oncoming(PASSING, (10.0 * TIMES, 10.0), TIMES, first(there), (math.inf, 10.0), there) == meets


def test_oncoming_traffic_is_in_the_way_once_on_the_lane() -> None:
    # The way is at 3 m to the left up to s = 50 m; the front of the object, 2.5 m ahead of its center, is there at 5 s.
    assert TIMES[first(scene((102.5, 3.5, -10.0)))] == pytest.approx(5.0, abs=1.2)
    for harmless in (scene(), scene((100.0, 3.5, 10.0)), scene((-10.0, 3.5, -10.0)), scene((100.0, 9.0, -10.0))):
        assert first(harmless) == len(TIMES)


@pytest.mark.parametrize(("place", "meets"), [(95.0, True), (105.0, False)])
def test_unseen_traffic_counts_from_its_place(place: float, meets: bool) -> None:
    assert meets_oncoming(PASSING, (10.0 * TIMES, 10.0), TIMES, len(TIMES), (place, 10.0), scene()) == meets


def test_maneuver_that_does_not_return_within_the_horizon_meets_traffic() -> None:
    assert meets_oncoming(PASSING, (5.0 * TIMES, 5.0), TIMES, len(TIMES), (math.inf, 10.0), scene())


@pytest.mark.parametrize(
    ("place", "start", "meets"),
    [
        (UNKNOWN, UNKNOWN, False),
        (155.0, UNKNOWN, False),
        (145.0, UNKNOWN, True),
        (UNKNOWN, 155.0, False),
        (UNKNOWN, 145.0, True),
    ],
)
def test_return_past_standing_objects_after_the_horizon(place: float, start: float, meets: bool) -> None:
    """At 5 m/s the return begins after 10 s at 50 m; the front of traffic at -10 m/s is there from 150 m.

    place  of unseen traffic [m];  start  of the front of an oncoming car [m]
    """
    profile = replace(PASSING, passes_standing=True)
    there = scene((start + 2.5, 3.5, -10.0)) if math.isfinite(start) else scene()
    motion = 5.0 * TIMES, 5.0
    assert meets_oncoming(profile, motion, TIMES, len(TIMES), (place, 10.0), there) == meets
    assert meets_oncoming(profile, (5.0 * TIMES, 0.0), TIMES, len(TIMES), (place, 10.0), there), "it stands"

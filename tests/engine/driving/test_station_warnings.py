"""Warnings about areas off the roads and stations at rest."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from planned_drive import two_lane_road

from eidrive_scenario.driving.planner_settings import Polygon
from eidrive_scenario.driving.station_warnings import MotionlessStations, distance_to_road

ROADS = two_lane_road(400.0)
"""Lanes of 3.5 m from y = -3.5 m to y = 3.5 m."""


@pytest.mark.parametrize(
    ("area", "distance"),
    [
        (((100, -60), (101, -60), (101, 59), (200, 59), (200, 60), (100, 60)), 0.0),  # an arm of 1 m across the road
        (((100, 20), (101, 20), (101, 139), (200, 139), (200, 140), (100, 140)), 16.5),
        (((100, 23.5), (200, 23.5), (200, 33.5), (100, 33.5)), 20.0),
    ],
)
def test_distance_to_road_is_a_close_lower_bound(area: Polygon, distance: float) -> None:
    """Samples are closer than half a diagonal of a cell, a twelfth of the area."""
    x, y = np.array(area).T
    reach = np.hypot(np.ptp(x), np.ptp(y)) / 24.0
    assert max(distance - reach, 0.0) - 1e-9 <= distance_to_road(area, ROADS) <= distance


@pytest.mark.parametrize(("driving", "warnings"), [(0.5, 0), (1.9, 0), (2.5, 1)])
def test_motionless_time_ends_when_the_station_is_scripted(driving: float, warnings: int) -> None:
    """It stands while it drives, and is moved with 10 m/s afterwards."""
    stations = MotionlessStations(["Ego"])
    for time in np.arange(0.0, 10.0, 0.05).tolist():
        position = np.array([[10.0 * max(time - driving, 0.0), 0.0, 0.0]])
        view = SimpleNamespace(rows={"Ego": 0}, position=position, time=time)
        stations.observe(cast("Any", view), {"Ego"} if time < driving else set())
    scenario = SimpleNamespace(document=SimpleNamespace(entities=None), path=None)
    assert len(list(stations.warnings(cast("Any", scenario), 10.0))) == warnings

"""Tests of the spatial grid."""

import numpy as np
import pytest

from eidrive_scenario.world.physics.scenery import SpatialGrid, grid_cells


@pytest.fixture
def houses() -> SpatialGrid[tuple[float, float]]:
    found: SpatialGrid[tuple[float, float]] = SpatialGrid()
    for x, y in np.random.default_rng(1).uniform(-2000.0, 2000.0, (300, 2)).tolist():
        found.add((x, y), grid_cells(x, y, 4.0))
    return found


@pytest.mark.parametrize("reach", [0.0, 5.0, 299.0, 301.0, 1500.0])
def test_query_contains_all_objects_within_reach(houses: SpatialGrid[tuple[float, float]], reach: float) -> None:
    near = {place for place in houses.query(-40.0, 12.0, 1e7) if np.hypot(place[0] + 40.0, place[1] - 12.0) <= reach}
    around = set(houses.query(-40.0, 12.0, reach))
    assert near <= around
    assert all(max(abs(x + 40.0), abs(y - 12.0)) <= reach + 4.0 + 20.0 for x, y in around)


def test_query_with_infinite_reach_visits_occupied_cells_only(houses: SpatialGrid[tuple[float, float]]) -> None:
    assert len(set(houses.query(0.0, 0.0, 1e12))) == 300

"""Tests of the spatial grid."""

import numpy as np
import pytest

from eidrive_scenario.roads import Pose
from eidrive_scenario.world.physics.scenery import Obstacles, SpatialGrid, grid_cells
from eidrive_scenario.world.road_objects import RoadObjectBody


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


def wall(x: float, y: float, yaw: float, length: float, width: float, name: str = "wall") -> RoadObjectBody:
    return RoadObjectBody(name, "barrier", Pose(x, y, 0.0, yaw, 0.0, 0.0), length, width, 1.0)


def points_of(body: RoadObjectBody) -> np.ndarray:
    """Return points (N, 2) of the base of a box, at most half a meter apart."""
    sides = [np.linspace(-0.5, 0.5, int(2.0 * size) + 2) * size for size in (body.length, body.width)]
    ahead, left = (part.ravel() for part in np.meshgrid(*sides))
    cos, sin = np.cos(body.pose.h), np.sin(body.pose.h)
    return np.column_stack([body.pose.x + cos * ahead - sin * left, body.pose.y + sin * ahead + cos * left])


@pytest.mark.parametrize("most", [2.0, 8.0, 40.0])
def test_clearance_is_the_distance_of_the_nearest_body_up_to_its_bound(most: float) -> None:
    rng = np.random.default_rng(3)
    sizes = [(60.0, 40.0), (40.0, 60.0), (25.0, 0.3), (0.3, 45.0), (9.0, 9.0), (18.0, 2.0)]
    places = rng.uniform((-150.0, -150.0, 0.0), (150.0, 150.0, 6.3), (len(sizes), 3)).tolist()
    walls = [wall(x, y, yaw, length, width) for (x, y, yaw), (length, width) in zip(places, sizes, strict=True)]
    obstacles, points = Obstacles(walls), np.concatenate([points_of(each) for each in walls])
    for x, y in rng.uniform(-200.0, 200.0, (400, 2)).tolist():
        expected = min(float(np.hypot(points[:, 0] - x, points[:, 1] - y).min()), most)
        assert obstacles.clearance(x, y, most) == pytest.approx(expected, abs=0.4)


def test_contact_at_the_end_of_a_long_wall_has_its_name() -> None:
    obstacles = Obstacles([wall(0.0, 0.0, 0.0, 180.0, 0.3, "long"), wall(80.0, 30.0, 0.0, 4.0, 0.3, "short")])
    assert obstacles.name_at(89.9, 0.2) == "long"

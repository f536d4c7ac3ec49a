"""What is ground, and which points belong together."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.perception.lidar.clustering import clusters
from eidrive_scenario.perception.lidar.ground import CLEARANCE, ground_height


def rings(height: float, slope: tuple[float, float] = (0.0, 0.0), columns: int = 90) -> np.ndarray:
    """Where rays from (0, 0, height) meet a plane z = slope · (x, y), 3 to 40 m away."""
    azimuth = np.arange(columns) * 2 * math.pi / columns
    distance = height / np.tan(np.radians(np.arange(3.0, 31.0, 1.3)))
    x, y = (np.outer(f(azimuth), distance).ravel() for f in (np.cos, np.sin))
    plane = np.column_stack([x, y, slope[0] * x + slope[1] * y])
    return plane[np.hypot(plane[:, 0], plane[:, 1]) < 40.0]


def wall(x: float, y0: float, y1: float, low: float, high: float) -> np.ndarray:
    y, z = (grid.ravel() for grid in np.meshgrid(np.arange(y0, y1, 0.3), np.arange(low, high, 0.3)))
    return np.column_stack([np.full(len(y), x), y, z])


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.08, 0.0), (-0.05, 0.1)])
def test_a_plane_is_ground_whatever_its_slope(slope: tuple[float, float]) -> None:
    points = rings(1.9, slope)
    np.testing.assert_allclose(ground_height(points, 0.0), points[:, 2], atol=0.02)


def test_what_stands_on_it_is_not() -> None:
    """Two walls among the rings: all but their lowest quarter of a meter stands out, and no ring does."""
    ground, things = rings(1.9), np.concatenate([wall(12.0, -3, 3, 0.0, 2.0), wall(-20.0, -6, 6, 0.3, 3.0)])
    points = np.concatenate([ground, things])
    above = points[:, 2] - ground_height(points, 0.0) > CLEARANCE
    assert not above[: len(ground)].any()
    tall = things[:, 2] > 0.45
    assert above[len(ground) :][tall].all()


def test_a_road_that_bends_upwards_is_followed() -> None:
    """Flat for 15 m, then a vertical curve of 600 m radius: at 40 m it lies 0.52 m higher."""
    points = rings(5.0)
    points[:, 2] = np.maximum(np.hypot(points[:, 0], points[:, 1]) - 15.0, 0.0) ** 2 / 1200.0
    np.testing.assert_allclose(ground_height(points, 0.0), points[:, 2], atol=0.1)


def test_the_foot_says_how_high_the_ground_is() -> None:
    """Seen from a bridge 20 m up: the same scene, 20 m higher."""
    points = np.concatenate([rings(1.9), wall(12.0, -3, 3, 0.0, 2.0)])
    raised = points + np.array([0.0, 0.0, 20.0])
    np.testing.assert_allclose(ground_height(raised, 20.0), ground_height(points, 0.0) + 20.0, atol=1e-9)


def test_nothing_is_no_ground() -> None:
    assert ground_height(np.empty((0, 3)), 0.0).shape == (0,)


def groups(points: np.ndarray, step: float = 0.01, **options: bool) -> list[list[int]]:
    return sorted(sorted(rows.tolist()) for rows in clusters(points, step, **options))


def test_points_near_each_other_belong_together() -> None:
    points = np.array([[10.0, 0.0], [10.2, 0.3], [10.0, 5.0], [10.3, 5.2], [20.0, 0.0]])
    assert groups(points) == [[0, 1], [2, 3], [4]]


def test_farther_away_gaps_between_rays_are_larger() -> None:
    """Columns two degrees apart: neighbors on a wall 40 m away are 1.4 m apart, at 10 m that would be two things."""
    step = math.radians(2.0)
    far = np.array([[40.0, 0.0], [40.0, 1.4]])
    near = np.array([[10.0, 0.0], [10.0, 1.4]])
    assert groups(far, step) == [[0, 1]]
    assert groups(near, step) == [[0], [1]]


def test_a_surface_that_rays_graze_is_one() -> None:
    """A flank 4 m aside, met 12 to 15 m ahead by columns two degrees apart, with gaps of up to 1.9 m."""
    bearing = np.arctan2(4.0, 12.0) - math.radians(2.0) * np.arange(3)
    flank = np.column_stack([4.0 / np.tan(bearing), np.full(3, 4.0)])
    assert np.diff(flank[:, 0]).max() > 1.4
    assert groups(flank, math.radians(2.0)) == [[0, 1, 2]]
    assert len(groups(flank, math.radians(2.0), grazing=False)) > 1


def test_the_order_of_points_does_not_matter() -> None:
    rng = np.random.default_rng(1)
    points = np.concatenate([rng.normal(center, 0.2, (20, 2)) for center in ((10, 0), (12, 6), (-15, 3))])
    order = rng.permutation(len(points))
    shuffled = sorted(sorted(int(order[row]) for row in rows) for rows in clusters(points[order], 0.01))
    assert shuffled == groups(points) == [list(range(20)), list(range(20, 40)), list(range(40, 60))]


def test_no_points_make_no_clusters() -> None:
    assert clusters(np.empty((0, 3)), 0.01) == []

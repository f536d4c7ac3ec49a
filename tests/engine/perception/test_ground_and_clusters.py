"""Ground estimation and clustering of lidar points."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.perception.lidar.segmentation import CLEARANCE, _follow_ground, clusters, ground_height


def rings(height: float, slope: tuple[float, float] = (0.0, 0.0), columns: int = 90) -> np.ndarray:
    """Return the points of rays from (0, 0, height) on a plane z = slope · (x, y), 3 to 40 m away."""
    azimuth = np.arange(columns) * 2 * math.pi / columns
    distance = height / np.tan(np.radians(np.arange(3.0, 31.0, 1.3)))
    x, y = (np.outer(f(azimuth), distance).ravel() for f in (np.cos, np.sin))
    plane: np.ndarray = np.column_stack([x, y, slope[0] * x + slope[1] * y])
    near: np.ndarray = plane[np.hypot(plane[:, 0], plane[:, 1]) < 40.0]
    return near


def wall(x: float, y0: float, y1: float, low: float, high: float) -> np.ndarray:
    y, z = (grid.ravel() for grid in np.meshgrid(np.arange(y0, y1, 0.3), np.arange(low, high, 0.3)))
    return np.column_stack([np.full(len(y), x), y, z])


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.08, 0.0), (-0.05, 0.1)])
def test_ground_height_of_inclined_plane_equals_plane(slope: tuple[float, float]) -> None:
    points = rings(1.9, slope)
    np.testing.assert_allclose(ground_height(points, 0.0), points[:, 2], atol=0.02)


def test_ground_height_of_walls_is_below_them() -> None:
    """All points of two walls more than 0.45 m high are above the ground, and no ring is."""
    ground, walls = rings(1.9), np.concatenate([wall(12.0, -3, 3, 0.0, 2.0), wall(-20.0, -6, 6, 0.3, 3.0)])
    points = np.concatenate([ground, walls])
    above = points[:, 2] - ground_height(points, 0.0) > CLEARANCE
    assert not above[: len(ground)].any()
    tall = walls[:, 2] > 0.45
    assert above[len(ground) :][tall].all()


def test_ground_height_follows_vertical_curve() -> None:
    """Flat for 15 m, then a vertical curve of 600 m radius: at 40 m it is 0.52 m higher."""
    points = rings(5.0)
    points[:, 2] = np.maximum(np.hypot(points[:, 0], points[:, 1]) - 15.0, 0.0) ** 2 / 1200.0
    np.testing.assert_allclose(ground_height(points, 0.0), points[:, 2], atol=0.1)


def test_ground_height_of_raised_scene_follows_foot() -> None:
    """The same scene, 20 m higher, as on a bridge."""
    points = np.concatenate([rings(1.9), wall(12.0, -3, 3, 0.0, 2.0)])
    raised = points + np.array([0.0, 0.0, 20.0])
    np.testing.assert_allclose(ground_height(raised, 20.0), ground_height(points, 0.0) + 20.0, atol=1e-9)


def test_ground_height_without_points_is_empty() -> None:
    assert ground_height(np.empty((0, 3)), 0.0).shape == (0,)


def test_ground_height_between_knots_is_interpolated() -> None:
    """Sectors 0 and 12: a plane that the lowest points of bins of 2 m leave by small steps, as `np.interp` does."""
    rng = np.random.default_rng(3)
    offset, where = np.full((24, 20), np.inf), np.zeros((24, 20))
    for number in (0, 12):
        where[number] = 2.0 * np.arange(20) + rng.uniform(0.0, 1.9, 20)
        offset[number] = np.cumsum(rng.uniform(-0.05, 0.05, 20))
    offset[0, 7] += 1.5  # a body
    sector, distance, plane = np.repeat([0, 12, 5], 50), rng.uniform(0.0, 50.0, 150), np.ones(150)
    expected = np.ones(150)
    for number, knots in ((0, np.delete(np.arange(20), 7)), (12, np.arange(20))):
        along, rise = ([0.0, *table[number, knots]] for table in (where, offset))
        expected[sector == number] += np.interp(distance[sector == number], along, rise)
    _follow_ground(offset, where, sector, distance, plane)
    np.testing.assert_array_equal(plane, expected)


def groups(points: np.ndarray, step: float = 0.01, **options: bool) -> list[list[int]]:
    return sorted(sorted(rows.tolist()) for rows in clusters(points, step, **options))


def test_clusters_group_points_by_distance() -> None:
    points = np.array([[10.0, 0.0], [10.2, 0.3], [10.0, 5.0], [10.3, 5.2], [20.0, 0.0]])
    assert groups(points) == [[0, 1], [2, 3], [4]]


def test_clusters_distance_threshold_grows_with_range() -> None:
    """Columns two degrees apart: neighbors on a wall 40 m away are 1.4 m apart; at 10 m these are two objects."""
    step = math.radians(2.0)
    far = np.array([[40.0, 0.0], [40.0, 1.4]])
    near = np.array([[10.0, 0.0], [10.0, 1.4]])
    assert groups(far, step) == [[0, 1]]
    assert groups(near, step) == [[0], [1]]


def test_clusters_of_grazed_surface_are_merged() -> None:
    """A flank at a lateral distance of 4 m, hit 12 to 15 m ahead by columns two degrees apart, with gaps of up to 1.9
    m."""
    bearing = np.arctan2(4.0, 12.0) - math.radians(2.0) * np.arange(3)
    flank = np.column_stack([4.0 / np.tan(bearing), np.full(3, 4.0)])
    assert np.diff(flank[:, 0]).max() > 1.4
    assert groups(flank, math.radians(2.0)) == [[0, 1, 2]]
    assert len(groups(flank, math.radians(2.0), grazing=False)) > 1


def test_clusters_are_independent_of_point_order() -> None:
    rng = np.random.default_rng(1)
    points = np.concatenate([rng.normal(center, 0.2, (20, 2)) for center in ((10, 0), (12, 6), (-15, 3))])
    order = rng.permutation(len(points))
    shuffled = sorted(sorted(int(order[row]) for row in rows) for rows in clusters(points[order], 0.01))
    assert shuffled == groups(points) == [list(range(20)), list(range(20, 40)), list(range(40, 60))]


def test_clusters_are_the_connected_components_of_near_cells() -> None:
    """Random points, compared with a search in the table of all distances between the centers of their cells."""
    rng = np.random.default_rng(2)
    points = rng.uniform(-12.0, 12.0, (400, 2))
    cells = sorted(set(map(tuple, np.floor(points / 0.1).astype(int).tolist())))
    members = [[row for row in range(400) if tuple(np.floor(points[row] / 0.1)) == cell] for cell in cells]
    centers = np.array([points[rows].mean(axis=0) for rows in members])
    gap = np.linalg.norm(centers[:, None] - centers, axis=-1)
    reach = np.maximum(0.5, 2.0 * 0.04 * np.linalg.norm(centers, axis=1))
    near = gap <= np.minimum(reach[:, None], reach)
    label = np.arange(len(cells))
    for _ in range(len(cells)):
        label = np.where(near, label, len(cells)).min(axis=1)
    expected = [sorted(row for cell in np.flatnonzero(label == first) for row in members[cell]) for first in set(label)]
    assert 20 < len(expected) < 300
    assert groups(points, 0.04, grazing=False) == sorted(expected)


def test_clusters_without_points_are_empty() -> None:
    assert clusters(np.empty((0, 3)), 0.01) == []

"""Lidar points in plan view: channels of the grid, and the earlier scan."""

from __future__ import annotations

import math

import numpy as np
import pytest

from eidrive_scenario.perception.geometry.lidar_geometry import LevelFrame
from eidrive_scenario.perception.learned.pillars.grid import ScanHistory, fill
from eidrive_scenario.perception.lidar.segmentation import CLEARANCE
from eidrive_scenario.sensing.readings import LidarReading

FOOT_POSE = LevelFrame(0.0, 0.0, 2.0, 0.0)


def grid_of(
    points: np.ndarray, height: np.ndarray, intensity: np.ndarray, earlier: np.ndarray, earlier_height: np.ndarray
) -> np.ndarray:
    grid = np.full((12, 256, 256), np.nan, dtype=np.float32)
    fill(points, height, intensity, earlier, earlier_height, CLEARANCE, grid)
    return grid


def stated(
    points: np.ndarray, height: np.ndarray, intensity: np.ndarray, earlier: np.ndarray, earlier_height: np.ndarray
) -> np.ndarray:
    """Return the grid cell by cell, as the definition of the channels says."""
    grid = np.zeros((12, 256, 256))

    def members(plan: np.ndarray, rows: np.ndarray) -> dict[tuple[int, int], list[int]]:
        cells: dict[tuple[int, int], list[int]] = {}
        for row in np.flatnonzero(rows).tolist():
            i, j = math.floor((plan[row, 0] + 51.2) / 0.4), math.floor((plan[row, 1] + 51.2) / 0.4)
            if 0 <= i < 256 and 0 <= j < 256:
                cells.setdefault((i, j), []).append(row)
        return cells

    def offset(plan: np.ndarray, rows: list[int], i: int, j: int) -> np.ndarray:
        return np.asarray(np.mean((plan[rows, :2] + 51.2) / 0.4 - (i + 0.5, j + 0.5), axis=0))

    for (i, j), rows in members(points, (height > 0.25) & (height < 4.5)).items():
        h = height[rows]
        grid[:5, i, j] = [
            math.log1p(len(rows)) / 3, h.max() / 4, h.min() / 4, h.mean() / 4, intensity[rows].mean()
        ]  # fmt: skip
        grid[5:7, i, j] = offset(points, rows, i, j)
    for (i, j), rows in members(points, height <= 0.25).items():
        grid[7, i, j] = math.log1p(len(rows)) / 3
    for (i, j), rows in members(earlier, np.ones(len(earlier), dtype=bool)).items():
        grid[8:10, i, j] = math.log1p(len(rows)) / 3, earlier_height[rows].max() / 4
        grid[10:, i, j] = offset(earlier, rows, i, j)
    return grid


@pytest.mark.parametrize("spread", [3.0, 40.0, 80.0])
def test_fill_random_points_equals_definition(spread: float) -> None:
    """Few cells with many points, many cells with few, and points outside of the grid."""
    rng = np.random.default_rng(int(spread))
    points = rng.uniform(-spread, spread, (6000, 3))
    earlier = rng.uniform(-spread, spread, (2000, 2))
    height, intensity = rng.uniform(-1.0, 6.0, 6000), rng.random(6000)
    arguments = (points, height, intensity, earlier, rng.uniform(0.3, 4.4, 2000))
    np.testing.assert_allclose(grid_of(*arguments), stated(*arguments), atol=2e-6)


def test_fill_three_points_in_cell_has_calculated_channels() -> None:
    """Cell (128, 127) covers x from 0 to 0.4 m and y from -0.4 m to 0; the third point is ground."""
    points = np.array([[0.1, -0.1, 0.0], [0.3, -0.1, 0.0], [0.2, -0.2, 0.0]])
    grid = grid_of(points, np.array([1.0, 2.0, 0.25]), np.array([0.2, 0.6, 1.0]), np.empty((0, 2)), np.empty(0))
    expected = [math.log(3) / 3, 0.5, 0.25, 0.375, 0.4, 0.0, 0.25, math.log(2) / 3, 0.0, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(grid[:, 128, 127], expected, atol=1e-7)
    assert np.count_nonzero(np.abs(grid).sum(axis=0)) == 1


@pytest.mark.parametrize("x", [-51.21, 51.2, 1e30, -1e30, math.inf, math.nan])
def test_fill_points_outside_are_ignored(x: float) -> None:
    points, plan = np.array([[x, 0.0, 1.0], [0.0, x, 1.0]]), np.array([[x, 0.0], [0.0, x]])
    ones = np.ones(2)
    assert not grid_of(points, ones, ones, plan, ones).any()


def test_fill_border_points_are_in_first_and_last_cell() -> None:
    points = np.array([[-51.2, -51.2, 0.0], [51.199, 51.199, 0.0]])
    grid = grid_of(points, np.ones(2), np.ones(2), np.empty((0, 2)), np.empty(0))
    assert grid[0, 0, 0] == grid[0, 255, 255] > 0.0


def reading(points: np.ndarray, frame: LevelFrame, pitch: float = 0.0) -> LidarReading:
    """Return a lidar in a level frame, pitched downwards, that measures points (N, 3) of the world."""
    cos, sin, c, s = math.cos(frame.yaw), math.sin(frame.yaw), math.cos(pitch), math.sin(pitch)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    pose[:3, 3] = frame.x, frame.y, frame.height
    return LidarReading((points - pose[:3, 3]) @ pose[:3, :3], np.full(len(points), 0.5), pose)


def street(slope: float = 0.0) -> np.ndarray:
    """Return points (N, 3) of a ground of this slope along x, and then of a wall on it, 1.0 m and 1.5 m high."""
    x, y = (values.ravel() for values in np.meshgrid(np.arange(-29.7, 30.0, 0.8), np.arange(-29.7, 30.0, 0.8)))
    ground = np.stack([x, y, slope * x], axis=1)
    wall = np.array([(10.2, float(y), slope * 10.2 + high) for y in np.arange(-4.9, 5.0, 0.25) for high in (1.0, 1.5)])
    return np.concatenate([ground, wall])


def test_history_standing_wall_is_in_same_cells_of_both_scans() -> None:
    """The station drives 3.7 m and turns by 25 degrees meanwhile."""
    history, points = ScanHistory(), street()
    poses = (FOOT_POSE, LevelFrame(3.7, 1.1, 2.0, math.radians(25.0)))
    first, second = (
        history.add(time, [reading(points, frame)], frame, 0.0) for time, frame in zip((0.3, 0.5), poses, strict=True)
    )
    assert first.age is None
    assert not first.channels[8:].any()
    assert second.age == pytest.approx(0.2)
    present, earlier = second.channels[[0, 1, 5, 6]], second.channels[8:]
    np.testing.assert_allclose(earlier, present, atol=1e-4)
    assert np.count_nonzero(present[0]) > 20


@pytest.mark.parametrize(
    ("times", "age"),
    [
        ((0.0, 0.1), None),
        ((0.0, 0.1, 0.2), 0.2),
        ((0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3), 0.2),
        ((0.0, 0.25), 0.25),
        ((0.0, 0.15), 0.15),
        ((0.0, 0.15, 0.3), 0.15),
        ((0.0, 0.3), None),
        ((0.0, 0.1, 0.2, 1.0), None),
    ],
)
def test_history_earlier_scan_is_that_nearest_to_fifth_of_second(times: tuple[float, ...], age: float | None) -> None:
    history, points = ScanHistory(), street()
    views = [history.add(time, [reading(points, FOOT_POSE)], FOOT_POSE, 0.0) for time in times]
    assert views[-1].age == (None if age is None else pytest.approx(age))


def test_history_lidars_of_station_form_one_cloud() -> None:
    """The second lidar is elsewhere, looks backwards, and is tilted; it measures every other point."""
    points = street()
    together = ScanHistory().add(0.0, [reading(points, FOOT_POSE)], FOOT_POSE, 0.0)
    another = LevelFrame(-1.5, 0.7, 1.2, math.pi)
    parts = [reading(points[::2], FOOT_POSE), reading(points[1::2], another, math.radians(20.0))]
    divided = ScanHistory().add(0.0, parts, FOOT_POSE, 0.0)
    np.testing.assert_allclose(divided.channels, together.channels, atol=1e-5)


@pytest.mark.parametrize("slope", [-0.08, 0.0, 0.06])
def test_history_tilted_lidar_on_slope_measures_heights_above_ground(slope: float) -> None:
    """A unit 6 m above a sloping road, pitched down by 30 degrees: the wall is 1.0 m to 1.5 m above the road."""
    frame = LevelFrame(0.0, 0.0, 6.0, 0.0)
    view = ScanHistory().add(0.0, [reading(street(slope), frame, math.radians(30.0))], frame, 0.0)
    occupied = np.argwhere(view.channels[0] > 0.0)
    assert set(occupied[:, 0].tolist()) == {math.floor(10.2 / 0.4) + 128}
    np.testing.assert_allclose(
        4.0 * view.channels[1:3, occupied[:, 0], occupied[:, 1]], [[1.5], [1.0]] * np.ones(len(occupied)), atol=0.1
    )


def test_history_empty_cloud_has_empty_grid() -> None:
    history = ScanHistory()
    for time in (0.0, 0.2):
        view = history.add(time, [reading(np.empty((0, 3)), FOOT_POSE)], FOOT_POSE, 0.0)
        assert not view.channels.any()
    assert view.age == pytest.approx(0.2)

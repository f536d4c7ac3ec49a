"""Nearest points of small and large sets, compared with the k-d tree of scipy."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from opendrive_xml import map_xml, road_xml, section_xml
from scipy.spatial import cKDTree

from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.geometry.nearest import FEW, NearestPoints


def test_map_without_lanes_has_no_lane_near_a_point() -> None:
    roads = RoadNetwork.parse(map_xml(road_xml("1", lanes=section_xml())))
    assert roads.locate_at(5.0, 0.0) is None
    assert roads.bounds() == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("size", [1, 40, FEW, FEW + 1])
@pytest.mark.parametrize("dimensions", [2, 3])
def test_nearest_points_equal_those_of_tree(size: int, dimensions: int) -> None:
    generator = np.random.default_rng(size)
    points, to = (generator.uniform(-100.0, 100.0, (count, dimensions)) for count in (size, 700))
    tree, found = cKDTree(points), NearestPoints(points)
    for within in (np.inf, 5.0):
        distance, index = found.nearest(to, within)
        expected, number = tree.query(to, k=1, distance_upper_bound=within)
        np.testing.assert_array_equal(distance, expected)
        np.testing.assert_array_equal(index, number)
    several = min(size, 12)
    distance, index = found.several(to, several)
    expected, number = tree.query(to, k=list(range(1, several + 1)))
    np.testing.assert_array_equal(distance, expected)
    np.testing.assert_array_equal(index, number)


def test_nearest_points_at_same_distance_start_with_lowest_index() -> None:
    points = NearestPoints(np.array([[9.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]]))
    assert points.nearest(np.zeros((1, 2)))[1].tolist() == [1]
    assert points.several(np.zeros((1, 2)), 4)[1].tolist() == [[1, 2, 3, 4]]


def test_nearest_points_of_no_point_are_empty() -> None:
    points = NearestPoints(np.zeros((3, 2)))
    assert [len(part) for part in (*points.nearest(np.empty((0, 2))), *points.several(np.empty((0, 2)), 2))] == [0] * 4


@pytest.mark.parametrize("dimensions", [2, 3])
def test_nearest_points_of_several_blocks_equal_comparison_with_all(dimensions: int) -> None:
    generator = np.random.default_rng(dimensions)
    way = np.cumsum(generator.uniform(-1.0, 1.0, (FEW, dimensions)), axis=0)
    points = np.concatenate([way, np.round(way), np.round(way)])[::3]
    near = points[generator.integers(0, len(points), 100)] + generator.normal(0.0, 2.0, (100, dimensions))
    to = np.concatenate([near, np.round(near) + 0.5, points[:50], 1e4 * near])
    square = ((to[:, None] - points) ** 2).sum(axis=2)
    distance, index = NearestPoints(points).nearest(to)
    np.testing.assert_array_equal(index, square.argmin(axis=1))
    np.testing.assert_array_equal(distance, np.sqrt(square.min(axis=1)))


@pytest.mark.exhaustive
@pytest.mark.parametrize("dimensions", [2, 3])
def test_tree_of_often_used_set_gives_the_same_points_as_comparisons(dimensions: int) -> None:
    generator = np.random.default_rng(dimensions)
    grid = np.round(generator.uniform(-100.0, 100.0, (3 * FEW, dimensions)) / 4.0) * 4.0
    points = np.concatenate(
        [grid, generator.uniform(-100.0, 100.0, (FEW, dimensions)), np.repeat(grid[:3], 40, axis=0)]
    )
    to = np.concatenate([np.round(generator.uniform(-100.0, 100.0, (200, dimensions))), points[-130:], grid[:100]])
    order = ((to[:, None] - points) ** 2).sum(axis=2).argsort(axis=1, kind="stable")
    assert np.any(order[:, 0] > order[:, 1])
    used = NearestPoints(points)
    for _ in range(3):
        used.nearest(to)
    assert "_tree" in vars(used)
    for within in (np.inf, 3.0):
        one_by_one = [NearestPoints(points).nearest(position[None], within) for position in to]
        for part, expected in zip(used.nearest(to, within), zip(*one_by_one, strict=True), strict=True):
            np.testing.assert_array_equal(part, np.concatenate(expected))
    np.testing.assert_array_equal(used.nearest(to)[1], order[:, 0])
    for count in (1, 2, 12, 30):
        distance, index = used.several(to, count)
        np.testing.assert_array_equal(index, order[:, :count])
        np.testing.assert_array_equal(
            distance, np.concatenate([NearestPoints(points).several(p[None], count)[0] for p in to])
        )


@pytest.mark.parametrize("searches", [0, FEW])
def test_no_point_is_near_a_position_that_is_not_finite(searches: int) -> None:
    points = NearestPoints(np.random.default_rng(1).uniform(0.0, 10.0, (2 * FEW, 2)))
    points.nearest(np.zeros((searches, 2)))
    distance, index = points.nearest(np.array([[np.nan, 1.0], [5.0, 5.0], [np.inf, np.nan], [1.0, -np.inf]]))
    assert np.isinf(distance).tolist() == [True, False, True, True]
    assert (index == len(points.points)).tolist() == [True, False, True, True]


def test_few_searches_in_large_set_import_no_tree() -> None:
    program = (
        "import sys, numpy as np; from eidrive_scenario.roads.geometry.nearest import NearestPoints; "
        "points = NearestPoints(np.random.default_rng(1).uniform(0.0, 1e3, (40_000, 2))); "
        "points.nearest(np.zeros((100, 2))), points.several(np.zeros((100, 2)), 12); few = 'scipy' in sys.modules; "
        "points.nearest(np.zeros((2000, 2))); print(few, 'scipy' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]

"""Gated assignment, compared with the best of all possible assignments."""

from __future__ import annotations

import subprocess
import sys
from itertools import combinations

import numpy as np
import pytest

from eidrive_scenario.base.assignment import assign, assign_matrix, associate

Pair = tuple[int, int]


def best(pairs: list[Pair], cost: np.ndarray) -> set[Pair]:
    """Return the assignment with the most pairs, and among these the least sum of costs, of all subsets of pairs."""
    for size in range(min(cost.shape), 0, -1):
        valid = [
            chosen
            for chosen in combinations(pairs, size)
            if len({row for row, _ in chosen}) == len({column for _, column in chosen}) == size
        ]
        if valid:
            return set(min(valid, key=lambda chosen: sum(cost[pair] for pair in chosen)))
    return set()


@pytest.mark.parametrize("density", [0.2, 0.4, 0.7])
def test_assignment_is_the_best_of_all(density: float) -> None:
    generator = np.random.default_rng(int(10 * density))
    for _ in range(150):
        cost = generator.random(generator.integers(1, 5, 2))
        inside = generator.random(cost.shape) < density
        pairs = [(int(row), int(column)) for row, column in np.argwhere(inside)]
        expected = best(pairs, cost)
        assert set(assign_matrix(cost, inside)) == expected
        if pairs:
            found = assign([row for row, _ in pairs], [column for _, column in pairs], cost[inside].tolist())
            assert set(found) == expected
            assert found == sorted(found)


@pytest.mark.parametrize("count", [6, 40])
def test_points_with_two_candidates_get_the_nearer_one(count: int) -> None:
    """Of two detections near one track the nearer one, for few pairs and for many."""
    tracks = np.array([[50.0 * number, 0.0] for number in range(count)])
    detections = np.concatenate([tracks + np.array([0.9, 0.0]), tracks + np.array([0.0, 0.4])])
    assert associate(detections, tracks, 1.0) == [(count + row, row) for row in range(count)]
    assert associate(tracks, detections, 1.0) == [(row, count + row) for row in range(count)]


def test_equal_costs_select_the_lowest_indices() -> None:
    assert assign([0, 0, 1, 2], [0, 1, 2, 2], [1.0, 1.0, 2.0, 2.0]) == [(0, 0), (1, 2)]


def test_competing_pairs_import_the_general_method_only_if_necessary() -> None:
    program = (
        "import sys; from eidrive_scenario.base.assignment import assign; "
        "assign([0, 0, 1], [0, 1, 2], [3.0, 2.0, 1.0]); "
        "star = 'scipy' in sys.modules; assign([0, 0, 1], [0, 1, 1], [3.0, 2.0, 1.0]); "
        "print(star, 'scipy' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]

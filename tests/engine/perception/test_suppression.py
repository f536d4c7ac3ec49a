"""Overlap of image boxes, non-maximum suppression, and class names."""

from __future__ import annotations

import numpy as np
import pytest

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.perception.learned.image_network import (
    IMAGE_CLASSES,
    light_state,
    object_category,
    suppression_groups,
)
from eidrive_scenario.perception.learned.networks.suppression import covered, overlap, suppress


def test_overlap_and_covered_of_shifted_boxes_equal_area_ratios() -> None:
    a = np.array([[0.0, 0.0, 10.0, 10.0]])
    b = np.array([[5.0, 0.0, 15.0, 10.0], [0.0, 0.0, 10.0, 10.0], [10.0, 0.0, 20.0, 10.0], [2.0, 2.0, 4.0, 4.0]])
    np.testing.assert_allclose(overlap(a, b), [[50 / 150, 1.0, 0.0, 4 / 100]])
    np.testing.assert_allclose(covered(b, a)[:, 0], [0.5, 1.0, 0.0, 1.0])


def test_suppress_overlapping_boxes_keeps_best_of_each_group() -> None:
    boxes = np.array(
        [
            [0.0, 0.0, 10.0, 10.0],  # overlaps the next by 9/11
            [1.0, 0.0, 11.0, 10.0],
            [2.0, 0.0, 12.0, 10.0],  # overlaps the first by 8/12 and the second by 9/11
            [40.0, 0.0, 50.0, 10.0],
        ]
    )
    scores = np.array([0.6, 0.9, 0.8, 0.3])
    same = np.zeros(4, dtype=np.int64)
    assert suppress(boxes, scores, same, 0.5).tolist() == [1, 3]
    # A suppressed box suppresses no others: the first and the third overlap by 2/3, below 0.7.
    assert suppress(boxes[[0, 2]], scores[[0, 2]], same[:2], 0.7).tolist() == [1, 0]
    assert suppress(boxes, scores, np.arange(4), 0.5).tolist() == [1, 2, 0, 3]
    assert suppress(boxes, scores, np.arange(4), 0.5, max_boxes=2).tolist() == [1, 2]
    assert suppress(boxes[:0], scores[:0], same[:0], 0.5).tolist() == []


def test_suppress_equal_scores_keeps_first() -> None:
    boxes = np.array([[0.0, 0.0, 10.0, 10.0], [0.0, 0.0, 10.0, 10.0]])
    assert suppress(boxes, np.array([0.5, 0.5]), np.zeros(2, dtype=np.int64), 0.5).tolist() == [0]


def test_suppress_boxes_without_area_are_removed_and_suppress_none() -> None:
    boxes = np.array([[5.0, 5.0, 5.0, 9.0], [8.0, 8.0, 2.0, 2.0], [0.0, 0.0, 10.0, 10.0], [5.0, 5.0, 5.0, 9.0]])
    assert suppress(boxes, np.array([0.9, 0.8, 0.7, 0.6]), np.zeros(4, dtype=np.int64), 0.5).tolist() == [2]


def test_suppress_group_far_outside_image_leaves_other_groups_unchanged() -> None:
    """Double precision resolves no pixels at 1e30, so a common offset per group would merge all boxes."""
    near = np.array([[0.0, 0.0, 10.0, 10.0], [20.0, 0.0, 30.0, 10.0]])
    boxes = np.concatenate([near, [[0.0, 0.0, 1e30, 1e30]]])
    assert suppress(boxes, np.array([0.9, 0.8, 0.7]), np.array([1, 1, 0]), 0.5).tolist() == [0, 1, 2]


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("kind", ["continuous", "grid"])
def test_suppress_random_boxes_agrees_with_greedy_definition(kind: str, seed: int) -> None:
    """On the grid, overlaps equal to the limit and equal scores are frequent."""
    rng = np.random.default_rng(seed)
    low, size = rng.uniform(0.0, 200.0, (60, 2)), rng.uniform(1.0, 80.0, (60, 2))
    scores = rng.uniform(0.1, 1.0, 60)
    if kind == "grid":
        low, size, scores = np.floor(low / 20.0), np.ceil(size / 20.0), np.ceil(scores * 8.0) / 8.0
    boxes, groups = np.concatenate([low, low + size], axis=1), rng.integers(0, 4, 60)
    assert suppress(boxes, scores, groups, 0.5).tolist() == greedy(boxes, scores, groups, 0.5)


def greedy(boxes: Array, scores: Array, groups: Integers, limit: float) -> list[int]:
    """Keep each box, best first, that overlaps no kept box of its group by more than `limit`."""
    kept: list[int] = []
    for row in np.argsort(-scores, kind="stable").tolist():
        rivals = [other for other in kept if groups[other] == groups[row]]
        if not rivals or overlap(boxes[[row]], boxes[rivals]).max() <= limit:
            kept.append(row)
    return kept


def test_suppression_groups_merge_vehicle_classes_and_light_states() -> None:
    group = dict(zip(IMAGE_CLASSES, suppression_groups(IMAGE_CLASSES).tolist(), strict=True))
    assert group["car"] == group["truck"] == group["bus"]
    assert group["traffic light red"] == group["traffic light green"]
    assert (
        len({group["car"], group["pedestrian"], group["bicycle"], group["stop sign"], group["traffic light off"]}) == 5
    )


def test_class_names_map_to_image_classes_categories_and_light_states() -> None:
    assert object_category("person") == "pedestrian"
    assert object_category("stop sign") is None
    assert light_state("traffic light yellow") == "yellow"
    assert light_state("traffic light") == "unknown"
    assert light_state("car") is None

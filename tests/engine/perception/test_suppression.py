"""Overlap of boxes in a picture, and the choice among several on one object, by hand."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.perception.learned.classes import (
    IMAGE_CLASSES,
    image_class,
    light_state,
    object_category,
    suppression_groups,
)
from eidrive_scenario.perception.learned.networks.suppression import covered, overlap, suppress


def test_overlap_by_hand() -> None:
    a = np.array([[0.0, 0.0, 10.0, 10.0]])
    b = np.array([[5.0, 0.0, 15.0, 10.0], [0.0, 0.0, 10.0, 10.0], [10.0, 0.0, 20.0, 10.0], [2.0, 2.0, 4.0, 4.0]])
    np.testing.assert_allclose(overlap(a, b), [[50 / 150, 1.0, 0.0, 4 / 100]])
    np.testing.assert_allclose(covered(b, a)[:, 0], [0.5, 1.0, 0.0, 1.0])


def test_the_best_of_overlapping_boxes_stays() -> None:
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
    # What the best suppresses no longer suppresses others: at 0.7 the first and the third are 2/3 apart.
    assert suppress(boxes[[0, 2]], scores[[0, 2]], same[:2], 0.7).tolist() == [1, 0]
    assert suppress(boxes, scores, np.arange(4), 0.5).tolist() == [1, 2, 0, 3]
    assert suppress(boxes, scores, np.arange(4), 0.5, most=2).tolist() == [1, 2]
    assert suppress(boxes[:0], scores[:0], same[:0], 0.5).tolist() == []


def test_equal_scores_keep_their_order() -> None:
    boxes = np.array([[0.0, 0.0, 10.0, 10.0], [0.0, 0.0, 10.0, 10.0]])
    assert suppress(boxes, np.array([0.5, 0.5]), np.zeros(2, dtype=np.int64), 0.5).tolist() == [0]


def test_a_vehicle_is_not_two_vehicles_and_a_lamp_not_two_colors() -> None:
    group = dict(zip(IMAGE_CLASSES, suppression_groups(IMAGE_CLASSES).tolist(), strict=True))
    assert group["car"] == group["truck"] == group["bus"]
    assert group["traffic light red"] == group["traffic light green"]
    assert (
        len({group["car"], group["pedestrian"], group["bicycle"], group["stop sign"], group["traffic light off"]}) == 5
    )


def test_names_of_classes() -> None:
    assert image_class("van") == "car"
    assert image_class("truck") == "truck"
    assert object_category("person") == "pedestrian"
    assert object_category("stop sign") is None
    assert light_state("traffic light yellow") == "yellow"
    assert light_state("traffic light") == "unknown"
    assert light_state("car") is None

"""Average precision and recall, against values calculated by hand."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from eidrive_scenario.experiments.average_precision import (
    Matches,
    area_in_order,
    average_precision,
    best_confidence,
    match,
    match_by_share,
    precision_recall,
    recall_at,
)

NONE = np.zeros(0, dtype=bool)


def matches_of(*entries: tuple[float, bool]) -> Matches:
    scores = np.array([score for score, _ in entries])
    return Matches(scores, np.array([right for _, right in entries]), np.ones(len(entries), dtype=bool), NONE)


def test_average_precision_sorts_detections_over_all_images() -> None:
    # Sorted: false 0.9, true 0.5; one of two objects is found with precision 1/2. Per image, the result would be 1/2.
    images = [matches_of((0.5, True)), matches_of((0.9, False))]
    assert average_precision(images, 2) == pytest.approx(0.25)
    assert average_precision([images[1], images[0]], 2) == pytest.approx(0.25)


@pytest.mark.parametrize("entries", [[(0.8, True), (0.8, False)], [(0.8, False), (0.8, True)]])
def test_detections_of_one_score_enter_together(entries: list[tuple[float, bool]]) -> None:
    """A right and a wrong detection of one object: no threshold admits only one of them, so that precision is 1/2."""
    apart = [matches_of(entry) for entry in entries]
    for images in (apart, [matches_of(*entries)]):
        assert average_precision(images, 1) == 0.5
        assert [curve.tolist() for curve in precision_recall(images, 1)] == [[1.0], [0.5]]
        assert best_confidence(images, 1) == 0.8


def test_average_precision_with_equal_scores_among_others() -> None:
    # Of four objects: true 0.9; true, false, false 0.5; true 0.3. Points: 1/4 and 1; 2/4 and 2/4; 3/4 and 3/5.
    single = matches_of((0.5, False), (0.9, True), (0.5, True), (0.5, False), (0.3, True))
    recall, precision = precision_recall([single], 4)
    np.testing.assert_allclose(recall, [0.25, 0.5, 0.75])
    np.testing.assert_allclose(precision, [1.0, 0.5, 0.6])
    assert average_precision([single], 4) == pytest.approx(0.25 * (1.0 + 0.6 + 0.6))
    # F1: 2/5, 4/8, 6/9
    assert best_confidence([single], 4) == 0.3


def test_area_in_order_is_that_of_opencood_without_scores() -> None:
    """Each detection enters alone: true, false, true of two objects has precisions 1, 1/2 and 2/3."""
    correct = np.array([True, False, True])
    assert area_in_order(correct, 2) == pytest.approx(0.5 * (1.0 + 2 / 3))
    assert area_in_order(correct, 2, np.array([0.9, 0.9, 0.9])) == pytest.approx(2 / 3)
    assert area_in_order(np.zeros(0, dtype=bool), 2, np.zeros(0)) == 0.0


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_match_of_equal_scores_does_not_depend_on_their_order(order: tuple[int, ...]) -> None:
    """The detection that overlaps the object most takes it; the score of 0.5 comes last wherever it stands."""
    shares, scores = np.array([[0.9, 0.6], [0.7, 0.0], [0.0, 0.8]]), np.array([0.8, 0.8, 0.5])
    rows = list(order)
    found = match_by_share(shares[rows], scores[rows], np.zeros(2, dtype=bool), 0.5)
    assert found.correct.tolist() == [True, False, True]
    assert found.taken.tolist() == [0, -1, 1]


def test_average_precision_uses_maximum_precision_at_or_above_recall() -> None:
    # true, false, true, false, true, of four objects
    single = matches_of((0.9, True), (0.8, False), (0.7, True), (0.6, False), (0.5, True))
    recall, precision = precision_recall([single], 4)
    np.testing.assert_allclose(recall, [0.25, 0.25, 0.5, 0.5, 0.75])
    np.testing.assert_allclose(precision, [1.0, 0.5, 2 / 3, 0.5, 0.6])
    assert average_precision([single], 4) == pytest.approx(0.25 * (1.0 + 2 / 3 + 0.6))
    assert recall_at([single], 4, 0.65) == pytest.approx(0.5)


def test_average_precision_without_detections_is_zero_without_objects_nan() -> None:
    assert average_precision([], 3) == 0.0
    assert np.isnan(average_precision([matches_of((0.9, False))], 0))
    assert np.isnan(recall_at([], 0, 0.5))


def test_best_confidence_maximizes_f1() -> None:
    # of four objects: F1 after each detection 2/5, 2/6, 4/7, 4/8, 6/9
    single = matches_of((0.9, True), (0.8, False), (0.7, True), (0.6, False), (0.5, True))
    assert best_confidence([single], 4) == 0.5
    assert best_confidence([matches_of((0.9, True), (0.8, False)), matches_of((0.7, False))], 4) == 0.9
    with pytest.raises(ValueError, match="no detection is correct"):
        best_confidence([matches_of((0.9, False))], 4)


def test_match_assigns_each_object_to_its_best_detection() -> None:
    objects = np.array([[0.0, 0.0, 10.0, 10.0], [20.0, 0.0, 30.0, 10.0]])
    boxes = np.array([[0.0, 0.0, 10.0, 9.0], [0.0, 0.0, 10.0, 10.0], [20.0, 0.0, 30.0, 4.9], [20.0, 0.0, 30.0, 5.0]])
    found = match(boxes, np.array([0.9, 0.8, 0.7, 0.6]), objects, np.zeros(2, dtype=bool))
    assert found.correct.tolist() == [True, False, False, True]  # overlap 0.49 is below the minimum of 0.5
    assert found.counted.all()
    assert found.found.all()


def test_match_ignored_objects_are_not_counted() -> None:
    objects = np.array([[0.0, 0.0, 10.0, 10.0], [20.0, 0.0, 40.0, 20.0]])
    ignored = np.array([False, True])
    boxes = np.array(
        [
            [20.0, 0.0, 40.0, 19.0],  # matches the ignored object
            [22.0, 2.0, 26.0, 6.0],  # lies within it
            [60.0, 0.0, 70.0, 10.0],  # matches nothing
            [0.0, 0.0, 10.0, 10.0],
        ]
    )
    found = match(boxes, np.array([0.9, 0.8, 0.7, 0.6]), objects, ignored)
    assert found.counted.tolist() == [False, False, True, True]
    assert found.correct.tolist() == [False, False, False, True]
    assert average_precision([found], 1) == pytest.approx(0.5)

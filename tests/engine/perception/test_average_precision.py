"""Average precision and recall, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from eidrive_scenario.perception.learned.average_precision import (
    Matches,
    average_precision,
    best_confidence,
    match,
    precision_recall,
    recall_at,
)

NONE = np.zeros(0, dtype=bool)


def told(*entries: tuple[float, bool]) -> Matches:
    scores = np.array([score for score, _ in entries])
    return Matches(scores, np.array([right for _, right in entries]), np.ones(len(entries), dtype=bool), NONE)


def test_detections_are_sorted_over_the_whole_set() -> None:
    # Sorted: wrong 0.9, right 0.5; of two objects one is found with precision 1/2. Picture by picture it were 1/2.
    pictures = [told((0.5, True)), told((0.9, False))]
    assert average_precision(pictures, 2) == pytest.approx(0.25)
    assert average_precision([pictures[1], pictures[0]], 2) == pytest.approx(0.25)


def test_the_area_counts_the_best_precision_at_each_recall_or_beyond() -> None:
    # right, wrong, right, wrong, right, of four objects
    single = told((0.9, True), (0.8, False), (0.7, True), (0.6, False), (0.5, True))
    recall, precision = precision_recall([single], 4)
    np.testing.assert_allclose(recall, [0.25, 0.25, 0.5, 0.5, 0.75])
    np.testing.assert_allclose(precision, [1.0, 0.5, 2 / 3, 0.5, 0.6])
    assert average_precision([single], 4) == pytest.approx(0.25 * (1.0 + 2 / 3 + 0.6))
    assert recall_at([single], 4, 0.65) == pytest.approx(0.5)


def test_nothing_found_and_nothing_there() -> None:
    assert average_precision([], 3) == 0.0
    assert np.isnan(average_precision([told((0.9, False))], 0))
    assert np.isnan(recall_at([], 0, 0.5))


def test_the_best_confidence_has_the_largest_f1() -> None:
    # of four objects: F1 after each detection 2/5, 2/6, 4/7, 4/8, 6/9
    single = told((0.9, True), (0.8, False), (0.7, True), (0.6, False), (0.5, True))
    assert best_confidence([single], 4) == 0.5
    assert best_confidence([told((0.9, True), (0.8, False)), told((0.7, False))], 4) == 0.9
    with pytest.raises(ValueError, match="without any right detection"):
        best_confidence([told((0.9, False))], 4)


def test_each_object_is_found_once_by_the_surest_detection() -> None:
    objects = np.array([[0.0, 0.0, 10.0, 10.0], [20.0, 0.0, 30.0, 10.0]])
    boxes = np.array([[0.0, 0.0, 10.0, 9.0], [0.0, 0.0, 10.0, 10.0], [20.0, 0.0, 30.0, 4.9], [20.0, 0.0, 30.0, 5.0]])
    found = match(boxes, np.array([0.9, 0.8, 0.7, 0.6]), objects, np.zeros(2, dtype=bool))
    assert found.correct.tolist() == [True, False, False, True]  # overlap 0.49 is too little, 0.5 enough
    assert found.counted.all()
    assert found.found.all()


def test_ignored_objects_neither_count_nor_harm() -> None:
    objects = np.array([[0.0, 0.0, 10.0, 10.0], [20.0, 0.0, 40.0, 20.0]])
    ignored = np.array([False, True])
    boxes = np.array(
        [
            [20.0, 0.0, 40.0, 19.0],  # finds the ignored object
            [22.0, 2.0, 26.0, 6.0],  # lies within it
            [60.0, 0.0, 70.0, 10.0],  # finds nothing
            [0.0, 0.0, 10.0, 10.0],
        ]
    )
    found = match(boxes, np.array([0.9, 0.8, 0.7, 0.6]), objects, ignored)
    assert found.counted.tolist() == [False, False, True, True]
    assert found.correct.tolist() == [False, False, False, True]
    assert average_precision([found], 1) == pytest.approx(0.5)

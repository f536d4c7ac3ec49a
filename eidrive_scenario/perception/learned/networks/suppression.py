"""Overlap of boxes in an image, and non-maximum suppression."""

from __future__ import annotations

import cv2
import numpy as np

from eidrive_scenario.base.arrays import Array, Integers


def overlap(first: Array, second: Array) -> Array:
    """Return the intersection over union (N, M) of boxes (N, 4) and (M, 4), each x1 y1 x2 y2."""
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    shared = np.prod(np.maximum(high - low, 0.0), axis=2)
    total = _area(first)[:, None] + _area(second)[None, :] - shared
    return np.asarray(shared / np.maximum(total, 1e-12))


def covered(boxes: Array, regions: Array) -> Array:
    """Return the share (N, M) of each box (N, 4) that lies in each region (M, 4)."""
    low = np.maximum(boxes[:, None, :2], regions[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], regions[None, :, 2:])
    shared = np.prod(np.maximum(high - low, 0.0), axis=2)
    return np.asarray(shared / np.maximum(_area(boxes)[:, None], 1e-12))


def suppress(boxes: Array, scores: Array, groups: Integers, limit: float, max_boxes: int = 300) -> Integers:
    """Return the rows to keep, best first: greedy non-maximum suppression within each group.

    A box is removed if it overlaps a better one of its group by more than `limit`, if it has no area, or if its score
    is 0. Boxes of equal score keep their order.
    """
    has_area = (boxes[:, 2:] > boxes[:, :2]).all(axis=1)  # OpenCV gives boxes without area an overlap of 1
    kept = [np.zeros(0, dtype=np.int64)]
    # One call per group: NMSBoxesBatched shifts the groups apart, which loses digits of distant boxes.
    for group in np.unique(groups[has_area]):
        rows = np.flatnonzero(has_area & (groups == group))
        rectangles = np.concatenate([boxes[rows, :2], boxes[rows, 2:] - boxes[rows, :2]], axis=1)
        best = cv2.dnn.NMSBoxes(rectangles.tolist(), scores[rows].tolist(), 0.0, limit)
        kept.append(rows[np.asarray(best, np.int64)])
    remaining = np.sort(np.concatenate(kept))
    return np.asarray(remaining[np.argsort(-scores[remaining], kind="stable")][:max_boxes], dtype=np.int64)


def _area(boxes: Array) -> Array:
    return np.asarray((boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1]))

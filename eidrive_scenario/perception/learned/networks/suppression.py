"""Boxes in a picture: overlap, and the choice of the best of several on one object."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array, Integers


def overlap(first: Array, second: Array) -> Array:
    """(N, M) intersection over union of boxes (N, 4) and (M, 4), each x1 y1 x2 y2."""
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    shared = np.prod(np.maximum(high - low, 0.0), axis=2)
    total = _area(first)[:, None] + _area(second)[None, :] - shared
    return np.asarray(shared / np.maximum(total, 1e-12))


def covered(boxes: Array, regions: Array) -> Array:
    """(N, M) share of each box (N, 4) that lies in each region (M, 4)."""
    low = np.maximum(boxes[:, None, :2], regions[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], regions[None, :, 2:])
    shared = np.prod(np.maximum(high - low, 0.0), axis=2)
    return np.asarray(shared / np.maximum(_area(boxes)[:, None], 1e-12))


def suppress(boxes: Array, scores: Array, groups: Integers, limit: float, most: int = 300) -> Integers:
    """Rows to keep, best first: greedy non-maximum suppression within each group.

    A box goes if it overlaps a better one of its group by more than `limit`; equal scores keep the order given.
    """
    order = np.argsort(-scores, kind="stable")
    shares = overlap(boxes[order], boxes[order])
    rivals = (shares > limit) & (groups[order][:, None] == groups[order][None, :])
    alive = np.ones(len(order), dtype=bool)
    kept = []
    for rank in range(len(order)):
        if alive[rank]:
            kept.append(rank)
            if len(kept) == most:
                break
            alive[rank + 1 :] &= ~rivals[rank, rank + 1 :]
    return np.asarray(order[kept], dtype=np.int64)


def _area(boxes: Array) -> Array:
    return np.asarray((boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1]))

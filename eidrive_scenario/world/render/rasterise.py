"""Triangles to pixels, all at once: rows of triangles, spans of rows, the nearest of each pixel's fragments."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Array = NDArray[np.float64]
Integers = NDArray[np.int64]

_SHIFT = np.uint64(32)
_LOW = np.uint64(0xFFFFFFFF)


class Cover(NamedTuple):
    """What each pixel (H · W,) shows: the number of a triangle or -1, and the greatest of its nearness there."""

    triangle: NDArray[np.int32]
    nearness: Floats


def rasterise(x: Array, y: Array, nearness: Array, width: int, height: int) -> Cover:
    """Cover a picture with triangles, given by x, y [px] and nearness (3, N) of their corners.

    A pixel shows a triangle that holds its centre, the one of greatest nearness there. Nearness must be positive and
    linear across the picture: 1 / depth in perspective. Of equals the later one wins. A centre on an edge belongs to
    the triangle right of or below that edge, so that neighbours neither overlap nor leave gaps.
    """
    held = np.zeros(width * height, dtype=np.uint64)
    # Over so short an axis, comparing rows is many times as fast as a reduction.
    low, high = np.minimum(np.minimum(y[0], y[1]), y[2]), np.maximum(np.maximum(y[0], y[1]), y[2])
    left_end, right_end = np.minimum(np.minimum(x[0], x[1]), x[2]), np.maximum(np.maximum(x[0], x[1]), x[2])
    first = np.clip(np.ceil(low - 0.5), 0, height).astype(np.int64)
    last = np.clip(np.ceil(high - 0.5), 0, height).astype(np.int64)
    chosen = np.flatnonzero((last > first) & (right_end > 0.5) & (left_end < width))
    if not len(chosen):
        return Cover(np.full(width * height, -1, dtype=np.int32), np.zeros(width * height, dtype=np.float32))
    first, last = first[chosen], last[chosen]
    (x0, x1, x2), (y0, y1, y2), (n0, n1, n2) = _from_top(np.stack([x[:, chosen], y[:, chosen], nearness[:, chosen]]))
    with np.errstate(divide="ignore", invalid="ignore"):
        long_slope = (x2 - x0) / (y2 - y0)
        upper_slope = (x1 - x0) / (y1 - y0)
        lower_slope = (x2 - x1) / (y2 - y1)
        twice_area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        rightwards = ((n1 - n0) * (y2 - y0) - (n2 - n0) * (y1 - y0)) / twice_area
        downwards = ((n2 - n0) * (x1 - x0) - (n1 - n0) * (x2 - x0)) / twice_area

    counts = last - first
    of_row = np.repeat(np.arange(len(chosen)), counts)
    row = np.arange(len(of_row)) + np.repeat(first - (np.cumsum(counts) - counts), counts)
    at = row + 0.5
    down = at - y0[of_row]
    one = x0[of_row] + down * long_slope[of_row]
    below = at >= y1[of_row]
    with np.errstate(invalid="ignore"):
        other = np.where(
            below, x1[of_row] + (at - y1[of_row]) * lower_slope[of_row], x0[of_row] + down * upper_slope[of_row]
        )
        left = np.clip(np.ceil(np.minimum(one, other) - 0.5), 0, width)
        right = np.clip(np.ceil(np.maximum(one, other) - 0.5), 0, width)
        lengths = right - left
    some = np.flatnonzero(lengths > 0)
    of_row, row, left = of_row[some], row[some], left[some].astype(np.int64)
    lengths = lengths[some].astype(np.int64)

    start = np.cumsum(lengths) - lengths
    slope = rightwards[of_row]
    level = n0[of_row] + (row + 0.5 - y0[of_row]) * downwards[of_row] + (left + 0.5 - x0[of_row]) * slope
    number = np.arange(int(lengths.sum()))
    of_fragment = np.repeat(np.arange(len(some)), lengths)
    pixel = (row * width + left - start)[of_fragment] + number
    value = (level - slope * start)[of_fragment] + slope[of_fragment] * number
    key = np.maximum(value, 1e-30).astype(np.float32).view(np.uint32).astype(np.uint64) << _SHIFT
    key |= (chosen + 1).astype(np.uint64)[of_row][of_fragment]
    np.maximum.at(held, pixel, key)
    return Cover((held & _LOW).astype(np.int32) - 1, (held >> _SHIFT).astype(np.uint32).view(np.float32))


def _from_top(corners: Array) -> Array:
    """(3, 3, N) x, y and nearness of corners in any order: the uppermost, the middle and the lowest."""
    for one, two in ((0, 1), (1, 2), (0, 1)):
        wrong = np.flatnonzero(corners[1, two] < corners[1, one])
        corners[:, one, wrong], corners[:, two, wrong] = corners[:, two, wrong], corners[:, one, wrong]
    return corners

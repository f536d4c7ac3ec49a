"""Triangles to pixels: large ones as blocks of rows, all others at once; the nearest of each pixel's fragments."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Array = NDArray[np.float64]
Integers = NDArray[np.int64]

_SHIFT = np.uint64(32)
_LOW = np.uint64(0xFFFFFFFF)
_LARGE = 8000.0
"""Triangles of so many pixels are filled row by row as blocks, which pays from about there on."""
_FULL = 0.15
"""And of at least this share of the block that holds them."""
_LEAST = 1e-30
"""Nearness of what is infinitely far; 0 is nothing."""


class Cover(NamedTuple):
    """What each pixel of a window of the picture shows, from line `top` and column `left` on.

    triangle (h, w) numbers, -1 where there is none; nearness (h, w) of it there, 0 where there is none
    """

    triangle: NDArray[np.int32]
    nearness: Floats
    top: int = 0
    left: int = 0

    @property
    def window(self) -> tuple[slice, slice]:
        """Lines and columns of the picture."""
        height, width = self.triangle.shape
        return slice(self.top, self.top + height), slice(self.left, self.left + width)


class _Corners(NamedTuple):
    """Of N triangles, from the uppermost corner to the lowest."""

    x: Array
    y: Array
    nearness: Array


class _Spans(NamedTuple):
    """Rows of triangles, one after the other: whose, at which line, and the columns from left up to right."""

    whose: Integers
    line: Integers
    left: Integers
    right: Integers


def rasterise(x: Array, y: Array, nearness: Array, width: int, height: int) -> Cover:
    """Cover a picture with triangles, given by x, y [px] and nearness (3, N) of their corners.

    A pixel shows a triangle that holds its centre, the one of greatest nearness there. Nearness must be positive and
    linear across the picture: 1 / depth in perspective. Of equals the later one wins. A centre on an edge belongs to
    the triangle right of or below that edge, so that neighbours neither overlap nor leave gaps.
    """
    found = rasterised(x, y, nearness, width, height)
    if found.triangle.shape == (height, width):
        return found
    triangle, near = np.full((height, width), -1, dtype=np.int32), np.zeros((height, width), dtype=np.float32)
    triangle[found.window], near[found.window] = found.triangle, found.nearness
    return Cover(triangle, near)


def rasterised(x: Array, y: Array, nearness: Array, width: int, height: int) -> Cover:
    """The same for the part of the picture that holds all of them. What one triangle shows does not depend on others
    but for what lies before it."""
    # Over so short an axis, comparing rows is many times as fast as a reduction.
    low, high = np.minimum(np.minimum(y[0], y[1]), y[2]), np.maximum(np.maximum(y[0], y[1]), y[2])
    left_end, right_end = np.minimum(np.minimum(x[0], x[1]), x[2]), np.maximum(np.maximum(x[0], x[1]), x[2])
    first = np.clip(np.ceil(low - 0.5), 0, height).astype(np.int64)
    last = np.clip(np.ceil(high - 0.5), 0, height).astype(np.int64)
    chosen = np.flatnonzero((last > first) & (right_end > 0.5) & (left_end < width))
    if not len(chosen):
        return Cover(np.full((0, 0), -1, dtype=np.int32), np.zeros((0, 0), dtype=np.float32))
    corners = _from_top(np.stack([x[:, chosen], y[:, chosen], nearness[:, chosen]]))
    rightwards, downwards = _slopes(corners)
    spans = _spans(corners, first[chosen], last[chosen], width)
    if not len(spans.whose):
        return Cover(np.full((0, 0), -1, dtype=np.int32), np.zeros((0, 0), dtype=np.float32))
    top, left = int(spans.line.min()), int(spans.left.min())
    shape = (int(spans.line.max()) + 1 - top, int(spans.right.max()) - left)
    triangle, near = np.full(shape, -1, dtype=np.int32), np.zeros(shape, dtype=np.float32)

    lengths = spans.right - spans.left
    # How near the middle of the line's first pixel would be at column 0, and the first span of each triangle.
    start = corners.nearness[0] - corners.x[0] * rightwards
    level = start[spans.whose] + (spans.line + 0.5 - corners.y[0][spans.whose]) * downwards[spans.whose]
    begins = np.flatnonzero(np.diff(spans.whose, prepend=-1))
    area = np.add.reduceat(lengths, begins)
    ends = np.append(begins[1:], len(lengths))
    widths = np.maximum.reduceat(spans.right, begins) - np.minimum.reduceat(spans.left, begins)
    large = (area >= _LARGE) & (area >= _FULL * widths * (ends - begins))
    for begin, end in zip(begins[large].tolist(), ends[large].tolist(), strict=True):
        row = int(spans.whose[begin])
        part = _Spans(*(column[begin:end] for column in spans))
        _fill(triangle, near, part, level[begin:end], float(rightwards[row]), int(chosen[row]), top, left)

    small = np.flatnonzero(np.repeat(~large, ends - begins))
    if len(small):
        few = _Spans(*(column[small] for column in spans))
        _scatter(triangle, near, few, level[small], rightwards[few.whose], chosen[few.whose], top, left)
    return Cover(triangle, near, top, left)


def _from_top(corners: Array) -> _Corners:
    """(3, 3, N) x, y and nearness of corners in any order: the uppermost, the middle and the lowest."""
    for one, two in ((0, 1), (1, 2), (0, 1)):
        wrong = np.flatnonzero(corners[1, two] < corners[1, one])
        corners[:, one, wrong], corners[:, two, wrong] = corners[:, two, wrong], corners[:, one, wrong]
    return _Corners(*corners)


def _slopes(corners: _Corners) -> tuple[Array, Array]:
    """How nearness grows per pixel rightwards and downwards (N,)."""
    (x0, x1, x2), (y0, y1, y2), (n0, n1, n2) = corners
    with np.errstate(divide="ignore", invalid="ignore"):
        twice_area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        rightwards = ((n1 - n0) * (y2 - y0) - (n2 - n0) * (y1 - y0)) / twice_area
        downwards = ((n2 - n0) * (x1 - x0) - (n1 - n0) * (x2 - x0)) / twice_area
    return rightwards, downwards


def _spans(corners: _Corners, first: Integers, last: Integers, width: int) -> _Spans:
    """The rows of all triangles that hold centres of pixels."""
    (x0, x1, x2), (y0, y1, y2), _ = corners
    counts = last - first
    whose = np.repeat(np.arange(len(counts)), counts)
    line = np.arange(len(whose)) + np.repeat(first - (np.cumsum(counts) - counts), counts)
    at = line + 0.5
    with np.errstate(divide="ignore", invalid="ignore"):
        one = x0[whose] + (at - y0[whose]) * ((x2 - x0) / (y2 - y0))[whose]
        upper = x0[whose] + (at - y0[whose]) * ((x1 - x0) / (y1 - y0))[whose]
        lower = x1[whose] + (at - y1[whose]) * ((x2 - x1) / (y2 - y1))[whose]
        other = np.where(at >= y1[whose], lower, upper)
        left = np.clip(np.ceil(np.minimum(one, other) - 0.5), 0, width)
        right = np.clip(np.ceil(np.maximum(one, other) - 0.5), 0, width)
        some = np.flatnonzero(right > left)
    return _Spans(whose[some], line[some], left[some].astype(np.int64), right[some].astype(np.int64))


def _fill(
    triangle: NDArray[np.int32],
    near: Floats,
    spans: _Spans,
    level: Array,
    slope: float,
    number: int,
    top: int,
    left: int,
) -> None:
    """Draw one triangle, numbers rising from call to call."""
    first, last = int(spans.line[0]), int(spans.line[-1]) + 1
    begin, end = int(spans.left.min()), int(spans.right.max())
    window = (slice(first - top, last - top), slice(begin - left, end - left))
    # Where a tip is thinner than a pixel, some of its lines hold no centre of one.
    rows = spans.line - first
    levels = np.zeros(last - first)
    levels[rows] = level
    from_column, to_column = np.zeros((2, last - first, 1), dtype=np.int32)
    from_column[rows, 0], to_column[rows, 0] = spans.left, spans.right
    columns = np.arange(begin, end, dtype=np.int32)
    value = np.empty((last - first, end - begin), dtype=np.float32)
    np.add(levels[:, None], (columns + 0.5) * slope, out=value, casting="same_kind")
    np.maximum(value, np.float32(_LEAST), out=value)
    better = value >= near[window]
    better &= columns >= from_column
    better &= columns < to_column
    np.copyto(near[window], value, where=better)
    np.copyto(triangle[window], np.int32(number), where=better)


def _scatter(
    triangle: NDArray[np.int32],
    near: Floats,
    spans: _Spans,
    level: Array,
    slope: Array,
    number: Integers,
    top: int,
    left: int,
) -> None:
    """Draw the rows of many triangles over what is there, all fragments at once."""
    first = int(spans.line.min())
    rows = slice(first - top, int(spans.line.max()) + 1 - top)
    triangle, near = triangle[rows], near[rows]
    held = near.view(np.uint32).astype(np.uint64)
    held <<= _SHIFT
    held |= (triangle + 1).astype(np.uint64)
    lengths = spans.right - spans.left
    start = np.cumsum(lengths) - lengths
    step = np.arange(int(lengths.sum())) - np.repeat(start, lengths)
    value = np.repeat(slope, lengths)
    value *= step
    value += np.repeat(level + (spans.left + 0.5) * slope, lengths)
    pixel = np.repeat((spans.line - first) * triangle.shape[1] + spans.left - left, lengths)
    pixel += step
    key = np.maximum(value.astype(np.float32), np.float32(_LEAST)).view(np.uint32).astype(np.uint64)
    key <<= _SHIFT
    key |= np.repeat((number + 1).astype(np.uint64), lengths)
    np.maximum.at(held.reshape(-1), pixel, key)
    np.subtract(held & _LOW, 1, out=triangle, casting="unsafe")
    held >>= _SHIFT
    near[...] = held.astype(np.uint32).view(np.float32)

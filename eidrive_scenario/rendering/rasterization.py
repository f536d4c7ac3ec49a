"""Rasterization: large triangles as blocks of rows, all others jointly; the nearest fragment of each pixel wins."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats, Integers

_SHIFT = np.uint64(32)
_LOW = np.uint64(0xFFFFFFFF)
_LARGE = 8000.0
"""Minimum number of pixels of triangles that are filled row by row as blocks, which is then faster."""
_FULL = 0.15
"""Minimum share of the bounding block that such triangles cover."""
_LEAST = 1e-30
"""Nearness of infinite distance; 0 means no triangle."""


class Cover(NamedTuple):
    """Visible triangles in a window of the image from line `top` and column `left` on.

    triangle  (h, w) index, -1 without a triangle
    nearness  (h, w) at the pixel, 0 without a triangle
    """

    triangle: NDArray[np.int32]
    nearness: Floats
    top: int = 0
    left: int = 0

    @property
    def window(self) -> tuple[slice, slice]:
        """Lines and columns in the image."""
        height, width = self.triangle.shape
        return slice(self.top, self.top + height), slice(self.left, self.left + width)


def rasterize(x: Array, y: Array, nearness: Array, width: int, height: int) -> Cover:
    """Rasterize triangles given by x, y [px] and nearness (3, N) of their corners.

    A pixel shows the triangle of maximum nearness among those that contain its center. Nearness must be positive and
    linear in the image: 1 / depth in perspective. In a tie the later triangle wins. A center on an edge belongs to the
    triangle right of or below that edge, so that neighbors neither overlap nor leave gaps.
    """
    found = rasterize_reference(x, y, nearness, width, height)
    if found.triangle.shape == (height, width):
        return found
    triangle, near = np.full((height, width), -1, dtype=np.int32), np.zeros((height, width), dtype=np.float32)
    triangle[found.window], near[found.window] = found.triangle, found.nearness
    return Cover(triangle, near)


def rasterize_reference(x: Array, y: Array, nearness: Array, width: int, height: int) -> Cover:
    """Return the same for the bounding window of all triangles.

    The result of one triangle does not depend on others except by occlusion.
    """
    rows = _rows(x, y, nearness, width, height)
    if rows is None:
        return Cover(np.full((0, 0), -1, dtype=np.int32), np.zeros((0, 0), dtype=np.float32))
    (top, left), shape = rows.corner, rows.shape
    triangle, near = np.full(shape, -1, dtype=np.int32), np.zeros(shape, dtype=np.float32)
    for one in rows.large:
        window, value, inside = _block(one, top, left)
        inside &= value >= near[window]
        np.copyto(near[window], value, where=inside)
        np.copyto(triangle[window], np.int32(one.number[0]), where=inside)
    if len(rows.small.line):
        _scatter(triangle, near, rows.small, top, left)
    return Cover(triangle, near, top, left)


def greatest(x: Array, y: Array, nearness: Array, width: int, height: int) -> tuple[Floats, int, int]:
    """Return the nearness in the bounding window of triangles, 0 outside of them, and its first line and column."""
    rows = _rows(x, y, nearness, width, height)
    if rows is None:
        return np.zeros((0, 0), dtype=np.float32), 0, 0
    (top, left), near = rows.corner, np.zeros(rows.shape, dtype=np.float32)
    for one in rows.large:
        window, value, inside = _block(one, top, left)
        np.maximum(near[window], value, out=near[window], where=inside)
    if len(rows.small.line):
        pixel, value = _fragments(rows.small, top, left, near.shape[1])
        np.maximum.at(near.reshape(-1), pixel, value)
    return near, top, left


class _Lines(NamedTuple):
    """Lines of triangles that contain pixel centers, in sequence.

    number, line, left, right  index of the triangle, line of the image, and columns from left up to right
    level, slope               nearness at column 0, and per pixel to the right
    """

    number: Integers
    line: Integers
    left: Integers
    right: Integers
    level: Array
    slope: Array


class _Rows(NamedTuple):
    """Lines of each large triangle and of all others jointly, and the bounding window of all."""

    large: list[_Lines]
    small: _Lines
    corner: tuple[int, int]
    shape: tuple[int, int]


def _rows(x: Array, y: Array, nearness: Array, width: int, height: int) -> _Rows | None:
    """Return the rows of triangles with corners (3, N); None if there are none."""
    # On such a short axis, comparisons of rows are many times faster than a reduction.
    low, high = np.minimum(np.minimum(y[0], y[1]), y[2]), np.maximum(np.maximum(y[0], y[1]), y[2])
    left_end, right_end = np.minimum(np.minimum(x[0], x[1]), x[2]), np.maximum(np.maximum(x[0], x[1]), x[2])
    first = np.clip(np.ceil(low - 0.5), 0, height).astype(np.int64)
    last = np.clip(np.ceil(high - 0.5), 0, height).astype(np.int64)
    chosen = np.flatnonzero((last > first) & (right_end > 0.5) & (left_end < width))
    if not len(chosen):
        return None
    # From here on x, y and nearness (3, N) of the chosen triangles, from the uppermost corner to the lowest
    x, y, nearness = _from_top(np.stack([x[:, chosen], y[:, chosen], nearness[:, chosen]]))
    whose, line, left, right = _spans(x, y, first[chosen], last[chosen], width)
    if not len(whose):
        return None
    rightwards, downwards = _slopes(x, y, nearness)
    start = nearness[0] - x[0] * rightwards
    level = start[whose] + (line + 0.5 - y[0][whose]) * downwards[whose]
    lines = _Lines(chosen[whose], line, left, right, level, rightwards[whose])
    begins = np.flatnonzero(np.diff(whose, prepend=-1))
    ends = np.append(begins[1:], len(whose))
    area = np.add.reduceat(right - left, begins)
    widths = np.maximum.reduceat(right, begins) - np.minimum.reduceat(left, begins)
    large = (area >= _LARGE) & (area >= _FULL * widths * (ends - begins))
    alone = [
        _Lines._make(column[begin:end] for column in lines)
        for begin, end in zip(begins[large].tolist(), ends[large].tolist(), strict=True)
    ]
    small = np.flatnonzero(np.repeat(~large, ends - begins))
    top, start_column = int(line.min()), int(left.min())
    shape = (int(line.max()) + 1 - top, int(right.max()) - start_column)
    return _Rows(alone, _Lines._make(column[small] for column in lines), (top, start_column), shape)


def _from_top(corners: Array) -> Array:
    """Return x, y and nearness (3, 3, N) of corners in any order as uppermost, middle and lowest."""
    for one, two in ((0, 1), (1, 2), (0, 1)):
        wrong = np.flatnonzero(corners[1, two] < corners[1, one])
        corners[:, one, wrong], corners[:, two, wrong] = corners[:, two, wrong], corners[:, one, wrong]
    return corners


def _slopes(x: Array, y: Array, nearness: Array) -> tuple[Array, Array]:
    """Return the slopes of nearness per pixel to the right and downwards (N,)."""
    (x0, x1, x2), (y0, y1, y2), (n0, n1, n2) = x, y, nearness
    with np.errstate(divide="ignore", invalid="ignore"):
        twice_area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        rightwards = ((n1 - n0) * (y2 - y0) - (n2 - n0) * (y1 - y0)) / twice_area
        downwards = ((n2 - n0) * (x1 - x0) - (n1 - n0) * (x2 - x0)) / twice_area
    return rightwards, downwards


def _spans(
    x: Array, y: Array, first: Integers, last: Integers, width: int
) -> tuple[Integers, Integers, Integers, Integers]:
    """Return the lines of all triangles that contain pixel centers: triangle, line, columns from left up to right."""
    (x0, x1, x2), (y0, y1, y2) = x, y
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
    return whose[some], line[some], left[some].astype(np.int64), right[some].astype(np.int64)


def _block(one: _Lines, top: int, left: int) -> tuple[tuple[slice, slice], Floats, NDArray[np.bool_]]:
    """Return lines and columns of the bounding block of a triangle, its nearness, and its mask."""
    first, last = int(one.line[0]), int(one.line[-1]) + 1
    begin, end = int(one.left.min()), int(one.right.max())
    # A tip that is thinner than a pixel has lines without pixel centers.
    rows = one.line - first
    levels = np.zeros(last - first)
    levels[rows] = one.level
    from_column, to_column = np.zeros((2, last - first, 1), dtype=np.int32)
    from_column[rows, 0], to_column[rows, 0] = one.left, one.right
    columns = np.arange(begin, end, dtype=np.int32)
    value = np.empty((last - first, end - begin), dtype=np.float32)
    np.add(levels[:, None], (columns + 0.5) * one.slope[0], out=value, casting="same_kind")
    np.maximum(value, np.float32(_LEAST), out=value)
    inside = columns >= from_column
    inside &= columns < to_column
    return (slice(first - top, last - top), slice(begin - left, end - left)), value, inside


def _fragments(few: _Lines, top: int, left: int, width: int) -> tuple[Integers, Floats]:
    """Return the pixels of rows in a window of this width in sequence, with their nearness."""
    lengths = few.right - few.left
    step = np.arange(int(lengths.sum())) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    value = np.repeat(few.slope, lengths)
    value *= step
    value += np.repeat(few.level + (few.left + 0.5) * few.slope, lengths)
    pixel = np.repeat((few.line - top) * width + few.left - left, lengths)
    pixel += step
    return pixel, np.maximum(value.astype(np.float32), np.float32(_LEAST))


def _scatter(triangle: NDArray[np.int32], near: Floats, few: _Lines, top: int, left: int) -> None:
    """Draw the rows of many triangles over existing ones, all fragments jointly."""
    first = int(few.line.min())
    rows = slice(first - top, int(few.line.max()) + 1 - top)
    triangle, near = triangle[rows], near[rows]
    # Bits of positive floats are ordered as their values: nearness above the triangle in one key, and the largest wins.
    held = near.view(np.uint32).astype(np.uint64)
    held <<= _SHIFT
    held |= (triangle + 1).astype(np.uint64)
    pixel, value = _fragments(few, first, left, near.shape[1])
    key = value.view(np.uint32).astype(np.uint64)
    key <<= _SHIFT
    key |= np.repeat((few.number + 1).astype(np.uint64), few.right - few.left)
    np.maximum.at(held.reshape(-1), pixel, key)
    np.subtract(held & _LOW, 1, out=triangle, casting="unsafe")
    held >>= _SHIFT
    near[...] = held.astype(np.uint32).view(np.float32)

"""Parts of roads that pass above other roads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Integers

CLEARANCE = 3.0
"""Minimum height of a road above another one that it covers [m]."""
_CELL = 5.0
"""Size of the squares in which heights are compared [m]."""
_FARTHEST = 1e9
"""Maximum coordinate of roads of which parts are found [m]."""
_MARGIN = 5.0
"""Length of a road before and after a part above another one that is drawn above it, too [m]."""


class Strip(NamedTuple):
    """Part of a lane section.

    stations  s coordinates (N,) in ascending order [m]
    heights   of the road (N,) [m]
    points    of the edges of all lanes (K, N, 2) [m]
    """

    stations: Array
    heights: Array
    points: Array


def bridge_spans(strips: Sequence[Strip]) -> Iterator[tuple[int, float, float]]:
    """Yield the parts of strips that are above another strip, or another part of it: index, first and last s [m]."""
    usual = [index for index, strip in enumerate(strips) if strip.points.size and _is_usual(strip)]
    strips = [strips[index] for index in usual]
    if not strips:
        return
    highest = max(float(strip.heights.max()) for strip in strips)
    lowest = min(float(strip.heights.min()) for strip in strips)
    if highest - lowest < CLEARANCE:
        return
    cells = _cells(strips)
    flat = np.concatenate([cell.ravel() for cell in cells])
    heights = np.concatenate([np.tile(strip.heights, len(strip.points)) for strip in strips])
    known, place = np.unique(flat, return_inverse=True)
    ground = np.full(len(known), np.inf)
    np.minimum.at(ground, place, heights)
    above = heights - ground[place] >= CLEARANCE
    start = 0
    for index, strip, cell in zip(usual, strips, cells, strict=True):
        covers = above[start : start + cell.size].reshape(cell.shape).any(axis=0)
        start += cell.size
        for first, last in _runs(covers):
            yield (
                index,
                max(float(strip.stations[0]), float(strip.stations[first]) - _MARGIN),
                min(float(strip.stations[-1]), float(strip.stations[last]) + _MARGIN),
            )


def _is_usual(strip: Strip) -> bool:
    """Return whether all numbers are finite and no coordinate is beyond the maximum."""
    return bool(np.isfinite(strip.heights).all() and (np.abs(strip.points) <= _FARTHEST).all())


def _cells(strips: Sequence[Strip]) -> list[Integers]:
    """Return the number of the square of each point of the strips, (K, N) each."""
    columns_and_rows = [np.floor(strip.points / _CELL).astype(np.int64) for strip in strips]
    rows = [each[..., 1] for each in columns_and_rows]
    lowest = min(int(each.min()) for each in rows)
    count = max(int(each.max()) for each in rows) - lowest + 1
    return [each[..., 0] * count + (each[..., 1] - lowest) for each in columns_and_rows]


def _runs(covers: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Yield first and last index of each run of True."""
    changes = np.flatnonzero(np.diff(covers, prepend=False, append=False)).tolist()
    for first, end in zip(changes[::2], changes[1::2], strict=True):
        yield first, end - 1

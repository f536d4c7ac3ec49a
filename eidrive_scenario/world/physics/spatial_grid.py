"""Spatial hash of static objects by square cells of the ground."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Generic, TypeVar

Thing = TypeVar("Thing")
Cell = tuple[int, int]

SQUARE = 10.0
"""Side of a cell [m]."""
_FAR = 300.0
"""Reach from which on the occupied cells are searched instead of all cells in reach [m]: steps of many seconds."""


class SpatialGrid(Generic[Thing]):
    """Static objects, each in the cells that it may overlap."""

    def __init__(self) -> None:
        self._in_cell: dict[Cell, list[Thing]] = {}

    def add(self, thing: Thing, cells: Iterable[Cell]) -> None:
        """Add an object to these cells."""
        for cell in dict.fromkeys(cells):
            self._in_cell.setdefault(cell, []).append(thing)

    def query(self, x: float, y: float, reach: float) -> list[Thing]:
        """Return the objects in the cells within reach of a point [m], possibly with duplicates."""
        found: list[Thing] = []
        if reach > _FAR:
            side = reach + SQUARE
            for (column, line), things in self._in_cell.items():
                if abs((column + 0.5) * SQUARE - x) <= side and abs((line + 0.5) * SQUARE - y) <= side:
                    found += things
        elif self._in_cell:
            for cell in grid_cells(x, y, reach):
                if cell in self._in_cell:
                    found += self._in_cell[cell]
        return found


def grid_cells(x: float, y: float, reach: float) -> list[Cell]:
    """Return the cells that overlap the square around a point with half the side `reach` [m]."""
    left, right = math.floor((x - reach) / SQUARE), math.floor((x + reach) / SQUARE)
    low, high = math.floor((y - reach) / SQUARE), math.floor((y + reach) / SQUARE)
    if left == right and low == high:
        return [(left, low)]
    return [(column, line) for column in range(left, right + 1) for line in range(low, high + 1)]

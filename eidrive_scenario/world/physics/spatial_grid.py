"""What stands where, by squares of the ground: who is far from everything learns it at once."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Generic, TypeVar

Thing = TypeVar("Thing")
Cell = tuple[int, int]

SQUARE = 10.0
"""Side of a square [m]."""
_FAR = 300.0
"""Reach from which on there may be more squares than any that have something in them [m]: steps of many seconds."""


class SpatialGrid(Generic[Thing]):
    """Things that do not move, each in the squares that it may touch."""

    def __init__(self) -> None:
        self._in_cell: dict[Cell, list[Thing]] = {}

    def add(self, thing: Thing, cells: Iterable[Cell]) -> None:
        """One more, in these squares."""
        for cell in dict.fromkeys(cells):
            self._in_cell.setdefault(cell, []).append(thing)

    def query(self, x: float, y: float, reach: float) -> list[Thing]:
        """Return those in the squares within reach of a point [m]; one may come several times."""
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
    """Return the squares that touch the square around a point that reaches as far to each side [m]."""
    left, right = math.floor((x - reach) / SQUARE), math.floor((x + reach) / SQUARE)
    low, high = math.floor((y - reach) / SQUARE), math.floor((y + reach) / SQUARE)
    if left == right and low == high:
        return [(left, low)]
    return [(column, line) for column in range(left, right + 1) for line in range(low, high + 1)]

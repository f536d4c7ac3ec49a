"""Gated assignment of two lists: the minimum sum of costs, by default with the maximum number of pairs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools

OUTSIDE = 1e6
"""Cost of a pair outside the gate: finite, so that a full assignment exists, and above any sum of gated costs."""
_TIE = 1e-6
"""Cost by which one more pair is preferred if the sums are equal."""


def associate(first: Array, second: Array, gate: float) -> list[tuple[int, int]]:
    """Return pairs (row of first, row of second) of points (N, D) and (M, D) within `gate` [m].

    The assignment has the maximum number of pairs, and among these the minimum sum of distances. Each row is used at
    most once.
    """
    if not len(first) or not len(second):
        return []
    offset = first[:, None, :] - second[None, :, :]
    distance = np.sqrt(np.einsum("nmi,nmi->nm", offset, offset))
    return assign_matrix(distance, distance < gate)


def assign_matrix(cost: Array, inside: Bools) -> list[tuple[int, int]]:
    """Return the assigned pairs (row, column) of a cost matrix (N, M), restricted to pairs `inside` the gate (N, M).

    Costs are smaller than OUTSIDE by more than their sum. Each row and column is used at most once.
    """
    rows, columns = np.nonzero(inside)
    return assign(rows.tolist(), columns.tolist(), cost[inside].tolist())


def assign(
    rows: Sequence[int], columns: Sequence[int], costs: Sequence[float], limits: Sequence[float] = ()
) -> list[tuple[int, int]]:
    """Return the assigned pairs of the candidate pairs (row, column): maximum number, then minimum sum of costs.

    limits  at least the costs. Then each pair that is not assigned costs the maximum limit of the competing pairs
            instead (global nearest neighbors; Blackman and Popoli, Design and analysis of modern tracking systems,
            1999, section 6.4), and the number of pairs resolves ties

    Each row and column is used at most once. The order of the indices resolves ties. Pairs without a common row or
    column, directly or by other pairs, are assigned separately.
    """
    pairs = _assign_stars(rows, columns, costs)
    if pairs is not None:
        return pairs
    chosen: set[tuple[int, int]] = set()
    for part in _components(rows, columns):
        own_rows, own_columns = [rows[index] for index in part], [columns[index] for index in part]
        own_costs = [costs[index] for index in part]
        stars = _assign_stars(own_rows, own_columns, own_costs)
        if stars is None:
            limit = max([limits[index] for index in part]) + _TIE if limits else OUTSIDE
            stars = _assign_optimally(own_rows, own_columns, own_costs, limit)
        chosen.update(stars)
    return [pair for pair in zip(rows, columns, strict=True) if pair in chosen]


def _components(rows: Sequence[int], columns: Sequence[int]) -> list[list[int]]:
    """Return the places of the pairs of each connected component."""
    parent: dict[tuple[int, int], tuple[int, int]] = {}

    def root(node: tuple[int, int]) -> tuple[int, int]:
        while (above := parent.setdefault(node, node)) != node:
            parent[node] = parent.setdefault(above, above)
            node = parent[node]
        return node

    for row, column in zip(rows, columns, strict=True):
        parent[root((1, column))] = root((0, row))
    parts: dict[tuple[int, int], list[int]] = {}
    for index, row in enumerate(rows):
        parts.setdefault(root((0, row)), []).append(index)
    return list(parts.values())


def _assign_optimally(
    rows: Sequence[int], columns: Sequence[int], costs: Sequence[float], limit: float
) -> list[tuple[int, int]]:
    """Return the result of `assign` by the general method."""
    from scipy.optimize import linear_sum_assignment

    row_of = {row: index for index, row in enumerate(sorted(set(rows)))}
    column_of = {column: index for index, column in enumerate(sorted(set(columns)))}
    matrix = np.full((len(row_of), len(column_of)), limit)
    for row, column, cost in zip(rows, columns, costs, strict=True):
        matrix[row_of[row], column_of[column]] = cost
    assigned = {
        (row, column) for row, column in zip(*(side.tolist() for side in linear_sum_assignment(matrix)), strict=True)
    }
    return [
        (row, column) for row, column in zip(rows, columns, strict=True) if (row_of[row], column_of[column]) in assigned
    ]


def _assign_stars(rows: Sequence[int], columns: Sequence[int], costs: Sequence[float]) -> list[tuple[int, int]] | None:
    """Return the result of `assign` if no pair competes by its row and by its column with other pairs, or else None.

    A row with several columns that have no other row, and the reverse, gets the pair with the least cost. The package
    with the general method takes longer to import than a short run.
    """
    pairs = list(zip(rows, columns, strict=True))
    if len(set(rows)) == len(pairs) == len(set(columns)):
        return pairs
    of_row, of_column = Counter(rows), Counter(columns)
    best: dict[tuple[int, int], tuple[float, int, int]] = {}
    for (row, column), cost in zip(pairs, costs, strict=True):
        if of_row[row] > 1 and of_column[column] > 1:
            return None
        star = (0, row) if of_row[row] > 1 else (1, column)
        best[star] = min(best.get(star, (math.inf, 0, 0)), (cost, row, column))
    chosen = {(row, column) for _, row, column in best.values()}
    return [pair for pair in pairs if pair in chosen]

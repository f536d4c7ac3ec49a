"""Pairs of estimates that may be of one object."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.fusion.association import assign

Table = NDArray[np.void]
Integers = NDArray[np.intp]

LEFT_OVER = -2.0 * math.log(1e-6)
"""One true pair in a hundred lies beyond a gate of 99 %, which would make two objects of one many times a second. What
finds no partner within the gate is paired up to this squared Mahalanobis distance."""
CERTAIN = -1e3
"""Cost of a pair whose station says that both are the same object: less than any other."""


class AssociationGate(NamedTuple):
    """When two positions may be of one object.

    chi_square  squared Mahalanobis distance at most
    distance    where one of the two does not say how exact it is: between the centers at most [m]
    """

    chi_square: float
    distance: float

    @classmethod
    def of(cls, probability: float, distance: float) -> AssociationGate:
        """The gate that holds an estimate of the same object with this probability; in the plane, chi-square of 2."""
        return cls(-2.0 * math.log1p(-probability), distance)


class Pairs(NamedTuple):
    """Rows of the first and of the second table, what it costs to take both for one object, and whether that is within
    the gate, or only for want of another partner."""

    first: list[int]
    second: list[int]
    cost: list[float]
    inside: list[bool]


def gated_pairs(first: Table, second: Table, gate: AssociationGate, *, same_station: bool) -> Pairs:
    """Pairs of tracks that may be one object: of the same station, or the second of a later one than the first.

    They may by the gate, by the station's own number, or because the center of one lies within half a width of the
    other: two bodies cannot be in one place, however sure their reporters are that they stand apart. The cost is the
    negative log-likelihood of the offset, but for constants.
    """
    own = _Side.of(first, gate)
    other = own if second is first else _Side.of(second, gate)
    dx, dy = own.x[:, None] - other.x, own.y[:, None] - other.y
    limit = own.reach[:, None] + other.reach
    near = dx * dx + dy * dy <= limit * limit
    numbered = None
    if same_station:
        stations = first["station"][:, None] == second["station"][None, :]
        near &= stations
        if second["number"].max(initial=-1) >= 0:
            numbered = stations & (first["number"][:, None] == second["number"][None, :]) & (second["number"] >= 0)
            near |= numbered
    else:
        near &= first["station"][:, None] < second["station"][None, :]
    rows, columns = np.nonzero(near)
    if not len(rows):
        return Pairs([], [], [], [])
    x, y = dx[rows, columns], dy[rows, columns]
    xx, xy, yy = own.xx[rows] + other.xx[columns], own.xy[rows] + other.xy[columns], own.yy[rows] + other.yy[columns]
    determinant = xx * yy - xy * xy
    mahalanobis = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / determinant
    square = x * x + y * y
    vague = own.vague[rows] | other.vague[columns]
    inside = np.where(vague, square < gate.distance**2, mahalanobis <= gate.chi_square)
    narrower = np.minimum(own.width[rows], other.width[columns])
    inside |= square < 0.25 * narrower * narrower
    cost = mahalanobis + np.log(determinant)
    if numbered is not None:
        certain = numbered[rows, columns]
        inside |= certain
        cost[certain] = CERTAIN
    fits = inside | (~vague & (mahalanobis <= LEFT_OVER))
    return Pairs(rows[fits].tolist(), columns[fits].tolist(), cost[fits].tolist(), inside[fits].tolist())


def assigned_pairs(pairs: Pairs) -> list[tuple[int, int]]:
    """Those chosen: first within the gate, then among the rows that are left over."""
    if all(pairs.inside):
        return assign(pairs.first, pairs.second, pairs.cost)
    chosen = (
        assign(*zip(*(pair[:3] for pair in zip(*pairs, strict=True) if pair[3]), strict=True))
        if any(pairs.inside)
        else []
    )
    rows, columns = {row for row, _ in chosen}, {column for _, column in chosen}
    rest = [
        (row, column, cost)
        for row, column, cost in zip(pairs.first, pairs.second, pairs.cost, strict=True)
        if row not in rows and column not in columns
    ]
    return chosen + assign(*zip(*rest, strict=True)) if rest else chosen


class _Side(NamedTuple):
    """One side of the pairs, (N,) each: place, covariance of the place, width, and whether the place is vague.

    reach  the farthest that any of the rules can take this side of a pair [m]
    """

    x: Array
    y: Array
    xx: Array
    xy: Array
    yy: Array
    width: Array
    vague: NDArray[np.bool_]
    reach: Array

    @classmethod
    def of(cls, tracks: Table, gate: AssociationGate) -> _Side:
        mean, covariance, pose, vague = (tracks[name] for name in ("mean", "covariance", "pose", "vague"))
        xx, yy = covariance[:, 0, 0] + pose[:, 0, 0], covariance[:, 1, 1] + pose[:, 1, 1]
        width = tracks["body"][:, 2]
        statistical = math.sqrt(max(gate.chi_square, LEFT_OVER)) * np.sqrt(xx + yy)
        reach = np.maximum(statistical, np.where(vague, gate.distance, width))
        return cls(mean[:, 0], mean[:, 1], xx, covariance[:, 0, 1] + pose[:, 0, 1], yy, width, vague, reach)

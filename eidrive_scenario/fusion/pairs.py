"""Pairs of tracks of one object: gates, candidates, assignment, and groups of tracks by object."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.assignment import OUTSIDE, assign
from eidrive_scenario.base.geometry import on_two_levels
from eidrive_scenario.perception.tracking.association import UNASSIGNED_GATE

Table = NDArray[np.void]
"""Structured array of tracks; see `fusion.tracks.TRACK`."""

_MAX_COORDINATE = 1e7
"""Maximum coordinate in the search by position [m], which rounding would affect beyond."""
CERTAIN = -1e3
"""Cost of a pair with the same object id of a station: less than any other."""


class AssociationGate(NamedTuple):
    """Association gate of two positions.

    chi_square  maximum squared Mahalanobis distance
    distance    maximum distance between the centers if one covariance is unknown [m]
    """

    chi_square: float
    distance: float

    @classmethod
    def of(cls, probability: float, distance: float) -> AssociationGate:
        """Return the gate that contains estimates of the same object with this probability (chi-square, 2 degrees)."""
        return cls(-2.0 * math.log1p(-probability), distance)


class Pairs(NamedTuple):
    """Candidate pairs: rows of both tables, costs with and without the association, and whether a pair is in the gate.

    Pairs outside the gate are only used for tracks without another partner.
    """

    first: list[int]
    second: list[int]
    cost: list[float]
    limit: list[float]
    inside: list[bool]


def gated_pairs(first: Table, second: Table, gate: AssociationGate, *, same_station: bool) -> Pairs:
    """Return association candidates: tracks of the same station, or of two stations with the lower one first.

    Stations are distinct over all receiving stations if `same_station`, and those of one receiving station otherwise.
    Candidates are on one level, not on and below a bridge. They are within the gate, have the same object id of the
    station, or have centers within half a width of each other, because two bodies cannot overlap even if the
    covariances are small. The cost is the negative log-likelihood of the offset without constants.

    The cost without a pair is that at the gate: two stations see different parts of a row of parked cars, and the
    maximum number of pairs would shift one part by a car. Errors of poses move all objects of a station together and
    say nothing about a single pair, so that only the other errors count there. A station that repeats its report sees
    the same objects: the number of its pairs is maximum.
    """
    own = _Side.of(first, gate)
    other = own if second is first else _Side.of(second, gate)
    if same_station:
        order = np.argsort(second["station"], kind="stable")
        begin, end = (np.searchsorted(second["station"][order], first["station"], side) for side in ("left", "right"))
        rows, columns = ranges(begin, end, order)
    else:
        rows, columns = _pairs_of_two_stations(first, second, own, other)
    x, y = own.x[rows] - other.x[columns], own.y[rows] - other.y[columns]
    limit = own.reach[rows] + other.reach[columns]
    body, other_body = first["body"][rows], second["body"][columns]  # z, length, width, height
    apart = on_two_levels(body[:, 0], body[:, 3], other_body[:, 0], other_body[:, 3])
    near = (x * x + y * y <= limit * limit) & ~apart
    certain = None
    if same_station and second["number"].max(initial=-1) >= 0:
        number = second["number"][columns]
        certain = (first["number"][rows] == number) & (number >= 0)
        near |= certain
    if not near.any():
        return Pairs([], [], [], [], [])
    if not near.all():
        rows, columns, x, y = rows[near], columns[near], x[near], y[near]
        certain = None if certain is None else certain[near]
    # Squared Mahalanobis distances by the closed inverse of 2 x 2 matrices. The cost adds the logarithm of the
    # determinant, which prevents that an uncertain track wins by its wide gate.
    xx, xy, yy = own.xx[rows] + other.xx[columns], own.xy[rows] + other.xy[columns], own.yy[rows] + other.yy[columns]
    determinant = xx * yy - xy * xy
    mahalanobis = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / determinant
    square = x * x + y * y
    vague = own.vague[rows] | other.vague[columns]
    inside = np.where(vague, square < gate.distance**2, mahalanobis <= gate.chi_square)
    narrower = np.minimum(own.width[rows], other.width[columns])
    inside |= square < 0.25 * narrower * narrower
    size = np.log(determinant)
    cost = mahalanobis + size
    limit = np.full(len(cost), OUTSIDE)
    if not same_station:
        separate = own.separate[rows] + other.separate[columns]
        limit = np.maximum(cost, gate.chi_square * (xx + yy) / separate + size)
    if certain is not None:
        inside |= certain
        cost[certain] = CERTAIN
    fits = inside | (~vague & (mahalanobis <= UNASSIGNED_GATE))
    return Pairs(*(values[fits].tolist() for values in (rows, columns, cost, limit, inside)))


def assigned_pairs(pairs: Pairs) -> list[tuple[int, int]]:
    """Return the assigned pairs: first within the gate, then among the unassigned rows."""
    if all(pairs.inside):
        return assign(*pairs[:4])
    assigned = (
        assign(*zip(*(pair[:4] for pair in zip(*pairs, strict=True) if pair[4]), strict=True))
        if any(pairs.inside)
        else []
    )
    rows, columns = {row for row, _ in assigned}, {column for _, column in assigned}
    rest = [pair[:3] for pair in zip(*pairs, strict=True) if pair[0] not in rows and pair[1] not in columns]
    return assigned + assign(*zip(*rest, strict=True)) if rest else assigned


def _pairs_of_two_stations(first: Table, second: Table, own: _Side, other: _Side) -> tuple[Integers, Integers]:
    """Return rows and columns, in order, of the pairs of two stations of one receiving station, the lower one first.

    Pairs that are too far apart may be omitted.
    """
    station, other_station = first["station"], second["station"]
    receiver, other_receiver = first["receiver"], second["receiver"]
    # Clipping brings no pair farther apart. A reach of unknown or large size covers all clipped positions.
    x, other_x = (np.clip(side.x, -_MAX_COORDINATE, _MAX_COORDINATE) for side in (own, other))
    distance = np.fmin(own.reach + other.reach.max(), 2.0 * _MAX_COORDINATE) * (1.0 + 1e-9) + 1e-6  # for rounding
    extent = max(float(x.max()), float(other_x.max())) - min(float(x.min()), float(other_x.min()))
    # Receiving stations are shifted so far that no pair of two of them is near.
    width = extent + 3.0 * float(distance.max())
    x, other_x = x + width * receiver, other_x + width * other_receiver
    distance += 1e-12 * max(float(np.abs(x).max()), float(np.abs(other_x).max()))
    order = np.argsort(other_x, kind="stable")
    sorted_x = other_x[order]
    rows, columns = ranges(
        np.searchsorted(sorted_x, x - distance), np.searchsorted(sorted_x, x + distance, "right"), order
    )
    # Each pair of two stations once, in the order of rows and columns as of a full matrix: ties go by this order.
    ahead = (station[rows] < other_station[columns]) & (receiver[rows] == other_receiver[columns])
    rows, columns = rows[ahead], columns[ahead]
    in_order = np.lexsort((columns, rows))
    return rows[in_order], columns[in_order]


def ranges(starts: Integers, ends: Integers, order: Integers) -> tuple[Integers, Integers]:
    """Return each row (N,) as often as its range of places is long, and the entries of `order` at these places.

    starts, ends  (N,) first place of each row, and the one after its last
    """
    counts = ends - starts
    total = np.cumsum(counts)
    rows = np.repeat(np.arange(len(counts)), counts)
    places = np.arange(len(rows)) - np.repeat(total - counts - starts, counts)
    return rows, order[places]


class _Side(NamedTuple):
    """One side of the pairs, (N,) each: position, covariance, width, and whether the covariance is unknown.

    separate  trace of the covariance without the error of the pose, which all tracks of a station share
    reach     maximum contribution of this side to the distance of a candidate pair [m]
    """

    x: Array
    y: Array
    xx: Array
    xy: Array
    yy: Array
    width: Array
    vague: NDArray[np.bool_]
    separate: Array
    reach: Array

    @classmethod
    def of(cls, tracks: Table, gate: AssociationGate) -> _Side:
        mean, covariance, pose, vague = (tracks[name] for name in ("mean", "covariance", "pose", "vague"))
        xx, yy = covariance[:, 0, 0] + pose[:, 0, 0], covariance[:, 1, 1] + pose[:, 1, 1]
        width = tracks["body"][:, 2]
        statistical = math.sqrt(max(gate.chi_square, UNASSIGNED_GATE)) * np.sqrt(xx + yy)
        separate = covariance[:, 0, 0] + covariance[:, 1, 1]
        reach = np.maximum(statistical, np.where(vague, gate.distance, width))
        return cls(mean[:, 0], mean[:, 1], xx, covariance[:, 0, 1] + pose[:, 0, 1], yy, width, vague, separate, reach)


class Objects(NamedTuple):
    """Tracks by object: (N,) rows of the tracks, those of one object in sequence, and (G,) their first places."""

    rows: Integers
    starts: Integers


def group_tracks(tracks: Table, gate: AssociationGate) -> Objects:
    """Return the rows of each object, from tracks at a common time that are sorted by receiving station and station.

    The tracks of each station in turn are assigned to known objects by global nearest neighbors (`assign`), at most one
    per object, because a station reports different objects. Unassigned tracks form new objects. The cost of an object
    is that of its likeliest member. Objects are in the order of their first tracks. Each receiving station has its own
    objects.
    """
    label = np.arange(len(tracks))
    station, receiver = tracks["station"], tracks["receiver"]
    if station[0] == station[-1] and receiver[0] == receiver[-1]:
        return Objects(label, label)
    pairs = gated_pairs(tracks, tracks, gate, same_station=False)
    if not pairs.first:
        return Objects(label, label)
    first, second = np.array(pairs.first), np.array(pairs.second)
    np.minimum.at(label, second, first)
    unclear = label[first] != label[second]
    if not all(pairs.inside):
        unclear |= ~np.array(pairs.inside)
    twice = _tracks_of_one_station(label, station)
    if unclear.any() or len(twice):
        for ambiguous in np.unique(receiver[np.concatenate([first[unclear], twice])]).tolist():
            begin, end = np.searchsorted(receiver, [ambiguous, ambiguous + 1]).tolist()
            # Pairs are in order of their rows: those of one receiver are consecutive.
            part = slice(bisect_left(pairs.first, begin), bisect_left(pairs.first, end))
            of_first, of_second = ([row - begin for row in side[part]] for side in (pairs.first, pairs.second))
            own = Pairs(of_first, of_second, pairs.cost[part], pairs.limit[part], pairs.inside[part])
            for members in _group_sequentially(station[begin:end].tolist(), own):
                label[[begin + row for row in members]] = begin + members[0]
    rows = np.argsort(label, kind="stable")
    grouped = label[rows]
    return Objects(rows, np.flatnonzero(np.concatenate([[True], grouped[1:] != grouped[:-1]])))


def _tracks_of_one_station(label: Integers, station: Integers) -> Integers:
    """Return tracks of an object (N,) that has another track of their station (N,)."""
    keys = label * (int(station.max()) + 1) + station
    order = np.argsort(keys)
    ordered = keys[order]
    twice: Integers = order[1:][ordered[1:] == ordered[:-1]]
    return twice


def _group_sequentially(stations: Sequence[int], pairs: Pairs) -> list[list[int]]:
    partners: dict[int, list[tuple[int, float, float, bool]]] = {}
    for first, second, cost, limit, inside in zip(*pairs, strict=True):
        partners.setdefault(second, []).append((first, cost, limit, inside))
    objects: list[list[int]] = []
    object_of: dict[int, int] = {}
    start = 0
    for end in range(1, len(stations) + 1):
        if end < len(stations) and stations[end] == stations[start]:
            continue
        assigned = _assign_rows(range(start, end), partners, object_of)
        for row in range(start, end):
            if row not in assigned:
                assigned[row] = len(objects)
                objects.append([])
            object_of[row] = assigned[row]
            objects[assigned[row]].append(row)
        start = end
    return objects


def _assign_rows(
    rows: Sequence[int], partners: dict[int, list[tuple[int, float, float, bool]]], object_of: dict[int, int]
) -> dict[int, int]:
    """Return the object of each of these rows of one station; rows without a candidate are omitted."""
    best: dict[tuple[int, int], tuple[bool, float, float]] = {}
    for row in rows:
        for other, cost, limit, is_inside in partners.get(row, ()):
            pair = (object_of[other], row)
            best[pair] = min((not is_inside, cost, limit), best.get(pair, (True, math.inf, math.inf)))
    # A track that remains because it is another object than its candidates within the gate has no partner outside.
    inside = [pair for pair, (outside, _, _) in best.items() if not outside]
    labels, near = {label for label, _ in inside}, {row for _, row in inside}
    best = {
        pair: values
        for pair, values in best.items()
        if not values[0] or (pair[0] not in labels and pair[1] not in near)
    }
    pairs = Pairs(
        [label for label, _ in best],
        [row for _, row in best],
        [cost for _, cost, _ in best.values()],
        [limit for _, _, limit in best.values()],
        [not outside for outside, _, _ in best.values()],
    )
    return {row: label for label, row in assigned_pairs(pairs)}

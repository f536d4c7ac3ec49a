"""Track-to-track association: grouping of the tracks of several stations by object."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Integers
from eidrive_scenario.fusion.pairs import AssociationGate, Pairs, Table, assigned_pairs, gated_pairs


class Objects(NamedTuple):
    """Tracks by object: (N,) rows of the tracks, those of one object in sequence, and (G,) their first places."""

    rows: Integers
    starts: Integers


def group_tracks(tracks: Table, gate: AssociationGate) -> Objects:
    """Return the rows of each object, from tracks at a common time that are sorted by receiving station and station.

    The tracks of each station in turn are assigned to known objects: maximum number, then minimum cost, and at most one
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
            own = _pairs_between(pairs, begin, end)
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


def _pairs_between(pairs: Pairs, begin: int, end: int) -> Pairs:
    """Return the pairs of these rows, relative to the first one; pairs are in order of their rows."""
    own = slice(bisect_left(pairs.first, begin), bisect_left(pairs.first, end))
    first, second = ([row - begin for row in side[own]] for side in (pairs.first, pairs.second))
    return Pairs(first, second, pairs.cost[own], pairs.inside[own])


def _group_sequentially(stations: Sequence[int], pairs: Pairs) -> list[list[int]]:
    partners: dict[int, list[tuple[int, float, bool]]] = {}
    for first, second, cost, inside in zip(*pairs, strict=True):
        partners.setdefault(second, []).append((first, cost, inside))
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
    rows: Sequence[int], partners: dict[int, list[tuple[int, float, bool]]], object_of: dict[int, int]
) -> dict[int, int]:
    """Return the object of each of these rows of one station; rows without a candidate are omitted."""
    best: dict[tuple[int, int], tuple[bool, float]] = {}
    for row in rows:
        for other, cost, inside in partners.get(row, ()):
            pair = (object_of[other], row)
            best[pair] = min((not inside, cost), best.get(pair, (True, math.inf)))
    pairs = Pairs(
        [label for label, _ in best],
        [row for _, row in best],
        [cost for _, cost in best.values()],
        [not outside for outside, _ in best.values()],
    )
    return {row: label for label, row in assigned_pairs(pairs)}

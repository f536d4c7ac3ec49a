"""Which tracks of several stations are of one object."""

from __future__ import annotations

import math
from collections.abc import Sequence

from eidrive_scenario.fusion.pairs import AssociationGate, Pairs, assigned_pairs, gated_pairs
from eidrive_scenario.fusion.tracks import Table


def group_tracks(tracks: Table, gate: AssociationGate) -> list[list[int]]:
    """The rows of each object, of tracks at one instant that are sorted by station.

    Station by station, tracks are given to the objects known so far, as many as possible and at the least cost; one to
    an object at most, as a station reports different objects. What fits none begins a new one. The cost of an object is
    that of its likeliest member.
    """
    stations = tracks["station"].tolist()
    if stations[0] == stations[-1]:
        return [[row] for row in range(len(tracks))]
    pairs = gated_pairs(tracks, tracks, gate, same_station=False)
    return _cliques(stations, pairs) or _in_turn(stations, pairs)


def _cliques(stations: Sequence[int], pairs: Pairs) -> list[list[int]] | None:
    """The objects where nothing is to be decided: all tracks that fit each other are of different stations."""
    object_of = list(range(len(stations)))
    for first, second in zip(pairs.first, pairs.second, strict=True):
        object_of[second] = min(object_of[second], first)
    if not all(pairs.inside) or len(set(zip(object_of, stations, strict=True))) < len(stations):
        return None
    if any(object_of[first] != object_of[second] for first, second in zip(pairs.first, pairs.second, strict=True)):
        return None
    objects: dict[int, list[int]] = {}
    for row, found in enumerate(object_of):
        objects.setdefault(found, []).append(row)
    return list(objects.values())


def _in_turn(stations: Sequence[int], pairs: Pairs) -> list[list[int]]:
    partners: dict[int, list[tuple[int, float, bool]]] = {}
    for first, second, cost, inside in zip(*pairs, strict=True):
        partners.setdefault(second, []).append((first, cost, inside))
    objects: list[list[int]] = []
    object_of: dict[int, int] = {}
    start = 0
    for end in range(1, len(stations) + 1):
        if end < len(stations) and stations[end] == stations[start]:
            continue
        taken = _assigned(range(start, end), partners, object_of)
        for row in range(start, end):
            if row not in taken:
                taken[row] = len(objects)
                objects.append([])
            object_of[row] = taken[row]
            objects[taken[row]].append(row)
        start = end
    return objects


def _assigned(
    rows: Sequence[int], partners: dict[int, list[tuple[int, float, bool]]], object_of: dict[int, int]
) -> dict[int, int]:
    """The object of each of these rows of one station, for those that fit one."""
    best: dict[tuple[int, int], tuple[bool, float]] = {}
    for row in rows:
        for other, cost, inside in partners.get(row, ()):
            pair = (object_of[other], row)
            best[pair] = min((not inside, cost), best.get(pair, (True, math.inf)))
    pairs = Pairs(
        [found for found, _ in best],
        [row for _, row in best],
        [cost for _, cost in best.values()],
        [not outside for outside, _ in best.values()],
    )
    return {row: found for found, row in assigned_pairs(pairs)}

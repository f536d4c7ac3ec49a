"""Track-to-track association: grouping of the tracks of several stations by object."""

from __future__ import annotations

import math
from collections.abc import Sequence

from eidrive_scenario.fusion.pairs import AssociationGate, Pairs, Table, assigned_pairs, gated_pairs


def group_tracks(tracks: Table, gate: AssociationGate) -> list[list[int]]:
    """Return the rows of each object, from tracks at a common time that are sorted by station.

    The tracks of each station in turn are assigned to known objects: maximum number, then minimum cost, and at most one
    per object, because a station reports different objects. Unassigned tracks form new objects. The cost of an object
    is that of its likeliest member.
    """
    stations = tracks["station"].tolist()
    if stations[0] == stations[-1]:
        return [[row] for row in range(len(tracks))]
    pairs = gated_pairs(tracks, tracks, gate, same_station=False)
    return _cliques(stations, pairs) or _group_sequentially(stations, pairs)


def _cliques(stations: Sequence[int], pairs: Pairs) -> list[list[int]] | None:
    """Return the objects if the grouping is unambiguous: all associated tracks belong to different stations."""
    object_of = list(range(len(stations)))
    for first, second in zip(pairs.first, pairs.second, strict=True):
        object_of[second] = min(object_of[second], first)
    if not all(pairs.inside) or len(set(zip(object_of, stations, strict=True))) < len(stations):
        return None
    if any(object_of[first] != object_of[second] for first, second in zip(pairs.first, pairs.second, strict=True)):
        return None
    objects: dict[int, list[int]] = {}
    for row, label in enumerate(object_of):
        objects.setdefault(label, []).append(row)
    return list(objects.values())


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

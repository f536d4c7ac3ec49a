"""The road users among the points of a scan; poles are none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Integers
from eidrive_scenario.geometry import overlap
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.geometry.size_priors import PRIORS
from eidrive_scenario.perception.lidar.box_fit import Fit
from eidrive_scenario.perception.lidar.clustering import clusters
from eidrive_scenario.perception.lidar.scan import Scan

UNLIKELY = 16.0
"""Sum of squared deviations from the sizes of its class beyond which a cluster is no road user: with three sizes, one
in a thousand is beyond."""
DOUBTFUL = 9.0
"""Beyond this a cluster is looked at again, as it may be several objects close to each other."""
FEW = 12
"""A cluster of so few points may show no heading; then that of its lane is looked up."""


TOUCHING = 0.2
"""Boxes this near to each other are taken to touch [m]."""


class FittedObject(NamedTuple):
    """The points of one object, as rows of the scan, and the box around it."""

    rows: Integers
    fit: Fit


def objects(scan: Scan, surroundings: MapContext, min_points: int) -> list[FittedObject]:
    """The objects of a scan that have at least so many points.

    A cluster that fits no class is taken apart where its points lie apart; clusters whose boxes overlap are put
    together where one box fits them both.
    """
    found = _fitted(scan, surroundings, clusters(scan.points, scan.pattern.azimuth), min_points)
    whole = [one for one in found if one.fit.deviation <= DOUBTFUL]
    for doubtful in (one for one in found if one.fit.deviation > DOUBTFUL):
        parts = clusters(scan.points[doubtful.rows], scan.pattern.azimuth, grazing=False)
        pieces = [doubtful.rows[part] for part in parts]
        good = [
            one
            for one in (_fitted(scan, surroundings, pieces, min_points) if len(parts) > 1 else [])
            if one.fit.deviation <= DOUBTFUL
        ]
        whole += good or [doubtful]
    return [one for one in _joined(scan, whole) if one.fit.deviation <= UNLIKELY and one.fit.name != "pole"]


def _fitted(scan: Scan, surroundings: MapContext, groups: list[Integers], min_points: int) -> list[FittedObject]:
    groups = [rows for rows in groups if len(rows) >= min_points]
    headings = np.full(len(groups), np.nan)
    few = [number for number, rows in enumerate(groups) if len(rows) < FEW]
    if few and surroundings.has_map:
        middles = np.array([scan.points[groups[number], :2].mean(axis=0) for number in few])
        headings[few] = surroundings.lane_heading(scan.frame.to_world(middles)) - scan.frame.yaw
    found = []
    for rows, heading in zip(groups, headings.tolist(), strict=True):
        fit = scan.fit(rows, tuple(PRIORS), heading if math.isfinite(heading) else None)
        if fit is not None:
            found.append(FittedObject(rows, fit))
        elif len(rows) > min_points:
            found += _taken_apart(scan, rows, min_points)
    return found


def _taken_apart(scan: Scan, rows: Integers, min_points: int) -> list[FittedObject]:
    """The pieces of what is larger than any road user."""
    parts = [rows[part] for part in clusters(scan.points[rows], scan.pattern.azimuth, grazing=False)]
    fits = [(part, scan.fit(part, tuple(PRIORS))) for part in parts if len(part) >= min_points]
    return [FittedObject(part, fit) for part, fit in fits if fit is not None]


def _joined(scan: Scan, found: list[FittedObject]) -> list[FittedObject]:
    """The same objects, two boxes of which overlap put together where one box fits the points of both.

    Two bodies cannot be in one place, and hardly ever touch: such boxes are pieces of one that something nearer cuts in
    two, or that the rays graze so that its points lie far apart.
    """
    whole = list(found)
    again = True
    while again:
        again = False
        for one, other in combinations(whole, 2):
            if overlap(_grown(one.fit.box), other.fit.box):
                rows = np.concatenate([one.rows, other.rows])
                fit = scan.fit(rows, tuple(PRIORS))
                if fit is not None and fit.deviation <= DOUBTFUL:
                    whole = [thing for thing in whole if thing is not one and thing is not other]
                    whole.append(FittedObject(rows, fit))
                    again = True
                    break
    return whole


def _grown(box: Sequence[float]) -> Sequence[float]:
    x, y, z, length, width, height, yaw = box
    return x, y, z, length + 2.0 * TOUCHING, width + 2.0 * TOUCHING, height, yaw

"""Road users among the points of a scan, and other objects on lanes for vehicles; poles beside them are excluded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.geometry import overlap
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.geometry.size_priors import PRIORS
from eidrive_scenario.perception.lidar.box_fit import POOR_FIT, Fit
from eidrive_scenario.perception.lidar.scan import Scan
from eidrive_scenario.perception.lidar.segmentation import CLEARANCE, clusters

UNLIKELY = 16.0
"""Sum of squared size deviations above which a cluster is not a road user: with three sizes, one in a thousand exceeds
it."""
FEW = 12
"""Number of points below which the heading of the lane is used, as they may show none."""


DENSER = 3
"""Number of halvings of the gap between points at which a cluster that is no road user is split."""
COVERED = 0.8
"""Minimum share of the points of such a cluster in the parts that are road users."""
TOUCHING = 0.2
"""Distance below which boxes are assumed to touch [m]."""
UNDERSIDE = 2.5
"""Height of the lowest point of an object that is above the road instead of on it [m]: the least usual headroom of
bridges and signals is 4.5 m, and gaps between rings are up to 1 m within the range of a usual lidar."""
SAMPLES = 8
"""Number of points of an object whose heights above the road are compared."""
NEAR = 1.5
"""Distance of boxes up to which their points may be those of one surface at grazing incidence [m]."""


class FittedObject(NamedTuple):
    """Points of one object, as rows of the scan, and the box around them."""

    rows: Integers
    fit: Fit


def objects(scan: Scan, surroundings: MapContext, min_points: int) -> list[FittedObject]:
    """Return the objects of a scan with at least `min_points` points.

    A cluster that fits no class is split at its gaps. Clusters with overlapping boxes are merged if one box fits both.
    On a lane for vehicles, what is no road user is an obstacle, of class `misc`.
    """
    candidates = _fit_clusters(scan, surroundings, clusters(scan.points, scan.pattern.azimuth), min_points)
    separate = [candidate for candidate in candidates if candidate.fit.deviation <= POOR_FIT]
    for poor in (candidate for candidate in candidates if candidate.fit.deviation > POOR_FIT):
        parts = [poor.rows[part] for part in clusters(scan.points[poor.rows], scan.pattern.azimuth, grazing=False)]
        fitted = _fit_clusters(scan, surroundings, parts, min_points) if len(parts) > 1 else []
        good = [candidate for candidate in fitted if candidate.fit.deviation <= POOR_FIT]
        separate += good or _split_dense(scan, poor) or [poor]
    road_users: list[FittedObject] = []
    others: list[FittedObject] = []
    for candidate in _standing(scan, surroundings, _merge_parts(scan, separate)):
        is_road_user = candidate.fit.deviation <= UNLIKELY and candidate.fit.name != "pole"
        (road_users if is_road_user else others).append(candidate)
    return road_users + _obstacles(scan, surroundings, others)


def _standing(scan: Scan, surroundings: MapContext, candidates: list[FittedObject]) -> list[FittedObject]:
    """Return those of the objects that stand on the road of the map.

    Below crests and in dips the height of the ground that a scan shows may be wrong, and a part of the road stand out.
    """
    if not candidates or not surroundings.has_map:
        return candidates
    samples = np.array(
        [candidate.rows[np.linspace(0, len(candidate.rows) - 1, SAMPLES).astype(int)] for candidate in candidates]
    )
    points = scan.points[samples.ravel()]
    # Both heights are those of the map: an error of the own height does not count.
    roads = surroundings.ground(
        scan.frame.to_world(np.array([*points[:, :2], np.zeros(2)])), scan.foot, np.array([*points[:, 2], scan.foot])
    )
    heights = (points[:, 2] - scan.foot - roads[:-1] + roads[-1]).reshape(samples.shape)
    standing = (heights.max(axis=1) > CLEARANCE) & (heights.min(axis=1) < UNDERSIDE)
    return [candidate for candidate, stands in zip(candidates, standing.tolist(), strict=True) if stands]


def _obstacles(scan: Scan, surroundings: MapContext, candidates: list[FittedObject]) -> list[FittedObject]:
    """Return those of the objects that stand on lanes for vehicles."""
    if not candidates or not surroundings.has_map:
        return []
    centers = _centers(scan, [candidate.rows for candidate in candidates])
    on_lane = surroundings.on_lane(centers[:, :2]).tolist()
    headings = surroundings.lane_heading(centers[:, :2], centers[:, 2]) - scan.frame.yaw
    obstacles = []
    for candidate, is_on_lane, heading in zip(candidates, on_lane, headings.tolist(), strict=True):
        if not is_on_lane:
            continue
        fit = scan.fit(candidate.rows, ("misc",), heading if math.isfinite(heading) else None)
        if fit is not None:
            # Obstacles have all sizes: theirs says nothing about whether they exist.
            obstacles.append(FittedObject(candidate.rows, replace(fit, deviation=0.0)))
    return obstacles


def _split_dense(scan: Scan, poor: FittedObject) -> list[FittedObject]:
    """Return the parts of a cluster that is no road user, for decreasing gaps between points until all are.

    Far from the sensor the usual gap is wider than that between cars in adjacent lanes. Points are denser than it, for
    example, if they are those of another station. Empty if there is no such gap.
    """
    if poor.fit.deviation <= UNLIKELY:
        return []
    step = scan.pattern.azimuth
    for _ in range(DENSER):
        step /= 2.0
        parts = _fit_parts(scan, poor.rows, step, FEW)
        candidates = [part for part in parts if part.fit.deviation <= POOR_FIT]
        if len(candidates) > 1 and sum(len(candidate.rows) for candidate in candidates) >= COVERED * len(poor.rows):
            return candidates
    return []


def _fit_clusters(scan: Scan, surroundings: MapContext, groups: list[Integers], min_points: int) -> list[FittedObject]:
    groups = [rows for rows in groups if len(rows) >= min_points]
    headings = np.full(len(groups), np.nan)
    few = [number for number, rows in enumerate(groups) if len(rows) < FEW]
    if few and surroundings.has_map:
        centers = _centers(scan, [groups[number] for number in few])
        headings[few] = surroundings.lane_heading(centers[:, :2], centers[:, 2]) - scan.frame.yaw
    candidates = []
    for rows, heading in zip(groups, headings.tolist(), strict=True):
        fit = scan.fit(rows, tuple(PRIORS), heading if math.isfinite(heading) else None)
        if fit is not None:
            candidates.append(FittedObject(rows, fit))
        elif len(rows) > min_points:
            # A cluster that is larger than any road user: its parts at a finer distance.
            candidates += _fit_parts(scan, rows, scan.pattern.azimuth, min_points)
    return candidates


def _centers(scan: Scan, groups: list[Integers]) -> Array:
    """Return the mean of the points of each group in the world (N, 3)."""
    centers = np.array([scan.points[rows].mean(axis=0) for rows in groups])
    return np.column_stack([scan.frame.to_world(centers[:, :2]), centers[:, 2]])


def _fit_parts(scan: Scan, rows: Integers, step: float, min_points: int) -> list[FittedObject]:
    """Return the parts of a cluster at the gaps of rays in this angle [rad] that are not larger than any road user."""
    parts = [rows[part] for part in clusters(scan.points[rows], step, grazing=False)]
    fits = [(part, scan.fit(part, tuple(PRIORS))) for part in parts if len(part) >= min_points]
    return [FittedObject(part, fit) for part, fit in fits if fit is not None]


def _merge_parts(scan: Scan, candidates: list[FittedObject]) -> list[FittedObject]:
    """Return the objects, with overlapping boxes merged if one box fits the points of both.

    Two bodies cannot overlap, and hardly ever touch. Such boxes are parts of one object that something nearer divides,
    or that the rays graze so that its points are far apart. The same applies to boxes near each other whose points are
    one cluster.
    """
    merged = dict(enumerate(candidates))
    compared = {number: number for number in merged}
    """Number of the last object with which each object has been compared."""
    again = True
    while again:
        again = False
        end = max(merged, default=-1) + 1
        pairs = ((first, other) for first in merged for other in range(compared[first] + 1, end) if other in merged)
        for first, other in pairs:
            compared[first] = other
            union = _union(scan, merged[first], merged[other])
            if union is not None:
                del merged[first], merged[other]
                merged[end], compared[end] = union, end
                again = True
                break
    return list(merged.values())


def _union(scan: Scan, first: FittedObject, second: FittedObject) -> FittedObject | None:
    """Return one object with the points of two, or None if they are two objects."""
    if not overlap(_enlarge(first.fit.box, NEAR), second.fit.box):
        return None
    rows = np.concatenate([first.rows, second.rows])
    touches = overlap(_enlarge(first.fit.box, TOUCHING), second.fit.box)
    if not touches and len(clusters(scan.points[rows], scan.pattern.azimuth)) != 1:
        return None
    fit = scan.fit(rows, tuple(PRIORS))
    return FittedObject(rows, fit) if fit is not None and fit.deviation <= POOR_FIT else None


def _enlarge(box: Sequence[float], margin: float) -> Sequence[float]:
    x, y, z, length, width, height, yaw = box
    return x, y, z, length + 2.0 * margin, width + 2.0 * margin, height, yaw

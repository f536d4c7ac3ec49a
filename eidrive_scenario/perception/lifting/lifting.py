"""From boxes in a picture to boxes in the world."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.detections import Detections
from eidrive_scenario.geometry import box_corners, overlap
from eidrive_scenario.perception.geometry.lidar_geometry import Pattern, pattern_from_points
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.geometry.projection import pixels
from eidrive_scenario.perception.geometry.size_priors import prior_of
from eidrive_scenario.perception.lidar.box_fit import Fit
from eidrive_scenario.perception.lidar.clustering import clusters
from eidrive_scenario.perception.lidar.scan import Scan
from eidrive_scenario.perception.lifting.ground import AT_BORDER, ByGround, lift_by_ground
from eidrive_scenario.sensing.readings import CameraReading, LidarReading

LEAST_POINTS = 2
"""Of a cluster that can be the object in a box."""
MARGIN = 0.1
"""Points this far beside a box may belong to its object, as a share of the box's size: so exact are detectors, and what
a LiDAR's rays meet is not quite what a camera sees."""
MOST_TRIED = 3
"""Clusters of which boxes are fitted, for each box of the picture."""
LEAST_DEVIATION, LARGEST_DEVIATION = 0.1, 0.4
"""Of the logarithm of the distance that a box leads to expect."""
LEAST_OVERLAP = 0.3
"""Of a box from points, seen by the camera, with the box in the picture (intersection over union)."""
GATE = 3.0
"""Clusters at a distance that differs by more deviations are not the object."""
DOUBTFUL = 9.0
"""Sum of squared deviations from the sizes of its class up to which points suit it."""
BODY_DEVIATION = 0.15
"""Of the center of a body from that of the rectangle around the points on it: bumpers, mirrors and wheel arches [m]."""
UNLIKELY = 60.0
"""Sum of squared deviations from the sizes of its class beyond which points are not believed to be the object."""
UNLIKELY_HEADING = 9.0
"""Cost of a heading that the picture and the map rule out, as squared standard deviations."""
MAY_BE: Mapping[str, tuple[str, ...]] = {
    "car": ("car", "van"),
    "truck": ("truck", "van", "bus"),
    "bus": ("bus", "truck"),
}
"""Sizes that are looked for where a detector of pictures says a class: such detectors know few classes."""


def lift(
    boxes: Array,
    classes: Sequence[str],
    scores: Sequence[float] | Array,
    camera: CameraReading,
    lidar: LidarReading | None = None,
    *,
    time: float,
    ground: float = 0.0,
    surroundings: MapContext | None = None,
    pattern: Pattern | None = None,
) -> Detections:
    """The objects in the world that a detector of pictures saw, one for each box, in the order given.

    boxes    (N, 4) left, top, right, bottom [px]; classes  out of eidrive_scenario.detections.CLASSES
    lidar    a sweep of the same tick; None: by the ground plane alone
    time     when the picture was taken [s]
    ground   height of the ground below the sensors [m]: that of the station's reference point
    surroundings  the map, for the direction of lanes and the height of roads
    pattern  of the LiDAR's rays; by its points where None

    With a LiDAR, its points without the ground are projected into the picture. Those in and close to a box, and beyond
    the picture's border where that cuts the box off, are clustered. The object is the cluster with many points in the
    box, about where `lift_by_ground` expects it, of which an L-shape fit makes a box that has the size of the class and
    fills the picture's; pieces that lie in that box belong to it. A box without such points stands on the ground where
    `lift_by_ground` puts it. Velocities are unknown.
    """
    boxes = np.asarray(boxes, dtype=float).reshape(-1, 4)
    surroundings = surroundings or MapContext(None)
    by_ground = lift_by_ground(boxes, classes, camera, ground=ground, surroundings=surroundings)
    lifted, covariance = by_ground.boxes, by_ground.covariance
    if lidar is not None and len(boxes):
        scan = Scan(lidar, pattern or pattern_from_points(lidar.points), ground)
        for row, fit in enumerate(_by_points(boxes, classes, camera, scan, by_ground)):
            if fit is not None:
                lifted[row] = scan.frame.boxes_to_world(np.array([fit.box]))[0]
                covariance[row] = scan.frame.covariance_to_world(fit.covariance[None])[0]
        lifted[:, 6] = surroundings.facing(lifted)
    return Detections(
        time,
        lifted,
        np.asarray(scores, dtype=float).reshape(-1),
        tuple(classes),
        np.full((len(boxes), 2), np.nan),
        covariance,
    )


def _by_points(
    boxes: Array, classes: Sequence[str], camera: CameraReading, scan: Scan, by_ground: ByGround
) -> list[Fit | None]:
    """What the points in each box say of its object."""
    places, _ = pixels(scan.world, camera)
    behind = np.isnan(places[:, 0])
    aside = (scan.world[behind] - camera.pose[:3, 3]) @ camera.pose[:3, 0]
    places[behind, 0] = np.where(aside < 0.0, -math.inf, math.inf)
    places[behind, 1] = camera.rgb.shape[0] / 2.0
    away = np.hypot(*(scan.world[:, :2] - camera.pose[:2, 3]).T)
    found: list[Fit | None] = []
    for row, (box, name) in enumerate(zip(boxes, classes, strict=True)):
        guess, spread = by_ground.boxes[row], by_ground.covariance[row]
        place = guess[:2] - camera.pose[:2, 3]
        expected = max(float(np.linalg.norm(place)), 0.5)
        deviation = math.sqrt(float(place @ spread @ place)) / expected**2
        target = _Target(
            box.tolist(),
            MAY_BE.get(name, (name,)),
            expected,
            min(math.hypot(deviation, LEAST_DEVIATION), LARGEST_DEVIATION),
            max(prior_of(name).mean[:2]) / 4.0,
            float(guess[6]) - scan.frame.yaw,
            float(by_ground.headings[row, 0]) - scan.frame.yaw,
            (by_ground.costs[row] - by_ground.costs[row].min()).tolist(),
            scan.frame.to_local(guess[:2]),
            scan.frame.covariance_to_local(spread),
            bool(box[0] <= AT_BORDER or box[2] >= camera.rgb.shape[1] - AT_BORDER),
        )
        fit = _foreground(scan, camera, target, places, away)
        found.append(None if fit is None else replace(fit, covariance=_honest(fit, scan, target, camera)))
    return found


def _honest(fit: Fit, scan: Scan, target: _Target, camera: CameraReading) -> Array:
    """(2, 2) covariance of a fit with what it leaves unexplained [m²]: bodies are no boxes, and camera and points
    disagree.

    Where sizes are unusual, it grows by the Birge ratio, the squared deviations over their number. Where the points
    are not at the place that the picture leads to expect, they may be those of something else: two hypotheses, equally
    likely at worst, spread by a quarter of the squared distance between them.
    """
    box = target.box
    spread = fit.covariance * max(1.0, fit.deviation / 3.0) + BODY_DEVIATION**2 * np.eye(2)
    off = np.array(fit.box[:2]) - target.center
    spread += 0.25 * (1.0 - target.agreement(fit)) * np.outer(off, off)
    outline, _ = pixels(box_corners(scan.frame.boxes_to_world(np.array([fit.box])))[0], camera)
    if np.isnan(outline).any():
        return spread
    width = camera.rgb.shape[1]
    offsets = []
    if box[0] > AT_BORDER:
        offsets.append(float(outline[:, 0].min()) - box[0])
    if box[2] < width - AT_BORDER:
        offsets.append(float(outline[:, 0].max()) - box[2])
    if not offsets:
        return spread
    x, y = fit.box[:2]
    away = math.hypot(x, y)
    aside = away / float(camera.intrinsics[0, 0]) * sum(offsets) / len(offsets)
    across = np.array([-y, x]) / max(away, 1e-9)
    return np.asarray(spread + aside**2 * np.outer(across, across))


class _Target(NamedTuple):
    """The object that is looked for.

    box      in the picture [px];  classes  that it may be
    distance from the camera at which it should be [m], and the deviation of the logarithm of that
    depth    from the points that are seen of it to its middle, about [m]
    heading  in the level frame, where the points are too few to show one [rad]
    first    of the headings that were tried, evenly over half a turn [rad];  costs  of each, the least is 0
    center   where its middle should be (2,) [m];  covariance  of that (2, 2) [m²]; both in the level frame
    cut      whether the picture's border cuts its left or right side off
    """

    box: list[float]
    classes: tuple[str, ...]
    distance: float
    deviation: float
    depth: float
    heading: float
    first: float
    costs: list[float]
    center: Array
    covariance: Array
    cut: bool

    def agreement(self, fit: Fit) -> float:
        """How well a box agrees with where the object should be, 1 at best: Cauchy's density of the squared distance
        in units of both covariances, as either may be of something else."""
        off = np.array(fit.box[:2]) - self.center
        return 1.0 / (1.0 + 0.5 * float(off @ np.linalg.solve(self.covariance + fit.covariance, off)))

    def heading_cost(self, heading: float) -> float:
        """What the picture and the map say against a heading, between those that were tried; UNLIKELY_HEADING at most:
        shapes differ, and vehicles turn."""
        count = len(self.costs)
        place = (heading - self.first) % math.pi / math.pi * count
        row, part = int(place), place - int(place)
        cost = (1.0 - part) * self.costs[row % count] + part * self.costs[(row + 1) % count]
        return min(cost, UNLIKELY_HEADING)

    def likelihood(self, distance: float) -> float:
        """How well something at this distance [m] agrees with what is expected, 1 at best; 0 beyond the gate, but where
        so little of the object is in the picture that nothing certain can be expected."""
        off = math.log(max(distance + self.depth, 0.5) / self.distance) / self.deviation
        if abs(off) <= GATE:
            return math.exp(-0.5 * off * off)
        return math.exp(-0.5 * GATE * GATE) if self.cut else 0.0


class _Candidate(NamedTuple):
    """Points that may be the object, as rows of the scan; how many of them are in its box, and that times the
    likelihood of their distance."""

    rows: Integers
    inside: int
    weight: float


def _foreground(scan: Scan, camera: CameraReading, target: _Target, places: Array, away: Array) -> Fit | None:
    """The box of the object among the points in and about a box of the picture; None where there is none.

    places   (N, 2) of all points of the scan in the picture, those behind the camera infinitely far beside it [px]
    away     (N,) their distance from the camera [m]
    """
    inside = _within(places, target.box)
    rows = np.flatnonzero(_within(places, _widened(target.box, camera)))
    best: tuple[float, Fit] | None = None
    tried: set[bytes] = set()
    for grazing in (True, False):
        groups = [
            rows[group].astype(np.int64) for group in clusters(scan.points[rows], scan.pattern.azimuth, grazing=grazing)
        ]
        candidates = _candidates([group for group in groups if group.tobytes() not in tried], inside, away, target)
        for candidate in candidates[:MOST_TRIED]:
            fit = scan.fit(candidate.rows, target.classes, target.heading, target.heading_cost)
            if fit is None:
                continue
            fit = _with_pieces(scan, candidate, fit, candidates, target)
            filled = _filled(fit, scan, target.box, camera)
            count = candidate.inside if target.cut else candidate.weight
            score = count * target.agreement(fit) * filled / (1.0 + fit.deviation / DOUBTFUL)
            if fit.deviation <= UNLIKELY and score > 0.0 and (best is None or score > best[0]):
                best = score, fit
        if best is not None and best[1].deviation <= DOUBTFUL:
            break  # else parts of what the rays graze may lie apart
        tried.update(group.tobytes() for group in groups)
    return None if best is None else best[1]


def _candidates(
    groups: Sequence[Integers], inside: NDArray[np.bool_], away: Array, target: _Target
) -> list[_Candidate]:
    """The groups of points that may be the object, the likeliest first."""
    found = []
    for group in groups:
        count = int(inside[group].sum())
        if count >= LEAST_POINTS:
            weight = count * target.likelihood(float(np.median(away[group])))
            if weight > 0.0:
                found.append(_Candidate(group, count, weight))
    return sorted(found, key=lambda candidate: -candidate.weight)


def _with_pieces(scan: Scan, candidate: _Candidate, fit: Fit, others: Sequence[_Candidate], target: _Target) -> Fit:
    """The fit with those other clusters that lie in its box, where one box suits them all as well; and where the points
    alone are no such object, with those that make one of them."""
    for other in others:
        if not np.intersect1d(other.rows, candidate.rows).size:
            piece = scan.fit(other.rows, target.classes, target.heading, target.heading_cost)
            near = piece is not None and overlap(fit.box, piece.box)
            if near or fit.deviation > DOUBTFUL:
                rows = np.concatenate([candidate.rows, other.rows])
                whole = scan.fit(rows, target.classes, target.heading, target.heading_cost)
                limit = max(fit.deviation, DOUBTFUL) if near else DOUBTFUL
                if whole is not None and whole.deviation <= limit:
                    candidate = _Candidate(rows, candidate.inside + other.inside, candidate.weight)
                    fit = whole
    return fit


def _within(places: Array, box: Sequence[float]) -> NDArray[np.bool_]:
    left, top, right, bottom = box
    x, y = places[:, 0], places[:, 1]
    return np.asarray((x >= left) & (x <= right) & (y >= top) & (y <= bottom))


def _widened(box: Sequence[float], camera: CameraReading) -> tuple[float, float, float, float]:
    """A box with its margin; without an end where the picture ends."""
    left, top, right, bottom = box
    height, width = camera.rgb.shape[:2]
    across, down = MARGIN * (right - left), MARGIN * (bottom - top)
    return (
        left - across if left > AT_BORDER else -math.inf,
        top - down if top > AT_BORDER else -math.inf,
        right + across if right < width - AT_BORDER else math.inf,
        bottom + down if bottom < height - AT_BORDER else math.inf,
    )


def _filled(fit: Fit, scan: Scan, box: Sequence[float], camera: CameraReading) -> float:
    """How much of a box of the picture a box of the world fills, seen by the camera: intersection over union; 0 where
    that is too little, 1 where it reaches behind the camera, and so out of the picture on several sides."""
    outline, _ = pixels(box_corners(scan.frame.boxes_to_world(np.array([fit.box])))[0], camera)
    if np.isnan(outline).any():
        return 1.0
    height, width = camera.rgb.shape[:2]
    left, top = np.clip(outline.min(axis=0), 0.0, (width, height)).tolist()
    right, bottom = np.clip(outline.max(axis=0), 0.0, (width, height)).tolist()
    across, down = min(right, box[2]) - max(left, box[0]), min(bottom, box[3]) - max(top, box[1])
    shared = max(across, 0.0) * max(down, 0.0)
    areas = (right - left) * (bottom - top) + (box[2] - box[0]) * (box[3] - box[1])
    share = shared / max(areas - shared, 1e-9)
    return share if share > LEAST_OVERLAP else 0.0

"""Lifting of image boxes to boxes in the world."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import box_corners, overlap
from eidrive_scenario.perception.geometry.lidar_geometry import Pattern, pattern_from_points
from eidrive_scenario.perception.geometry.map_context import MapContext
from eidrive_scenario.perception.geometry.projection import pixels
from eidrive_scenario.perception.geometry.size_priors import possible_classes, prior_of
from eidrive_scenario.perception.lidar.box_fit import POOR_FIT, Fit
from eidrive_scenario.perception.lidar.scan import Scan
from eidrive_scenario.perception.lidar.segmentation import clusters
from eidrive_scenario.perception.lifting.ground import ByGround, edges_in_image, lift_by_ground
from eidrive_scenario.sensing.readings import CameraReading, LidarReading

GATE = 3.0
"""Maximum deviation of the distance of a cluster from the expected one, in standard deviations."""
UNLIKELY_HEADING = 9.0
"""Cost of a heading that image and map exclude, as squared standard deviations."""


class Target(NamedTuple):
    """Object of an image box that is searched in the points.

    box      in the image [px];  classes  possible classes
    distance expected from the camera [m], and the standard deviation of its logarithm
    depth    from the visible points of the object to its center, approximately [m]
    heading  in the level frame, used if there are too few points to determine one [rad]
    first    first of the tested headings, evenly over half a turn [rad];  costs  of each, the minimum is 0
    center   expected center (2,) [m];  covariance  of it (2, 2) [m²]; both in the level frame
    edges_in_image  whether left, top, right and bottom edge are those of the object, not of the image
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
    edges_in_image: list[bool]

    @property
    def cut(self) -> bool:
        """Whether the border of the image cuts its left or right side."""
        return not (self.edges_in_image[0] and self.edges_in_image[2])

    def agreement(self, fit: Fit) -> float:
        """Return the agreement of a box with the expected center, at most 1.

        It is Cauchy's density of the squared distance in units of both covariances, as either may belong to another
        object.
        """
        off = np.array(fit.box[:2]) - self.center
        return 1.0 / (1.0 + 0.5 * float(off @ np.linalg.solve(self.covariance + fit.covariance, off)))

    def heading_cost(self, heading: float) -> float:
        """Return the cost of a heading by image and map, interpolated between tested headings.

        The maximum is UNLIKELY_HEADING, because shapes differ and vehicles turn.
        """
        count = len(self.costs)
        position = (heading - self.first) % math.pi / math.pi * count
        index, part = int(position), position - int(position)
        cost = (1.0 - part) * self.costs[index % count] + part * self.costs[(index + 1) % count]
        return min(cost, UNLIKELY_HEADING)

    def likelihood(self, distance: float) -> float:
        """Return the agreement of a distance [m] with the expected one, at most 1.

        It is 0 outside the gate, except for objects that the border cuts, whose distance is not certain.
        """
        off = math.log(max(distance + self.depth, 0.5) / self.distance) / self.deviation
        if abs(off) <= GATE:
            return math.exp(-0.5 * off * off)
        return math.exp(-0.5 * GATE * GATE) if self.cut else 0.0


LEAST_POINTS = 2
"""Minimum number of points of a cluster that may be the object in a box."""
MARGIN = 0.1
"""Margin around a box in which points may belong to its object, as a share of the box size. It covers errors of
detectors and differences between lidar returns and the image."""
MOST_TRIED = 3
"""Maximum number of clusters to which boxes are fitted, for each image box."""
LEAST_DEVIATION, LARGEST_DEVIATION = 0.1, 0.4
"""Minimum and maximum standard deviation of the logarithm of the distance expected from a box."""
LEAST_OVERLAP = 0.3
"""Minimum overlap of the projected box from points with the image box (intersection over union). A design choice: two
boxes of equal size that are shifted by half of their width have an overlap of one third."""
BODY_DEVIATION = 0.15
"""Standard deviation between the centers of a body and of the rectangle around its points: bumpers, mirrors and wheel
arches [m]."""
UNLIKELY = 60.0
"""Sum of squared size deviations above which points are not the object: 4.5 standard deviations in each of three sizes.
A design choice: it is larger than that of the detector `lidar`, because the image shows that there is an object."""


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
    """Return the objects in the world that an image detector detected, one for each box, in the given order.

    boxes    (N, 4) left, top, right, bottom [px]; classes  out of eidrive_scenario.base.detections.CLASSES
    lidar    reading of the same tick; None: from the ground plane alone
    time     of the image [s]
    ground   height of the ground below the sensors [m]: that of the reference point of the station
    surroundings  the map, for the direction of lanes and the height of roads
    pattern  of the lidar rays; None: estimated from the points

    With a lidar, its points without the ground are projected into the image. Points in and close to a box are
    clustered; if the border of the image cuts the box, points beyond the border are included. The object is a cluster
    with many points in the box, near the distance that `lift_by_ground` expects. Its L-shape fit has the size of the
    class and fills the image box. Other clusters within the fitted box belong to the object. A box without such points
    is placed by `lift_by_ground`; its score is 0 if no body of its class on the ground fills the box: the network
    mistakes markings or buildings for objects. Velocities are unknown.
    """
    boxes = np.asarray(boxes, dtype=float).reshape(-1, 4)
    surroundings = surroundings or MapContext(None)
    by_ground = lift_by_ground(boxes, classes, camera, ground=ground, surroundings=surroundings)
    lifted, covariance = by_ground.boxes, by_ground.covariance
    may_be_body = by_ground.may_be_bodies
    if lidar is not None and len(boxes):
        scan = Scan(lidar, pattern or pattern_from_points(lidar.points), ground)
        for row, fit in enumerate(_fit_points(boxes, classes, camera, scan, by_ground)):
            if fit is not None:
                lifted[row] = scan.frame.boxes_to_world(np.array([fit.box]))[0]
                covariance[row] = scan.frame.covariance_to_world(fit.covariance[None])[0]
                may_be_body[row] = True
        lifted[:, 6] = surroundings.facing(lifted)
    return Detections(
        time,
        lifted,
        np.where(may_be_body, np.asarray(scores, dtype=float).reshape(-1), 0.0),
        tuple(classes),
        np.full((len(boxes), 2), np.nan),
        covariance,
    )


def _fit_points(
    boxes: Array, classes: Sequence[str], camera: CameraReading, scan: Scan, by_ground: ByGround
) -> list[Fit | None]:
    """Return the fits to the points in each box, None for boxes without an object in the points."""
    world = scan.world
    positions, _ = pixels(world, camera)
    behind = np.isnan(positions[:, 0])
    aside = (world[behind] - camera.pose[:3, 3]) @ camera.pose[:3, 0]
    positions[behind, 0] = np.where(aside < 0.0, -math.inf, math.inf)
    positions[behind, 1] = camera.size[1] / 2.0
    away = np.hypot(*(world[:, :2] - camera.pose[:2, 3]).T)
    in_image = edges_in_image(boxes, camera).tolist()
    points: list[Fit | None] = []
    for row, (box, name) in enumerate(zip(boxes, classes, strict=True)):
        guess, spread = by_ground.boxes[row], by_ground.covariance[row]
        offset = guess[:2] - camera.pose[:2, 3]
        expected = max(float(np.linalg.norm(offset)), 0.5)
        deviation = math.sqrt(float(offset @ spread @ offset)) / expected**2
        target = Target(
            box.tolist(),
            possible_classes(name),
            expected,
            min(math.hypot(deviation, LEAST_DEVIATION), LARGEST_DEVIATION),
            max(prior_of(name).mean[:2]) / 4.0,
            float(guess[6]) - scan.frame.yaw,
            float(by_ground.headings[row, 0]) - scan.frame.yaw,
            (by_ground.costs[row] - by_ground.costs[row].min()).tolist(),
            scan.frame.to_local(guess[:2]),
            scan.frame.covariance_to_local(spread),
            in_image[row],
        )
        others = np.zeros(len(positions), dtype=bool)
        for other in range(len(boxes)):
            if other != row:
                others |= _inside_box(positions, boxes[other])
        fit = _foreground(scan, camera, target, positions, away, others)
        points.append(None if fit is None else replace(fit, covariance=_total_covariance(fit, scan, target, camera)))
    return points


def _total_covariance(fit: Fit, scan: Scan, target: Target, camera: CameraReading) -> Array:
    """Return the covariance (2, 2) of a fit including unmodeled errors [m²]: bodies are not boxes, and camera and
    points differ.

    For unusual sizes it is scaled by the Birge ratio, the squared deviations over their number. If the points are not
    at the position expected from the image, they may belong to another object: two hypotheses, equally likely at worst,
    have a spread of a quarter of their squared distance.
    """
    box = target.box
    spread = fit.covariance * max(1.0, fit.deviation / 3.0) + BODY_DEVIATION**2 * np.eye(2)
    off = np.array(fit.box[:2]) - target.center
    spread += 0.25 * (1.0 - target.agreement(fit)) * np.outer(off, off)
    outline, _ = pixels(box_corners(scan.frame.boxes_to_world(np.array([fit.box])))[0], camera)
    if np.isnan(outline).any():
        return spread
    offsets = []
    if target.edges_in_image[0]:
        offsets.append(float(outline[:, 0].min()) - box[0])
    if target.edges_in_image[2]:
        offsets.append(float(outline[:, 0].max()) - box[2])
    if not offsets:
        return spread
    x, y = fit.box[:2]
    away = math.hypot(x, y)
    aside = away / float(camera.intrinsics[0, 0]) * sum(offsets) / len(offsets)
    across = np.array([-y, x]) / max(away, 1e-9)
    return np.asarray(spread + aside**2 * np.outer(across, across))


class _Candidate(NamedTuple):
    """Points that may be the object, as rows of the scan; their number in the box, and that times the distance
    likelihood."""

    rows: Integers
    inside: int
    weight: float


def _foreground(
    scan: Scan, camera: CameraReading, target: Target, positions: Array, away: Array, others: Bools
) -> Fit | None:
    """Return the box of the object among the points in and around an image box, or None.

    Objects close to each other are one cluster: the points that are in no other image box are clustered, too.

    positions  (N, 2) in the image of all points of the scan [px]; infinitely far aside for points behind the camera
    away       (N,) distances from the camera [m];  others  (N,) whether points are in another image box
    """
    inside = _inside_box(positions, target.box)
    around = _inside_box(positions, _widened(target))
    parts = [np.flatnonzero(around)]
    if (inside & others).any():
        parts.append(np.flatnonzero(around & ~others))
    best: tuple[float, Fit] | None = None
    tried: set[bytes] = set()
    for grazing in (True, False):
        groups = {
            rows[group].tobytes(): rows[group].astype(np.int64)
            for rows in parts
            for group in clusters(scan.points[rows], scan.pattern.azimuth, grazing=grazing)
        }
        candidates = []
        for group in [groups[key] for key in groups if key not in tried]:
            points = int(inside[group].sum())
            weight = points * target.likelihood(float(np.median(away[group]))) if points >= LEAST_POINTS else 0.0
            if weight > 0.0:
                candidates.append(_Candidate(group, points, weight))
        candidates.sort(key=lambda candidate: -candidate.weight)  # the likeliest first
        for candidate in candidates[:MOST_TRIED]:
            fit = scan.fit(candidate.rows, target.classes, target.heading, target.heading_cost)
            if fit is None:
                continue
            fit = _merge_parts(scan, candidate, fit, candidates, target)
            image_overlap = _image_overlap(fit, scan, target.box, camera)
            count = candidate.inside if target.cut else candidate.weight
            score = count * target.agreement(fit) * image_overlap / (1.0 + fit.deviation / POOR_FIT)
            if fit.deviation <= UNLIKELY and score > 0.0 and (best is None or score > best[0]):
                best = score, fit
        if best is not None and best[1].deviation <= POOR_FIT:
            break  # otherwise parts of a grazed surface may be separate clusters
        tried.update(groups)
    return None if best is None else best[1]


def _merge_parts(scan: Scan, candidate: _Candidate, fit: Fit, others: Sequence[_Candidate], target: Target) -> Fit:
    """Return the fit merged with other clusters in its box if one box fits all of them.

    If the points alone fit no class, other clusters are merged that make a plausible object.
    """
    for other in others:
        if not np.intersect1d(other.rows, candidate.rows).size:
            part_fit = scan.fit(other.rows, target.classes, target.heading, target.heading_cost)
            near = part_fit is not None and overlap(fit.box, part_fit.box)
            if near or fit.deviation > POOR_FIT:
                rows = np.concatenate([candidate.rows, other.rows])
                merged = scan.fit(rows, target.classes, target.heading, target.heading_cost)
                limit = max(fit.deviation, POOR_FIT) if near else POOR_FIT
                if merged is not None and merged.deviation <= limit:
                    candidate = _Candidate(rows, candidate.inside + other.inside, candidate.weight)
                    fit = merged
    return fit


def _inside_box(positions: Array, box: Sequence[float]) -> NDArray[np.bool_]:
    left, top, right, bottom = box
    x, y = positions[:, 0], positions[:, 1]
    return np.asarray((x >= left) & (x <= right) & (y >= top) & (y <= bottom))


def _widened(target: Target) -> tuple[float, float, float, float]:
    """Return the box with its margin; unbounded at edges on the border of the image."""
    left, top, right, bottom = target.box
    across, down = MARGIN * (right - left), MARGIN * (bottom - top)
    from_left, from_top, to_right, to_bottom = target.edges_in_image
    return (
        left - across if from_left else -math.inf,
        top - down if from_top else -math.inf,
        right + across if to_right else math.inf,
        bottom + down if to_bottom else math.inf,
    )


def _image_overlap(fit: Fit, scan: Scan, box: Sequence[float], camera: CameraReading) -> float:
    """Return the intersection over union of a projected world box and an image box.

    0 below LEAST_OVERLAP; 1 if the box extends behind the camera, so that it leaves the image on several sides.
    """
    outline, _ = pixels(box_corners(scan.frame.boxes_to_world(np.array([fit.box])))[0], camera)
    if np.isnan(outline).any():
        return 1.0
    width, height = camera.size
    left, top = np.clip(outline.min(axis=0), 0.0, (width, height)).tolist()
    right, bottom = np.clip(outline.max(axis=0), 0.0, (width, height)).tolist()
    across, down = min(right, box[2]) - max(left, box[0]), min(bottom, box[3]) - max(top, box[1])
    shared = max(across, 0.0) * max(down, 0.0)
    areas = (right - left) * (bottom - top) + (box[2] - box[0]) * (box[3] - box[1])
    share = shared / max(areas - shared, 1e-9)
    return share if share > LEAST_OVERLAP else 0.0

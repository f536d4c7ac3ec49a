"""From boxes in a picture to boxes in the world."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.detections import Detections
from eidrive_scenario.geometry import box_corners
from eidrive_scenario.perception.box_fit import Fit
from eidrive_scenario.perception.clustering import clusters
from eidrive_scenario.perception.ground_lifting import lift_by_ground
from eidrive_scenario.perception.lidar_geometry import Pattern, pattern_from_points
from eidrive_scenario.perception.projection import pixels
from eidrive_scenario.perception.scan import Scan
from eidrive_scenario.perception.size_priors import prior_of
from eidrive_scenario.perception.surroundings import Surroundings
from eidrive_scenario.sensing.readings import CameraReading, LidarReading

Array = NDArray[np.float64]

LEAST_POINTS = 2
"""Of a cluster that can be the object in a box."""
LEAST_DEVIATION, LARGEST_DEVIATION = 0.1, 0.4
"""Of the logarithm of the distance that a box leads to expect."""
LEAST_OVERLAP = 0.3
"""Of a box from points, seen by the camera, with the box in the picture (intersection over union)."""
GATE = 3.0
"""Clusters at a distance that differs by more deviations are not the object."""
UNLIKELY = 60.0
"""Sum of squared deviations from the sizes of its class beyond which points are not believed to be the object."""
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
    surroundings: Surroundings | None = None,
    pattern: Pattern | None = None,
) -> Detections:
    """The objects in the world that a detector of pictures saw, one for each box, in the order given.

    boxes    (N, 4) left, top, right, bottom [px]; classes  out of eidrive_scenario.detections.CLASSES
    lidar    a sweep of the same tick; None: by the ground plane alone
    time     when the picture was taken [s]
    ground   height of the ground below the sensors [m]: that of the station's reference point
    surroundings  the map, for the direction of lanes and the height of roads
    pattern  of the LiDAR's rays; by its points where None

    With a LiDAR, its points without the ground are projected into the picture. Those within a box are clustered, and
    the cluster that has many points at the distance which the box's height leads to expect is the object: its box comes
    from an L-shape fit. A box without such points stands on the ground where `lift_by_ground` puts it. Velocities are
    unknown.
    """
    boxes = np.asarray(boxes, dtype=float).reshape(-1, 4)
    surroundings = surroundings or Surroundings(None)
    lifted, covariance = lift_by_ground(boxes, classes, camera, ground=ground, surroundings=surroundings)
    if lidar is not None and len(boxes):
        scan = Scan(lidar, pattern or pattern_from_points(lidar.points), ground)
        for row, fit in enumerate(_by_points(boxes, classes, camera, scan, lifted, covariance)):
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
    boxes: Array, classes: Sequence[str], camera: CameraReading, scan: Scan, by_ground: Array, covariance: Array
) -> list[Fit | None]:
    """What the points in each box say of its object."""
    places, _ = pixels(scan.world, camera)
    away = np.hypot(*(scan.world[:, :2] - camera.pose[:2, 3]).T)
    found: list[Fit | None] = []
    for box, name, guess, spread in zip(boxes.tolist(), classes, by_ground, covariance, strict=True):
        left, top, right, bottom = box
        inside = (places[:, 0] >= left) & (places[:, 0] <= right) & (places[:, 1] >= top) & (places[:, 1] <= bottom)
        place = guess[:2] - camera.pose[:2, 3]
        expected = max(float(np.linalg.norm(place)), 0.5)
        deviation = math.sqrt(float(place @ spread @ place)) / expected**2
        lengths = _Expected(expected, min(math.hypot(deviation, LEAST_DEVIATION), LARGEST_DEVIATION))
        heading = float(guess[6]) - scan.frame.yaw
        fit = _foreground(scan, np.flatnonzero(inside), away, name, lengths, heading)
        found.append(fit if fit is not None and _fills(fit, scan, box, camera) else None)
    return found


def _fills(fit: Fit, scan: Scan, box: Sequence[float], camera: CameraReading) -> bool:
    """Whether a box of the world, seen by the camera, is about the box that the picture has."""
    outline, _ = pixels(box_corners(scan.frame.boxes_to_world(np.array([fit.box])))[0], camera)
    if np.isnan(outline).any():
        return True  # it reaches behind the camera, and so out of the picture on several sides
    height, width = camera.rgb.shape[:2]
    left, top = np.clip(outline.min(axis=0), 0.0, (width, height)).tolist()
    right, bottom = np.clip(outline.max(axis=0), 0.0, (width, height)).tolist()
    across, down = min(right, box[2]) - max(left, box[0]), min(bottom, box[3]) - max(top, box[1])
    shared = max(across, 0.0) * max(down, 0.0)
    areas = (right - left) * (bottom - top) + (box[2] - box[0]) * (box[3] - box[1])
    return bool(shared > LEAST_OVERLAP * (areas - shared))


class _Expected(NamedTuple):
    """How far away an object should be [m], and the deviation of the logarithm of that."""

    distance: float
    deviation: float


def _foreground(
    scan: Scan, rows: NDArray[np.intp], away: Array, name: str, expected: _Expected, heading: float
) -> Fit | None:
    """The box of the object among points that a box of a picture has within it; None where there is none.

    away   (N,) distance of all points of the scan from the camera [m]
    """
    best: tuple[float, NDArray[np.int64]] | None = None
    points = scan.points[rows]
    depth = max(prior_of(name).mean[:2]) / 2.0
    for cluster in clusters(points, scan.pattern.azimuth):
        if len(cluster) < LEAST_POINTS:
            continue
        distance = float(np.median(away[rows[cluster]])) + depth / 2.0
        off = math.log(max(distance, 0.5) / expected.distance) / expected.deviation
        if abs(off) > GATE:
            continue
        weight = len(cluster) * math.exp(-0.5 * off * off)
        if best is None or weight > best[0]:
            best = (weight, rows[cluster].astype(np.int64))
    if best is None:
        return None
    fit = scan.fit(best[1], MAY_BE.get(name, (name,)), heading)
    return fit if fit is not None and fit.deviation <= UNLIKELY else None

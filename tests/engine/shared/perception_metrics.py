"""Metrics of cooperative perception: average precision, recall by visibility, position error."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import iou_bev
from eidrive_scenario.evaluation.known_actors import nearest_pairs
from eidrive_scenario.experiments.average_precision import Matches, average_precision, match_by_share
from eidrive_scenario.experiments.statistics.intervals import Proportion, wilson
from eidrive_scenario.recording.frame import Frame

SIGHTED = 2.0
"""Maximum distance between the centers of an object and of a detection of a station that sees it [m]."""
FARTHEST = 4.0
"""Maximum distance between the centers of an object and of its detection, for the position error [m]."""


@dataclass(frozen=True)
class MetricSample:
    """Fused detections of one station at one time, and the ground truth.

    objects      (M, 7) true boxes
    own_sight    (M,) True for objects that the station itself sees
    other_sight  (M,) True for objects that another station sees
    """

    detections: Detections
    objects: Array
    own_sight: Bools
    other_sight: Bools


def metric_sample(frame: Frame, station: str, *, reach: float) -> MetricSample:
    """Return fused detections of `station` and true objects of a frame within `reach` of the station's center [m].

    Stations are excluded because they report their own states. Detections of stations and detections beyond the reach
    are excluded as well, so that detections and objects refer to the same region. Visibility follows the stations' own
    detections, which for the oracle detector are the objects in line of sight.
    """
    view, step = frame.view, frame.steps[station]
    center = view.boxes[view.row(station), :2]
    rows = [row for name, row in view.rows.items() if name not in frame.steps]
    objects = view.boxes[rows].reshape(-1, 7)
    objects = objects[np.linalg.norm(objects[:, :2] - center, axis=1) <= reach]
    stations = view.boxes[[view.row(name) for name in frame.steps if name in view.rows]]
    fused = step.fused.boxes
    outside = np.linalg.norm(fused[:, :2] - center, axis=1) > reach
    distinct = ~outside & ~_near(fused, stations)
    others = [other.detections.boxes for name, other in frame.steps.items() if name != station]
    return MetricSample(
        step.fused.subset(np.flatnonzero(distinct).tolist()),
        objects,
        _near(objects, step.detections.boxes),
        _near(objects, np.concatenate(others) if others else np.empty((0, 7))),
    )


def precision_bev(samples: Iterable[MetricSample], min_iou: float) -> float:
    """Return the average precision over all samples, for boxes from above with an intersection over union of `min_iou`.

    Detections are sorted by score over the whole set, and the area is computed at all points. The result is NaN without
    objects. Classes are not compared.
    """
    matches, count = [], 0
    for sample in samples:
        matches.append(_matches(sample, min_iou))
        count += len(sample.objects)
    return average_precision(matches, count)


@dataclass(frozen=True)
class Recall:
    """Recall of objects in sight of the station itself, of other stations only, and of neither; None without such
    objects."""

    own: Proportion | None
    others: Proportion | None
    neither: Proportion | None


def recall_by_sight(samples: Iterable[MetricSample], min_iou: float) -> Recall:
    """Return the recall at an intersection over union of `min_iou`, for all scores.

    An object in sight of neither group can be detected from memory only.
    """
    found, total = np.zeros(3, dtype=np.int64), np.zeros(3, dtype=np.int64)
    for sample in samples:
        matched = _matches(sample, min_iou).found
        hidden = ~sample.own_sight
        groups = (sample.own_sight, hidden & sample.other_sight, hidden & ~sample.other_sight)
        for index, group in enumerate(groups):
            found[index] += np.count_nonzero(matched & group)
            total[index] += np.count_nonzero(group)
    own, others, neither = (wilson(int(k), int(n)) if n else None for k, n in zip(found, total, strict=True))
    return Recall(own, others, neither)


def position_error(samples: Iterable[MetricSample]) -> float:
    """Return the root mean square distance between the centers of objects and of their detections, from above [m].

    Objects and detections are paired in order of increasing distance, up to FARTHEST. An association by
    overlap would exclude large errors. The result is NaN without pairs.
    """
    squares = [
        distance**2
        for sample in samples
        for _, _, distance in nearest_pairs(sample.detections.boxes, sample.objects, FARTHEST)
    ]
    return float(np.sqrt(np.mean(squares))) if squares else float("nan")


def _matches(sample: MetricSample, min_iou: float) -> Matches:
    shares = iou_bev(sample.detections.boxes, sample.objects)
    return match_by_share(shares, sample.detections.scores, np.zeros(len(sample.objects), dtype=bool), min_iou)


def _near(boxes: Array, others: Array) -> Bools:
    """Return the mask (N,) of boxes (N, 7) whose center is within SIGHTED of the center of one of `others`."""
    if not len(boxes) or not len(others):
        return np.zeros(len(boxes), dtype=bool)
    distance = np.linalg.norm(boxes[:, None, :2] - others[None, :, :2], axis=2)
    near: Bools = distance.min(axis=1) < SIGHTED
    return near

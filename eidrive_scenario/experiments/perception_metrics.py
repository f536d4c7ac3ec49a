"""How good cooperative perception is: average precision, recall by who can see, error of position."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from eidrive_scenario.arrays import Array, Bools
from eidrive_scenario.detections import Detections
from eidrive_scenario.experiments.statistics import Proportion, wilson
from eidrive_scenario.geometry import iou_bev
from eidrive_scenario.perception.learned.average_precision import Matches, average_precision, match_by_share
from eidrive_scenario.recording.frame import Frame

SIGHTED = 2.0
"""A station sees an object where it reports one of its own with its center this near [m]."""


@dataclass(frozen=True)
class MetricSample:
    """What one station knows at one instant, and what there is.

    objects      (M, 7) true boxes
    own_sight    (M,) which of them the station itself sees
    other_sight  (M,) which of them another station sees
    """

    detections: Detections
    objects: Array
    own_sight: Bools
    other_sight: Bools


def snapshot(frame: Frame, station: str, *, reach: float) -> MetricSample:
    """What `station` knows in a frame of all actors around it, up to `reach` [m] from its center to theirs.

    Stations are not asked for, as they tell of themselves, and boxes of them or beyond the reach do not count: the
    region is the same for what is known and what is there. Who sees what is told by the stations' own detections; of
    the oracle's that is the line of sight.
    """
    view, step = frame.view, frame.steps[station]
    center = view.boxes[view.row(station), :2]
    asked = [row for name, row in view.rows.items() if name not in frame.steps]
    objects = view.boxes[asked].reshape(-1, 7)
    objects = objects[np.linalg.norm(objects[:, :2] - center, axis=1) <= reach]
    stations = view.boxes[[view.row(name) for name in frame.steps if name in view.rows]]
    known = step.fused.boxes
    outside = np.linalg.norm(known[:, :2] - center, axis=1) > reach
    distinct = ~outside & ~_near(known, stations)
    others = [other.detections.boxes for name, other in frame.steps.items() if name != station]
    return MetricSample(
        step.fused.subset(np.flatnonzero(distinct).tolist()),
        objects,
        _near(objects, step.detections.boxes),
        _near(objects, np.concatenate(others) if others else np.empty((0, 7))),
    )


def precision_bev(snapshots: Iterable[MetricSample], least: float) -> float:
    """Average precision over all snapshots, boxes seen from above that overlap by `least` (intersection over union).

    Detections are sorted by score over the whole set, and the area is taken at all points; NaN without any object.
    Classes are not compared.
    """
    matches, count = [], 0
    for entry in snapshots:
        matches.append(_matches(entry, least))
        count += len(entry.objects)
    return average_precision(matches, count)


@dataclass(frozen=True)
class Recall:
    """The share of objects that are known, by who can see them: the station itself, only others, nobody; None where
    there is no such object."""

    own: Proportion | None
    others: Proportion | None
    neither: Proportion | None


def recall_by_sight(snapshots: Iterable[MetricSample], least: float) -> Recall:
    """Recall at an overlap of `least`, whatever the scores. What nobody sees is known from memory at best."""
    found, total = np.zeros(3, dtype=np.int64), np.zeros(3, dtype=np.int64)
    for entry in snapshots:
        known = _matches(entry, least).found
        hidden = ~entry.own_sight
        for place, group in enumerate((entry.own_sight, hidden & entry.other_sight, hidden & ~entry.other_sight)):
            found[place] += np.count_nonzero(known & group)
            total[place] += np.count_nonzero(group)
    own, others, nobody = (wilson(int(k), int(n)) if n else None for k, n in zip(found, total, strict=True))
    return Recall(own, others, nobody)


def position_error(snapshots: Iterable[MetricSample], farthest: float = 4.0) -> float:
    """Root mean square distance between the centers of objects and of what is known of them, seen from above [m].

    Each object and the box nearest to it are a pair, nearest pairs first, up to `farthest` [m] apart: an overlap would
    hide the larger errors. NaN where there is no pair.
    """
    squares: list[float] = []
    for entry in snapshots:
        offset = entry.detections.boxes[:, None, :2] - entry.objects[None, :, :2]
        distance = np.linalg.norm(offset, axis=2)
        taken: set[tuple[str, int]] = set()
        for flat in np.argsort(distance, axis=None, kind="stable").tolist():
            box, thing = divmod(flat, len(entry.objects))
            if distance[box, thing] > farthest:
                break
            if ("box", box) not in taken and ("object", thing) not in taken:
                taken |= {("box", box), ("object", thing)}
                squares.append(float(distance[box, thing]) ** 2)
    return float(np.sqrt(np.mean(squares))) if squares else float("nan")


def _matches(entry: MetricSample, least: float) -> Matches:
    shares = iou_bev(entry.detections.boxes, entry.objects)
    return match_by_share(shares, entry.detections.scores, np.zeros(len(entry.objects), dtype=bool), least)


def _near(boxes: Array, others: Array) -> Bools:
    """(N,) whether the center of one of `others` is within SIGHTED of that of a box (N, 7)."""
    if not len(boxes) or not len(others):
        return np.zeros(len(boxes), dtype=bool)
    distance = np.linalg.norm(boxes[:, None, :2] - others[None, :, :2], axis=2)
    near: Bools = distance.min(axis=1) < SIGHTED
    return near

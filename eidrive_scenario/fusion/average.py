"""Late fusion by averaging: one box per object, independent of the number of reporting stations."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array
from eidrive_scenario.assignment import MAX_SCALAR as MAX_SCALAR_PAIRS
from eidrive_scenario.assignment import associate, associate_small
from eidrive_scenario.detections import NOT_ESTIMATED, Detections
from eidrive_scenario.fusion.method import FusionMethod, Report

MAX_SCALAR = 16
"""Maximum number of boxes for scalar evaluation, which is then faster than arrays."""
GATE = 4.0
"""Association gate: maximum distance between boxes of one object, as in EI-Drive [m]."""


class AverageFusion(FusionMethod):
    """Fusion by averaging. Stations are processed in order of their names, and boxes are assigned within the gate.

    Boxes of one station are never fused, because they are different objects. Classes are not compared, because
    detectors confuse them. Position, size and score are means, and yaw is a circular mean. Velocity is the mean of the
    known values, and the class is the most frequent one. The covariance is the mean of the known ones, an upper bound
    for any correlation of the errors. The existence probability is that of at least one correct report.
    """

    is_finite_by_construction: ClassVar[bool] = True

    def __init__(self, gate: float = GATE) -> None:
        self.gate = gate

    def fuse(self, reports: Sequence[Report], now: float) -> Detections:
        ordered = sorted(reports, key=lambda report: report.station) if len(reports) > 1 else reports
        present = [report.detections for report in ordered if len(report.detections)]
        if not present:
            return Detections(now)
        if len(present) == 1:
            only = present[0]
            if only.time == now:
                return only
            return replace(only, time=now)
        labels = self._labels(present)
        small = len(labels) <= MAX_SCALAR
        fused = fuse_average_small(present, labels, now) if small else fuse_average(present, labels, now)
        if all([report.existence is NOT_ESTIMATED for report in present]):
            return fused
        return replace(fused, existence=joint_existence(present, labels))

    def _labels(self, reports: Sequence[Detections]) -> list[int]:
        """Return the object of each box, over all boxes of all reports; objects are numbered in order of appearance."""
        objects = [_Object(*center) for center in reports[0].boxes[:, :3].tolist()]
        labels = list(range(len(objects)))
        for report in reports[1:]:
            centers = report.boxes[:, :3]
            known = [(entry.x, entry.y, entry.z) for entry in objects]
            plain: list[list[float]] = centers.tolist()
            small = len(known) * len(plain) <= MAX_SCALAR_PAIRS
            assigned = (
                associate_small(known, plain, self.gate) if small else associate(np.array(known), centers, self.gate)
            )
            pairs = {column: row for row, column in assigned}
            for column, (x, y, z) in enumerate(plain):
                label = pairs.get(column)
                if label is None:
                    label = len(objects)
                    objects.append(_Object(x, y, z))
                else:
                    objects[label].add(x, y, z)
                labels.append(label)
        return labels


def joint_existence(reports: Sequence[Detections], labels: Sequence[int]) -> Array:
    """Return the probability that at least one report of each object is correct (G,): 1 - prod (1 - r).

    Reports are independent, because stations report only detections of their sensors. The score replaces a missing
    existence probability.
    """
    absence = np.ones(max(labels) + 1)
    np.multiply.at(absence, np.array(labels, dtype=np.intp), 1.0 - np.concatenate([r.confidence for r in reports]))
    return np.asarray(1.0 - absence)


@dataclass
class _Object:
    """Running mean of the centers of one object."""

    x: float
    y: float
    z: float
    count: int = 1

    def add(self, x: float, y: float, z: float) -> None:
        self.count += 1
        self.x += (x - self.x) / self.count
        self.y += (y - self.y) / self.count
        self.z += (z - self.z) / self.count


def fuse_average(reports: Sequence[Detections], numbers: Sequence[int], now: float) -> Detections:
    """Return the means over the boxes of each object; a single box is unchanged to the bit.

    numbers  object of each box

    Headings that point backwards from the first one are reversed before: some detectors do not distinguish front and
    rear, and the mean of opposite headings would be a box across the object.
    """
    labels = np.array(numbers, dtype=np.intp)
    boxes = np.concatenate([report.boxes for report in reports])
    counts = np.bincount(labels)
    several = counts > 1
    means = _sums(boxes, labels, len(counts)) / counts[:, None]
    yaw = boxes[:, 6]
    _, first = np.unique(labels, return_index=True)
    front = np.where(np.cos(yaw - yaw[first][labels]) < 0.0, -1.0, 1.0)
    mean_yaw = np.arctan2(
        _sums(front * np.sin(yaw), labels, len(counts)), _sums(front * np.cos(yaw), labels, len(counts))
    )
    means[several, 6] = mean_yaw[several]
    words = [word for report in reports for word in report.classes]
    votes: list[list[str]] = [[] for _ in counts]
    for label, word in zip(labels.tolist(), words, strict=True):
        votes[label].append(word)
    return Detections(
        now,
        means,
        _sums(np.concatenate([report.scores for report in reports]), labels, len(counts)) / counts,
        tuple(map(_most_frequent, votes)),
        _means_of_known(np.concatenate([report.velocity for report in reports]), labels, len(counts)),
        _means_of_known(np.concatenate([report.covariance for report in reports]), labels, len(counts)),
    )


def fuse_average_small(reports: Sequence[Detections], labels: Sequence[int], now: float) -> Detections:
    """Return the result of `fuse_average`, evaluated box by box."""
    members: list[list[int]] = [[] for _ in range(max(labels) + 1)]
    for row, label in enumerate(labels):
        members[label].append(row)
    boxes = [box for report in reports for box in report.boxes.tolist()]
    scores = [score for report in reports for score in report.scores.tolist()]
    words = [word for report in reports for word in report.classes]
    velocity = [one for report in reports for one in report.velocity.tolist()]
    covariance = [one for report in reports for one in report.covariance.reshape(-1, 4).tolist()]
    return Detections(
        now,
        np.array([_mean_box([boxes[row] for row in rows]) for rows in members]),
        np.array([sum([scores[row] for row in rows]) / len(rows) for rows in members]),
        tuple([_most_frequent([words[row] for row in rows]) for rows in members]),
        np.array([_mean_of_known([velocity[row] for row in rows]) for rows in members]),
        np.array([_mean_of_known([covariance[row] for row in rows]) for rows in members]).reshape(-1, 2, 2),
    )


def _most_frequent(words: Sequence[str]) -> str:
    """Return the most frequent word, the first one among equals."""
    return Counter(words).most_common(1)[0][0] if len(words) > 2 else words[0]


def _mean_box(boxes: list[list[float]]) -> list[float]:
    if len(boxes) == 1:
        return boxes[0]
    mean = _mean(boxes)
    first = boxes[0][6]
    fronts = [-1.0 if math.cos(box[6] - first) < 0.0 else 1.0 for box in boxes]
    mean[6] = math.atan2(
        sum([front * math.sin(box[6]) for front, box in zip(fronts, boxes, strict=True)]),
        sum([front * math.cos(box[6]) for front, box in zip(fronts, boxes, strict=True)]),
    )
    return mean


def _mean(rows: list[list[float]]) -> list[float]:
    if len(rows) == 2:
        return [(a + b) / 2.0 for a, b in zip(*rows, strict=True)]
    return [sum(column) / len(rows) for column in zip(*rows, strict=True)]


def _mean_of_known(rows: list[list[float]]) -> list[float]:
    """Return the mean of the rows without NaN; NaN if there is none."""
    known = [row for row in rows if not math.isnan(sum(row))]
    if not known:
        return [math.nan] * len(rows[0])
    return known[0] if len(known) == 1 else _mean(known)


def _sums(values: Array, labels: NDArray[np.intp], count: int) -> Array:
    """Return the sums (count, ...) of the values (K, ...) of each label, added in order."""
    total = np.zeros((count, *values.shape[1:]))
    np.add.at(total, labels, values)
    return total


def _means_of_known(values: Array, labels: NDArray[np.intp], count: int) -> Array:
    """Return the means (count, ...) of the values (K, ...) without NaN of each label; NaN if there is none."""
    flat = values.reshape(len(values), -1)
    known = ~np.isnan(flat).any(axis=1)
    number = np.bincount(labels[known], minlength=count)
    total = _sums(flat[known], labels[known], count)
    mean = np.full(total.shape, np.nan)
    np.divide(total, number[:, None], out=mean, where=number[:, None] > 0)
    return mean.reshape((count, *values.shape[1:]))

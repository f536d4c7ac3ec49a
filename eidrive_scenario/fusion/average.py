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

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.assignment import associate
from eidrive_scenario.base.detections import NOT_ESTIMATED, Detections
from eidrive_scenario.fusion.method import FusionMethod, Report

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
        fused = fuse_average(present, labels, now)
        if all([report.existence is NOT_ESTIMATED for report in present]):
            return fused
        return replace(fused, existence=joint_existence(present, labels))

    def _labels(self, reports: Sequence[Detections]) -> list[int]:
        """Return the object of each box, over all boxes of all reports; objects are numbered in order of appearance."""
        objects = [_Object(*center) for center in reports[0].boxes[:, :3].tolist()]
        labels = list(range(len(objects)))
        for report in reports[1:]:
            centers = report.boxes[:, :3]
            means = np.array([(entry.x, entry.y, entry.z) for entry in objects])
            pairs = {column: row for row, column in associate(means, centers, self.gate)}
            for column, (x, y, z) in enumerate(centers.tolist()):
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

    numbers  object of each box, in order of appearance

    Headings that point backwards from the first one are reversed before: some detectors do not distinguish front and
    rear, and the mean of opposite headings would be a box across the object.
    """
    labels = np.array(numbers, dtype=np.intp)
    boxes = np.concatenate([report.boxes for report in reports])
    scores = np.concatenate([report.scores for report in reports])
    velocity = np.concatenate([report.velocity for report in reports])
    covariance = np.concatenate([report.covariance for report in reports])
    count = max(numbers) + 1
    means, score, mean_velocity, mean_covariance = _means((boxes, scores, velocity, covariance), labels, count)
    words = [word for report in reports for word in report.classes]
    votes: list[list[str]] = [[] for _ in range(count)]
    yaws: list[list[float]] = [[] for _ in range(count)]
    for label, word, yaw in zip(numbers, words, boxes[:, 6].tolist(), strict=True):
        votes[label].append(word)
        yaws[label].append(yaw)
    means[:, 6] = [_mean_yaw(own) for own in yaws]
    return Detections(
        now,
        means,
        score,
        tuple(map(_most_frequent, votes)),
        mean_velocity,
        mean_covariance,
    )


def _most_frequent(words: Sequence[str]) -> str:
    """Return the most frequent word, the first one among equals."""
    return Counter(words).most_common(1)[0][0] if len(words) > 2 else words[0]


def _mean_yaw(yaws: Sequence[float]) -> float:
    """Return the circular mean, with headings reversed that point backwards from the first one."""
    if len(yaws) == 1:
        return yaws[0]
    fronts = [-1.0 if math.cos(yaw - yaws[0]) < 0.0 else 1.0 for yaw in yaws]
    return math.atan2(
        sum([front * math.sin(yaw) for front, yaw in zip(fronts, yaws, strict=True)]),
        sum([front * math.cos(yaw) for front, yaw in zip(fronts, yaws, strict=True)]),
    )


def _means(quantities: Sequence[Array], labels: NDArray[np.intp], count: int) -> list[Array]:
    """Return the means (G, ...) of quantities (K, ...) without NaN of each label, added in order; NaN if there is none.

    Sums begin with -0, the neutral element of addition, so that a single value is unchanged to the bit.
    """
    columns = [values.reshape(len(values), -1) for values in quantities]
    widths = [values.shape[1] for values in columns]
    table, starts = np.concatenate(columns, axis=1), np.cumsum([0, *widths[:-1]])
    known = ~np.logical_or.reduceat(np.isnan(table), starts, axis=1).repeat(widths, axis=1)
    total, counts = np.full((count, table.shape[1]), -0.0), np.zeros((count, table.shape[1]))
    np.add.at(total, labels, np.where(known, table, -0.0))
    np.add.at(counts, labels, known)
    means = np.divide(total, counts, out=np.full(total.shape, math.nan), where=counts > 0)
    split = zip(starts.tolist(), widths, quantities, strict=True)
    return [means[:, start : start + width].reshape(-1, *values.shape[1:]) for start, width, values in split]

"""Late fusion by averaging: one box per object, independent of the number of reporting stations."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.base.assignment import associate
from eidrive_scenario.base.detections import NOT_ESTIMATED, Detections
from eidrive_scenario.fusion.method import FusionMethod, Report

GATE = 4.0
"""Association gate: maximum distance between boxes of one object, as in EI-Drive [m]."""


class AverageFusion(FusionMethod):
    """Fusion by averaging. Stations are processed in order of their names, and boxes are assigned within the gate.

    Boxes of one station are never fused, because they are different objects; nor are those of senders that report
    themselves, which are processed first. Classes are not compared, because detectors confuse them. Position, size and
    score are means, and yaw is a circular mean. Velocity is the mean of the known values, and the class is the most
    frequent one. The covariance is the mean of the known ones, an upper bound for any correlation of the errors. The
    existence probability is that of at least one correct report.
    """

    is_finite_by_construction: ClassVar[bool] = True

    def fuse(self, reports: Sequence[Report], now: float) -> Detections:
        ordered = sorted(reports, key=_order_of) if len(reports) > 1 else reports
        present = [report.detections for report in ordered if len(report.detections)]
        if not present:
            return Detections(now)
        if len(present) == 1:
            only = present[0]
            if only.time == now:
                return only
            return replace(only, time=now)
        senders = sum(report.describes_sender for report in ordered if len(report.detections))
        labels = _label_objects(present, senders)
        fused = fuse_average(present, labels, now)
        if all([report.existence is NOT_ESTIMATED for report in present]):
            return fused
        # An object exists if at least one report is correct: 1 - prod (1 - r). Reports are independent, because
        # stations report only detections of their sensors. The score replaces a missing existence probability.
        absence = np.ones(len(fused))
        np.multiply.at(absence, labels, 1.0 - np.concatenate([report.confidence for report in present]))
        return replace(fused, existence=1.0 - absence)


def _order_of(report: Report) -> tuple[bool, str]:
    """Return the place of a report in the order of processing."""
    return not report.describes_sender, report.station


def _label_objects(reports: Sequence[Detections], senders: int) -> list[int]:
    """Return the object of each box, over all boxes of all reports; objects are numbered in order of appearance.

    senders  number of reports of senders about themselves, which are the first ones
    """
    # Single numbers: for the few objects of a station, arrays take longer.
    means: list[list[float]] = reports[0].boxes[:, :3].tolist()
    counts, labels = [1] * len(means), list(range(len(means)))
    for number, report in enumerate(reports[1:], 1):
        centers = report.boxes[:, :3]
        associated: dict[int, int] = {}
        if number >= senders:
            associated = {box: label for label, box in associate(np.array(means), centers, GATE)}
        for box, center in enumerate(centers.tolist()):
            label = associated.get(box, len(means))
            if label == len(means):
                means.append(center)
                counts.append(1)
            else:
                counts[label] += 1
                means[label] = [
                    mean + (value - mean) / counts[label] for mean, value in zip(means[label], center, strict=True)
                ]
            labels.append(label)
    return labels


def fuse_average(reports: Sequence[Detections], numbers: Sequence[int], now: float) -> Detections:
    """Return the means over the boxes of each object; a single box is unchanged to the bit.

    numbers  object of each box, in order of appearance
    """
    # Plain loops: the usual few boxes take half the time of array operations, and 64 objects take 1.7 times.
    members: list[list[_Entry]] = [[] for _ in range(max(numbers) + 1)]
    entries = [
        entry
        for report in reports
        for entry in zip(
            report.boxes.tolist(),
            report.scores.tolist(),
            report.classes,
            report.velocity.tolist(),
            report.covariance.reshape(-1, 4).tolist(),
            strict=True,
        )
    ]
    for number, entry in zip(numbers, entries, strict=True):
        members[number].append(entry)
    boxes, scores, classes, velocity, covariance = zip(*map(_mean_entry, members), strict=True)
    return Detections(
        now,
        np.array(boxes),
        np.array(scores),
        classes,
        np.array(velocity),
        np.array(covariance).reshape(-1, 2, 2),
    )


_Entry = tuple[list[float], float, str, list[float], list[float]]
"""Box, score, class, velocity and covariance of a detection."""


def _mean_entry(entries: Sequence[_Entry]) -> _Entry:
    """Return the mean of the detections of one object."""
    boxes, scores, classes, velocity, covariance = zip(*entries, strict=True)
    box = _mean(boxes)
    box[6] = _mean_yaw([box[6] for box in boxes])
    # The first class among equally frequent ones.
    name = Counter(classes).most_common(1)[0][0] if len(classes) > 2 else classes[0]
    return box, sum(scores) / len(scores), name, _mean_of_known(velocity), _mean_of_known(covariance)


def _mean_yaw(yaws: Sequence[float]) -> float:
    """Return the circular mean, with headings reversed that point backwards from the first one.

    Some detectors do not distinguish front and rear, and the mean of opposite headings would be a box across the
    object.
    """
    if len(yaws) == 1:
        return yaws[0]
    fronts = [-1.0 if math.cos(yaw - yaws[0]) < 0.0 else 1.0 for yaw in yaws]
    return math.atan2(
        sum([front * math.sin(yaw) for front, yaw in zip(fronts, yaws, strict=True)]),
        sum([front * math.cos(yaw) for front, yaw in zip(fronts, yaws, strict=True)]),
    )


def _mean_of_known(vectors: Sequence[list[float]]) -> list[float]:
    """Return the mean of the vectors without NaN; NaN if there is none."""
    complete = [vector for vector in vectors if not math.isnan(sum(vector))]
    return _mean(complete) if complete else [math.nan] * len(vectors[0])


def _mean(vectors: Sequence[list[float]]) -> list[float]:
    if len(vectors) == 1:
        return vectors[0]
    return [sum(values) / len(vectors) for values in zip(*vectors, strict=True)]

"""Late fusion by averaging: one box per object, however many stations report it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.detections import Detections
from eidrive_scenario.fusion.association import associate
from eidrive_scenario.fusion.method import FusionMethod, Report

Array = NDArray[np.float64]

GATE = 4.0
"""Two boxes nearer than this are one object, as in EI-Drive [m]."""


@dataclass
class _Object:
    """The boxes of one object, as (report, row), and the mean of their centres."""

    centre: Array
    members: list[tuple[Detections, int]] = field(default_factory=list)

    def add(self, report: Detections, row: int) -> None:
        self.members.append((report, row))
        self.centre = self.centre + (report.boxes[row, :3] - self.centre) / len(self.members)


class AverageFusion(FusionMethod):
    """Takes the stations in the order of their names and gives each box to the nearest object within the gate.

    Boxes of one station are never joined: it reports different objects. Classes are not compared, as detectors confuse
    them. Position and size are means, the yaw is a mean on the circle, the velocity a mean of those known, the class
    that of the most reports. The covariance is the mean of those known: an upper bound, however much the reports'
    errors depend on each other.
    """

    def __init__(self, gate: float = GATE) -> None:
        self.gate = gate

    def fuse(self, reports: Sequence[Report], now: float) -> Detections:
        present = [report for report in sorted(reports, key=lambda report: report.station) if len(report.detections)]
        if len(present) == 1:
            only = present[0].detections
            return Detections(now, only.boxes, only.scores, only.classes, only.velocity, only.covariance)
        objects: list[_Object] = []
        for report in present:
            self._enter(report.detections, objects)
        return _joined(objects, now)

    def _enter(self, detections: Detections, objects: list[_Object]) -> None:
        """Give each box of one station to the object that it shows, or make it a new one."""
        known = np.array([thing.centre for thing in objects]).reshape(-1, 3)
        pairs = {column: row for row, column in associate(known, detections.boxes[:, :3], self.gate)}
        for column in range(len(detections)):
            row = pairs.get(column)
            if row is None:
                objects.append(_Object(detections.boxes[column, :3], [(detections, column)]))
            else:
                objects[row].add(detections, column)


def _joined(objects: list[_Object], now: float) -> Detections:
    count = len(objects)
    boxes, scores = np.empty((count, 7)), np.empty(count)
    velocity, covariance = np.empty((count, 2)), np.empty((count, 2, 2))
    classes = []
    for index, thing in enumerate(objects):
        members = thing.members
        if len(members) == 1:
            report, row = members[0]
            boxes[index], scores[index] = report.boxes[row], report.scores[row]
            velocity[index], covariance[index] = report.velocity[row], report.covariance[row]
            classes.append(report.classes[row])
            continue
        stacked = np.array([report.boxes[row] for report, row in members])
        boxes[index] = stacked.mean(axis=0)
        boxes[index, 6] = mean_angle(stacked[:, 6].tolist())
        scores[index] = sum(float(report.scores[row]) for report, row in members) / len(members)
        velocity[index] = _mean_of_known([report.velocity[row] for report, row in members])
        covariance[index] = _mean_of_known([report.covariance[row] for report, row in members])
        classes.append(Counter(report.classes[row] for report, row in members).most_common(1)[0][0])
    return Detections(now, boxes, scores, tuple(classes), velocity, covariance)


def mean_angle(angles: Sequence[float]) -> float:
    """Mean direction on the circle [rad]; the first angle where they cancel out."""
    east, north = sum(map(math.cos, angles)), sum(map(math.sin, angles))
    return math.atan2(north, east) if math.hypot(east, north) > 1e-9 * len(angles) else angles[0]


def _mean_of_known(values: Sequence[Array]) -> Array:
    """The mean of the arrays without NaN; the first where there is none."""
    known = [value for value in values if not np.isnan(value).any()]
    return np.mean(known, axis=0) if known else values[0]

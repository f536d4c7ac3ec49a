"""CPM generation rules and object selection: ETSI TS 103 324 V2.1.1, 6.1."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from eidrive_scenario.detections import Detections
from eidrive_scenario.geometry import wrap_angle

SHORTEST, LONGEST = 0.1, 1.0
"""T_GenCpmMin and T_GenCpmMax [s]."""
RETENTION = 2.0 * LONGEST
"""Time after which an object that is no longer detected is forgotten, so that it is new afterwards [s].

A design choice: an object that is in sight is reported at least every `LONGEST`, so two reports of it are missing.
"""
SENSORS = 1.0
"""T_AddSensorInformation: minimum time between two lists of the sensors of the station [s]."""
HEADING, DISTANCE, SPEED = math.radians(4.0), 4.0, 0.5
"""Maximum change of an object since its last report without inclusion in the next message [rad, m, m/s]."""
MAX_OMITTED_QUALITY = 3
"""Maximum perception quality (0 to 15) of objects that are omitted."""
VULNERABLE = frozenset({"pedestrian", "bicycle"})
"""Classes of type A, which are reported together."""
MOVING = 0.1
"""Minimum speed at which the direction is that of the velocity instead of the box [m/s]."""

EQUAL = 1e-6
"""Tolerance of comparisons."""


@dataclass(frozen=True)
class CpmContents:
    """Contents of a message: rows of the detections by descending utility, and whether it lists the sensors."""

    rows: tuple[int, ...]
    sensors: bool


@dataclass(frozen=True)
class _ReportedObject:
    time: float
    x: float
    y: float
    speed: float
    direction: float


class CpmGenerationRules:
    """CPM generation rules of one station, with the last report of each object.

    Vehicles are included if they are new, have moved, have changed speed or direction, or were not reported for
    `LONGEST`. All pedestrians and cyclists are included if one of them is new or was not reported for half of that.
    """

    def __init__(self) -> None:
        self._sent = -math.inf
        self._sensors = -math.inf
        self._reported: dict[int, _ReportedObject] = {}

    def contents(
        self, detections: Detections, numbers: Sequence[int], now: float, shortest: float = SHORTEST
    ) -> CpmContents | None:
        """Return the contents of the message at `now` [s]; None if no message is due.

        numbers   object ids, constant across messages
        shortest  minimum interval between messages [s]
        """
        if now - self._sent < shortest - EQUAL:
            return None
        scores: list[float] = detections.confidence.tolist()
        rows = [row for row, score in enumerate(scores) if quality(score) > MAX_OMITTED_QUALITY]
        present = {row: _report(detections, row, now) for row in rows}
        vulnerable = [row for row in rows if detections.classes[row] in VULNERABLE]
        chosen = [row for row in rows if row not in vulnerable and self._vehicle_due(numbers[row], present[row])]
        if any(self._person_due(numbers[row], now) for row in vulnerable):
            chosen += vulnerable
        sensors = now - self._sensors >= SENSORS - EQUAL
        if not chosen and not sensors:
            return None
        chosen.sort(key=lambda row: (-self._utility(numbers[row], present[row], scores[row]), numbers[row]))
        for row in chosen:
            self._reported[numbers[row]] = present[row]
        self._reported = {number: report for number, report in self._reported.items() if now - report.time <= RETENTION}
        self._sent = now
        self._sensors = now if sensors else self._sensors
        return CpmContents(tuple(chosen), sensors)

    def _vehicle_due(self, number: int, present: _ReportedObject) -> bool:
        last = self._reported.get(number)
        return (
            last is None
            or math.hypot(present.x - last.x, present.y - last.y) > DISTANCE + EQUAL
            or abs(present.speed - last.speed) > SPEED + EQUAL
            or abs(wrap_angle(present.direction - last.direction)) > HEADING + EQUAL
            or present.time - last.time >= LONGEST - EQUAL
        )

    def _person_due(self, number: int, now: float) -> bool:
        last = self._reported.get(number)
        return last is None or now - last.time >= LONGEST / 2.0 - EQUAL

    def _utility(self, number: int, present: _ReportedObject, score: float) -> float:
        """Return the utility of an object. New objects come first, then those of higher quality or larger change.

        Terms as in the CpService of Artery: quality, changes of position, speed and direction, age; at most 1 each.
        """
        last = self._reported.get(number)
        if last is None:
            return 10.0 + score
        moved = math.hypot(present.x - last.x, present.y - last.y)
        turned = abs(wrap_angle(present.direction - last.direction))
        terms = (
            moved / (2.0 * DISTANCE),
            abs(present.speed - last.speed) / (2.0 * SPEED),
            turned / (2.0 * HEADING),
            (present.time - last.time - SHORTEST) / (LONGEST - SHORTEST),
        )
        return score + sum(min(1.0, max(0.0, term)) for term in terms)


def quality(score: float) -> int:
    """Return the perception quality, 0 to 15, of an object with this existence probability in [0, 1]."""
    return math.floor(15.0 * score + 0.5)


def _report(detections: Detections, row: int, now: float) -> _ReportedObject:
    x, y, *_, yaw = detections.boxes[row].tolist()
    vx, vy = detections.velocity[row].tolist()
    speed = math.hypot(vx, vy)
    known = not math.isnan(speed)
    return _ReportedObject(now, x, y, speed if known else 0.0, math.atan2(vy, vx) if known and speed > MOVING else yaw)

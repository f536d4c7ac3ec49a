"""When a station sends a collective perception message, and of which objects: ETSI TS 103 324 V2.1.1, 6.1."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from eidrive_scenario.detections import Detections
from eidrive_scenario.geometry import wrap_angle

SHORTEST, LONGEST = 0.1, 1.0
"""T_GenCpmMin and T_GenCpmMax [s]."""
SENSORS = 1.0
"""T_AddSensorInformation: least time between two lists of the own sensors [s]."""
HEADING, DISTANCE, SPEED = math.radians(4.0), 4.0, 0.5
"""More than this change since an object was last in a message puts it into the next [rad, m, m/s]."""
LEAST_QUALITY = 3
"""Objects of this perception quality (0 to 15) or a lower one are left out."""
VULNERABLE = frozenset({"pedestrian", "bicycle"})
"""Type A: they come all together."""
MOVING = 0.1
"""Below this speed the direction of the velocity says nothing, and the box's heading counts [m/s]."""

EQUAL = 1e-6
"""Differences smaller than this are none."""


@dataclass(frozen=True)
class CpmContents:
    """What a message carries: rows of the detections, the most important first, and whether it lists the sensors."""

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
    """Remembers what it has said of each object.

    Vehicles come when they are new, have moved, changed speed or direction, or were not said for `LONGEST`; pedestrians
    and cyclists all come when one of them is new or was not said for half of that.
    """

    def __init__(self) -> None:
        self._sent = -math.inf
        self._sensors = -math.inf
        self._said: dict[int, _ReportedObject] = {}

    def contents(
        self, detections: Detections, numbers: Sequence[int], now: float, shortest: float = SHORTEST
    ) -> CpmContents | None:
        """Return what to send now [s], None if nothing is due. `numbers` identify objects across messages."""
        if now - self._sent < shortest - EQUAL:
            return None
        scores: list[float] = detections.confidence.tolist()
        rows = [row for row, score in enumerate(scores) if quality(score) > LEAST_QUALITY]
        present = {row: _said(detections, row, now) for row in rows}
        vulnerable = [row for row in rows if detections.classes[row] in VULNERABLE]
        chosen = [row for row in rows if row not in vulnerable and self._vehicle_due(numbers[row], present[row])]
        if any(self._person_due(numbers[row], now) for row in vulnerable):
            chosen += vulnerable
        sensors = now - self._sensors >= SENSORS - EQUAL
        if not chosen and not sensors:
            return None
        chosen.sort(key=lambda row: (-self._utility(numbers[row], present[row], scores[row]), numbers[row]))
        for row in chosen:
            self._said[numbers[row]] = present[row]
        self._said = {number: said for number, said in self._said.items() if now - said.time <= 2.0 * LONGEST}
        self._sent = now
        self._sensors = now if sensors else self._sensors
        return CpmContents(tuple(chosen), sensors)

    def _vehicle_due(self, number: int, present: _ReportedObject) -> bool:
        last = self._said.get(number)
        return (
            last is None
            or math.hypot(present.x - last.x, present.y - last.y) > DISTANCE + EQUAL
            or abs(present.speed - last.speed) > SPEED + EQUAL
            or abs(wrap_angle(present.direction - last.direction)) > HEADING + EQUAL
            or present.time - last.time >= LONGEST - EQUAL
        )

    def _person_due(self, number: int, now: float) -> bool:
        last = self._said.get(number)
        return last is None or now - last.time >= LONGEST / 2.0 - EQUAL

    def _utility(self, number: int, present: _ReportedObject, score: float) -> float:
        """How much an object is worth its place: new ones first, then the better seen and the more changed.

        The terms are those of Artery's CpService: quality, changes of place, speed and direction, age; up to 1 each.
        """
        last = self._said.get(number)
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
    """The perception quality, 0 to 15, of an object with this probability of existence in [0, 1]."""
    return math.floor(15.0 * score + 0.5)


def _said(detections: Detections, row: int, now: float) -> _ReportedObject:
    x, y, *_, yaw = detections.boxes[row].tolist()
    vx, vy = detections.velocity[row].tolist()
    speed = math.hypot(vx, vy)
    known = not math.isnan(speed)
    return _ReportedObject(now, x, y, speed if known else 0.0, math.atan2(vy, vx) if known and speed > MOVING else yaw)

"""Generation rules of CAMs and CPMs, object ids and sizes of messages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from eidrive_scenario.base.assignment import associate
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import wrap_angle
from eidrive_scenario.v2x.messages.message import StationState

CHECK = 0.1
"""T_CheckCamGen: period of evaluation [s]."""
SHORTEST, LONGEST = 0.1, 1.0
"""T_GenCamMin and T_GenCamMax (ETSI EN 302 637-2), T_GenCpmMin and T_GenCpmMax (ETSI TS 103 324) [s]."""
REPEATS = 3
"""N_GenCam: number of messages that keep the interval of the last trigger."""
DISTANCE, SPEED, HEADING = LIMITS = 4.0, 0.5, math.radians(4.0)
"""Maximum changes without a new CAM, or of an object without inclusion in the next CPM [m, m/s, rad]."""
LOW_FREQUENCY = 0.5
"""Minimum time between two low-frequency containers [s]."""

EQUAL = 1e-6
"""Tolerance of comparisons: 4.0 m do not exceed 4 m after floating-point rounding."""


class CamGenerationRules:
    """CAM generation rules of one station, evaluated at each tick.

    A change of heading, position or speed beyond the limits triggers a message, at the earliest `SHORTEST` after the
    last one. The next `REPEATS` messages keep its interval; later ones use the longest interval.
    """

    def __init__(self, elapsed: float | None = None) -> None:
        """Start without an earlier message, or in the steady state of the speed at the first evaluation.

        elapsed  share of the interval between two messages that has passed then, in [0, 1); None: no earlier message
        """
        self._elapsed = elapsed
        self._checked = -math.inf
        self._sent = -math.inf
        self._low_frequency = -math.inf
        self._last: StationState | None = None
        self._interval = LONGEST
        self._repeats = 0

    def is_due(self, state: StationState, now: float, shortest: float = SHORTEST) -> bool:
        """Return True if a message is due now; congestion control may require a longer `shortest` interval [s]."""
        if now - self._checked < CHECK - EQUAL:
            return False
        if self._checked == -math.inf and self._elapsed is not None:
            self._start_in_steady_state(state, now, self._elapsed)
        self._checked = now
        passed = now - self._sent
        if passed < shortest - EQUAL:
            return False
        last = self._last
        if last is None or _has_changed(last, state):
            self._interval = min(max(passed, SHORTEST), LONGEST)
            self._repeats = 0
        elif passed >= self._interval - EQUAL:
            self._repeats += 1
            if self._repeats >= REPEATS:
                self._interval = LONGEST
        else:
            return False
        self._sent, self._last = now, state
        return True

    def _start_in_steady_state(self, state: StationState, now: float, elapsed: float) -> None:
        speed = abs(state.speed)
        interval = DISTANCE / speed if speed * LONGEST > DISTANCE else LONGEST
        age = elapsed * max(interval, SHORTEST)
        self._sent, self._last = now - age, earlier_state(state, age)

    def low_frequency(self, now: float) -> bool:
        """Return True if the message that is sent now carries the low-frequency container."""
        if now - self._low_frequency < LOW_FREQUENCY - EQUAL:
            return False
        self._low_frequency = now
        return True


def earlier_state(state: StationState, age: float) -> StationState:
    """Return the state of a station that has driven straight on for a time [s]."""
    back = state.speed * age
    return replace(state, x=state.x - back * math.cos(state.yaw), y=state.y - back * math.sin(state.yaw))


RETENTION = 2.0 * LONGEST
"""Time after which an object that is no longer detected is forgotten, so that it is new afterwards [s].

A design choice: an object that is in sight is reported at least every `LONGEST`, so two reports of it are missing.
"""
SENSORS = 1.0
"""T_AddSensorInformation: minimum time between two lists of the sensors of the station [s]."""
MAX_OMITTED_QUALITY = 3
"""Maximum perception quality (0 to 15) of objects that are omitted."""
VULNERABLE = frozenset({"pedestrian", "bicycle"})
"""Classes of type A, which are reported together."""
MOVING = 0.1
"""Minimum speed at which the direction is that of the velocity instead of the box [m/s]."""


@dataclass(frozen=True)
class CpmContents:
    """Contents of a message: rows of the detections by descending utility, and whether it lists the sensors."""

    rows: tuple[int, ...]
    sensors: bool


class CpmGenerationRules:
    """CPM generation rules of one station, with the last report of each object.

    Vehicles are included if they are new, have moved, have changed speed or direction, or were not reported for
    `LONGEST`. All pedestrians and cyclists are included if one of them is new or was not reported for half of that.
    """

    def __init__(self) -> None:
        self._sent = -math.inf
        self._sensors = -math.inf
        self._reported: dict[int, StationState] = {}

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
        reports = [self._reported.get(numbers[row]) for row in vulnerable]
        if any(last is None or now - last.time >= LONGEST / 2.0 - EQUAL for last in reports):
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

    def _vehicle_due(self, number: int, present: StationState) -> bool:
        last = self._reported.get(number)
        return last is None or _has_changed(last, present) or present.time - last.time >= LONGEST - EQUAL

    def _utility(self, number: int, present: StationState, score: float) -> float:
        """Return the utility of an object. New objects come first, then those of higher quality or larger change.

        Terms as in the CpService of Artery: quality, changes of position, speed and direction, age; at most 1 each.
        """
        last = self._reported.get(number)
        if last is None:
            return 10.0 + score
        terms = [change / (2.0 * limit) for change, limit in zip(_changes(last, present), LIMITS, strict=True)]
        terms.append((present.time - last.time - SHORTEST) / (LONGEST - SHORTEST))
        return score + sum([min(1.0, max(0.0, term)) for term in terms])


def _changes(before: StationState, after: StationState) -> tuple[float, float, float]:
    """Return the changes of position, speed and direction, in the order of LIMITS."""
    moved = math.hypot(after.x - before.x, after.y - before.y)
    return moved, abs(after.speed - before.speed), abs(wrap_angle(after.yaw - before.yaw))


def _has_changed(before: StationState, after: StationState) -> bool:
    """Return whether a change exceeds its limit."""
    moved, accelerated, turned = _changes(before, after)
    return moved > DISTANCE + EQUAL or accelerated > SPEED + EQUAL or turned > HEADING + EQUAL


def quality(score: float) -> int:
    """Return the perception quality, 0 to 15, of an object with this existence probability in [0, 1]."""
    return math.floor(15.0 * score + 0.5)


def _report(detections: Detections, row: int, now: float) -> StationState:
    """Return the state of an object as it is reported, with the direction of its motion as yaw."""
    x, y, z, *_, yaw = detections.boxes[row].tolist()
    vx, vy = detections.velocity[row].tolist()
    speed = math.hypot(vx, vy)
    direction = math.atan2(vy, vx) if speed > MOVING else yaw  # an unknown speed (NaN) compares as False
    return StationState(now, x, y, z, direction, 0.0 if math.isnan(speed) else speed)


GATE = 3.0
"""Maximum distance between an object and the predicted position of the same object [m].

A design choice, not taken from a standard: an object of unknown velocity keeps its id up to 30 m/s if it is detected
every 0.1 s, and the distance is less than that between the centers of two lanes of 3.5 m.
"""


class ObjectIdAssigner:
    """Assignment of object ids: those of the tracker, or else of the nearest predicted earlier object.

    next_id  of the next object that is new
    """

    def __init__(self, next_id: int = 0) -> None:
        self.next_id = next_id
        self._earlier: dict[int, tuple[float, float, float, float, float]] = {}

    def assign_ids(self, detections: Detections) -> Sequence[int]:
        """Return one object id per row."""
        if detections.tracks or not len(detections):
            return detections.tracks
        now = detections.time
        self._earlier = {number: last for number, last in self._earlier.items() if now - last[0] <= RETENTION}
        positions = detections.boxes[:, :2]
        expected = np.array(
            [(x + vx * (now - time), y + vy * (now - time)) for time, x, y, vx, vy in self._earlier.values()]
        )
        ids = list(self._earlier)
        id_of = {row: ids[column] for row, column in associate(positions, expected, GATE)}
        numbers = []
        for row in range(len(detections)):
            number = id_of.get(row)
            if number is None:
                number, self.next_id = self.next_id, self.next_id + 1
            x, y = positions[row].tolist()
            vx, vy = (0.0 if math.isnan(v) else v for v in detections.velocity[row].tolist())
            self._earlier[number] = (now, x, y, vx, vy)
            numbers.append(number)
        return tuple(numbers)


MANAGEMENT_BYTES = 121
"""Size of header, management and station containers [bytes]."""
CONTAINER_BYTES = 35
"""Size of one sensor information container and of one perceived object [bytes]."""
CAM_BYTES, CAM_LOW_FREQUENCY_BYTES = 190, 300
"""Size of a CAM without and with the low-frequency container, including security [bytes].

These are the message sizes of the periodic traffic model of 3GPP TR 36.885, A.1.5.
"""


def cpm_size(objects: int, sensors: int, security: int = 0) -> int:
    """Return the size of a CPM with a security envelope of `security` bytes [bytes].

    121 + 35 (S + O) for S sensors and O objects (Thandavarayan, Sepulcre, Gozalvez: Generation of cooperative
    perception messages for connected and automated vehicles, IEEE IV 2019).
    """
    return MANAGEMENT_BYTES + CONTAINER_BYTES * (sensors + objects) + security


def cam_size(low_frequency: bool) -> int:
    """Return the size of a CAM [bytes]."""
    return CAM_LOW_FREQUENCY_BYTES if low_frequency else CAM_BYTES


def objects_that_fit(mtu: int, sensors: int, security: int = 0) -> int:
    """Return the maximum number of objects in a CPM of at most `mtu` bytes, at least one."""
    return max(1, (mtu - cpm_size(0, sensors, security)) // CONTAINER_BYTES)

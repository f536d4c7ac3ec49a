"""Stopping for traffic lights and stop signs."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array
from eidrive_scenario.driving.planning.path import APPROACH_DECELERATION
from eidrive_scenario.perception.traffic_lights import SignalAhead, SignalsAhead
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.tolerances import TIME_TOLERANCE
from eidrive_scenario.world.actor import ActorSpec

BEFORE_LINE = 1.5
"""Where the front comes to a stand before the line [m]."""
TOO_LATE = 5.0
"""A vehicle that would have to brake harder than this passes a light that has just turned [m/s²]."""
STANDING = 0.1
"""Slower than this a vehicle has stopped [m/s]."""
AT_LINE = 2.0
"""It has done so for the sign if its front is this near to where it should be [m]."""
ANOTHER = 5.0
"""A stop line that lies this much farther ahead than it did is that of another visit, on another lap [m]."""
WAIT = 3.0
"""How long a vehicle stands at a stop sign: EI-Drive's 60 ticks of 0.05 s [s]."""


class StopPoint(NamedTuple):
    """Where to stand, as a distance along the path [m], and why."""

    place: float
    reason: str


class SignalStops:
    """Which signal stops the vehicle next. At a stop sign it waits and goes; it does not look for others there."""

    def __init__(self, roads: RoadNetwork | None, spec: ActorSpec) -> None:
        self.signals = SignalsAhead(roads)
        self._front = spec.offset[0] + spec.size[0] / 2.0
        self._stopping: set[str] = set()
        self._too_late: set[str] = set()
        self._standing_since: dict[str, float] = {}
        self._served: set[str] = set()
        self._distances: dict[str, float] = {}
        """How far ahead the next stop line of each signal was last [m]."""
        self._along = np.zeros(1)

    def follow(self, path: Array) -> None:
        """A path (M, 2) is followed from now on."""
        self.signals.follow(path)
        self._along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])

    def next(self, along: float, speed: float, now: float) -> StopPoint | None:
        """The stop ahead of a vehicle whose reference point is `along` the path, None where nothing stops it."""
        found: StopPoint | None = None
        ahead: dict[str, SignalAhead] = {}
        for signal in self.signals.ahead(along):
            ahead.setdefault(signal.signal, signal)
        for name, before in self._distances.items():
            if name not in ahead or ahead[name].distance > before + ANOTHER:
                self._forget(name)
        self._distances = {name: signal.distance for name, signal in ahead.items()}
        for signal in ahead.values():
            left = signal.distance - self._front - BEFORE_LINE
            holds = self._light_holds if signal.kind == "light" else self._sign_holds
            if holds(signal, left, speed, now) and found is None:
                what = "traffic light" if signal.kind == "light" else "stop sign"
                found = StopPoint(along + max(left, 0.0), f"stop at {what} {signal.signal}")
        return found

    def _forget(self, name: str) -> None:
        """The vehicle has left a signal behind, whatever it did there."""
        self._stopping.discard(name)
        self._too_late.discard(name)
        self._served.discard(name)
        self._standing_since.pop(name, None)

    def limits(self, stop: StopPoint, part: slice) -> Array:
        """The speeds at points of the path with which the vehicle comes to a stand there [m/s]."""
        return np.sqrt(2.0 * APPROACH_DECELERATION * np.maximum(stop.place - self._along[part], 0.0))

    def place_of(self, index: int, path: Array, x: float, y: float) -> float:
        """Where along the path a point is, whose nearest segment begins at an index [m]."""
        index = min(index, len(path) - 2)
        (x0, y0), (x1, y1) = path[index].tolist(), path[index + 1].tolist()
        length = math.hypot(x1 - x0, y1 - y0)
        share = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / length if length > 0.0 else 0.0
        return float(self._along[index]) + min(max(share, 0.0), length)

    def _light_holds(self, light: SignalAhead, left: float, speed: float, now: float) -> bool:
        name = light.signal
        if not light.must_stop:
            self._stopping.discard(name)
            self._too_late.discard(name)
            return False
        if name not in self._stopping and name not in self._too_late:
            can_stop = left > 0.0 and speed * speed <= 2.0 * TOO_LATE * left
            (self._stopping if can_stop or speed < STANDING else self._too_late).add(name)
        return name in self._stopping

    def _sign_holds(self, sign: SignalAhead, left: float, speed: float, now: float) -> bool:
        name = sign.signal
        if not sign.must_stop or name in self._served:
            return False
        if speed < STANDING and left < AT_LINE:
            since = self._standing_since.setdefault(name, now)
            if now - since >= WAIT - TIME_TOLERANCE:
                del self._standing_since[name]
                self._served.add(name)
                return False
        return True

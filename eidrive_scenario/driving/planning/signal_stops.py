"""Stopping for traffic lights and stop signs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.base.geometry import distances_along
from eidrive_scenario.base.tolerances import TIME_TOLERANCE
from eidrive_scenario.driving.planning.path import APPROACH_DECELERATION
from eidrive_scenario.perception.traffic_lights import SignalAhead, SignalsAhead
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import SignalReading
from eidrive_scenario.sensing.signals import RANGE
from eidrive_scenario.world.actor import ActorSpec

BEFORE_LINE = 1.5
"""Distance between the front of a stopped vehicle and the stop line [m]."""
TOO_LATE = 5.0
"""Maximum deceleration before a light that is red, or will be before the vehicle arrives [m/s²]; a vehicle
that would need more passes."""
COMFORTABLE = 3.05
"""Deceleration at which traffic stops at a yellow light [m/s²]: 10 ft/s², Institute of Transportation Engineers."""
PERCEPTION = 1.0
"""Time from the change to yellow to the braking of a driver [s], of the same source."""
REACTION = 0.1
"""Time until this vehicle brakes [s]."""
STANDING = 0.1
"""Maximum speed of a stopped vehicle [m/s]."""
AT_LINE = 2.0
"""Maximum distance of the front from its stop point at which a stop counts for the sign [m]."""
ANOTHER = 5.0
"""Minimum increase of the distance of a stop line that indicates the next lap [m]."""
STEP, FARTHEST = 1.0, 100.0
"""Steps in which the places are searched from which a light is in view, and the maximum distance from the usual place
to stop [m]; a light that is in view from farther away is no reason to slow down."""
READING = 0.5
"""Time from a light being in view to its state being known, for cameras of some images per second [s]."""
WAIT = 3.0
"""Waiting time at a stop sign [s]: 60 ticks of 0.05 s, as in EI-Drive."""
LONGEST_RED = 120.0
"""Waiting time at a red light that is out of view [s]: longer than the cycles of usual traffic lights."""


CanReadLight = Callable[[str, float, float, float, float], bool]
"""Function as `Detector.can_read_light`."""


class StopPoint(NamedTuple):
    """Stop point: distance along the path [m], and reason."""

    along: float
    reason: str


@dataclass
class _Decision:
    """State of the decision about one signal ahead.

    distance        of its next stop line in the last tick [m]
    stops           whether the vehicle stops for the light; None: not decided
    yellow_since    time at which the light was first seen in yellow [s]; None in another state
    standing_since  time at which the vehicle stopped at the sign, or at a light out of its view [s]; None before
    is_served       whether the vehicle has waited there
    back            distance of the stop point from the usual one, so that the light stays in view [m]
    shown           distance before the stop point up to which the light is in view [m]
    """

    distance: float
    back: float = 0.0
    shown: float = math.inf
    stops: bool | None = None
    yellow_since: float | None = None
    standing_since: float | None = None
    is_served: bool = False


class SignalStops:
    """Stops for traffic lights and stop signs. At a stop sign the vehicle waits and continues, regardless of others.

    A light that the vehicle has not read where it should have had it in view is a stop sign, and then a dark light.
    """

    def __init__(self, roads: RoadNetwork | None, spec: ActorSpec) -> None:
        self.signals = SignalsAhead(roads)
        self._front = spec.offset[0] + spec.size[0] / 2.0
        self._decisions: dict[str, _Decision] = {}
        """By the id of the signal; a signal whose stop line has been passed has none."""
        self._path: Array = np.zeros((1, 2))
        self._along: Array = np.zeros(1)

    def follow(self, path: Array, heights: Array | None = None) -> None:
        """Set the path (M, 2) of the vehicle and the heights of the road along it (M,) [m]; None: roads are level."""
        self.signals.follow(path, heights)
        self._path = path
        self._along = distances_along(path)

    def next(self, along: float, speed: float, now: float, can_read: CanReadLight | None = None) -> StopPoint | None:
        """Return the next stop of a vehicle at distance `along` of the path [m]; None if no signal requires one.

        can_read  as `Detector.can_read_light`; None: the vehicle has all lights in view up to their stop lines
        """
        stops: list[StopPoint] = []
        ahead: dict[str, SignalAhead] = {}
        for signal in self.signals.ahead(along):
            ahead.setdefault(signal.signal, signal)
        self._decisions = {
            name: decision
            for name, decision in self._decisions.items()
            if name in ahead and ahead[name].distance <= decision.distance + ANOTHER
        }
        for name, signal in ahead.items():
            if name not in self._decisions:
                self._decisions[name] = _Decision(signal.distance, *self._view_of(signal, along, can_read))
            decision = self._decisions[name]
            decision.distance = signal.distance
            if signal.distance > RANGE:
                self.signals.forget(name)  # It was read on an earlier passage
            left = signal.distance - self._front - BEFORE_LINE - decision.back
            is_unread = signal.kind == "light" and signal.state is None
            holds = _unread_holds if is_unread else _light_holds if signal.kind == "light" else _sign_holds
            if holds(signal, decision, left, speed, now):
                what = f"{'unread ' if is_unread else ''}traffic light" if signal.kind == "light" else "stop sign"
                # Without `max`, errors of its position do not move a standing vehicle out of the view of the light.
                held = left if decision.shown < math.inf else max(left, 0.0)
                stops.append(StopPoint(along + held, f"stop at {what} {name}"))
            elif signal.kind == "light" and decision.is_served:
                decision.is_served, decision.standing_since = False, None
                self.signals.update([SignalReading(name, "off")])
            elif is_unread and left > decision.shown:
                # It approaches so that it can still stop when it reads the light.
                late = TOO_LATE * READING
                entry = math.sqrt(late**2 + 2.0 * TOO_LATE * decision.shown) - late
                beyond = entry**2 / (2.0 * APPROACH_DECELERATION)
                stops.append(StopPoint(along + left - decision.shown + beyond, f"approach traffic light {name}"))
        return min(stops, default=None)

    def _view_of(self, signal: SignalAhead, along: float, can_read: CanReadLight | None) -> tuple[float, float]:
        """Return how far before its usual place a vehicle at distance `along` of the path has a light in view [m], and
        from there up to which distance.

        0 and inf if it has it in view nowhere, or in one place only. Two steps more are for errors of the position and
        of the control.
        """
        if signal.kind != "light" or can_read is None:
            return 0.0, math.inf
        usual = along + signal.distance - self._front - BEFORE_LINE
        distances = np.arange(0.0, FARTHEST, STEP).tolist()
        is_shown = (can_read(signal.signal, *self._pose_at(usual - back, signal.z)) for back in distances)
        views = zip(distances, is_shown, strict=True)
        nearest = next((back for back, shown in views if shown), None)
        if nearest is None:
            return 0.0, math.inf
        hidden = next((back for back, shown in views if not shown), math.inf)
        back = nearest + 2.0 * STEP if nearest else 0.0
        shown = hidden - STEP - back
        return (back, shown) if shown > 0.0 else (0.0, math.inf)

    def _pose_at(self, along: float, z: float) -> tuple[float, float, float, float]:
        """Return x, y, z [m] and heading [rad] at a distance along the path [m]."""
        index = min(max(int(np.searchsorted(self._along, along)) - 1, 0), len(self._path) - 2)
        (x0, y0), (x1, y1) = self._path[index : index + 2].tolist()
        yaw, ahead = math.atan2(y1 - y0, x1 - x0), along - float(self._along[index])
        return x0 + ahead * math.cos(yaw), y0 + ahead * math.sin(yaw), z, yaw

    def limits(self, stop: StopPoint, part: slice) -> Array:
        """Return the maximum speeds at points of the path with which the vehicle stops there [m/s]."""
        return np.sqrt(2.0 * APPROACH_DECELERATION * np.maximum(stop.along - self._along[part], 0.0))

    def along(self, index: int, x: float, y: float) -> float:
        """Return the distance of a point along the path [m]; its nearest segment begins at `index`."""
        (x0, y0), (x1, y1) = self._path[index : index + 2].tolist()
        length = math.hypot(x1 - x0, y1 - y0)
        ahead: float = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / length
        return float(self._along[index]) + min(max(ahead, 0.0), length)


def _light_holds(light: SignalAhead, decision: _Decision, left: float, speed: float, now: float) -> bool:
    """Return whether a light holds the vehicle. It decides when a phase begins, and keeps this decision."""
    if not light.is_yellow and decision.yellow_since is not None:
        decision.yellow_since = None
        # A vehicle that meant to pass at yellow may still be able to stop at red.
        decision.stops = decision.stops or None
    if not light.must_stop:
        decision.stops = None
        return False
    if decision.stops is None:
        remaining = 0.0
        if light.is_yellow:
            if decision.yellow_since is None:
                decision.yellow_since = now
            remaining = yellow_time(speed) - (now - decision.yellow_since)
        to_line = left + decision.back + BEFORE_LINE
        passes_in_time = to_line <= speed * remaining
        # It rather stops where the light is out of view than passes at red.
        way = left if passes_in_time else left + decision.back
        decision.stops = can_stop_for_light(way, speed, passes_in_time=passes_in_time) or speed < STANDING
    is_in_view = left >= -STEP or math.isinf(decision.shown)
    return decision.stops and (is_in_view or _sign_holds(light, decision, left, speed, now, LONGEST_RED))


def _sign_holds(
    sign: SignalAhead, decision: _Decision, left: float, speed: float, now: float, wait: float = WAIT
) -> bool:
    if not sign.must_stop or decision.is_served:
        return False
    if speed < STANDING and left < AT_LINE:
        if decision.standing_since is None:
            decision.standing_since = now
        decision.is_served = now - decision.standing_since >= wait - TIME_TOLERANCE
    return not decision.is_served


def _unread_holds(light: SignalAhead, decision: _Decision, left: float, speed: float, now: float) -> bool:
    """Return whether a light holds the vehicle that has not read it in time, or started where it is out of view.

    A light that is in view from nowhere does not.
    """
    if decision.stops is None and left <= min(decision.shown, speed * REACTION + speed * speed / (2.0 * TOO_LATE)):
        can_stop = can_stop_for_light(left + decision.back, speed, passes_in_time=False)
        decision.stops = (decision.shown < math.inf and (can_stop or speed < STANDING)) or None
    return bool(decision.stops) and _sign_holds(light._replace(must_stop=True), decision, left, speed, now)


def yellow_time(speed: float) -> float:
    """Return the usual duration of yellow for traffic of a speed [m/s], by the formula of the ITE [s]."""
    return PERCEPTION + speed / (2.0 * COMFORTABLE)


def can_stop_for_light(left: float, speed: float, *, passes_in_time: bool) -> bool:
    """Return whether a vehicle should stop `left` meters ahead: comfortably if it would pass in time, else firmly."""
    deceleration = COMFORTABLE if passes_in_time else TOO_LATE
    return left > 0.0 and speed * REACTION + speed * speed / (2.0 * deceleration) <= left

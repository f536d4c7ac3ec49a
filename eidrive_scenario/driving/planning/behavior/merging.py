"""Gaps in neighboring lanes: whether a vehicle may enter them, how it reaches them, and its distance afterwards."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.driving.planning.behavior.memory import STILL
from eidrive_scenario.driving.planning.behavior.oncoming import LONG, PAUSE, STOPPING_ERROR
from eidrive_scenario.driving.planning.behavior.proposals import Body
from eidrive_scenario.driving.planning.behavior.rollout import Rollout
from eidrive_scenario.driving.planning.behavior.scoring import WEIGHTS
from eidrive_scenario.driving.planning.behavior.settings import BehaviorSettings
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings, later

REAR_REACTION, REAR_DECELERATION, REAR_GAP = 1.0, 1.5, 3.0
"""Reaction time [s] and deceleration [m/s²] that a lane change may require of the traffic behind, and the minimum gap
[m]; the deceleration is that of the vehicle as well."""
AHEAD_GAP = 1.5
"""Minimum gap to the vehicle ahead at a lane change [m]; less than the standstill gap that the vehicle keeps."""
ENTRY = 1.0
"""Time that a vehicle needs to the border of the lane to which it changes, in which a gap may become larger [s]."""
BESIDE_LANE = 1.0
"""Distance from the center of a lane within which a body is in it [m]: half the width of a vehicle."""
REAR_RESPONSE = 3.0
"""Deceleration that the vehicle expects of traffic behind in the lane to which it changes [m/s²]."""
MERGING_TIME_GAP, RELAXATION = 0.56, 25.0
"""Time gap at which a vehicle merges, and time constant of its return to its own [s], by LMRS (Schakel et al. 2012)."""
LEAST_TIME_GAP, NEARLY = 0.2, 0.05
"""Time gap of a vehicle that has merged as long as another follows it closer than it follows itself, and difference to
its own time gap at which it has that again [s]; choices."""
BEYOND = np.arange(1.0, 17.0)
"""Times after the horizon at which a gap is expected where all keep their speeds [s]."""


def in_lane(scene: Surroundings, offset: float) -> Bools:
    """Return where hypotheses (N, K) are in the lane whose center is at an offset, without crossing it."""
    return np.asarray((np.abs(scene.d - offset) < scene.half_width + BESIDE_LANE) & ~scene.crosses)


def has_gap(scene: Surroundings, offset: float, s: Array, speed: Array, body: Body, time_gap: float) -> Bools:
    """Return where (P, K) a lane has a gap that a vehicle can enter: neither it nor traffic behind has to brake hard.

    offset    distance of the center of the lane to the left of the line [m]
    s, speed  distances along the line [m] and speeds [m/s] (P, K) of the vehicle at the first K times of the scene
    time_gap  least time to a vehicle ahead and for one behind [s]
    """
    times = slice(0, s.shape[1])
    lane, others, here = in_lane(scene, offset)[:, times], scene.speed[:, times], speed[:, None]
    behind = scene.s[:, times] <= (s + body.center)[:, None]
    ahead = scene.rear[:, times] - (s + body.front)[:, None]
    after = (s - body.rear)[:, None] - scene.front[:, times]
    closing, approach = np.maximum(here - others, 0.0), np.maximum(others - here, 0.0)
    needed = AHEAD_GAP + time_gap * here + closing**2 / (2.0 * REAR_DECELERATION)
    kept = np.maximum(time_gap * others, REAR_GAP) + REAR_REACTION * approach + approach**2 / (2.0 * REAR_DECELERATION)
    gap, least = np.where(behind, after, ahead), np.where(behind, kept, needed)
    opening = np.where(behind, closing, approach)
    blocked = lane & ((gap < 0.0) | (gap + ENTRY * opening < least))
    return np.asarray(~np.logical_or.reduce(blocked, axis=1))


def has_gap_now(
    scene: Surroundings, offset: float, motion: tuple[float, float], body: Body, time_gap: float = 0.0
) -> bool:
    """Return whether a vehicle with a distance along the line [m] and a speed [m/s] can enter a lane now.

    Arguments as those of `has_gap`.
    """
    s, speed = motion
    return bool(has_gap(scene, offset, np.array([[s]]), np.array([[speed]]), body, time_gap).all())


def leaves_room(scene: Surroundings, offset: float, s: Array, body: Body, steps: int) -> Bools:
    """Return where (P, K) traffic that is behind in a lane does not come too close within a number of time steps.

    It keeps its speed, and the vehicle may have to stop soon.

    s  distances of the vehicle along the line at the times of the scene (P, K) [m]
    """
    behind = in_lane(scene, offset) & (scene.s <= (s + body.center)[:, None])
    gap = (s - body.rear)[:, None] - scene.front
    least = gap.copy()
    for step in range(1, min(steps, gap.shape[2] - 1) + 1):
        np.minimum(least[:, :, :-step], gap[:, :, step:], out=least[:, :, :-step])
    return np.asarray(~np.logical_or.reduce(behind & (least < REAR_GAP), axis=1))


def with_followers(scene: Surroundings, offset: float, motion: tuple[float, float], body: Body) -> Surroundings:
    """Return the scene in which traffic behind in a lane follows the vehicle, unless it has to brake hard for that."""
    s, speed = motion
    gap = s - body.rear - scene.front[:, 0]
    closing = np.maximum(scene.speed[:, 0] - speed, 0.0)
    follows = in_lane(scene, offset)[:, 0] & (gap > closing**2 / (2.0 * REAR_RESPONSE))
    return msgspec.structs.replace(scene, behind=scene.behind | follows)


def gap_leader(
    scene: Surroundings, offset: float, motion: tuple[float, float], body: Body, deceleration: float
) -> Bools:
    """Return which hypothesis (N, 1) of a lane is the nearest ahead that the vehicle can follow into a gap behind it.

    deceleration  with which it can brake for it [m/s²]
    """
    s, speed = motion
    closing = np.maximum(speed - scene.speed[:, 0], 0.0)
    nearest = s + body.center + closing**2 / (2.0 * deceleration)
    ahead = in_lane(scene, offset)[:, 0] & (scene.s[:, 0] > nearest)
    leads = np.zeros((len(scene), 1), dtype=bool)
    if ahead.any():
        leads[np.where(ahead, scene.s[:, 0], np.inf).argmin()] = True
    return leads


def costs_of_waiting(
    offset: float,
    rolled: Rollout,
    scene: Surroundings,
    times: Array,
    desire: float,
    body: Body,
    ends: tuple[float, float],
) -> Array:
    """Return the costs (P,) of the lane that the route leaves, which increase with the time until a gap is beside.

    offset  distance of the center of the other lane to the left [m]
    desire  how urgent the change is, in [0, 1]
    ends    places at which the vehicle has to change at the latest, and at which the route ends [m]
    """
    last, end = ends
    seconds = np.arange(0.0, times[-1] + 1e-9, ENTRY)
    steps, horizon = times.searchsorted(seconds - 1e-9), len(seconds) - 1
    seconds = np.append(seconds, times[-1] + BEYOND)
    s = np.hstack([rolled.s[:, steps], np.minimum(rolled.s[:, -1:] + rolled.speed[:, -1:] * BEYOND, end)])
    speed = np.pad(rolled.speed[:, steps], ((0, 0), (0, len(BEYOND))), mode="edge")
    ahead = later(scene, steps, BEYOND)
    gap = has_gap(ahead, offset, s, speed, body, MERGING_TIME_GAP) & (s <= last + STOPPING_ERROR)
    gap &= leaves_room(ahead, offset, s, body, horizon)
    # A gap that passes by, faster or slower than the vehicle, is none: it has to last for some time.
    lasts = gap[:, :-1] & gap[:, 1:]
    first = np.where(lasts.any(axis=1), seconds[lasts.argmax(axis=1)], seconds[-1])
    overruns = rolled.s.max(axis=1) > last + STOPPING_ERROR
    return np.asarray(WEIGHTS.stays + WEIGHTS.gap * desire * first / seconds[-1] + WEIGHTS.refused * overruns)


class TrafficBehind:
    """Traffic in a neighboring lane, and what may come there from behind out of view.

    view  distance behind the reference point up to which a car is in view [m]
    """

    def __init__(self, view: float, body: Body, settings: BehaviorSettings) -> None:
        self._gap = view - body.rear
        self._relative = REAR_RESPONSE + settings.acceleration
        """Deceleration of traffic behind relative to the vehicle, which accelerates meanwhile [m/s²]."""
        self._is_observed = False
        """Whether there was a lane in the last decision."""
        self._fastest = 0.0
        self._last = -math.inf
        """Time of the last traffic, or since when the lane is observed [s]."""

    def observe(self, scene: Surroundings, lane: float, now: float) -> None:
        """Update by the objects in the lane whose center is at an offset [m], nan without a lane, at `now` [s]."""
        was_observed, self._is_observed = self._is_observed, not math.isnan(lane)
        if not self._is_observed:
            return
        if not was_observed:
            self._fastest, self._last = 0.0, now
        speeds = scene.speed[in_lane(scene, lane)[:, 0], 0]
        fastest = float(speeds.max(initial=0.0))
        if fastest > STILL:
            self._fastest = fastest if self._is_quiet(now) else max(fastest, self._fastest)
            self._last = now

    def leaves_gap(self, limit: float, speed: float, now: float) -> bool:
        """Return whether traffic that comes into view when the vehicle enters the lane does not have to brake hard.

        It drives at the speed limit, or as fast as the traffic before it. Without any for some time none is expected.

        limit, speed  speed limit, and speed of the vehicle [m/s]
        """
        approach = max(limit, self._fastest) - speed
        if approach <= 0.0 or self._is_quiet(now):
            return True
        return self._gap >= REAR_GAP + REAR_REACTION * approach + approach**2 / (2.0 * self._relative)

    def _is_quiet(self, now: float) -> bool:
        return now - self._last > LONG * PAUSE


class TimeGap:
    """Time gap of one vehicle: short while it merges, then longer again unless another follows it closely."""

    def __init__(self, settings: BehaviorSettings) -> None:
        self._usual = settings.time_gap
        self._updated = math.inf
        """Time of the last update [s]."""
        self.value = settings.time_gap
        """Time gap [s]."""

    def update(
        self, scene: Surroundings, position: tuple[float, float], body: Body, now: float, *, merges: bool
    ) -> None:
        """Set the time gap of the decision at `now` [s]; `position` are s and d of the vehicle [m]."""
        elapsed, self._updated = max(now - self._updated, 0.0), now
        if merges:
            self.value = min(MERGING_TIME_GAP, self._usual)
        if self.value == self._usual:
            return
        s, d = position
        lane = [
            hypothesis
            for hypothesis in scene.present
            if abs(hypothesis.d - d) < hypothesis.half_width + body.half_width
        ]
        center = s + body.center
        rear = min((hypothesis.rear for hypothesis in lane if hypothesis.s > center), default=math.inf)
        front = max((hypothesis.front for hypothesis in lane if hypothesis.s <= center), default=-math.inf)
        if s - body.rear - front < rear - s - body.front:
            self.value = min(LEAST_TIME_GAP, self._usual)
        self.value += (self._usual - self.value) * elapsed / RELAXATION
        if self._usual - self.value < NEARLY:
            self.value = self._usual

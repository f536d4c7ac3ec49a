"""Oncoming traffic while the vehicle uses a lane of the opposite direction."""

from __future__ import annotations

import math

import numpy as np

from eidrive_scenario.arrays import Array, Bools
from eidrive_scenario.driving.planning.behavior.lateral import LateralProfile
from eidrive_scenario.driving.planning.behavior.proposals import ONCOMING_SPEED
from eidrive_scenario.driving.planning.behavior.reference import LanesBeside
from eidrive_scenario.driving.planning.behavior.surroundings import Surroundings

LANES = 6.0
"""Offset from the line within which oncoming traffic counts [m]: two lanes."""
PAUSE = 6.0
"""Time of waiting without oncoming traffic after which none is expected beyond the view [s], of the order of the
critical gaps of the Highway Capacity Manual (4.1 to 7.5 s)."""
FREE_TIME = 1.0
"""Time without an obstruction after which the vehicle does not wait any more [s]."""
SAMPLE = 2.0
"""Spacing of the places on the oncoming lane that are checked for a view [m]."""


class OncomingTraffic:
    """Oncoming traffic that one vehicle observes over time, and what may come from where it has no view.

    view  range of the perception of the vehicle [m]
    """

    def __init__(self, view: float) -> None:
        self._ahead: Array = np.arange(SAMPLE, view + SAMPLE, SAMPLE)
        """Distances of the places that are checked for a view [m]."""
        self._last = -math.inf
        self._held_up_since: float | None = None
        self._held_up_until = -math.inf

    def observe(self, scene: Surroundings, center: float, now: float, *, held_up: bool) -> None:
        """Update by the objects at `now` [s].

        center   distance of the center of the vehicle along the line [m]
        held_up  whether the vehicle would pass something
        """
        if bool(_is_oncoming(scene, 0, center).any()):
            self._last = now
        if held_up:
            self._held_up_until = now
            self._held_up_since = now if self._held_up_since is None else self._held_up_since
        elif now - self._held_up_until > FREE_TIME:
            self._held_up_since = None

    def first_hidden(self, scene: Surroundings, beside: LanesBeside, ego: tuple[float, float], now: float) -> float:
        """Return the place nearest to the vehicle from which traffic may come unseen [m]; inf if none is expected.

        None is expected if the vehicle has waited and no oncoming traffic appeared for a time of PAUSE.

        ego  distance of the center of the vehicle along the line, and its offset [m]
        """
        since = max(self._last, now if self._held_up_since is None else self._held_up_since)
        if now - since >= PAUSE or math.isnan(beside.oncoming):
            return math.inf
        s, d = ego
        places = s + self._ahead
        center, half = scene.d[:, 0, None], scene.half_width[:, 0, None]
        edges = np.concatenate([scene.rear[:, 0], scene.front[:, 0]])
        share = ((edges - s)[:, None] / (places - s)).reshape(2, len(scene), len(places))
        at_edge = d + share * (beside.oncoming - d)
        crosses = (share > 0.0) & (share < 1.0) & (at_edge > center - half) & (at_edge < center + half)
        hidden: Bools = np.logical_or.reduce(crosses, axis=(0, 1))
        first = int(hidden.argmax()) if hidden.any() else len(places)
        return float(s + first * SAMPLE)


def first_oncoming(way: Bools, s: float, scene: Surroundings) -> int:
    """Return the index of the first time at which oncoming traffic is in the way of a vehicle at s; K if never.

    way  where hypotheses are in the way of the vehicle (N, K)
    """
    meets: Bools = np.logical_or.reduce(way & (scene.speed < -ONCOMING_SPEED) & (scene.front > s), axis=0)
    return int(meets.argmax()) if meets.any() else len(meets)


def meets_oncoming(
    profile: LateralProfile,
    motion: tuple[Array, float],
    times: Array,
    oncoming: int,
    hidden: tuple[float, float],
    scene: Surroundings,
) -> bool:
    """Return whether the vehicle meets oncoming traffic before it is back on its side, or does not return.

    Past objects that stand it also returns after the horizon, until which all keep their last speeds.

    motion    distances along the line (K,) of the vehicle at `times` [m], and its last speed [m/s]
    oncoming  index of the time from which on oncoming traffic is in its way
    hidden    place from which traffic may come unseen [m], inf without one, and its speed [m/s]
    """
    s, own_speed = motion
    back = int(s.searchsorted(profile.places[-2]))
    if oncoming < len(s) and oncoming <= back:
        return True
    if back < len(s):
        end, duration = float(s[back]), float(times[back])
    elif profile.passes_standing and own_speed > ONCOMING_SPEED:
        end = profile.places[-2]
        after = (end - float(s[-1])) / own_speed
        duration = float(times[-1]) + after
        if bool((_is_oncoming(scene, -1, float(s[-1])) & (scene.rear[:, -1] + scene.speed[:, -1] * after < end)).any()):
            return True
    else:
        return True
    place, speed = hidden
    return bool(place - speed * duration < end)


def _is_oncoming(scene: Surroundings, step: int, place: float) -> Bools:
    """Return which hypotheses (N,) are oncoming traffic ahead of a place [m] at a time step."""
    is_oncoming = (scene.speed[:, step] < -ONCOMING_SPEED) & (np.abs(scene.d[:, step]) < LANES)
    return np.asarray(is_oncoming & (scene.front[:, step] > place))

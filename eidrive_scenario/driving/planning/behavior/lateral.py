"""Lateral motion along the reference line: offsets that change smoothly between constant values."""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec
import numpy as np

from eidrive_scenario.arrays import Array

ROUTE = "route"
"""Name of the maneuver without a lateral deviation."""
PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)
"""Peak of the second derivative of the quintic blend from 0 to 1 in unit time: 5.774."""
SHORTEST = 11.0
"""Minimum length of a lateral motion by a lane [m]; a car steers about that tightly at walking speed."""
USUAL_WIDTH = 3.5
"""Width of a lane [m]."""
TIGHTER = 1.5
"""Share of the lateral acceleration up to which an obstacle is passed that was recognized late."""
TIGHTEST = 0.6
"""Share of the length of a lateral motion in which most of it must be possible."""
AT_OFFSET = 0.1
"""Difference to an offset up to which the vehicle is there [m]; its control has errors of this size."""


class Body(NamedTuple):
    """Distances of the front and the rear end from the rear axle, wheelbase, and half width of the vehicle [m]."""

    front: float
    rear: float
    wheelbase: float
    half_width: float

    @property
    def center(self) -> float:
        """Distance of the center ahead of the rear axle [m]."""
        return (self.front - self.rear) / 2.0

    @property
    def half_length(self) -> float:
        """Half of the length [m]."""
        return (self.front + self.rear) / 2.0


class LateralProfile(msgspec.Struct, frozen=True):
    """Offset to the left of the reference line as a function of the distance along it.

    name   what the vehicle does, the same for all profiles of one maneuver
    places (M,) distances along the line at which the values hold [m], increasing
    values (M,) offsets [m]; constant before the first and after the last place
    slope  derivative at the first place
    side   +1 for a maneuver to the left of the route, -1 to the right, 0 for the route itself
    """

    name: str
    places: tuple[float, ...]
    values: tuple[float, ...]
    slope: float = 0.0
    side: int = 0
    uses_oncoming: bool = False
    """Whether the vehicle enters a lane of the opposite direction."""
    passes_standing: bool = False
    """Whether it passes objects that stand, so that its end is known beyond the horizon."""

    def offset(self, s: Array) -> Array:
        """Return the offsets (…) at distances (…) along the line."""
        if len(self.places) == 1:
            return np.full(s.shape, self.values[0])
        places, values = np.array(self.places), np.array(self.values)
        index = places[1:-1].searchsorted(s, side="right")
        begin, length = places[index], (places[1:] - places[:-1])[index]
        share = np.minimum(np.maximum((s - begin) / length, 0.0), 1.0)
        found = values[index] + (values[1:] - values[:-1])[index] * blend(share)
        if self.slope:
            first = np.where(index == 0, share, 1.0)
            found = found + self.slope * float(places[1] - places[0]) * _leaving(first)
        return np.asarray(found)

    def offset_at(self, s: float) -> float:
        """Return the offset at one distance along the line [m]."""
        return float(self.offset(np.array([s]))[0])

    def slope_at(self, s: float) -> float:
        """Return the derivative of the offset."""
        before, after = self.offset(np.array([s - 0.05, s + 0.05])).tolist()
        return float(after - before) / 0.1

    @property
    def last(self) -> float:
        """Offset at the end of the maneuver [m]."""
        return self.values[-1]


def blend(share: Array) -> Array:
    """Return the quintic blend from 0 to 1, with derivatives of 0 at both ends."""
    return np.asarray(share**3 * (10.0 + share * (6.0 * share - 15.0)))


def _leaving(share: Array) -> Array:
    """Return the quintic with value 0 at both ends and derivative 1 at the start."""
    return np.asarray(share * (1.0 - share * share * (6.0 - share * (8.0 - 3.0 * share))))


def change_length(change: float, speed: float, lateral_acceleration: float) -> float:
    """Return the length of a lateral motion by `change` [m] at a speed [m/s] with this peak acceleration [m/s²]."""
    if not change:
        return 1.0
    duration = math.sqrt(PEAK_ACCELERATION * abs(change) / lateral_acceleration)
    return max(duration * speed, SHORTEST * math.sqrt(min(abs(change) / USUAL_WIDTH, 1.0)), 1.0)


def towards(
    name: str,
    value: float,
    s: float,
    start: float,
    slope: float,
    speed: float,
    lateral_acceleration: float,
    side: int = 0,
) -> LateralProfile:
    """Return the motion from offset `start` at `s` to a constant offset."""
    length = change_length(value - start, speed, lateral_acceleration)
    if abs(slope) * length > abs(value - start) + 0.5:
        length = max(length, 1.5 * speed)
    return LateralProfile(name, (s, s + length), (start, value), slope, side)


def passing(
    name: str,
    value: float,
    obstacle: tuple[float, float],
    s: float,
    start: float,
    slope: float,
    speed: float,
    lateral_acceleration: float,
    side: int,
    *,
    stands: bool = False,
) -> LateralProfile | None:
    """Return the motion to an offset before `obstacle` (start and end along the line) and back to 0 behind it.

    The result is None if the obstacle is too near for it. A vehicle at the offset, or farther aside, may be beside an
    obstacle that `stands`: it needs no motion before it.
    """
    begin, end = obstacle
    length = change_length(value - start, speed, lateral_acceleration)
    if stands and side * (value - start) <= AT_OFFSET:
        begin = max(begin, s + length)
    first = max(begin - length, s)
    if begin - first < TIGHTEST * change_length(value - start, speed, TIGHTER * lateral_acceleration):
        return None
    places, values = [s], [start]
    if first > s + 0.5 and abs(start) < 0.3:
        places.append(first)
        values.append(start)
    back = change_length(value, speed, lateral_acceleration)
    places += [max(begin, places[-1] + 1.0)]
    places += [max(end, places[-1] + 0.5)]
    places += [places[-1] + back]
    return LateralProfile(name, tuple(places), (*values, value, value, 0.0), slope, side)

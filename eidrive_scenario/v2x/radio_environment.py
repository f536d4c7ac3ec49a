"""Antenna positions and lines of sight: the data that a channel receives from the world."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.v2x.messages.message import LineOfSight

LOS, NLOSV, NLOS = range(3)
"""Codes of line-of-sight states in arrays."""

STATES: tuple[LineOfSight, ...] = ("los", "nlosv", "nlos")
"""Names of line-of-sight states, by code."""


class LineOfSightStates(NamedTuple):
    """Result of M rays between antennas.

    states    (M,) LOS, NLOSV or NLOS
    heights   (M,) top of the highest blocking vehicle above the ground [m]; minus infinity without one
    blockers  names of the blocking bodies in order from the first antenna, by index of the ray; without open rays
    """

    states: Integers
    heights: Array
    blockers: Mapping[int, tuple[str, ...]]


LineOfSightQuery = Callable[[Sequence[tuple[str, str]]], LineOfSightStates]
"""Query of the current lines of sight between pairs of stations."""


@dataclass(frozen=True)
class RadioEnvironment:
    """Antenna positions by station in the world frame [m]; `sight` is None without a query for lines of sight.

    grounds  height of the ground below antennas in the world frame [m]; 0 for other stations
    """

    places: Mapping[str, tuple[float, float, float]]
    sight: LineOfSightQuery | None = None
    grounds: Mapping[str, float] = field(default_factory=dict)

    def distance(self, first: str, second: str) -> float | None:
        """Return the distance between two antennas [m]; None if one is absent."""
        a, b = self.places.get(first), self.places.get(second)
        return None if a is None or b is None else math.dist(a, b)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names in alphabetical order, which makes sums over stations independent of the order of entry."""
        return tuple(sorted(self.places))

    @cached_property
    def positions(self) -> Array:
        """Antenna positions (N, 3) in the order of `names` [m]."""
        return np.array([self.places[name] for name in self.names], dtype=float).reshape(-1, 3)

    @cached_property
    def heights(self) -> Array:
        """Heights of the antennas above the ground (N,) in the order of `names` [m]."""
        return np.array([self.places[name][2] - self.grounds.get(name, 0.0) for name in self.names], dtype=float)


EMPTY_RADIO_ENVIRONMENT = RadioEnvironment({})
"""Environment without antennas, before the first update."""

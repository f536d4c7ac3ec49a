"""Where the antennas are, and what stands between them: all that a channel is told about the world."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.v2x.messages.message import LineOfSight

LOS, NLOSV, NLOS = range(3)
"""Codes of the states of a line of sight in arrays."""

STATES: tuple[LineOfSight, ...] = ("los", "nlosv", "nlos")
"""Their names, by code."""


class LineOfSightStates(NamedTuple):
    """What M rays from antenna to antenna met.

    states    (M,) LOS, NLOSV or NLOS
    heights   (M,) top of the highest vehicle in between, in the world frame [m]; minus infinity where there is none
    blockers  by place of the ray: names of the bodies in between, from the first antenna on; open rays are not there
    """

    states: Integers
    heights: Array
    blockers: Mapping[int, tuple[str, ...]]


LineOfSightQuery = Callable[[Sequence[tuple[str, str]]], LineOfSightStates]
"""Asks for the lines of sight between pairs of stations, now."""


@dataclass(frozen=True)
class RadioEnvironment:
    """Antennas by the name of their station, in the world frame [m]; `sight` is None where nobody can look."""

    places: Mapping[str, tuple[float, float, float]]
    sight: LineOfSightQuery | None = None

    def distance(self, first: str, second: str) -> float | None:
        """Between two antennas [m]; None if one of them is nowhere."""
        a, b = self.places.get(first), self.places.get(second)
        return None if a is None or b is None else math.dist(a, b)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """In alphabetical order, so that no sum over stations depends on the order in which they joined."""
        return tuple(sorted(self.places))

    @cached_property
    def positions(self) -> Array:
        """(N, 3) in the order of `names` [m]."""
        return np.array([self.places[name] for name in self.names], dtype=float).reshape(-1, 3)


EMPTY_RADIO_ENVIRONMENT = RadioEnvironment({})
"""Before anybody said where the antennas are."""

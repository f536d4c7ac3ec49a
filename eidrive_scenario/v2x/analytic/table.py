"""What an analytic model says: how often a packet is lost for each cause, by distance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eidrive_scenario.arrays import Array


@dataclass(frozen=True)
class ErrorTable:
    """Causes stand in the order in which they strike: who is lost for one is not lost for a later one.

    distance  (D,) between the antennas, rising [m]
    given     cause to (D,) probability of it where no earlier cause struck
    channel_busy_ratio  channel busy ratio, in [0, 1]
    """

    distance: Array
    given: Mapping[str, Array]
    channel_busy_ratio: float

    @cached_property
    def errors(self) -> Mapping[str, Array]:
        """Cause to (D,) probability that a packet is lost for it."""
        left = np.ones_like(self.distance)
        found = {}
        for cause, probability in self.given.items():
            found[cause] = left * probability
            left = left - found[cause]
        return found

    @cached_property
    def delivery_ratio(self) -> Array:
        """(D,) packet delivery ratio."""
        ratio: Array = 1.0 - np.sum(list(self.errors.values()), axis=0)
        return ratio

    def cause(self, distance: float, draw: float) -> str | None:
        """Why a packet over this distance [m] is lost, by a number in (0, 1); None if it is not.

        Beyond the table its last entry holds.
        """
        reached = 0.0
        for cause, probability in self.errors.items():
            reached += float(np.interp(distance, self.distance, probability))
            if draw < reached:
                return cause
        return None

"""Result of an analytic model: error probability of each cause of loss, by distance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eidrive_scenario.arrays import Array


@dataclass(frozen=True)
class ErrorTable:
    """Error probabilities by distance. Causes are exclusive and ordered: a packet is lost for the first that applies.

    distance  (D,) distance between the antennas, ascending [m]
    given     by cause: conditional probability (D,), given that no earlier cause applies
    channel_busy_ratio  in [0, 1]
    """

    distance: Array
    given: Mapping[str, Array]
    channel_busy_ratio: float

    @cached_property
    def errors(self) -> Mapping[str, Array]:
        """Error probability (D,) by cause."""
        left = np.ones_like(self.distance)
        found = {}
        for cause, probability in self.given.items():
            found[cause] = left * probability
            left = left - found[cause]
        return found

    @cached_property
    def delivery_ratio(self) -> Array:
        """Packet delivery ratio (D,)."""
        ratio: Array = 1.0 - np.sum(list(self.errors.values()), axis=0)
        return ratio

    def cause(self, distance: float, draw: float) -> str | None:
        """Return the cause of loss of a packet over this distance [m]; None if it is delivered.

        `draw` is a uniform number in (0, 1). The last entry of the table applies beyond its end.
        """
        reached = 0.0
        for cause, probability in self.errors.items():
            reached += float(np.interp(distance, self.distance, probability))
            if draw < reached:
                return cause
        return None

"""MOBIL: minimizing overall braking induced by lane changes.

Kesting, Treiber and Helbing, General lane-changing model MOBIL for car-following models, Transportation Research Record
1999 (2007) 86.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array


@dataclass(frozen=True)
class LaneChanger:
    """Parameters of the model with the values of the paper. Its symmetric rule has no bias.

    politeness         p, weight of the disadvantage of others, from 0 (egoistic) to 1 (altruistic)
    threshold          Δa_th, minimum advantage of a lane change [m/s²]
    safe_deceleration  b_safe, maximum deceleration of the new follower [m/s²]
    bias               Δa_bias, in favor of the lane on the side of slow traffic [m/s²]
    """

    politeness: float = 0.5
    threshold: float = 0.1
    safe_deceleration: float = 4.0
    bias: float = 0.0


@dataclass(frozen=True)
class Prospect:
    """Accelerations (N,) before and after a lane change [m/s²] of the car, its new and its old follower."""

    own: Array
    own_after: Array
    new_follower: Array
    new_follower_after: Array
    old_follower: Array
    old_follower_after: Array


def safe(changer: LaneChanger, prospect: Prospect) -> NDArray[np.bool_]:
    """Return the safety criterion (equation 1): neither the new follower nor the car has to brake too hard."""
    hardest = np.minimum(prospect.new_follower_after, prospect.own_after)
    return np.asarray(hardest >= -changer.safe_deceleration)


def incentive(changer: LaneChanger, prospect: Prospect, to_slow_side: bool) -> Array:
    """Return the incentive minus the threshold (equations 2 and 6) [m/s²]. A positive value favors the change."""
    gain = prospect.own_after - prospect.own
    others = prospect.new_follower_after - prospect.new_follower + prospect.old_follower_after - prospect.old_follower
    bias = changer.bias if to_slow_side else -changer.bias
    return np.asarray(gain + changer.politeness * others - changer.threshold + bias)

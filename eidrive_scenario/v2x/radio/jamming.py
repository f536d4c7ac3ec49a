"""Jammers: transmitters of noise in the whole channel, which disturb reception and block carrier sensing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.extensions.settings import Settings
from eidrive_scenario.v2x.propagation import LinkGeometry, PathLoss

ENERGY_DETECTION_DBM = -65.0
"""Power of any signal from which a station senses a busy channel of 10 MHz [dBm] (IEEE 802.11-2012, 18.3.10.6)."""

Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]


class Jammer(Settings):
    """Continuous noise in the 10 MHz of the channel, from a fixed place.

    x, y, z    place of its antenna in the world frame [m]
    power_dbm  radiated power with the gain of its antenna (EIRP) [dBm]
    """

    x: Coordinate
    y: Coordinate
    z: Annotated[float, Field(ge=0.0, le=1000.0)] = 1.5
    power_dbm: Annotated[float, Field(ge=-30.0, le=80.0)] = 30.0


def jamming_power(
    jammers: Sequence[Jammer], path_loss: PathLoss, positions: Array, *, frequency_ghz: float, gain_dbi: float
) -> Array:
    """Return the power (N,) [mW] that antennas at `positions` (N, 3) receive from all jammers, in line of sight."""
    total = np.zeros(len(positions))
    for jammer in jammers:
        antenna = np.array([jammer.x, jammer.y, jammer.z])
        heights, distance = positions[:, 2], np.linalg.norm(positions - antenna, axis=1)
        between = LinkGeometry.in_sight(distance, np.minimum(heights, jammer.z), np.maximum(heights, jammer.z))
        loss = path_loss.loss(between, frequency_ghz, np.full(len(positions), 0.5))
        total += 10.0 ** ((jammer.power_dbm + gain_dbi - loss) / 10.0)
    return total

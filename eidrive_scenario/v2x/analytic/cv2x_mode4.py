"""Analytic model of C-V2X Mode 4 (LTE-V2X sidelink, autonomous resource selection) for many vehicles on a road.

The road is straight.

M. Gonzalez-Martín, M. Sepulcre, R. Molina-Masegosa, J. Gozalvez: Analytical Models of the Performance of C-V2X Mode 4
Vehicular Communications, IEEE Transactions on Vehicular Technology 68(2), 2019, arXiv:1807.06508. Numbers in brackets
are those of its equations.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.v2x.analytic.table import RATIOS, STEP, ErrorTable, Road, autocorrelation, interference
from eidrive_scenario.v2x.standards import ANTENNA_HEIGHT, CANDIDATE_SHARE, NOISE_DBM, RESOURCE_BLOCKS, SENSING_DBM

FREQUENCY = 5.91
"""Carrier frequency [GHz]."""
ENVIRONMENT = 0.0
"""Height of the environment, which the path loss subtracts from the antenna heights [m]."""
SENSING = SENSING_DBM["cv2x_mode4"]
"""Sensing threshold [dBm]."""
NO_INTERFERENCE = -180.0
"""Power of an absent interferer [dBm]."""

_TAIL = (20.0, 20.0 + 1e-6)
CODINGS = {
    4: (10, (0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, *_TAIL),
        (1.0, 0.9, 0.7, 0.4, 0.13, 0.045, 0.017, 0.007, 1e-3, 1e-3, 1e-3, 1e-4)),
    2: (12, (-2.0, 0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, *_TAIL),
        (1.0, 0.9, 0.7, 0.3, 0.09, 0.02, 0.002, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-4)),
}  # fmt: skip
"""By number of subchannels: resource blocks of 190 bytes, SINR [dB], and block error rate at each SINR.

Source: 3GPP R1-160284, QPSK with r = 0.7 or 0.5, 280 km/h.
"""

MESSAGE = 190
"""Message size of the published block error rates [bytes]."""


def cv2x_mode4_errors(
    distance: Array,
    *,
    density: float,
    rate: float,
    power: float = 20.0,
    subchannels: int = 4,
    environment_height: float = ENVIRONMENT,
) -> ErrorTable:
    """Return the error probabilities over `distance` (D,) [m]: half_duplex, sensing, propagation, collision.

    Packets have 190 bytes.

    density  vehicles per meter;  rate  packets per second and vehicle;  power  [dBm];  subchannels  4 or 2
    """
    road = Road(density, power, SENSING, FREQUENCY, ANTENNA_HEIGHT - environment_height)
    blocks, ratios, block_errors = CODINGS[subchannels]
    noise = NOISE_DBM - 10.0 * np.log10(RESOURCE_BLOCKS / blocks)
    curve = np.interp(RATIOS, ratios, block_errors)
    errors = road.errors(distance, curve)
    propagation = errors @ interference(np.array([NO_INTERFERENCE]), noise)[0]  # (13)
    not_sensed = 1.0 - road.sensed(distance)  # (10)
    _, to_sender, destroys = road.interferers(distance, errors, noise, propagation)  # (17), (18)

    resources = subchannels * 1000.0 / rate  # (28)
    in_reach = density * float(road.sensed_around.sum())  # (11), (29.1)
    overlap = autocorrelation(road.sensed_around)  # (30.2)

    def collides(excluded: float, sensing: Road) -> Array:
        """Return the probability of a collision: an interferer on the same resource destroys the packet.

        Equations (14), (15), (23) to (27), (30).
        """
        apart = excluded**2 / resources
        common = overlap / overlap[0] * (density * excluded * overlap[0] / in_reach - apart) + apart
        candidates = CANDIDATE_SHARE * resources
        both = (resources - 2.0 * excluded + common) * (candidates / (resources - excluded)) ** 2
        unaware = 1.0 - (1.0 - 1.0 / rate) * sensing.sensed(to_sender)
        chosen = unaware * both[np.floor(to_sender + 0.5).astype(np.int64)] / candidates**2
        lost: Array = 1.0 - np.prod(1.0 - chosen * destroys, axis=1)
        return lost

    excluded = _count_excluded(in_reach, resources)
    channel_busy_ratio = excluded / resources  # (34)
    weight = float(np.clip(2.0 * channel_busy_ratio - 0.4, 0.0, 1.0))  # (22)
    collision = weight * collides(excluded, road)
    if weight < 1.0:
        raised, excluded = _raise_threshold(road, resources)
        collision = collision + (1.0 - weight) * collides(excluded, raised)  # (21)
    given = {
        "half_duplex": np.full_like(distance, rate / 1000.0),  # (7)
        "sensing": not_sensed,
        "propagation": propagation,
        "collision": collision,
    }
    return ErrorTable(distance, given, channel_busy_ratio)


def _count_excluded(in_reach: float, resources: float) -> float:
    """Return the number of resources that sensing excludes with `in_reach` vehicles in reach (29), (33)."""
    half = in_reach / 2.0
    shared = np.maximum(1.0 - np.arange(1.0, half + 1e-9) / (resources - half), 0.0)
    return half + float(shared.sum())


def _raise_threshold(road: Road, resources: float) -> tuple[Road, float]:
    """Raise the threshold until enough candidates remain (step 3); return it and the excluded resources (32)."""
    while True:
        in_reach = 2.0 * road.density * float(road.sensed_around.sum())
        excluded = _count_excluded(in_reach, resources)
        if resources - excluded >= CANDIDATE_SHARE * resources:
            return road, excluded
        road = replace(road, sensing=road.sensing + STEP)

"""Analytic model of IEEE 802.11p for many vehicles on a straight road.

M. Sepulcre, M. Gonzalez-Martín, J. Gozalvez, R. Molina-Masegosa, B. Coll-Perales: Analytical Models of the Performance
of IEEE 802.11p Vehicle to Vehicle Communications, IEEE Transactions on Vehicular Technology 2021, arXiv:2104.07923.
Numbers in brackets are those of its equations.
"""

from __future__ import annotations

import numpy as np

from eidrive_scenario.base.arrays import Array
from eidrive_scenario.v2x.analytic.table import LEVELS, RATIOS, STEP, ErrorTable, Road, autocorrelation
from eidrive_scenario.v2x.standards import ANTENNA_HEIGHT, NOISE_DBM, PREAMBLE, SENSING_DBM, SLOT

FREQUENCY = 5.89
"""Carrier frequency [GHz]."""
ENVIRONMENT = 0.5
"""Height of the environment, which the path loss subtracts from the antenna heights [m]."""
SENSING = SENSING_DBM["80211p"]
"""Sensing threshold [dBm]."""
HEADERS = 30
"""Size of the lower-layer headers [bytes]."""
BANDWIDTH = 10e6
"""Channel bandwidth [Hz]."""

FRAME_ERRORS = ((5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0), (1.0, 0.4, 0.015, 0.004, 0.003, 0.002, 0.001))
"""Frame error rate by Eb/N0 [dB]: O. Goubet et al., IEEE Transactions on Vehicular Technology 64(9), 2015, fig. 14."""
FIT = (-0.2481, 0.913, 0.003844)
"""Polynomial from the offered load to the channel busy ratio (35)."""
FULL = -FIT[1] / (2.0 * FIT[0])
"""Maximum offered load of the fit, 1.84: the polynomial decreases above it."""


def airtime(size: int, bit_rate: float) -> float:
    """Return the duration of a packet of `size` bytes at `bit_rate` [bit/s] in seconds."""
    return PREAMBLE + (size + HEADERS) * 8.0 / bit_rate


def ieee80211p_errors(
    distance: Array,
    *,
    density: float,
    rate: float,
    size: int,
    power: float = 23.0,
    bit_rate: float = 6e6,
    environment_height: float = ENVIRONMENT,
) -> ErrorTable:
    """Return the error probabilities over `distance` (D,) [m]: sensing, busy, propagation, collision.

    density  vehicles per meter;  rate  packets per second and vehicle;  size  [bytes];  power  [dBm]
    """
    height = ANTENNA_HEIGHT - environment_height
    road = Road(density, power, SENSING, FREQUENCY, height)
    duration = airtime(size, bit_rate)
    unsaturated = offered_load(density, rate, size, power, bit_rate, height)
    square, linear, constant = FIT
    channel_busy_ratio = square * unsaturated**2 + linear * unsaturated + constant  # (35)
    overlap = autocorrelation(road.sensed_around)  # (13)
    overlap /= overlap.max()  # (20)

    curve = np.interp(RATIOS + 10.0 * np.log10(BANDWIDTH / bit_rate), *FRAME_ERRORS)
    not_sensed = 1.0 - road.sensed(distance)  # (12)
    errors = road.errors(distance, curve)
    propagation = errors[:, round((NOISE_DBM - LEVELS[0]) / STEP)]  # (24)

    to_receiver, to_sender, destroys = road.interferers(distance, errors, NOISE_DBM, propagation)  # (30), (31)
    closer = np.abs(to_receiver) < np.abs(distance)[:, None]
    at_receiver, senses = road.sensed(to_receiver), road.sensed(to_sender)
    share = rate / (1.0 - channel_busy_ratio * overlap[np.floor(to_sender + 0.5).astype(np.int64)])
    same_slot = SLOT * share * senses  # (22)
    hidden = duration * share * (1.0 - senses)  # (18)
    busy = _any(np.where(closer, same_slot * at_receiver, 0.0) + hidden * at_receiver)  # (14), (16), (21)
    collision = _any(
        np.where(closer, 0.0, destroys * same_slot) + destroys * hidden * (2.0 - at_receiver)
    )  # (26), (28), (32)
    given = {"sensing": not_sensed, "busy": busy, "propagation": propagation, "collision": collision}
    return ErrorTable(distance, given, channel_busy_ratio)


def offered_load(density: float, rate: float, size: int, power: float, bit_rate: float, height: float) -> float:
    """Return the channel busy ratio without overlap of transmissions (34); `height` is the antenna height [m]."""
    road = Road(density, power, SENSING, FREQUENCY, height)
    return density * rate * airtime(size, bit_rate) * float(road.sensed_around.sum())


def _any(probability: Array) -> Array:
    """Return the probability that at least one of the independent events along the last axis occurs."""
    happens: Array = 1.0 - np.prod(1.0 - np.clip(probability, 0.0, 1.0), axis=-1)
    return happens

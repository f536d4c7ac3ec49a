"""Published path loss formulas for two antennas. Arguments are arrays or numbers; results are in decibels."""

from __future__ import annotations

import numpy as np

from eidrive_scenario.arrays import Array

Values = Array | float

SPEED_OF_LIGHT = 3e8
"""Speed of light, rounded as in the published models [m/s]."""

NEAREST = 3.0
"""Minimum distance of the WINNER+ formulas [m]; the loss is constant below it (TR 36.885, A.1.4)."""


def highway_los(distance: Values, frequency_ghz: float) -> Array:
    """Return the LOS path loss on highways [dB] over a distance [m] (3GPP TR 37.885, table 6.2.1-1)."""
    loss: Array = 32.4 + 20.0 * np.log10(distance) + 20.0 * np.log10(frequency_ghz)
    return loss


def urban_los(distance: Values, frequency_ghz: float) -> Array:
    """Return the LOS path loss in urban streets [dB] over a distance [m] (3GPP TR 37.885, table 6.2.1-1)."""
    loss: Array = 38.77 + 16.7 * np.log10(distance) + 18.2 * np.log10(frequency_ghz)
    return loss


def building_nlos(distance: Values, frequency_ghz: float) -> Array:
    """Return the NLOS path loss behind buildings [dB] over a distance [m] (3GPP TR 37.885, table 6.2.1-1)."""
    loss: Array = 36.85 + 30.0 * np.log10(distance) + 18.9 * np.log10(frequency_ghz)
    return loss


def blockage_moments(distance: Values, lower: Values, upper: Values, blocker: Values) -> tuple[Array, Array]:
    """Return mean and standard deviation of the additional loss by blocking vehicles [dB] (3GPP TR 37.885, 6.2.1).

    lower, upper  heights of the lower and the higher antenna; blocker  top of the highest blocking vehicle [m]
    """
    far = np.maximum(0.0, 15.0 * np.log10(distance) - 41.0)
    mean = np.where(upper < blocker, 9.0 + far, 5.0 + far)
    spread = np.where(upper < blocker, 4.5, 4.0)
    over = lower > blocker
    return np.where(over, 0.0, mean), np.where(over, 0.0, spread)


def winner_b1(distance: Values, frequency_ghz: float, first: float, second: float) -> Array:
    """Return the LOS path loss of WINNER+ B1 [dB] over a distance [m], as adopted in 3GPP TR 36.885, A.1.4.

    `first` and `second` are the effective antenna heights: height above ground minus environment height [m]. Published
    implementations differ in the environment height (1.0, 0.5 or 0 m). It shifts the break point and changes the loss
    at 200 m by 16 dB.
    """
    distance = np.maximum(np.abs(distance), NEAREST)
    break_point = 4.0 * first * second * frequency_ghz * 1e9 / SPEED_OF_LIGHT
    decades = np.log10(distance)
    near = 22.7 * decades + 27.0 + 20.0 * np.log10(frequency_ghz)
    heights = 17.3 * np.log10(first) + 17.3 * np.log10(second)
    far = 40.0 * decades + 7.56 - heights + 2.7 * np.log10(frequency_ghz)
    free_space = 20.0 * decades + 46.4 + 20.0 * np.log10(frequency_ghz / 5.0)
    loss: Array = np.maximum(np.where(distance < break_point, near, far), free_space)
    return loss


def free_space(distance: Values, frequency_ghz: float) -> Array:
    """Return the free-space path loss (Friis) [dB] over a distance [m]: 20 lg(4 pi d f / c)."""
    loss: Array = 20.0 * np.log10(4.0 * np.pi * distance * frequency_ghz * 1e9 / SPEED_OF_LIGHT)
    return loss


def log_distance(distance: Values, exponent: float, reference: float, reference_loss: Values) -> Array:
    """Return the log-distance path loss [dB] over a distance [m].

    The loss is `reference_loss` [dB] up to `reference` [m] and rises by 10 `exponent` dB per decade beyond.
    """
    loss: Array = reference_loss + 10.0 * exponent * np.log10(np.maximum(distance, reference) / reference)
    return loss


def probability_of_los(distance: Values, environment: str) -> Array:
    """Return the probability of LOS between two cars of random traffic (3GPP TR 37.885, table 6.2-1).

    environment  `highway` or `urban`
    """
    if environment == "urban":
        return np.minimum(1.0, 1.05 * np.exp(-0.0114 * distance))
    near = np.minimum(1.0, 2.1013e-6 * distance**2 - 0.002 * distance + 1.0193)
    return np.where(distance <= 475.0, near, np.maximum(0.0, 0.54 - 0.001 * (distance - 475.0)))

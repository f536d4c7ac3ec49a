"""Ellipse of the uncertainty of a position."""

from __future__ import annotations

import math

import numpy as np

from eidrive_scenario.arrays import Array

COVERED = math.sqrt(-2.0 * math.log(0.05))
"""Semi-axes of the ellipse that contains 95 % of a normal distribution in the plane, in standard deviations."""


def ellipse_of_95_percent(covariance: Array) -> tuple[float, float, float] | None:
    """Return the semi-axes [m] and the direction of the longer one [rad] of the ellipse that contains 95 %.

    covariance  (2, 2) of the position [m²]; None if it is unknown or no covariance
    """
    if not np.isfinite(covariance).all():
        return None
    (xx, xy), (_, yy) = covariance.tolist()
    middle, spread = (xx + yy) / 2.0, math.hypot((xx - yy) / 2.0, xy)
    if middle - spread < 0.0:
        return None
    long, short = COVERED * math.sqrt(middle + spread), COVERED * math.sqrt(middle - spread)
    return long, short, math.atan2(2.0 * xy, xx - yy) / 2.0

"""Tolerances of comparisons that several packages share."""

from __future__ import annotations

TIME_TOLERANCE = 1e-9
"""Maximum difference of two instants that count as equal [s]: sums of time steps are not exact in floating point."""
EPSILON = 1e-6
"""Maximum difference of two quantities in SI units that a Rule, an action or a trigger treats as equal."""

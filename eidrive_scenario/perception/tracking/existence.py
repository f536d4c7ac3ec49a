"""Probability of existence of an object: a Bernoulli filter, shared by tracking and fusion.

The recursions are those of the integrated probabilistic data association filter (Musicki, Evans and Stankovic,
Integrated probabilistic data association, IEEE Transactions on Automatic Control 39(6), 1994), for one detection that
is assigned beforehand. r is the probability of existence, p that of a detection if the object exists:

    prediction     r' = r exp(-T / lifetime)
    no detection   r' = r (1 - p) / (1 - r p)
    a detection    r' = r L / (1 - r + r L),  L = 1 - p + p g / c
    birth          r  = s

g is the density of the innovation [1/m²], c that of false detections [1/m² per scan], and s the confidence of the
detector, taken as the probability that an unassigned detection is an object. A new object appears with density b [1/m²
per scan], so s / (1 - s) = p b / c, and L = 1 - p + (g / b) s / (1 - s).
"""

from __future__ import annotations

import math

import numpy as np

from eidrive_scenario.arrays import Array

DETECTION_PROBABILITY = 0.9
"""Default probability that an object in full view is detected. The networks detect 89 % of the vehicles that are not
low in the image, dark, occluded or cut off (docs/perception.md)."""
BIRTH_DENSITY = 0.01
"""Default density of new objects [1/m² per scan]: one in the area of about two parked cars in ten scans. Small values
give a second detection nearby a high weight; the density of a detection that is exact to 1 m is 0.16 / m²."""
LIFETIME = 10.0
"""Default mean time that an object remains [s]: a survival probability of 0.99 per scan of 0.1 s, in the usual range of
0.98 to 0.999."""
LEAST, MOST = 1e-4, 1.0 - 1e-4
"""Minimum and maximum confidence that a single detection contributes."""


def survived(existence: Array, step: float | Array, lifetime: float = LIFETIME) -> Array:
    """Return the probabilities (N,) after `step` [s] without a scan."""
    return np.asarray(existence * np.exp(-np.abs(step) / lifetime))


def missed(existence: Array, detection: float | Array = DETECTION_PROBABILITY) -> Array:
    """Return the probabilities (N,) after a scan without detection, for these detection probabilities."""
    return np.asarray(existence * (1.0 - detection) / np.maximum(1.0 - existence * detection, 1e-12))


def detected(existence: Array, ratio: Array) -> Array:
    """Return the probabilities (N,) after detections with these likelihood ratios."""
    return np.asarray(existence * ratio / (1.0 - existence + existence * ratio))


def likelihood_ratio(
    squared: Array,
    determinant: Array,
    confidence: Array,
    detection: float = DETECTION_PROBABILITY,
    birth: float = BIRTH_DENSITY,
) -> Array:
    """Return the likelihood ratios L (N,) of two-dimensional detections.

    squared      (N,) squared Mahalanobis distances of the innovations;  determinant  (N,) of their covariances [m⁴]
    confidence   (N,) of the detector
    """
    sure = np.minimum(np.maximum(confidence, LEAST), MOST)
    density = np.exp(-0.5 * squared) / (2.0 * math.pi * np.sqrt(determinant))
    return np.asarray(1.0 - detection + density / birth * sure / (1.0 - sure))

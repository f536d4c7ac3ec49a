"""Noise tables for the spatial variation of surfaces."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from eidrive_scenario.arrays import Floats
from eidrive_scenario.randomness import generator

SIZE = 512


def _blurred(draws: Floats, deviation: float) -> Floats:
    """Return a periodic table (SIZE, SIZE) blurred by a Gaussian of this deviation without a seam."""

    import cv2

    margin = int(np.ceil(4.5 * deviation)) + 1
    blurred = np.asarray(cv2.GaussianBlur(np.pad(draws, margin, mode="wrap"), (0, 0), deviation), dtype=np.float32)
    return blurred[margin:-margin, margin:-margin]


@lru_cache(maxsize=1)
def patches() -> Floats:
    """Return smooth periodic noise (SIZE, SIZE) of mean 0 and deviation 1 without a seam."""
    draws = generator(0, "surfaces").standard_normal((SIZE, SIZE), dtype=np.float32)
    total = np.zeros((SIZE, SIZE), dtype=np.float32)
    for width, weight in ((3, 0.5), (9, 1.0), (27, 1.6)):
        layer = _blurred(draws, width / 2.0)
        total += weight * layer / layer.std()
    found: Floats = (total / total.std()).astype(np.float32)
    return found


@lru_cache(maxsize=1)
def grit() -> Floats:
    """Return uncorrelated noise (SIZE, SIZE) of mean 0 and deviation 1."""
    draws = generator(0, "grit").standard_normal((SIZE, SIZE), dtype=np.float32)
    layer = _blurred(draws, 0.7)
    found: Floats = (layer / layer.std()).astype(np.float32)
    return found


@lru_cache(maxsize=1)
def hollows() -> Floats:
    """Return smooth noise (SIZE, SIZE) of mean 0 and deviation 1 with larger structures than `patches`."""
    draws = generator(0, "hollows").standard_normal((SIZE, SIZE), dtype=np.float32)
    total = np.zeros((SIZE, SIZE), dtype=np.float32)
    for width, weight in ((8.0, 0.35), (22.0, 1.0)):
        layer = _blurred(draws, width)
        total += weight * layer / layer.std()
    found: Floats = (total / total.std()).astype(np.float32)
    return found


def variation(x: Floats, y: Floats, distance: Floats) -> Floats:
    """Return the relative variation of a surface at world positions [m], about ±1: grit near the camera, patches
    everywhere.
    """
    found: Floats = _looked_up(patches(), x, y, 4.0)
    found *= np.float32(0.35)
    fine = _looked_up(grit(), x, y, 24.0)
    fine *= np.float32(4.0) / (np.float32(6.0) + distance)
    found += fine
    return found


def _looked_up(table: Floats, x: Floats, y: Floats, per_meter: float) -> Floats:
    """Return the values of a periodic table at positions [m]."""
    mask = np.int32(SIZE - 1)
    at = (y * np.float32(per_meter)).astype(np.int32)
    at &= mask
    at *= np.int32(SIZE)
    at += (x * np.float32(per_meter)).astype(np.int32) & mask
    return table.ravel().take(at)

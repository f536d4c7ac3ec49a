"""Noise tables by which surfaces vary from place to place."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.randomness import generator

Floats = NDArray[np.float32]

SIZE = 512


@lru_cache(maxsize=1)
def patches() -> Floats:
    """(SIZE, SIZE) smooth noise of mean 0 and deviation 1 that repeats without a seam."""
    draws = generator(0, "surfaces").standard_normal((SIZE, SIZE), dtype=np.float32)
    total = np.zeros((SIZE, SIZE), dtype=np.float32)
    for width, weight in ((3, 0.5), (9, 1.0), (27, 1.6)):
        tiled = np.tile(draws, (3, 3))
        layer = np.asarray(cv2.GaussianBlur(tiled, (0, 0), width / 2.0))[SIZE : 2 * SIZE, SIZE : 2 * SIZE]
        total += weight * layer / layer.std()
    found: Floats = (total / total.std()).astype(np.float32)
    return found


@lru_cache(maxsize=1)
def grit() -> Floats:
    """(SIZE, SIZE) noise of mean 0 and deviation 1 from one place to the next."""
    draws = generator(0, "grit").standard_normal((SIZE, SIZE), dtype=np.float32)
    layer = np.asarray(cv2.GaussianBlur(np.tile(draws, (3, 3)), (0, 0), 0.7))[SIZE : 2 * SIZE, SIZE : 2 * SIZE]
    found: Floats = (layer / layer.std()).astype(np.float32)
    return found


@lru_cache(maxsize=1)
def hollows() -> Floats:
    """(SIZE, SIZE) smooth noise of mean 0 and deviation 1, of greater extent than `patches`."""
    draws = generator(0, "hollows").standard_normal((SIZE, SIZE), dtype=np.float32)
    total = np.zeros((SIZE, SIZE), dtype=np.float32)
    for width, weight in ((8.0, 0.35), (22.0, 1.0)):
        layer = np.asarray(cv2.GaussianBlur(np.tile(draws, (3, 3)), (0, 0), width))[SIZE : 2 * SIZE, SIZE : 2 * SIZE]
        total += weight * layer / layer.std()
    found: Floats = (total / total.std()).astype(np.float32)
    return found


def variation(x: Floats, y: Floats, distance: Floats) -> Floats:
    """How much lighter or darker a surface is at places in the world [m], about ±1: fine grit near the camera, patches
    everywhere."""
    mask = SIZE - 1
    coarse = patches()[(y * 4.0).astype(np.int64) & mask, (x * 4.0).astype(np.int64) & mask]
    fine = grit()[(y * 24.0).astype(np.int64) & mask, (x * 24.0).astype(np.int64) & mask]
    found: Floats = np.float32(0.35) * coarse + fine * (np.float32(4.0) / (np.float32(6.0) + distance))
    return found

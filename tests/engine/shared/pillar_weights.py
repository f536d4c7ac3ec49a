"""Weights of the network `pillars` for tests: random ones, and ones that detect a car in each occupied cell."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

CLASSES = ("car", "van", "truck", "bus", "motorbike", "bicycle", "pedestrian")
SHAPES: Mapping[str, tuple[int, ...]] = {
    "block0.0": (32, 12, 3, 3),
    "block0.1": (32, 32, 3, 3),
    "block1.0": (48, 32, 3, 3),
    "block1.1": (48, 48, 3, 3),
    "block1.2": (48, 48, 3, 3),
    "block2.0": (128, 48, 3, 3),
    "block2.1": (128, 128, 3, 3),
    "block2.2": (128, 128, 3, 3),
    "block2.3": (128, 128, 3, 3),
    "block2.4": (128, 128, 3, 3),
    "up0": (32, 32, 1, 1),
    "up1": (48, 32, 2, 2),
    "up2": (128, 32, 4, 4),
    "compress": (8, 96, 1, 1),
    "expand": (96, 8, 1, 1),
    "head": (20, 96, 1, 1),
}
"""Shapes of the weights; transposed convolutions have the inputs first."""
Arrays = dict[str, Any]


def random_arrays() -> Arrays:
    """Return weights that keep the variance of activations, few cells of which are objects."""
    rng = np.random.default_rng(1)
    arrays: Arrays = {}
    for name, shape in SHAPES.items():
        is_transposed = name in ("up1", "up2")
        deviation = math.sqrt(2.0 / (shape[0] if is_transposed else np.prod(shape[1:])))
        arrays[f"{name}.weight"] = rng.normal(0.0, deviation, shape).astype(np.float32)
        arrays[f"{name}.bias"] = rng.normal(0.0, 0.1, shape[1 if is_transposed else 0]).astype(np.float32)
    arrays["head.weight"] *= np.float32(0.5)
    arrays["head.bias"][: len(CLASSES)] -= np.float32(1.5)
    arrays["codebook"] = rng.normal(0.0, 1.0, (256, 8)).astype(np.float32)
    arrays["latent_scale"] = np.float32(0.05)
    return arrays


def plain_arrays(displacement: tuple[float, float] = (0.0, 0.0)) -> Arrays:
    """Return weights by which each 0.8 m cell with points of objects is a car of 4 m, 2 m and 1.5 m along the grid, by
    calculation.

    The score increases with the number of points. `displacement` is that of all objects during 0.2 s [m].
    """
    arrays = {name: np.zeros_like(value) for name, value in random_arrays().items()}
    # Rows 2 i and 2 i + 1 of the grid, which are row i of the features, are kernel rows 1 and 2.
    arrays["block0.0.weight"][0, 0, 1:, 1:] = 1.0
    arrays["block0.1.weight"][0, 0, 1, 1] = 1.0
    arrays["up0.weight"][0, 0, 0, 0] = 1.0
    arrays["head.weight"][0, 0, 0, 0] = 4.0
    sizes = [math.log(side) for side in (4.0, 2.0, 1.5)]
    attributes = [0.0, 0.0, 0.75, *sizes, 1.0, 0.0, 1.0, 0.0, *displacement, math.log(0.3)]
    arrays["head.bias"][:] = [-0.5] + [-9.0] * 6 + attributes
    arrays["latent_scale"] = np.float32(0.05)
    return arrays


def save(path: Path, arrays: Arrays, **description: Any) -> Path:
    """Write a file of weights; `description` replaces entries of the usual one."""
    entries = {"network": "pillars", "classes": CLASSES, "input_size": [256, 256], "confidence": 0.5} | description
    np.savez(path, **{**arrays, "description": np.array(json.dumps(entries))})
    return path

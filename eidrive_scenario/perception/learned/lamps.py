"""State of a traffic light from the image region in which the map locates it."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Floats

WEIGHTS = Path(__file__).parents[1] / "weights" / "lamps.npz"
NONE = "none"
"""Output for a region without a visible light."""
SHOWN = ("red", "redYellow", "yellow", "green", "off", NONE)
"""States that the network distinguishes, in the order of its outputs."""
CROP = (16, 32)
"""Width and height of the network input [px]."""
REGION_HEIGHT = 2.0
"""Height of the region in heights of the light; its width is half of its height."""
DARKEST = 0.05
"""Minimum brightness, as a share of white, for the normalization of a region."""


def crops(image: NDArray[np.uint8], centers: Array, heights: Array) -> Floats:
    """Return regions (N, 3, 32, 16) of an image (H, W, 3) around the centers (N, 2) of lights of these heights (N,)
    [px].

    The maximum value of each region is 1. Pixels outside the image repeat its border.
    """
    found = np.empty((len(centers), 3, CROP[1], CROP[0]), dtype=np.float32)
    for row, ((x, y), height) in enumerate(zip(centers.tolist(), heights.tolist(), strict=True)):
        high = max(REGION_HEIGHT * height, 4.0)
        region = _region(image, x - high / 4.0, y - high / 2.0, x + high / 4.0, y + high / 2.0)
        shrinks = region.shape[0] >= CROP[1] and region.shape[1] >= CROP[0]
        scaled = cv2.resize(region, CROP, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
        found[row] = scaled.transpose(2, 0, 1) / np.float32(255.0)
    brightest = found.max(axis=(1, 2, 3), keepdims=True, initial=DARKEST)
    return np.asarray(found / brightest, dtype=np.float32)


def _region(image: NDArray[np.uint8], left: float, top: float, right: float, bottom: float) -> NDArray[np.uint8]:
    """Return the pixels between these edges."""
    x0, y0 = int(np.floor(left + 0.5)), int(np.floor(top + 0.5))
    columns = np.arange(x0, max(int(np.floor(right + 0.5)), x0 + 1)).clip(0, image.shape[1] - 1)
    lines = np.arange(y0, max(int(np.floor(bottom + 0.5)), y0 + 1)).clip(0, image.shape[0] - 1)
    return np.asarray(image[lines[:, None], columns[None]])


class LampNetwork:
    """Network of three convolutions and one linear layer in numpy that classifies the state of lights.

    weights   `w0 b0 w1 b1 w2 b2`, kernels (O, I, 3, 3), and `w3` (6, 1024), `b3`, of training/train_lamps.py
    """

    def __init__(self, weights: dict[str, Floats]) -> None:
        self._weights = weights

    def probabilities(self, regions: Floats) -> Floats:
        """Return the probability (N, 6) of each state in SHOWN for regions (N, 3, 32, 16)."""
        if not len(regions):
            return np.empty((0, len(SHOWN)), dtype=np.float32)
        w = self._weights
        features = _max_pool(_convolve(regions, w["w0"], w["b0"]))
        features = _max_pool(_convolve(features, w["w1"], w["b1"]))
        features = _convolve(features, w["w2"], w["b2"])
        logits = features.reshape(len(features), -1) @ w["w3"].T + w["b3"]
        shares = np.exp(logits - logits.max(axis=1, keepdims=True))
        return np.asarray(shares / shares.sum(axis=1, keepdims=True), dtype=np.float32)


@cache
def lamp_network() -> LampNetwork:
    """Return the network with the shipped weights."""
    with np.load(WEIGHTS) as stored:
        return LampNetwork({name: stored[name].astype(np.float32) for name in stored.files})


def save(path: Path, weights: dict[str, Floats], card: dict[str, Any]) -> None:
    """Write weights in half precision, and their metadata."""
    halves: dict[str, Any] = {name: value.astype(np.float16) for name, value in weights.items()}
    np.savez_compressed(path, **halves)
    path.with_suffix(".json").write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")


def _convolve(features: Floats, kernel: Floats, bias: Floats) -> Floats:
    """Return the 3 x 3 convolution of (N, I, H, W) with zero padding, followed by a ReLU."""
    padded = np.pad(features, ((0, 0), (0, 0), (1, 1), (1, 1)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(2, 3))
    found = np.tensordot(windows, kernel, axes=((1, 4, 5), (1, 2, 3))) + bias
    return np.ascontiguousarray(np.maximum(found, 0.0).transpose(0, 3, 1, 2), dtype=np.float32)


def _max_pool(features: Floats) -> Floats:
    """Return the maximum of each 2 x 2 block."""
    count, channels, height, width = features.shape
    return np.asarray(features.reshape(count, channels, height // 2, 2, width // 2, 2).max(axis=(3, 5)))

"""What a traffic light shows, read from the part of a picture where the map has it."""

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
"""Of a part of a picture that shows no light, as something hides it."""
SHOWN = ("red", "redYellow", "yellow", "green", "off", NONE)
"""What the network tells apart, in the order of its outputs."""
CROP = (16, 32)
"""Width and height of its input [px]."""
AROUND = 2.0
"""The part that it sees is so many times as high as the light, and half as wide as high."""
DARKEST = 0.05
"""Parts are brought to one brightness, but for those that have nothing brighter than this share of white."""


def crops(picture: NDArray[np.uint8], middles: Array, heights: Array) -> Floats:
    """(N, 3, 32, 16) the parts of a picture (H, W, 3) about the middles (N, 2) of lights that are so high (N,) [px].

    The brightest value of each is 1. Beyond the picture's border its last pixels go on.
    """
    found = np.empty((len(middles), 3, CROP[1], CROP[0]), dtype=np.float32)
    for row, ((x, y), height) in enumerate(zip(middles.tolist(), heights.tolist(), strict=True)):
        high = max(AROUND * height, 4.0)
        part = _cut(picture, x - high / 4.0, y - high / 2.0, x + high / 4.0, y + high / 2.0)
        shrinks = part.shape[0] >= CROP[1] and part.shape[1] >= CROP[0]
        scaled = cv2.resize(part, CROP, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
        found[row] = scaled.transpose(2, 0, 1) / np.float32(255.0)
    brightest = found.max(axis=(1, 2, 3), keepdims=True, initial=DARKEST)
    return np.asarray(found / brightest, dtype=np.float32)


def _cut(picture: NDArray[np.uint8], left: float, top: float, right: float, bottom: float) -> NDArray[np.uint8]:
    """The pixels between these edges."""
    x0, y0 = int(np.floor(left + 0.5)), int(np.floor(top + 0.5))
    columns = np.arange(x0, max(int(np.floor(right + 0.5)), x0 + 1)).clip(0, picture.shape[1] - 1)
    lines = np.arange(y0, max(int(np.floor(bottom + 0.5)), y0 + 1)).clip(0, picture.shape[0] - 1)
    return np.asarray(picture[lines[:, None], columns[None]])


class LampNetwork:
    """Three convolutions and one layer more, in numpy: what each of the parts of a picture shows.

    weights   `w0 b0 w1 b1 w2 b2`, kernels (O, I, 3, 3), and `w3` (6, 1024), `b3`: training/train_lamps.py writes them
    """

    def __init__(self, weights: dict[str, Floats]) -> None:
        self._weights = weights

    def probabilities(self, parts: Floats) -> Floats:
        """(N, 6) probability of each of SHOWN for parts (N, 3, 32, 16)."""
        if not len(parts):
            return np.empty((0, len(SHOWN)), dtype=np.float32)
        w = self._weights
        seen = _halved(_convolved(parts, w["w0"], w["b0"]))
        seen = _halved(_convolved(seen, w["w1"], w["b1"]))
        seen = _convolved(seen, w["w2"], w["b2"])
        logits = seen.reshape(len(seen), -1) @ w["w3"].T + w["b3"]
        shares = np.exp(logits - logits.max(axis=1, keepdims=True))
        return np.asarray(shares / shares.sum(axis=1, keepdims=True), dtype=np.float32)


@cache
def lamp_network() -> LampNetwork:
    """The network with the weights that travel with the package."""
    with np.load(WEIGHTS) as stored:
        return LampNetwork({name: stored[name].astype(np.float32) for name in stored.files})


def save(path: Path, weights: dict[str, Floats], card: dict[str, Any]) -> None:
    """Write weights, in half precision, and their card."""
    halves: dict[str, Any] = {name: value.astype(np.float16) for name, value in weights.items()}
    np.savez_compressed(path, **halves)
    path.with_suffix(".json").write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")


def _convolved(seen: Floats, kernel: Floats, bias: Floats) -> Floats:
    """3 x 3 convolution of (N, I, H, W) with zeros around, then no negatives."""
    padded = np.pad(seen, ((0, 0), (0, 0), (1, 1), (1, 1)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(2, 3))
    found = np.tensordot(windows, kernel, axes=((1, 4, 5), (1, 2, 3))) + bias
    return np.ascontiguousarray(np.maximum(found, 0.0).transpose(0, 3, 1, 2), dtype=np.float32)


def _halved(seen: Floats) -> Floats:
    """The largest of each two by two."""
    count, channels, height, width = seen.shape
    return np.asarray(seen.reshape(count, channels, height // 2, 2, width // 2, 2).max(axis=(3, 5)))

"""Compression of features to a few bytes per cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Floats
from eidrive_scenario.perception.learned.graphs import Graph

FEATURES = 96
"""Channels of the features."""
LATENT = 8
"""Channels of the compressed features."""
LARGEST_CODE = 127
CODES = 256
"""Entries of the code book."""


class CellLayer(NamedTuple):
    """Linear layer from I to O channels, a 1x1 convolution: weight (O, I) and bias (O,).

    It is computed by numpy with every runtime, so that equal features have equal outputs, wherever they come from.
    """

    weight: Floats
    bias: Floats

    @classmethod
    def of(cls, arrays: Mapping[str, NDArray[Any]], name: str, inputs: int, outputs: int) -> CellLayer:
        """Return the layer with these weights of a network. Raise ValueError if they are missing or do not fit."""
        graph = Graph(arrays)
        weight = graph.array(f"{name}.weight", (outputs, inputs, 1, 1)).reshape(outputs, inputs)
        return cls(weight, graph.array(f"{name}.bias", (outputs,)))

    def __call__(self, values: Floats) -> Floats:
        """Return the outputs (O, ...) for the channels (I, ...) of cells."""
        outputs: Floats = self.weight @ values.reshape(len(values), -1)
        outputs += self.bias[:, None]
        return outputs.reshape(len(outputs), *values.shape[1:])


@dataclass(frozen=True)
class FeatureCodec:
    """Codec of the compressed features z (8, N) of N cells, which the network computes from the features.

    scale      latent units of one step of an 8-bit integer
    codebook   (256, 8), in latent units
    expansion  linear layer from z to the features, followed by a ReLU
    """

    scale: np.float32
    codebook: Floats
    expansion: CellLayer

    @classmethod
    def of(cls, arrays: Mapping[str, NDArray[Any]]) -> FeatureCodec:
        """Return the codec of these weights. Raise ValueError if arrays are missing or do not fit."""
        graph = Graph(arrays)
        scale = graph.array("latent_scale", ())
        expansion = CellLayer.of(arrays, "expand", LATENT, FEATURES)
        if not 0.0 < scale < np.inf:
            raise ValueError(f"latent_scale is invalid (got {scale:g}; expected a positive number)")
        return cls(np.float32(scale), graph.array("codebook", (CODES, LATENT)), expansion)

    def expand(self, latent: Floats) -> Floats:
        """Return the features (96, N) of cells with these compressed features (8, N)."""
        features = self.expansion(latent)
        np.maximum(features, np.float32(0.0), out=features)
        return features

    def to_int8(self, latent: Floats) -> NDArray[np.int8]:
        """Return the compressed features (8, N) as 8-bit integers."""
        steps = np.rint(latent / self.scale)
        return np.asarray(steps.clip(-LARGEST_CODE, LARGEST_CODE), np.int8)

    def from_int8(self, steps: NDArray[np.int8]) -> Floats:
        """Return the compressed features (8, N) that these integers stand for."""
        return steps * self.scale

    def to_codes(self, latent: Floats) -> NDArray[np.uint8]:
        """Return the number (N,) of the nearest entry of the code book to each column (8, N); of several, the first."""
        # |z - c|² = |z|² - 2 (z · c - |c|² / 2)
        nearness = latent.T @ self.codebook.T
        nearness -= np.square(self.codebook).sum(axis=1) / np.float32(2.0)
        return np.asarray(nearness.argmax(axis=1), np.uint8)

    def from_codes(self, codes: NDArray[np.uint8]) -> Floats:
        """Return the entries of the code book as compressed features (8, N)."""
        return self.codebook[codes].T

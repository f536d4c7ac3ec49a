"""Network `pillars`: features of a grid of lidar points, and the objects and compressed features in them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Floats
from eidrive_scenario.base.detections import CLASSES
from eidrive_scenario.perception.learned.graphs import IMAGE, Graph
from eidrive_scenario.perception.learned.pillars.codec import FEATURES, LATENT, CellLayer, FeatureCodec
from eidrive_scenario.perception.learned.pillars.decode import ATTRIBUTES
from eidrive_scenario.perception.learned.pillars.grid import CELLS, CHANNELS
from eidrive_scenario.perception.learned.quantization import Ranges
from eidrive_scenario.perception.learned.runtimes import Runtime, load_onnx
from eidrive_scenario.perception.learned.weights import Precision, another_network, read, read_weights, suitable

NETWORK = "pillars"
"""Name of the network in weight files."""
HINT = "use the shipped weights, or a .npz with the arrays of `pillars` (docs/perception.md)"
"""Hint for unsuitable weights."""
STRIDE = 2
"""Cells of the grid along an edge of a cell of the features."""
BLOCKS = ((32, 1), (48, 2), (128, 4))
"""Channels of each block, whose first convolution halves the resolution, and number of its further convolutions."""
UP = 32
"""Channels of each block after enlargement to the resolution of the features."""

INPUT_RANGE = (-0.5, 2.0)
"""Range of a grid for 8-bit integers: offsets are at least -0.5, and 400 points in a cell are 2."""


def features_onnx(arrays: Mapping[str, NDArray[Any]], ranges: Ranges | None = None) -> bytes:
    """Return the ONNX model from a grid (1, 12, 256, 256) to its features (1, 96, 128, 128), with 8-bit integers if the
    ranges of its layers are given.

    The outputs of the first block stay in single precision: few of them are large, and would leave few steps for the
    others.

    Raise ValueError if the weights do not fit.
    """
    graph = Graph(arrays, CHANNELS)
    x, units, levels = IMAGE, [], []
    for block, (channels, depth) in enumerate(BLOCKS):
        for layer in range(depth + 1):
            x = graph.relu_unit(x, f"block{block}.{layer}", channels, 3, 1 if layer else 2)
            units.append(x)
        factor = 2**block
        enlarge = graph.relu_unit if factor == 1 else graph.enlarging_unit
        levels.append(enlarge(x, f"up{block}", UP, factor))
    first = units[: BLOCKS[0][1] + 1]
    ranges = None if ranges is None else {IMAGE: INPUT_RANGE, **ranges}
    return graph.onnx((CELLS, CELLS), {graph.concatenation(*levels): STRIDE}, ranges, first)


class PillarNetwork:
    """Network `pillars` with the weights of a file, executed by a runtime.

    classes     names in the order of the class logits;  confidence  default of the minimum score
    objects     layer from features to the maps of objects (C + 13, 128, 128), which `decode` reads
    compress    layer from features to compressed ones (8, 128, 128), of which `codec` makes a few bytes per cell

    Raise SettingError if the weights are not suitable.
    """

    def __init__(self, path: Path, runtime: Runtime, precision: Precision = "float32") -> None:
        weights = read(path, HINT)
        description = weights.description
        if description.network != NETWORK:
            raise another_network(path, description.network, NETWORK)
        self.classes = description.classes
        self.confidence = description.confidence
        with suitable(path, HINT):
            if description.input_size != (CELLS, CELLS):
                raise ValueError(f"its input size is invalid (expected {CELLS} x {CELLS})")
            unknown = sorted(set(self.classes) - set(CLASSES))
            if unknown:
                raise ValueError(f"its class {unknown[0]!r} is unknown (expected some of {', '.join(CLASSES)})")
            self.codec = FeatureCodec.of(weights.arrays)
            self.objects = CellLayer.of(weights.arrays, "head", FEATURES, len(self.classes) + ATTRIBUTES)
            self.compress = CellLayer.of(weights.arrays, "compress", FEATURES, LATENT)
            model = features_onnx(weights.arrays, weights.ranges(precision))
        self._features = load_onnx(runtime, path, 1, model)

    def features(self, grid: Floats) -> Floats:
        """Return the features (96, 128, 128) of a grid (12, 256, 256)."""
        return np.asarray(self._features(grid[None])[0][0])


def load_network(path: Path, runtime: Runtime, precision: Precision) -> PillarNetwork:
    """Return the network, which stations and runs share. Raise SettingError if the weights are not suitable."""
    return _load(path, hashlib.sha256(read_weights(path)).hexdigest(), runtime, precision)


@lru_cache(maxsize=4)
def _load(path: Path, digest: str, runtime: Runtime, precision: Precision) -> PillarNetwork:
    return PillarNetwork(path, runtime, precision)

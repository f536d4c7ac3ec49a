"""Graph of a network for inference: layers with weights by the names of a weight file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Floats
from eidrive_scenario.perception.learned.graphs.onnx_file import Attribute, Node, onnx_model

IMAGE = "image"
_EPSILON = 1e-3
"""Summand of the variance in batch normalizations, as in networks/blocks.py."""
_NORM = ("weight", "bias", "running_mean", "running_var")


class Graph:
    """Graph of layers from images (1, 3, H, W) in [0, 1] to several outputs.

    Each method adds a layer and returns the name of its output. A layer has the weights whose names begin with its
    name, as in the classes of `networks`. Raise ValueError if a weight is missing or has another shape.
    """

    def __init__(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        self._arrays = arrays
        self._nodes: list[Node] = []
        self._tensors: dict[str, Floats] = {}
        self._channels: dict[str, int] = {IMAGE: 3}

    def channels(self, layer: str) -> int:
        """Return the number of channels of a layer's output."""
        return self._channels[layer]

    def array(self, name: str, shape: Sequence[int]) -> Floats:
        """Return a weight in single precision."""
        if name not in self._arrays:
            raise ValueError(f"{name} is missing")
        array = self._arrays[name]
        if array.shape != tuple(shape):
            raise ValueError(f"{name} has another shape than the network")
        return np.asarray(array, dtype=np.float32)

    def conv_unit(
        self,
        source: str,
        name: str,
        outputs: int,
        kernel: int = 1,
        stride: int = 1,
        *,
        groups: int = 1,
        padding: int | None = None,
    ) -> str:
        """Add a convolution, into which its batch normalization is folded, and SiLU."""
        shape = (outputs, self._channels[source] // groups, kernel, kernel)
        weight = self.array(f"{name}.conv.weight", shape).astype(np.float64)
        gain, offset, mean, variance = (self.array(f"{name}.norm.{part}", (outputs,)).astype(float) for part in _NORM)
        gain = gain / np.sqrt(variance + _EPSILON)
        pad = kernel // 2 if padding is None else padding
        folded = self._convolution(
            source, name, weight * gain[:, None, None, None], offset - mean * gain, stride, pad, groups
        )
        return self._add("Mul", (folded, self._add("Sigmoid", (folded,), outputs)), outputs)

    def head(self, source: str, name: str, outputs: int) -> str:
        """Add a 1x1 convolution without activation."""
        weight = self.array(f"{name}.weight", (outputs, self._channels[source], 1, 1))
        return self._convolution(source, name, weight, self.array(f"{name}.bias", (outputs,)), 1, 0, 1)

    def sum(self, first: str, second: str) -> str:
        """Add a residual connection."""
        return self._add("Add", (first, second), self._channels[first])

    def concatenation(self, *sources: str) -> str:
        """Add a concatenation of channels."""
        return self._add("Concat", sources, sum(self._channels[source] for source in sources), axis=1)

    def max_pool(self, source: str, kernel: int) -> str:
        """Add a maximum over a square around each cell."""
        attributes = {"kernel_shape": (kernel, kernel), "pads": (kernel // 2,) * 4, "strides": (1, 1)}
        return self._add("MaxPool", (source,), self._channels[source], **attributes)

    def doubled(self, source: str) -> str:
        """Add a repetition of each cell in both directions."""
        self._tensors["doubled"] = np.array([1.0, 1.0, 2.0, 2.0], dtype=np.float32)
        attributes = {"coordinate_transformation_mode": "asymmetric", "mode": "nearest", "nearest_mode": "floor"}
        return self._add("Resize", (source, "", "doubled"), self._channels[source], **attributes)

    def onnx(self, input_size: tuple[int, int], outputs: Mapping[str, int]) -> bytes:
        """Return the ONNX model.

        input_size  width and height of its input [px]
        outputs     layers whose outputs it returns, with the distance of their cells [px]
        """
        width, height = input_size
        shapes = {
            name: (1, self._channels[name], -(-height // stride), -(-width // stride))
            for name, stride in outputs.items()
        }
        return onnx_model(self._nodes, self._tensors, {IMAGE: (1, 3, height, width)}, shapes)

    def _convolution(
        self, source: str, name: str, weight: Any, bias: Any, stride: int, padding: int, groups: int
    ) -> str:
        self._tensors[f"{name}.weight"] = np.asarray(weight, dtype=np.float32)
        self._tensors[f"{name}.bias"] = np.asarray(bias, dtype=np.float32)
        return self._add(
            "Conv",
            (source, f"{name}.weight", f"{name}.bias"),
            len(bias),
            kernel_shape=tuple(weight.shape[2:]),
            strides=(stride, stride),
            pads=(padding,) * 4,
            group=groups,
        )

    def _add(self, operator: str, inputs: Sequence[str], channels: int, **attributes: Attribute) -> str:
        output = f"{operator.lower()}_{len(self._nodes)}"
        self._nodes.append(Node(operator, inputs, output, attributes))
        self._channels[output] = channels
        return output

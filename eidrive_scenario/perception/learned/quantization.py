"""Conversion of the graph of a network to 8-bit integers, by the pairs QuantizeLinear and DequantizeLinear of ONNX.

Runtimes compute a convolution with integers if its inputs come from such pairs. Activations have one scale per layer,
weights one per output channel. The activation function after a convolution, and the last convolutions of the network,
compute in single precision. So do transposed convolutions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Floats
from eidrive_scenario.perception.learned.onnx_file import Node

Ranges = Mapping[str, tuple[float, float]]
"""Least and greatest value of the output of each layer, by its name."""

_GREATEST_WEIGHT = 63
"""Largest magnitude of an integer weight. With 127, sums of two products exceed 16 bits, in which processors without
VNNI instructions add them."""
_STEPS = 255


def quantized(
    nodes: Sequence[Node],
    tensors: Mapping[str, Floats],
    image: str,
    outputs: Sequence[str],
    ranges: Ranges,
    single: Sequence[str] = (),
) -> tuple[list[Node], dict[str, NDArray[Any]]]:
    """Return the operations and constants of a graph whose convolutions compute with 8-bit integers.

    nodes    operations in the order of execution; tensors  their constants in single precision
    image    input of the graph; without a range, its values are multiples of 1/255 between 0 and 1
    outputs  layers whose outputs the graph returns
    ranges   of all layers that `has_range` selects, except `single`
    single   layers whose outputs stay in single precision, with the convolutions that read them

    Raise ValueError if the range of a layer is missing.
    """
    graph = _QuantizedGraph(tensors)
    graph.quantize(image, *ranges.get(image, (0.0, 1.0)))
    for node in nodes:
        inputs = [graph.integer_source.get(name, name) for name in node.inputs]
        if node.operator == "Conv" and node.inputs[0] in graph.integer_source and node.output not in outputs:
            inputs[1:] = graph.integer_weights(*node.inputs)
        graph.nodes.append(Node(node.operator, inputs, node.output, node.attributes))
        if has_range(node.operator, node.output, outputs) and node.output not in single:
            if node.output not in ranges:
                raise ValueError(f"the range of layer {node.output} is missing")
            graph.quantize(node.output, *ranges[node.output])
    return graph.nodes, graph.used_tensors()


def has_range(operator: str, output: str, outputs: Sequence[str]) -> bool:
    """Return whether the output of an operation is converted to integers: all but those before or inside of an
    activation, and the outputs of the network."""
    return operator not in ("Conv", "ConvTranspose", "Sigmoid") and output not in outputs


class _QuantizedGraph:
    """Graph that grows: its operations, its constants, and the layers with values of 8 bits by their former names."""

    def __init__(self, tensors: Mapping[str, Floats]) -> None:
        self.nodes: list[Node] = []
        self.integer_source: dict[str, str] = {}
        self._tensors: dict[str, NDArray[Any]] = dict(tensors)
        self._scales: dict[str, np.float32] = {}

    def quantize(self, layer: str, least: float, greatest: float) -> None:
        """Add the conversion of a layer's output to integers from 0 to 255 and back; 0 is exact."""
        least, greatest = min(least, 0.0), max(greatest, 0.0)
        scale = np.float32((greatest - least) / _STEPS or 1.0)
        zero = np.uint8(np.clip(np.rint(-least / scale), 0, _STEPS))
        self._scales[layer] = scale
        parameters = self._parameters(layer, scale, zero)
        self.nodes.append(Node("QuantizeLinear", (layer, *parameters), f"{layer}.integers"))
        self.nodes.append(Node("DequantizeLinear", (f"{layer}.integers", *parameters), f"{layer}.rounded"))
        self.integer_source[layer] = f"{layer}.rounded"

    def integer_weights(self, source: str, weight: str, bias: str) -> tuple[str, str]:
        """Add the integer weights and biases of a convolution; return the names of their values."""
        values, biases = self._tensors[weight], self._tensors[bias]
        magnitude = np.abs(values).reshape(len(values), -1).max(axis=1)
        scale = np.where(magnitude > 0.0, magnitude / _GREATEST_WEIGHT, 1.0).astype(np.float32)
        integers = np.rint(values / scale[:, None, None, None]).astype(np.int8)
        product = scale * self._scales[source]
        return (
            self._constant(weight, integers, scale),
            self._constant(bias, np.rint(biases / product).astype(np.int32), product),
        )

    def used_tensors(self) -> dict[str, NDArray[Any]]:
        """Return the constants that an operation reads."""
        names = {name for node in self.nodes for name in node.inputs}
        return {name: tensor for name, tensor in self._tensors.items() if name in names}

    def _constant(self, name: str, integers: NDArray[Any], scale: NDArray[Any]) -> str:
        self._tensors[f"{name}.integers"] = integers
        parameters = self._parameters(name, scale, np.zeros(len(scale), dtype=integers.dtype))
        self.nodes.append(Node("DequantizeLinear", (f"{name}.integers", *parameters), f"{name}.rounded", {"axis": 0}))
        return f"{name}.rounded"

    def _parameters(self, name: str, scale: Any, zero: Any) -> tuple[str, str]:
        self._tensors[f"{name}.scale"], self._tensors[f"{name}.zero"] = np.asarray(scale), np.asarray(zero)
        return f"{name}.scale", f"{name}.zero"

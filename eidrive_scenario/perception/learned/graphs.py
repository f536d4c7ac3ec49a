"""Graphs of networks as ONNX models, and those of `ssd` and `yolov5`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Floats
from eidrive_scenario.perception.learned.networks.ssd_sizes import BOXES_PER_CELL, COARSE, FINE, MIDDLE
from eidrive_scenario.perception.learned.networks.ssd_sizes import STRIDES as SSD_STRIDES
from eidrive_scenario.perception.learned.networks.yolov5_sizes import ANCHORS_PER_SCALE, DEPTHS, WIDTHS
from eidrive_scenario.perception.learned.networks.yolov5_sizes import STRIDES as YOLO_STRIDES
from eidrive_scenario.perception.learned.onnx_file import Attribute, Node, onnx_model
from eidrive_scenario.perception.learned.quantization import Ranges, quantized

IMAGE = "image"
_EPSILON = 1e-3
"""Summand of the variance in batch normalizations, as in networks/blocks.py."""
_NORM = ("weight", "bias", "running_mean", "running_var")


class Graph:
    """Graph of layers from an image (1, C, H, W) to several outputs.

    Each method adds a layer and returns the name of its output. A layer has the weights whose names begin with its
    name, as in the classes of `networks`. Raise ValueError if a weight is missing or has another shape.
    """

    def __init__(self, arrays: Mapping[str, NDArray[Any]], channels: int = 3) -> None:
        self._arrays = arrays
        self._nodes: list[Node] = []
        self._tensors: dict[str, Floats] = {}
        self.channels: dict[str, int] = {IMAGE: channels}
        """Number of channels of the output of each layer."""

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
        shape = (outputs, self.channels[source] // groups, kernel, kernel)
        weight = self.array(f"{name}.conv.weight", shape).astype(np.float64)
        gain, offset, mean, variance = (self.array(f"{name}.norm.{part}", (outputs,)).astype(float) for part in _NORM)
        gain = gain / np.sqrt(variance + _EPSILON)
        pad = kernel // 2 if padding is None else padding
        folded = self._convolution(
            source, name, weight * gain[:, None, None, None], offset - mean * gain, stride, pad, groups
        )
        return self._add("Mul", (folded, self._add("Sigmoid", (folded,), outputs)), outputs)

    def relu_unit(self, source: str, name: str, outputs: int, kernel: int = 1, stride: int = 1) -> str:
        """Add a convolution and ReLU."""
        weight = self.array(f"{name}.weight", (outputs, self.channels[source], kernel, kernel))
        bias = self.array(f"{name}.bias", (outputs,))
        return self._relu(self._convolution(source, name, weight, bias, stride, kernel // 2, 1))

    def enlarging_unit(self, source: str, name: str, outputs: int, factor: int) -> str:
        """Add a transposed convolution, by which each cell becomes `factor` x `factor` cells, and ReLU."""
        self._tensors[f"{name}.weight"] = self.array(f"{name}.weight", (self.channels[source], outputs, factor, factor))
        self._tensors[f"{name}.bias"] = self.array(f"{name}.bias", (outputs,))
        inputs = (source, f"{name}.weight", f"{name}.bias")
        sides = (factor, factor)
        return self._relu(self._add("ConvTranspose", inputs, outputs, kernel_shape=sides, strides=sides))

    def head(self, source: str, name: str, outputs: int) -> str:
        """Add a 1x1 convolution without activation."""
        weight = self.array(f"{name}.weight", (outputs, self.channels[source], 1, 1))
        return self._convolution(source, name, weight, self.array(f"{name}.bias", (outputs,)), 1, 0, 1)

    def sum(self, first: str, second: str) -> str:
        """Add a residual connection."""
        return self._add("Add", (first, second), self.channels[first])

    def concatenation(self, *sources: str) -> str:
        """Add a concatenation of channels."""
        return self._add("Concat", sources, sum(self.channels[source] for source in sources), axis=1)

    def max_pool(self, source: str, kernel: int) -> str:
        """Add a maximum over a square around each cell."""
        attributes = {"kernel_shape": (kernel, kernel), "pads": (kernel // 2,) * 4, "strides": (1, 1)}
        return self._add("MaxPool", (source,), self.channels[source], **attributes)

    def doubled(self, source: str) -> str:
        """Add a repetition of each cell in both directions."""
        self._tensors["doubled"] = np.array([1.0, 1.0, 2.0, 2.0], dtype=np.float32)
        attributes = {"coordinate_transformation_mode": "asymmetric", "mode": "nearest", "nearest_mode": "floor"}
        return self._add("Resize", (source, "", "doubled"), self.channels[source], **attributes)

    def onnx(
        self,
        input_size: tuple[int, int],
        outputs: Mapping[str, int],
        ranges: Ranges | None,
        single: Sequence[str] = (),
    ) -> bytes:
        """Return the ONNX model.

        input_size  width and height of its input [px]
        outputs     layers whose outputs it returns, with the distance of their cells [px]
        ranges      of the layers, to compute with 8-bit integers; None: in single precision
        single      layers whose outputs stay in single precision

        Raise ValueError if a range is missing.
        """
        width, height = input_size
        shapes = {
            name: (1, self.channels[name], -(-height // stride), -(-width // stride))
            for name, stride in outputs.items()
        }
        nodes: Sequence[Node] = self._nodes
        tensors: Mapping[str, NDArray[Any]] = self._tensors
        if ranges is not None:
            nodes, tensors = quantized(nodes, tensors, IMAGE, list(outputs), ranges, single)
        return onnx_model(nodes, tensors, {IMAGE: (1, self.channels[IMAGE], height, width)}, shapes)

    def _relu(self, source: str) -> str:
        return self._add("Relu", (source,), self.channels[source])

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
        self.channels[output] = channels
        return output


def ssd_onnx(
    arrays: Mapping[str, NDArray[Any]], classes: int, input_size: tuple[int, int], ranges: Ranges | None = None
) -> bytes:
    """Return the ONNX model of these weights, with 8-bit integers if the ranges of its layers are given.

    Its outputs are encoded boxes (1, 6 · 4, H/s, W/s) of each stride s, then class logits (1, 6 · (1 + C), H/s, W/s).
    Raise ValueError if the weights do not fit.
    """
    graph = Graph(arrays)
    x = graph.conv_unit(IMAGE, "fine.0", 16, 3, 2)
    levels = [_separable_units(graph, x, "fine", FINE, first=1)]
    levels.append(_separable_units(graph, levels[-1], "middle", MIDDLE))
    levels.append(_separable_units(graph, levels[-1], "coarse", COARSE))
    for name, reduced, widened in (("extra", 128, 256), ("last", 96, 192)):
        x = graph.conv_unit(levels[-1], f"{name}.0", reduced)
        levels.append(_separable_unit(graph, x, f"{name}.1", widened, 2))
    outputs = {}
    for kind, each in (("box_heads", 4), ("class_heads", 1 + classes)):
        for number, (level, stride) in enumerate(zip(levels, SSD_STRIDES, strict=True)):
            width = graph.channels[level]
            x = graph.conv_unit(level, f"{kind}.{number}.0", width, 3, groups=width)
            outputs[graph.head(x, f"{kind}.{number}.1", BOXES_PER_CELL * each)] = stride
    return graph.onnx(input_size, outputs, ranges)


def _separable_units(graph: Graph, source: str, name: str, units: tuple[tuple[int, int], ...], first: int = 0) -> str:
    """Add units with these output channels and strides, numbered from `first` on."""
    x = source
    for number, (outputs, stride) in enumerate(units, first):
        x = _separable_unit(graph, x, f"{name}.{number}", outputs, stride)
    return x


def _separable_unit(graph: Graph, source: str, name: str, outputs: int, stride: int) -> str:
    inputs = graph.channels[source]
    x = graph.conv_unit(source, f"{name}.depthwise", inputs, 3, stride, groups=inputs)
    x = graph.conv_unit(x, f"{name}.pointwise", outputs)
    return graph.sum(source, x) if stride == 1 and inputs == outputs else x


def yolov5_onnx(
    arrays: Mapping[str, NDArray[Any]], classes: int, input_size: tuple[int, int], ranges: Ranges | None = None
) -> bytes:
    """Return the ONNX model of these weights, with 8-bit integers if the ranges of its layers are given.

    Its outputs are (1, A (5 + C), H/s, W/s) for each stride s, before the sigmoid. Raise ValueError if the weights do
    not fit.
    """
    graph = Graph(arrays)
    graph.array("anchors", (len(YOLO_STRIDES), ANCHORS_PER_SCALE, 2))
    w1, w2, w3, w4, w5 = WIDTHS
    d2, d3, d4, d5 = DEPTHS
    x = graph.conv_unit(IMAGE, "fine.0", w1, 6, 2, padding=2)
    x = graph.conv_unit(x, "fine.1", w2, 3, 2)
    x = _cross_stage(graph, x, "fine.2", w2, d2)
    x = graph.conv_unit(x, "fine.3", w3, 3, 2)
    fine = _cross_stage(graph, x, "fine.4", w3, d3)
    x = graph.conv_unit(fine, "middle.0", w4, 3, 2)
    middle = _cross_stage(graph, x, "middle.1", w4, d4)
    x = graph.conv_unit(middle, "coarse.0", w5, 3, 2)
    x = _cross_stage(graph, x, "coarse.1", w5, d5)
    pooled = [graph.conv_unit(x, "coarse.2.reduce", w5 // 2)]
    for _ in range(3):
        pooled.append(graph.max_pool(pooled[-1], 5))
    x = graph.conv_unit(graph.concatenation(*pooled), "coarse.2.merge", w5)
    coarse = graph.conv_unit(x, "lateral_coarse", w4)
    x = graph.concatenation(graph.doubled(coarse), middle)
    middle = graph.conv_unit(_cross_stage(graph, x, "merge_middle", w4, 1, shortcut=False), "lateral_middle", w3)
    x = graph.concatenation(graph.doubled(middle), fine)
    fine = _cross_stage(graph, x, "merge_fine", w3, 1, shortcut=False)
    x = graph.concatenation(graph.conv_unit(fine, "down_fine", w3, 3, 2), middle)
    middle = _cross_stage(graph, x, "out_middle", w4, 1, shortcut=False)
    x = graph.concatenation(graph.conv_unit(middle, "down_middle", w4, 3, 2), coarse)
    coarse = _cross_stage(graph, x, "out_coarse", w5, 1, shortcut=False)
    channels = ANCHORS_PER_SCALE * (5 + classes)
    levels = enumerate(zip((fine, middle, coarse), YOLO_STRIDES, strict=True))
    outputs = {graph.head(level, f"heads.{number}", channels): stride for number, (level, stride) in levels}
    return graph.onnx(input_size, outputs, ranges)


def _cross_stage(graph: Graph, source: str, name: str, outputs: int, depth: int, *, shortcut: bool = True) -> str:
    half = outputs // 2
    x = graph.conv_unit(source, f"{name}.through", half)
    for number in range(depth):
        stage = f"{name}.stages.{number}"
        out = graph.conv_unit(graph.conv_unit(x, f"{stage}.reduce", half), f"{stage}.widen", half, 3)
        x = graph.sum(x, out) if shortcut else out
    bypass = graph.conv_unit(source, f"{name}.around", half)
    return graph.conv_unit(graph.concatenation(x, bypass), f"{name}.merge", outputs)

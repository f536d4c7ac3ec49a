"""Network `ssd` as an ONNX model: the layers of `networks.ssd.Ssd`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from eidrive_scenario.perception.learned.graphs.graph import IMAGE, Graph
from eidrive_scenario.perception.learned.networks.ssd_sizes import BOXES_PER_CELL, COARSE, FINE, MIDDLE, STRIDES


def ssd_onnx(arrays: Mapping[str, NDArray[Any]], classes: int, input_size: tuple[int, int]) -> bytes:
    """Return the ONNX model of these weights.

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
        for number, (level, stride) in enumerate(zip(levels, STRIDES, strict=True)):
            width = graph.channels(level)
            x = graph.conv_unit(level, f"{kind}.{number}.0", width, 3, groups=width)
            outputs[graph.head(x, f"{kind}.{number}.1", BOXES_PER_CELL * each)] = stride
    return graph.onnx(input_size, outputs)


def _separable_units(graph: Graph, source: str, name: str, units: tuple[tuple[int, int], ...], first: int = 0) -> str:
    """Add units with these output channels and strides, numbered from `first` on."""
    x = source
    for number, (outputs, stride) in enumerate(units, first):
        x = _separable_unit(graph, x, f"{name}.{number}", outputs, stride)
    return x


def _separable_unit(graph: Graph, source: str, name: str, outputs: int, stride: int) -> str:
    inputs = graph.channels(source)
    x = graph.conv_unit(source, f"{name}.depthwise", inputs, 3, stride, groups=inputs)
    x = graph.conv_unit(x, f"{name}.pointwise", outputs)
    return graph.sum(source, x) if stride == 1 and inputs == outputs else x

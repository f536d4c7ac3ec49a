"""Network `yolov5` as an ONNX model: the layers of `networks.yolov5.YoloV5`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from eidrive_scenario.perception.learned.graphs.graph import IMAGE, Graph
from eidrive_scenario.perception.learned.networks.yolov5_sizes import ANCHORS_PER_SCALE, DEPTHS, STRIDES, WIDTHS


def yolov5_onnx(arrays: Mapping[str, NDArray[Any]], classes: int, input_size: tuple[int, int]) -> bytes:
    """Return the ONNX model of these weights.

    Its outputs are (1, A (5 + C), H/s, W/s) for each stride s, before the sigmoid. Raise ValueError if the weights do
    not fit.
    """
    graph = Graph(arrays)
    graph.array("anchors", (len(STRIDES), ANCHORS_PER_SCALE, 2))
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
    coarse = graph.conv_unit(_pyramid_pooling(graph, x, "coarse.2", w5), "lateral_coarse", w4)
    x = graph.concatenation(graph.doubled(coarse), middle)
    middle = graph.conv_unit(_cross_stage(graph, x, "merge_middle", w4, 1, shortcut=False), "lateral_middle", w3)
    x = graph.concatenation(graph.doubled(middle), fine)
    fine = _cross_stage(graph, x, "merge_fine", w3, 1, shortcut=False)
    x = graph.concatenation(graph.conv_unit(fine, "down_fine", w3, 3, 2), middle)
    middle = _cross_stage(graph, x, "out_middle", w4, 1, shortcut=False)
    x = graph.concatenation(graph.conv_unit(middle, "down_middle", w4, 3, 2), coarse)
    coarse = _cross_stage(graph, x, "out_coarse", w5, 1, shortcut=False)
    channels = ANCHORS_PER_SCALE * (5 + classes)
    levels = enumerate(zip((fine, middle, coarse), STRIDES, strict=True))
    return graph.onnx(
        input_size, {graph.head(level, f"heads.{number}", channels): stride for number, (level, stride) in levels}
    )


def _cross_stage(graph: Graph, source: str, name: str, outputs: int, depth: int, *, shortcut: bool = True) -> str:
    half = outputs // 2
    x = graph.conv_unit(source, f"{name}.through", half)
    for number in range(depth):
        stage = f"{name}.stages.{number}"
        out = graph.conv_unit(graph.conv_unit(x, f"{stage}.reduce", half), f"{stage}.widen", half, 3)
        x = graph.sum(x, out) if shortcut else out
    bypass = graph.conv_unit(source, f"{name}.around", half)
    return graph.conv_unit(graph.concatenation(x, bypass), f"{name}.merge", outputs)


def _pyramid_pooling(graph: Graph, source: str, name: str, channels: int) -> str:
    pooled = [graph.conv_unit(source, f"{name}.reduce", channels // 2)]
    for _ in range(3):
        pooled.append(graph.max_pool(pooled[-1], 5))
    return graph.conv_unit(graph.concatenation(*pooled), f"{name}.merge", channels)

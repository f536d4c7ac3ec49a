"""Networks with 8-bit integers: against the reference implementation of ONNX, and against single precision."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eidrive_scenario.base.arrays import Floats
from eidrive_scenario.errors import SettingError
from eidrive_scenario.perception.learned.graphs import IMAGE, Graph
from eidrive_scenario.perception.learned.network_loading import SHIPPED
from eidrive_scenario.perception.learned.own_network import OwnNetwork
from eidrive_scenario.perception.learned.runtimes import openvino_network

SIZE = (16, 12)
RANGES = {"mul_2": (-0.3, 8.0), "mul_5": (-0.3, 8.0), "concat_6": (-0.3, 8.0)}


def small_graph() -> tuple[Graph, dict[str, int]]:
    """Return two convolutions with SiLU, their concatenation, and a head, with random weights."""
    rng = np.random.default_rng(3)
    arrays: dict[str, Any] = {}
    for name, shape in (("first", (8, 3, 3, 3)), ("second", (4, 8, 1, 1))):
        arrays[f"{name}.conv.weight"] = rng.normal(0.0, 0.3, shape)
        for part, values in (("weight", (0.5, 1.5)), ("bias", (-0.2, 0.2)), ("running_mean", (-0.2, 0.2))):
            arrays[f"{name}.norm.{part}"] = rng.uniform(*values, shape[0])
        arrays[f"{name}.norm.running_var"] = rng.uniform(0.5, 1.5, shape[0])
    arrays |= {"head.weight": rng.normal(0.0, 0.3, (5, 12, 1, 1)), "head.bias": rng.normal(0.0, 0.3, 5)}
    graph = Graph(arrays)
    first = graph.conv_unit(IMAGE, "first", 8, 3)
    joint = graph.concatenation(first, graph.conv_unit(first, "second", 4))
    return graph, {graph.head(joint, "head", 5): 1}


def reference_outputs(onnx: Any, model: bytes, image: Floats) -> list[Floats]:
    """Execute a model by onnx, whose DequantizeLinear begins with version 19 of the operators."""
    from onnx import version_converter
    from onnx.reference import ReferenceEvaluator

    converted = version_converter.convert_version(onnx.load_from_string(model), 19)
    outputs: Any = ReferenceEvaluator(converted).run(None, {IMAGE: image})
    return list(outputs)


def test_integer_network_equals_the_reference_implementation_of_onnx() -> None:
    """Values at a tie may be rounded to either step, of 8.3 / 255."""
    pytest.importorskip("openvino", reason="needs the extra 'openvino'")
    onnx = pytest.importorskip("onnx", reason="needs the extra 'dev'")
    graph, outputs = small_graph()
    model = graph.onnx(SIZE, outputs, RANGES)
    image = np.random.default_rng(7).integers(0, 256, (1, 3, *SIZE[::-1])).astype(np.float32) / np.float32(255.0)
    (expected,) = reference_outputs(onnx, model, image)
    (computed,) = openvino_network(Path("small.npz"), 1, model)(image)
    difference = np.abs(computed - expected)
    assert np.median(difference) < 1e-6
    assert difference.max() < 2.0 * 8.3 / 255
    (single,) = reference_outputs(onnx, graph.onnx(SIZE, outputs, None), image)
    assert 1e-4 < np.abs(computed - single).max() < 0.1


def test_missing_range_of_a_layer_raises_error() -> None:
    graph, outputs = small_graph()
    with pytest.raises(ValueError, match="the range of layer concat_6 is missing"):
        graph.onnx(SIZE, outputs, {name: RANGES[name] for name in ("mul_2", "mul_5")})


@pytest.mark.parametrize(
    ("ranges", "diagnostic"),
    [
        ({}, r"its layers have no ranges for int8 \(training/quantize.py computes them\)"),
        ({"mul_2": [2.0, -1.0]}, "ranges: invalid range"),
        ({"mul_2": [0.0, float("inf")]}, "ranges: invalid range"),
        ({"mul_2": [0.0, 1.0]}, "the range of layer mul_5 is missing"),
    ],
)
def test_weights_without_suitable_ranges_raise_error(ranges: dict[str, Any], diagnostic: str, tmp_path: Path) -> None:
    with np.load(SHIPPED / "ssd.npz") as stored:
        arrays = {name: stored[name] for name in stored.files}
    description = {**json.loads(str(arrays["description"])), "ranges": ranges}
    path = tmp_path / "own.npz"
    np.savez(path, **{**arrays, "description": np.array(json.dumps(description))})
    with pytest.raises(SettingError, match=f"do not fit: {diagnostic}"):
        OwnNetwork(path, "openvino", precision="int8")

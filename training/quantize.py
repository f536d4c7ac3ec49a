"""Ranges of the layers for `precision: int8`: `python -m training.quantize` writes them into weights.

The range of a layer is the mean of its least and of its greatest output over training images, which are rendered if
they are missing. The greatest range of all images costs `ssd` up to 0.05 of average precision, as most images then use
few of the 256 steps; without the rarest values of each image, traffic lights are missed.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import onnx
import onnxruntime

from eidrive_scenario.base.arrays import Floats
from eidrive_scenario.perception.learned.graphs import IMAGE
from eidrive_scenario.perception.learned.image_network import resized
from eidrive_scenario.perception.learned.network_loading import SHIPPED
from eidrive_scenario.perception.learned.own_network import planes
from eidrive_scenario.perception.learned.quantization import has_range
from eidrive_scenario.perception.learned.weights import read
from training.render_data import rendered
from training.weight_files import update_card, update_description


def layer_ranges(content: bytes, inputs: Iterable[Floats]) -> dict[str, list[float]]:
    """Return least and greatest output, as means over the inputs, of the layers of an ONNX model that int8 converts."""
    model = onnx.load_from_string(content)
    outputs = [entry.name for entry in model.graph.output]
    layers = [node.output[0] for node in model.graph.node if has_range(node.op_type, node.output[0], outputs)]
    model.graph.output.extend(onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, None) for name in layers)
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    limits = np.array(
        [[(values.min(), values.max()) for values in session.run(layers, {IMAGE: image})] for image in inputs]
    )
    return dict(zip(layers, limits.mean(axis=0).astype(float).round(5).tolist(), strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("weights", nargs="*", type=Path, default=[SHIPPED / "yolov5.npz", SHIPPED / "ssd.npz"])
    parser.add_argument("--data", type=Path, default=Path("training/data"))
    parser.add_argument("--pictures", type=int, default=200)
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    dataset = rendered(options.data, 1, "train", options.pictures, options.processes)
    rows = np.linspace(0, len(dataset) - 1, min(options.pictures, len(dataset))).astype(int).tolist()
    images = list(dataset.images(rows))
    for path in options.weights:
        weights = read(path)
        inputs = (planes(resized(image, weights.description.input_size)) for image in images)
        ranges = layer_ranges(weights.onnx(), inputs)
        update_description(path, ranges=ranges)
        update_card(path, ranges={"script": "training/quantize.py", "images": len(images), "layers": len(ranges)})
        print(f"{path.name}: ranges of {len(ranges)} layers in {len(images)} images")


if __name__ == "__main__":
    main()

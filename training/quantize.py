"""Ranges of the layers for `precision: int8`: `python -m training.quantize` writes them into weights.

The range of a layer is the mean of its least and of its greatest output over training images, which are rendered if
they are missing. The greatest range of all images costs `ssd` up to 0.05 of average precision, as most images then use
few of the 256 steps; without the rarest values of each image, traffic lights are missed.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Floats
from eidrive_scenario.perception.learned.graphs import IMAGE
from eidrive_scenario.perception.learned.image_network import resized
from eidrive_scenario.perception.learned.network_loading import SHIPPED
from eidrive_scenario.perception.learned.own_network import planes
from eidrive_scenario.perception.learned.quantization import has_range
from eidrive_scenario.perception.learned.weights import read
from training.calibrate import write_description
from training.image_evaluation import rendered


def layer_ranges(content: bytes, inputs: Iterable[Floats]) -> dict[str, tuple[float, float]]:
    """Return the range of each layer of an ONNX model that is converted to integers: the means over the inputs."""
    model = onnx.load_from_string(content)
    outputs = [entry.name for entry in model.graph.output]
    layers = [node.output[0] for node in model.graph.node if has_range(node.op_type, node.output[0], outputs)]
    model.graph.output.extend(onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, None) for name in layers)
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    limits = np.array(
        [[(values.min(), values.max()) for values in session.run(layers, {IMAGE: image})] for image in inputs]
    )
    return {name: (float(least), float(most)) for name, (least, most) in zip(layers, limits.mean(axis=0), strict=True)}


def _inputs(images: Sequence[NDArray[np.uint8]], size: tuple[int, int]) -> Iterator[Floats]:
    return (planes(resized(image, size)) for image in images)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("weights", nargs="*", type=Path, default=[SHIPPED / "yolov5.npz", SHIPPED / "ssd.npz"])
    parser.add_argument("--data", type=Path, default=Path("training/data"))
    parser.add_argument("--pictures", type=int, default=200)
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    dataset = rendered("train", options.data / "train", 1, options.pictures, options.processes)
    rows = np.linspace(0, len(dataset) - 1, min(options.pictures, len(dataset))).astype(int).tolist()
    images = list(dataset.images(rows))
    for path in options.weights:
        weights = read(path)
        ranges = layer_ranges(weights.onnx(), _inputs(images, weights.description.input_size))
        write_description(path, ranges={name: np.round(limits, 5).tolist() for name, limits in ranges.items()})
        card = path.with_suffix(".json")
        record = json.loads(card.read_text(encoding="utf-8"))
        record["ranges"] = {"script": "training/quantize.py", "images": len(images), "layers": len(ranges)}
        card.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
        print(f"{path.name}: ranges of {len(ranges)} layers in {len(images)} images")


if __name__ == "__main__":
    main()

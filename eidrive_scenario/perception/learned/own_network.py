"""Networks of this project, from a file .npz, by any runtime."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Floats
from eidrive_scenario.perception.image_detections import ImageDetections
from eidrive_scenario.perception.learned import image_memory
from eidrive_scenario.perception.learned.classes import VEHICLES
from eidrive_scenario.perception.learned.image_network import Candidates, ImageNetwork
from eidrive_scenario.perception.learned.raw_outputs import ssd_candidates, ssd_scales, yolo_candidates, yolo_scales
from eidrive_scenario.perception.learned.runtime_selection import Device, Runtime
from eidrive_scenario.perception.learned.runtimes import load_onnx
from eidrive_scenario.perception.learned.weight_files import read_weights
from eidrive_scenario.perception.learned.weights import Weights, read, suitable
from eidrive_scenario.sensing.readings import CameraReading

Infer = Callable[[Sequence[NDArray[np.uint8]]], list[list[Floats]]]
"""Function from images (H, W, 3) of the input size to all outputs of a network for each."""
GPU_BATCH = 4
"""Images that a GPU processes at once: as fast as one image, because the number of kernels limits both."""


class OwnNetwork(ImageNetwork):
    """Network `yolov5` or `ssd`, as the weights specify, executed by a runtime.

    If `confidence` is None, that of the weights is used. On one machine with one runtime and number of threads, equal
    images give equal bits.

    Raise SettingError if the weights are not suitable, or the device is not available.
    """

    def __init__(
        self,
        path: Path,
        runtime: Runtime,
        confidence: float | None = None,
        threads: int = 1,
        device: Device = "cpu",
    ) -> None:
        digest = hashlib.sha256(read_weights(path)).hexdigest()
        weights, self._infer = _loaded(path, digest, runtime, threads, device)
        description = weights.description
        super().__init__(description.classes, description.input_size, confidence or description.confidence)
        self.name = description.network
        self.identity: str = f"{digest} {self.confidence!r} {runtime} {threads} {device}"
        self._outward: Floats = np.array(description.outward, dtype=float).reshape(-1, 5)
        self._anchors = weights.arrays["anchors"] if self.name == "yolov5" else None

    def find_in(self, reading: CameraReading) -> ImageDetections:
        """Return the objects in the image of a camera; an image whose detections are stored is not drawn."""
        memory = image_memory.active()
        if memory is None or reading.image_digest is None:
            return self.find(reading.rgb)
        key = self._key_of(reading)
        found = memory.images.get(key)
        if found is None:
            found = self.find(reading.rgb)
            memory.images.add(key, found)
        return found

    def find_in_all(self, readings: Sequence[CameraReading]) -> list[ImageDetections]:
        """Return the objects in the image of each camera; images whose detections are not stored form one batch."""
        memory = image_memory.active()
        if memory is None:
            return self._find_all([reading.rgb for reading in readings])
        keys = [self._key_of(reading) for reading in readings]
        found = [memory.images.get(key) for key in keys]
        missing = [row for row, known in enumerate(found) if known is None]
        fresh = self._find_all([readings[row].rgb for row in missing])
        for row, one in zip(missing, fresh, strict=True):
            image_memory.read_only(one.boxes, one.scores)
            memory.images.add(keys[row], one)
            found[row] = one
        return [one for one in found if one is not None]

    def _key_of(self, reading: CameraReading) -> image_memory.Key:
        digest = reading.image_digest
        if digest is None:
            return image_memory.key_of(self.identity, reading.rgb)
        return self.identity, reading.size, digest

    def find(self, image: NDArray[np.uint8]) -> ImageDetections:
        memory = image_memory.active()
        if memory is None:
            return super().find(image)
        key = image_memory.key_of(self.identity, image)
        found = memory.images.get(key)
        if found is None:
            found = super().find(image)
            image_memory.read_only(found.boxes, found.scores)
            memory.images.add(key, found)
        return found

    def candidates(self, image: NDArray[np.uint8]) -> Candidates:
        return self._candidates(self._infer([image])[0])

    def candidates_of(self, images: Sequence[NDArray[np.uint8]]) -> list[Candidates]:
        if len(images) == 1:
            return [self.candidates(images[0])]
        return [self._candidates(outputs) for outputs in self._infer(images)]

    def calibrated(self, boxes: Array, classes: Sequence[str]) -> Array:
        vehicles = [row for row, name in enumerate(classes) if name in VEHICLES]
        if not len(self._outward) or not vehicles:
            return boxes
        boxes = boxes.copy()
        height = boxes[vehicles, 3] - boxes[vehicles, 1]
        left, top, right, bottom = (
            np.interp(height, self._outward[:, 0], self._outward[:, 1 + edge]) for edge in range(4)
        )
        boxes[vehicles] += np.stack([left, top, -right, -bottom], axis=1)
        return boxes

    def _candidates(self, outputs: list[Floats]) -> Candidates:
        if self._anchors is None:
            return ssd_candidates(ssd_scales(outputs), self.confidence)
        return yolo_candidates(self._anchors, yolo_scales(outputs), self.confidence)


@lru_cache(maxsize=4)
def _loaded(path: Path, digest: str, runtime: Runtime, threads: int, device: Device) -> tuple[Weights, Infer]:
    """Return a weight file with this digest and its function, which stations and runs share."""
    weights = read(path)
    if runtime == "torch":
        from eidrive_scenario.perception.learned.torch_network import TorchNetwork
        from eidrive_scenario.perception.learned.torch_weights import trainable

        with suitable(path):
            network = trainable(weights)
        return weights, TorchNetwork(network, threads, device, GPU_BATCH if device == "cuda" else 1)
    with suitable(path):
        content = weights.onnx()
    compute = load_onnx(runtime, path, threads, content)
    return weights, lambda images: [compute(_planes(image)) for image in images]


def _planes(image: NDArray[np.uint8]) -> Floats:
    """Return an image (H, W, 3) as (1, 3, H, W) in [0, 1]."""
    return np.divide(np.stack(cv2.split(image))[None], np.float32(255.0), dtype=np.float32)

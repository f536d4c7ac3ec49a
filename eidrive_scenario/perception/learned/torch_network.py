"""Shipped networks on the CPU."""

from __future__ import annotations

import hashlib
import math
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from eidrive_scenario.perception.image_detections import ImageDetections
from eidrive_scenario.perception.learned import image_memory
from eidrive_scenario.perception.learned.image_network import Candidates, ImageNetwork
from eidrive_scenario.perception.learned.networks.blocks import fold
from eidrive_scenario.perception.learned.networks.boxes import corners
from eidrive_scenario.perception.learned.networks.ssd import Ssd, decode, default_boxes
from eidrive_scenario.perception.learned.networks.yolov5 import STRIDES, YoloV5
from eidrive_scenario.perception.learned.weight_files import read_weights
from eidrive_scenario.perception.learned.weights import Description, load
from eidrive_scenario.sensing.readings import CameraReading


class TorchNetwork(ImageNetwork):
    """Network `yolov5` or `ssd`, as the weights specify. Raise SettingError if the weights are not suitable.

    If `confidence` is None, that of the weights is used. On one machine with one number of threads, equal images give
    equal bits.
    """

    def __init__(self, path: Path, confidence: float | None = None, threads: int = 1) -> None:
        digest = hashlib.sha256(read_weights(path)).hexdigest()
        description, network = _loaded(path, digest)
        super().__init__(description.classes, description.input_size, confidence or description.confidence)
        torch.set_num_threads(threads)
        self.name = description.network
        self.identity: str = f"{digest} {self.confidence!r} {threads}"
        self._network = network
        width, height = description.input_size
        self._defaults = default_boxes(height, width)

    def find_in(self, reading: CameraReading) -> ImageDetections:
        """Return the objects in the image of a camera; an image whose detections are stored is not drawn."""
        memory = image_memory.active()
        digest = None if memory is None else reading.image_digest
        if memory is None or digest is None:
            return self.find(reading.rgb)
        key = self.identity, reading.size, digest
        found = memory.images.get(key)
        if found is None:
            found = self.find(reading.rgb)
            memory.images.add(key, found)
        return found

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
        with torch.inference_mode():
            pixels = torch.from_numpy(np.ascontiguousarray(image)).permute(2, 0, 1)[None]
            outputs = self._network(pixels.to(torch.float32).div_(255.0))
            if isinstance(self._network, YoloV5):
                boxes, scores, classes = yolo_candidates(self._network.anchors, outputs, self.confidence)
            else:
                boxes, scores, classes = ssd_candidates(outputs, self._defaults, self.confidence)
            return Candidates(boxes.double().numpy(), scores.double().numpy(), classes.numpy())


@lru_cache(maxsize=4)
def _loaded(path: Path, digest: str) -> tuple[Description, YoloV5 | Ssd]:
    """Return the network of a weight file with this digest for inference, which stations and runs share."""
    description, network = load(path)
    fold(network)
    return description, network


def yolo_candidates(anchors: Tensor, outputs: list[Tensor], confidence: float) -> tuple[Tensor, Tensor, Tensor]:
    """Return boxes (N, 4) as corners, scores (N,) and classes (N,) of the first image; score = objectness · class.

    Decodes like `YoloV5.decode`, but only the cells whose objectness alone reaches the confidence.
    """
    least = _logit(confidence)
    boxes, scores, classes = [], [], []
    for scale, (raw, stride) in enumerate(zip(outputs, STRIDES, strict=True)):
        anchor, line, column = torch.nonzero(raw[0, ..., 4] >= least, as_tuple=True)
        share = raw[0, anchor, line, column].sigmoid()
        center = (2.0 * share[:, :2] - 0.5 + torch.stack([column, line], dim=1)) * stride
        size = (2.0 * share[:, 2:4]).square() * anchors[scale][anchor]
        best, number = share[:, 5:].max(dim=1)
        boxes.append(corners(torch.cat([center, size], dim=1)))
        scores.append(share[:, 4] * best)
        classes.append(number)
    box, score, number = torch.cat(boxes), torch.cat(scores), torch.cat(classes)
    sure = score >= confidence
    return box[sure], score[sure], number[sure]


def ssd_candidates(
    outputs: tuple[Tensor, Tensor], defaults: Tensor, confidence: float
) -> tuple[Tensor, Tensor, Tensor]:
    """Return the same for `ssd`.

    A class reaches the confidence only if its logit exceeds that of the background by enough.
    """
    encoded, logits = outputs[0][0], outputs[1][0]
    likely = (logits[:, 1:].amax(dim=1) - logits[:, 0] >= _logit(confidence)).nonzero()[:, 0]
    score, number = logits[likely].softmax(dim=1)[:, 1:].max(dim=1)
    boxes = corners(decode(encoded[likely], defaults[likely]))
    sure = score >= confidence
    return boxes[sure], score[sure], number[sure]


def _logit(probability: float) -> float:
    return math.log(probability / (1.0 - probability))

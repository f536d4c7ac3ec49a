"""Networks of this project, from a file .npz, by any runtime."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Floats
from eidrive_scenario.perception.detector import ImageDetections
from eidrive_scenario.perception.learned import image_memory
from eidrive_scenario.perception.learned.image_network import VEHICLES, Candidates, ImageNetwork
from eidrive_scenario.perception.learned.networks import ssd_sizes, yolov5_sizes
from eidrive_scenario.perception.learned.runtimes import Device, Runtime, load_onnx
from eidrive_scenario.perception.learned.weights import Precision, Weights, read, read_weights, suitable
from eidrive_scenario.sensing.readings import CameraReading


def yolo_scales(outputs: Sequence[Floats]) -> list[Floats]:
    """Return the outputs (1, A K, H, W) of the ONNX model of each scale as (A, H, W, K)."""
    count = yolov5_sizes.ANCHORS_PER_SCALE
    return [raw.reshape(count, -1, *raw.shape[2:]).transpose(0, 2, 3, 1) for raw in outputs]


def ssd_scales(outputs: Sequence[Floats]) -> list[tuple[Floats, Floats]]:
    """Return the outputs of the ONNX model as encoded boxes (H, W, 6, 4) and logits (H, W, 6, 1 + C) of each scale."""
    count = ssd_sizes.BOXES_PER_CELL
    parts = [raw.reshape(count, -1, *raw.shape[2:]).transpose(2, 3, 0, 1) for raw in outputs]
    levels = len(ssd_sizes.STRIDES)
    return list(zip(parts[:levels], parts[levels:], strict=True))


def yolo_candidates(anchors: Floats, scales: Iterable[Floats], confidence: float) -> Candidates:
    """Return the boxes of at least the minimum confidence; score = objectness · class.

    Only cells are decoded whose objectness alone reaches the confidence.

    anchors  width and height (S, A, 2) [px];  scales  raw outputs (A, H, W, 5 + C) of each scale
    """
    least = _logit(confidence)
    boxes, scores, classes = [], [], []
    for sizes, raw, stride in zip(anchors, scales, yolov5_sizes.STRIDES, strict=True):
        anchor, line, column = np.nonzero(raw[..., 4] >= least)
        share = _sigmoid(raw[anchor, line, column])
        center = (2.0 * share[:, :2] - 0.5 + np.stack([column, line], axis=1)) * stride
        size = np.square(2.0 * share[:, 2:4]) * sizes[anchor]
        boxes.append(_corners(center, size))
        classes.append(share[:, 5:].argmax(axis=1))
        scores.append(share[:, 4] * share[:, 5:].max(axis=1))
    return _confident(boxes, scores, classes, confidence)


def ssd_candidates(scales: Iterable[tuple[Floats, Floats]], confidence: float) -> Candidates:
    """Return the same for `ssd`.

    A class reaches the confidence only if its logit exceeds that of the background by enough.

    scales  encoded boxes (H, W, 6, 4) and logits (H, W, 6, 1 + C), background first, of each scale
    """
    least = _logit(confidence)
    boxes, scores, classes = [], [], []
    for level, (encoded, logits) in enumerate(scales):
        line, column, shape = np.nonzero(logits[..., 1:].max(axis=-1) - logits[..., 0] >= least)
        chosen = logits[line, column, shape]
        odds = np.exp((chosen - chosen.max(axis=1, keepdims=True, initial=-np.inf)).astype(float))
        probability = (odds / odds.sum(axis=1, keepdims=True))[:, 1:]
        sizes = _default_sizes(level)[shape]
        stride = ssd_sizes.STRIDES[level]
        offset, scale = np.split(encoded[line, column, shape].astype(float), 2, axis=1)
        center = offset * ssd_sizes.VARIANCES[0] * sizes + (np.stack([column, line], axis=1) + 0.5) * stride
        size = np.exp(np.minimum(scale * ssd_sizes.VARIANCES[1], ssd_sizes.MAX_LOG_SIZE)) * sizes
        boxes.append(_corners(center, size))
        classes.append(probability.argmax(axis=1))
        scores.append(probability.max(axis=1, initial=0.0))
    return _confident(boxes, scores, classes, confidence)


def _confident(boxes: list[Array], scores: list[Array], classes: list[Array], confidence: float) -> Candidates:
    score = np.concatenate(scores)
    sure = score >= confidence
    return Candidates(np.concatenate(boxes)[sure], score[sure], np.concatenate(classes)[sure].astype(np.int64))


def _default_sizes(level: int) -> Array:
    """Return width and height (6, 2) of the default boxes of a scale [px]."""
    side, following = ssd_sizes.SIDES[level : level + 2]
    sizes = [(side * math.sqrt(aspect), side / math.sqrt(aspect)) for aspect in ssd_sizes.ASPECTS]
    return np.array([*sizes, (math.sqrt(side * following),) * 2])


def _corners(center: Array, size: Array) -> Array:
    return np.concatenate([center - size / 2.0, center + size / 2.0], axis=1)


def _sigmoid(raw: Floats) -> Array:
    with np.errstate(over="ignore"):  # infinity gives 0
        return np.asarray(1.0 / (1.0 + np.exp(-raw.astype(float))))


def _logit(probability: float) -> float:
    return math.log(probability / (1.0 - probability))


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
        precision: Precision = "float32",
    ) -> None:
        digest = hashlib.sha256(read_weights(path)).hexdigest()
        weights, self._infer = _loaded(path, digest, runtime, threads, device, precision)
        description = weights.description
        super().__init__(description.classes, description.input_size, confidence or description.confidence)
        self.name = description.network
        self.identity: str = f"{digest} {self.confidence!r} {runtime} {threads} {device} {precision}"
        self._outward: Floats = np.array(description.outward, dtype=float).reshape(-1, 5)
        self._anchors = weights.arrays["anchors"] if self.name == "yolov5" else None

    def find_in_all(self, readings: Sequence[CameraReading]) -> list[ImageDetections]:
        """Return the objects in the image of each camera; images whose detections are not stored form one batch.

        An image whose detections are stored is not drawn.
        """
        memory = image_memory.active()
        if memory is None:
            return self._find_all([reading.rgb for reading in readings])
        keys = [self._key_of(reading) for reading in readings]
        results = [memory.images.get(key) for key in keys]
        missing = [index for index, result in enumerate(results) if result is None]
        fresh = self._find_all([readings[index].rgb for index in missing])
        for index, detections in zip(missing, fresh, strict=True):
            image_memory.read_only(detections.boxes, detections.scores)
            memory.images.add(keys[index], detections)
            results[index] = detections
        return [detections for detections in results if detections is not None]

    def _key_of(self, reading: CameraReading) -> image_memory.Key:
        if reading.image_digest is not None:
            return self.identity, reading.size, reading.image_digest
        return self.identity, reading.rgb.shape, hashlib.sha256(np.ascontiguousarray(reading.rgb).data).digest()

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
def _loaded(
    path: Path, digest: str, runtime: Runtime, threads: int, device: Device, precision: Precision
) -> tuple[Weights, Infer]:
    """Return a weight file with this digest and its function, which stations and runs share."""
    weights = read(path)
    if runtime == "torch":
        from eidrive_scenario.perception.learned.torch_network import TorchNetwork, trainable

        with suitable(path):
            network = trainable(weights)
        return weights, TorchNetwork(network, threads, device, GPU_BATCH if device == "cuda" else 1)
    with suitable(path):
        content = weights.onnx(precision)
    compute = load_onnx(runtime, path, threads, content)
    return weights, lambda images: [compute(planes(image)) for image in images]


def planes(image: NDArray[np.uint8]) -> Floats:
    """Return an image (H, W, 3) as (1, 3, H, W) in [0, 1]."""
    return np.divide(np.stack(cv2.split(image))[None], np.float32(255.0), dtype=np.float32)

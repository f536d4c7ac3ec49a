"""Boxes, scores and classes from the outputs of `yolov5` and `ssd`, with numpy for every runtime."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from eidrive_scenario.arrays import Array, Floats
from eidrive_scenario.perception.learned.image_network import Candidates
from eidrive_scenario.perception.learned.networks import ssd_sizes, yolov5_sizes


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

    Decodes like `YoloV5.decode`, but only the cells whose objectness alone reaches the confidence.

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
        probability = _softmax(logits[line, column, shape])[:, 1:]
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


def _softmax(raw: Floats) -> Array:
    shares = np.exp((raw - raw.max(axis=1, keepdims=True, initial=-np.inf)).astype(float))
    return np.asarray(shares / shares.sum(axis=1, keepdims=True))


def _logit(probability: float) -> float:
    return math.log(probability / (1.0 - probability))

"""The seam between a network and its pictures: what is found in one picture, whatever computes it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.arrays import Array, Integers
from eidrive_scenario.perception.image_detections import ImageDetections
from eidrive_scenario.perception.learned.classes import suppression_groups
from eidrive_scenario.perception.learned.networks.suppression import suppress

LARGEST_OVERLAP = 0.5
"""Of two boxes of like class that overlap by more, the better one counts."""
MOST_CANDIDATES = 1000
MARGIN_GRAY = 114
"""What is beside a letterboxed picture, in the networks of Ultralytics and those trained like them."""


@dataclass(frozen=True)
class Candidates:
    """Boxes before suppression: (N, 4) x1 y1 x2 y2 [px of the network's input], scores (N,), class numbers (N,)."""

    boxes: Array
    scores: Array
    classes: Integers


class ImageNetwork(ABC):
    """Finds objects in pictures of any size, which it takes to its own size.

    classes  names in the order of the outputs;  input_size  width and height of the network's input [px]
    letterbox  whether pictures keep their shape, with gray margins; else they are stretched
    """

    def __init__(
        self, classes: Sequence[str], input_size: tuple[int, int], confidence: float, letterbox: bool = False
    ) -> None:
        self.classes = tuple(classes)
        self.input_size = input_size
        self.confidence = confidence
        self.letterbox = letterbox
        self._groups = suppression_groups(self.classes)

    def find(self, picture: NDArray[np.uint8]) -> ImageDetections:
        """The objects in a picture (H, W, 3), red green blue. Boxes without an area in the picture are left out."""
        height, width = picture.shape[:2]
        if self.letterbox:
            own, scale, corner = letterboxed(picture, self.input_size)
        else:
            own, corner = resized(picture, self.input_size), np.zeros(2)
            scale = np.array([self.input_size[0] / width, self.input_size[1] / height])
        candidates = _finite(self.candidates(own))
        if len(candidates.scores) > MOST_CANDIDATES:
            best = np.argsort(-candidates.scores, kind="stable")[:MOST_CANDIDATES]
            candidates = Candidates(candidates.boxes[best], candidates.scores[best], candidates.classes[best])
        groups = self._groups[candidates.classes]
        kept = suppress(candidates.boxes, candidates.scores, groups, LARGEST_OVERLAP)
        boxes = (candidates.boxes[kept] - np.tile(corner, 2)) / np.tile(scale, 2)
        boxes[:, 0::2] = boxes[:, 0::2].clip(0.0, width)
        boxes[:, 1::2] = boxes[:, 1::2].clip(0.0, height)
        shown = (boxes[:, 2:] > boxes[:, :2]).all(axis=1)
        boxes, kept = boxes[shown], kept[shown]
        names = tuple(self.classes[number] for number in candidates.classes[kept].tolist())
        return ImageDetections(boxes, candidates.scores[kept], names)

    @abstractmethod
    def candidates(self, picture: NDArray[np.uint8]) -> Candidates:
        """All boxes of at least the least confidence in a picture of the network's own size."""


def _finite(candidates: Candidates) -> Candidates:
    """The candidates whose boxes have finite edges."""
    finite = np.isfinite(candidates.boxes).all(axis=1)
    if finite.all():
        return candidates
    return Candidates(candidates.boxes[finite], candidates.scores[finite], candidates.classes[finite])


def resized(picture: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """The picture in the size width x height, each new pixel the mean of what it covers where it shrinks."""
    height, width = picture.shape[:2]
    if (width, height) == size:
        return picture
    shrinks = width >= size[0] and height >= size[1]
    return np.asarray(
        cv2.resize(picture, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR), np.uint8
    )


def letterboxed(picture: NDArray[np.uint8], size: tuple[int, int]) -> tuple[NDArray[np.uint8], Array, Array]:
    """The picture in its own shape as large as fits into the size, in its middle; (2,) the scales by which it shrank
    in x and y, and (2,) where its corner is [px]."""
    height, width = picture.shape[:2]
    ratio = min(size[0] / width, size[1] / height)
    inner = max(round(width * ratio), 1), max(round(height * ratio), 1)
    left, top = (size[0] - inner[0]) // 2, (size[1] - inner[1]) // 2
    canvas = np.full((size[1], size[0], 3), MARGIN_GRAY, dtype=np.uint8)
    canvas[top : top + inner[1], left : left + inner[0]] = resized(picture, inner)
    return canvas, np.array([inner[0] / width, inner[1] / height]), np.array([left, top], dtype=float)

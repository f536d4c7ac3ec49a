"""Abstract base class of networks that detect objects in images."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.base.arrays import Array, Integers
from eidrive_scenario.base.detections import CLASSES
from eidrive_scenario.perception.detector import ImageDetections
from eidrive_scenario.perception.learned.networks.suppression import suppress
from eidrive_scenario.roads.model.signal_states import OFF, lamps
from eidrive_scenario.sensing.readings import CameraReading

OBJECT_CLASSES = ("car", "truck", "bus", "motorbike", "bicycle", "pedestrian")
LIGHT_STATES = ("red", "yellow", "green", "off")
LIGHT = "traffic light"
UNKNOWN = "unknown"
"""State of a light whose class has none."""
STOP_SIGN = "stop sign"
IMAGE_CLASSES = (*OBJECT_CLASSES, *(f"{LIGHT} {state}" for state in LIGHT_STATES), STOP_SIGN)
"""The classes of the shipped weights, in the order of the networks' outputs."""

VEHICLES = ("car", "truck", "bus")
"""Those of vehicles with four or more wheels; a van is a car."""

VERY_LIKE = 0.85
"""Similarity (ratio of Ratcliff and Obershelp) from which a name is reported as misspelt."""
_VEHICLES = (*VEHICLES, "van")
_SAME_AS = {"van": "car", "person": "pedestrian", "motorcycle": "motorbike"}


def object_category(name: str) -> str | None:
    """Return the class out of eidrive_scenario.base.detections.CLASSES for a network class; None for other things."""
    if name in CLASSES:
        return name
    category = _SAME_AS.get(name)
    return category if category in CLASSES else None


def light_state(name: str) -> str | None:
    """Return the state in the name of a traffic light class; None for all other classes."""
    if name == LIGHT:
        return UNKNOWN
    return name.removeprefix(f"{LIGHT} ") if name.startswith(f"{LIGHT} ") else None


def misspelt(name: str) -> str | None:
    """Return the class whose name is very similar to this name; None for classes that are in use, and if none is
    similar.

    Networks distinguish many things that are not used here, so an unknown name is not an error by itself.
    """
    state = light_state(name)
    if (
        object_category(name)
        or name == STOP_SIGN
        or (state and (state in ("off", UNKNOWN) or any(mode != OFF for _, mode in lamps(state))))
    ):
        return None
    near = get_close_matches(name, (*CLASSES, *_SAME_AS, LIGHT, *IMAGE_CLASSES), n=1, cutoff=VERY_LIKE)
    return near[0] if near else None


def suppression_groups(names: Sequence[str]) -> NDArray[np.int64]:
    """Return the group (C,) of each class: overlapping boxes of one group are one object.

    A traffic light has one state, so its states are one group; a vehicle is not both a car and a truck.
    """
    groups: dict[str, int] = {}
    keys = [LIGHT if light_state(name) else "vehicle" if name in _VEHICLES else name for name in names]
    return np.array([groups.setdefault(key, len(groups)) for key in keys], dtype=np.int64)


LARGEST_OVERLAP = 0.5
"""Overlap above which only the best of several boxes of one group is kept."""
MOST_CANDIDATES = 1000
"""Maximum number of boxes before suppression; those with the highest scores are used."""
MARGIN_GRAY = 114
"""Gray value of the margins of letterboxed images, as in the networks of Ultralytics."""


@dataclass(frozen=True)
class Candidates:
    """Boxes before suppression: (N, 4) x1 y1 x2 y2 [px of the network input], scores (N,), class numbers (N,)."""

    boxes: Array
    scores: Array
    classes: Integers


class _Scaled(NamedTuple):
    """Image in the size of the network input, its scales (2,) in x and y, and its offset (2,) in that input [px]."""

    pixels: NDArray[np.uint8]
    scale: Array
    corner: Array


class ImageNetwork(ABC):
    """Detector of objects in images of any size, which are scaled to the input size.

    classes  names in the order of the outputs;  input_size  width and height of the network input [px]
    letterbox  whether images keep their aspect ratio, with gray margins; otherwise they are stretched
    identity   text that determines weights and settings, if equal images give equal results; else None
    """

    def __init__(
        self, classes: Sequence[str], input_size: tuple[int, int], confidence: float, letterbox: bool = False
    ) -> None:
        self.classes = tuple(classes)
        self.input_size = input_size
        self.confidence = confidence
        self.letterbox = letterbox
        self.identity: str | None = None
        self._groups = suppression_groups(self.classes)

    def find_in(self, reading: CameraReading) -> ImageDetections:
        """Return the objects in the image of a camera."""
        return self.find_in_all([reading])[0]

    def find_in_all(self, readings: Sequence[CameraReading]) -> list[ImageDetections]:
        """Return the objects in the image of each camera."""
        return self._find_all([reading.rgb for reading in readings])

    def find(self, image: NDArray[np.uint8]) -> ImageDetections:
        """Return the objects in an image (H, W, 3), red green blue. Boxes without an area in the image are removed."""
        return self._find_all([image])[0]

    def _find_all(self, images: Sequence[NDArray[np.uint8]]) -> list[ImageDetections]:
        scaled = [self._scaled(image) for image in images]
        candidates = self.candidates_of([image.pixels for image in scaled])
        return [self._detections(*parts) for parts in zip(images, scaled, candidates, strict=True)]

    def _scaled(self, image: NDArray[np.uint8]) -> _Scaled:
        if self.letterbox:
            return _Scaled(*letterboxed(image, self.input_size))
        height, width = image.shape[:2]
        scale = np.array([self.input_size[0] / width, self.input_size[1] / height])
        return _Scaled(resized(image, self.input_size), scale, np.zeros(2))

    def _detections(self, image: NDArray[np.uint8], scaled: _Scaled, candidates: Candidates) -> ImageDetections:
        height, width = image.shape[:2]
        rows = np.flatnonzero(np.isfinite(candidates.boxes).all(axis=1))
        if len(rows) > MOST_CANDIDATES:
            rows = rows[np.argsort(-candidates.scores[rows], kind="stable")[:MOST_CANDIDATES]]
        candidates = Candidates(candidates.boxes[rows], candidates.scores[rows], candidates.classes[rows])
        groups = self._groups[candidates.classes]
        kept = suppress(candidates.boxes, candidates.scores, groups, LARGEST_OVERLAP)
        boxes = self.calibrated(candidates.boxes[kept], [self.classes[number] for number in candidates.classes[kept]])
        boxes = (boxes - np.tile(scaled.corner, 2)) / np.tile(scaled.scale, 2)
        boxes[:, 0::2] = boxes[:, 0::2].clip(0.0, width)
        boxes[:, 1::2] = boxes[:, 1::2].clip(0.0, height)
        visible = (boxes[:, 2:] > boxes[:, :2]).all(axis=1)
        boxes, kept = boxes[visible], kept[visible]
        names = tuple(self.classes[number] for number in candidates.classes[kept].tolist())
        return ImageDetections(boxes, candidates.scores[kept], names)

    def calibrated(self, boxes: Array, classes: Sequence[str]) -> Array:
        """Return boxes (N, 4) of an image of the input size [px] without the mean errors of their edges, if known."""
        return boxes

    @abstractmethod
    def candidates(self, image: NDArray[np.uint8]) -> Candidates:
        """Return all boxes of at least the minimum confidence in an image of the input size."""

    def candidates_of(self, images: Sequence[NDArray[np.uint8]]) -> list[Candidates]:
        """Return the boxes in each image of the input size, as `candidates` does."""
        return [self.candidates(image) for image in images]


def resized(image: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the image in the size width x height; shrinking averages over pixel areas."""
    height, width = image.shape[:2]
    if (width, height) == size:
        return image
    shrinks = width >= size[0] and height >= size[1]
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR), np.uint8)


def letterboxed(image: NDArray[np.uint8], size: tuple[int, int]) -> tuple[NDArray[np.uint8], Array, Array]:
    """Return the image scaled into the size with its aspect ratio, the scales (2,) in x and y, and its offset (2,)
    [px].

    The image is centered.
    """
    height, width = image.shape[:2]
    ratio = min(size[0] / width, size[1] / height)
    inner = max(round(width * ratio), 1), max(round(height * ratio), 1)
    left, top = (size[0] - inner[0]) // 2, (size[1] - inner[1]) // 2
    canvas = np.full((size[1], size[0], 3), MARGIN_GRAY, dtype=np.uint8)
    canvas[top : top + inner[1], left : left + inner[0]] = resized(image, inner)
    return canvas, np.array([inner[0] / width, inner[1] / height]), np.array([left, top], dtype=float)

"""Scores of detections over whole sets of images, for subsets of the objects: by class, distance, size and weather."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools
from eidrive_scenario.experiments.average_precision import Matches, average_precision, match, recall_at
from eidrive_scenario.perception.detector import ImageDetections
from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES, LIGHT, light_state


@dataclass(frozen=True)
class Objects:
    """Objects of one image: boxes (M, 4) [px], class names, height [px of the camera], distance [m], and whether they
    are required."""

    boxes: Array
    names: tuple[str, ...]
    height: Array
    distance: Array
    to_find: Bools


@dataclass(frozen=True)
class EvaluatedImage:
    """Image with its objects, detections, and the name of its weather."""

    objects: Objects
    detections: ImageDetections
    weather: str
    confidence: float
    """Default confidence of the detector, at which recall is evaluated."""


@dataclass(frozen=True)
class Part:
    """Subset of objects: classes, distances [m], minimum and maximum height [px], weather.

    detected_as  classes of detections that count; none: the same
    """

    names: tuple[str, ...]
    nearest: float = 0.0
    farthest: float = np.inf
    height: float = 0.0
    weather: str = ""
    max_height: float = np.inf
    detected_as: tuple[str, ...] = ()

    def required(self, objects: Objects) -> Bools:
        """Return the objects (M,) of this subset."""
        of_classes = np.array([name in self.names for name in objects.names], dtype=bool)
        near = (objects.distance >= self.nearest) & (objects.distance < self.farthest)
        high = (objects.height >= self.height) & (objects.height < self.max_height)
        return of_classes & near & high & objects.to_find


@dataclass(frozen=True)
class Score:
    """Scores of a subset: average precision at overlap 0.5, recall at the default confidence, number of objects."""

    precision: float
    recall: float
    objects: int


def score(images: Sequence[EvaluatedImage], part: Part) -> Score:
    """Return the score of a subset with all its classes as one: a truck that is detected as a car is detected.

    Objects of those classes outside the subset, and objects that are not required, are ignored.
    """
    matches: list[Matches] = []
    count = 0
    names = {*part.names, *part.detected_as}
    for image in images:
        if part.weather and image.weather != part.weather:
            continue
        objects = image.objects
        required = part.required(objects)
        of_classes = np.array([name in names for name in objects.names], dtype=bool) | ~objects.to_find
        detected = np.array([name in (part.detected_as or part.names) for name in image.detections.classes], dtype=bool)
        matches.append(
            match(
                image.detections.boxes[detected],
                image.detections.scores[detected],
                objects.boxes[of_classes],
                ~required[of_classes],
            )
        )
        count += int(required.sum())
    confidence = images[0].confidence if images else 0.0
    return Score(average_precision(matches, count), recall_at(matches, count, confidence), count)


def mean_precision(images: Sequence[EvaluatedImage], names: Sequence[str], weather: str) -> float:
    """Return the mean average precision of the classes that occur; NaN if there are none."""
    values = [score(images, Part((name,), weather=weather)).precision for name in names]
    defined = [value for value in values if not np.isnan(value)]
    return float(np.mean(defined)) if defined else float("nan")


def as_one_light(images: Sequence[EvaluatedImage]) -> list[EvaluatedImage]:
    """Return the images with one class for all traffic lights, to evaluate detection without the state."""

    def merge_lights(names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(LIGHT if light_state(name) else name for name in names)

    merged = []
    for image in images:
        objects = replace(image.objects, names=merge_lights(image.objects.names))
        boxes, scores, classes = image.detections.boxes, image.detections.scores, image.detections.classes
        detections = ImageDetections(boxes, scores, merge_lights(classes))
        merged.append(replace(image, objects=objects, detections=detections))
    return merged


ROAD_USERS = IMAGE_CLASSES[:6]

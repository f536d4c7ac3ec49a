"""Scores of detections over whole sets of pictures, for parts of the objects: by class, distance, size and weather."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.perception.image_detections import ImageDetections
from eidrive_scenario.perception.learned.average_precision import Matches, average_precision, match, recall_at
from eidrive_scenario.perception.learned.classes import IMAGE_CLASSES, LIGHT, light_state

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

VEHICLES = ("car", "truck", "bus")


@dataclass(frozen=True)
class Objects:
    """What is in one picture: boxes (M, 4) [px of the picture], class names, height [px of the camera], distance [m],
    and whether it shows enough to be asked for."""

    boxes: Array
    names: tuple[str, ...]
    height: Array
    distance: Array
    to_find: Bools


@dataclass(frozen=True)
class Judged:
    """One picture: its objects, what was found, and the name of its weather."""

    objects: Objects
    found: ImageDetections
    weather: str
    confidence: float
    """From which on the detector itself believes its boxes; recall is told for that."""


@dataclass(frozen=True)
class Part:
    """Some of the objects: of these classes, at these distances [m], at least so high [px], in this weather."""

    names: tuple[str, ...]
    nearest: float = 0.0
    farthest: float = np.inf
    height: float = 0.0
    weather: str = ""

    def asked(self, objects: Objects) -> Bools:
        """(M,) the objects of this part."""
        named = np.array([name in self.names for name in objects.names], dtype=bool)
        near = (objects.distance >= self.nearest) & (objects.distance < self.farthest)
        return named & near & (objects.height >= self.height) & objects.to_find


@dataclass(frozen=True)
class Score:
    """Of one part: average precision at overlap 0.5, recall at the detectors' confidence, number of objects."""

    precision: float
    recall: float
    objects: int


def score(pictures: Sequence[Judged], part: Part) -> Score:
    """All classes of the part taken as one: a truck found as a car is found.

    Objects of those classes beyond the part, and all that shows too little, neither count nor harm.
    """
    matches: list[Matches] = []
    count = 0
    for picture in pictures:
        if part.weather and picture.weather != part.weather:
            continue
        objects = picture.objects
        asked = part.asked(objects)
        mine = np.array([name in part.names for name in objects.names], dtype=bool) | ~objects.to_find
        detected = np.array([name in part.names for name in picture.found.classes], dtype=bool)
        matches.append(
            match(picture.found.boxes[detected], picture.found.scores[detected], objects.boxes[mine], ~asked[mine])
        )
        count += int(asked.sum())
    confidence = pictures[0].confidence if pictures else 0.0
    return Score(average_precision(matches, count), recall_at(matches, count, confidence), count)


def mean_precision(pictures: Sequence[Judged], names: Sequence[str], weather: str) -> float:
    """Mean of the average precision of each class that occurs; NaN where none does."""
    values = [score(pictures, Part((name,), weather=weather)).precision for name in names]
    known = [value for value in values if not np.isnan(value)]
    return float(np.mean(known)) if known else float("nan")


def as_one_light(pictures: Sequence[Judged]) -> list[Judged]:
    """The same with the states of traffic lights forgotten, to tell finding a light from reading it."""

    def plain(names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(LIGHT if light_state(name) else name for name in names)

    return [
        Judged(
            Objects(
                entry.objects.boxes,
                plain(entry.objects.names),
                entry.objects.height,
                entry.objects.distance,
                entry.objects.to_find,
            ),
            ImageDetections(entry.found.boxes, entry.found.scores, plain(entry.found.classes)),
            entry.weather,
            entry.confidence,
        )
        for entry in pictures
    ]


ROAD_USERS = IMAGE_CLASSES[:6]

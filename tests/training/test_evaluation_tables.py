"""Tables of `make eval`: accuracy of traffic light states, causes of missed vehicles, and scores by runtime."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from eidrive_scenario.perception.detector import ImageDetections
from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES
from eidrive_scenario.perception.learned.settings import LearnedSettings
from training import runtime_scores
from training.dataset import Dataset, encode, write
from training.light_scores import Reading, light_table
from training.misses import CAUSES, causes, misses
from training.realism import HEIGHTS, PHOTOGRAPHS
from training.scoring import EvaluatedImage, Objects, Part, score
from training.tables import as_markdown

CAR, WALKER = IMAGE_CLASSES.index("car"), IMAGE_CLASSES.index("pedestrian")


def dataset(folder: Path) -> Dataset:
    """Return two images of 100 x 80: by day with various cars, and at night with one; objects by image, class, box,
    height, seen, whole, distance."""
    rows = [
        (0, CAR, (30, 30, 50, 50), 20.0, 300, 300, 90.0),  # contrast exp(-3.912 · 90 / 200) = 0.17
        (0, CAR, (60, 30, 75, 40), 10.0, 100, 100, 40.0),
        (0, CAR, (10, 55, 30, 75), 20.0, 100, 300, 20.0),
        (0, CAR, (80, 30, 100, 50), 20.0, 300, 300, 20.0),
        (0, CAR, (40, 55, 60, 75), 20.0, 300, 300, 20.0),
        (0, CAR, (44, 55, 64, 75), 20.0, 300, 300, 20.0),
        (0, CAR, (70, 55, 78, 63), 20.0, 300, 300, 20.0),
        (0, WALKER, (5, 5, 12, 25), 20.0, 100, 100, 20.0),
        (1, CAR, (30, 30, 50, 50), 20.0, 300, 300, 20.0),
    ]
    columns: dict[str, Any] = {
        "size": np.full((2, 2), (100, 80)),
        "visual_range": np.array([200.0, 10_000.0]),
        "sun_elevation": np.array([40.0, -20.0]),
        "weather": np.array(["fog", "night"]),
        "picture": np.array([row[0] for row in rows]),
        "number": np.array([row[1] for row in rows]),
        "box": np.array([row[2] for row in rows], dtype=np.float32),
        "height": np.array([row[3] for row in rows]),
        "seen": np.array([row[4] for row in rows]),
        "whole": np.array([row[5] for row in rows]),
        "distance": np.array([row[6] for row in rows]),
        "readable": np.ones(len(rows), dtype=bool),
    }
    write(folder, [encode(np.full((80, 100, 3), 99, dtype=np.uint8), 80)] * 2, columns)
    return Dataset.load(folder)


def test_causes_returns_first_that_applies(tmp_path: Path) -> None:
    names = (*CAUSES, "none of these")
    found = [names[index] for index in causes(dataset(tmp_path))]
    assert found[:4] == [
        "faint in fog, rain or snow",
        "lower than 15 px",
        "more than half hidden",
        "cut off by the border of the image",
    ]
    assert found[4:7] == ["overlaps another vehicle", "overlaps another vehicle", "none of these"]
    assert found[8] == "at night"


def test_misses_count_vehicles_of_any_class(tmp_path: Path) -> None:
    """Detected: the car in fog, as a truck, and the one at night, below the confidence. Pedestrians do not count."""
    data = dataset(tmp_path)
    everything = np.array([[30.0, 30.0, 50.0, 50.0]])
    evaluated = [
        EvaluatedImage(
            Objects(np.empty((0, 4)), (), np.empty(0), np.empty(0), np.empty(0, dtype=bool)),
            ImageDetections(everything, np.array([score]), (name,)),
            "clear",
            confidence=0.5,
        )
        for score, name in ((0.9, "truck"), (0.3, "car"))
    ]
    _, head, rows = misses({"net": evaluated}, data)
    assert head == ["cause", "vehicles", "net missed", "of all misses", "recall"]
    by_name = {row[0]: row[1:] for row in rows}
    assert by_name["faint in fog, rain or snow"] == ["1", "0", "0%", "1.000"]
    assert by_name["at night"] == ["1", "1", "14%", "0.000"]
    assert by_name["overlaps another vehicle"] == ["2", "2", "29%", "0.000"]
    assert sum(int(row[0]) for row in by_name.values()) == 8


def test_light_table_counts_correct_and_incorrect_states() -> None:
    def reading(state: str, read: str, *, to_read: bool = True, hidden: bool = False) -> Reading:
        return Reading(state, 20.0, "clear", to_read, hidden, {"method": read})

    found = [reading("red", "red"), reading("red", "green"), reading("green", ""), reading("off", "off")]
    found += [reading("red", "red", to_read=False, hidden=True), reading("red", "", to_read=False, hidden=True)]
    title, head, rows = light_table(found)
    assert head == ["lights", "method: correct", "method: incorrect", "n"]
    by_name = {row[0]: row[1:] for row in rows}
    assert by_name["all"] == ["0.50", "0.25", "4"]
    assert by_name["red"] == ["0.50", "0.50", "2"]
    assert by_name["15 to 25 m"] == ["0.50", "0.25", "4"]
    assert by_name["occluded"] == ["0.50", "0.00", "2"]
    assert f"## {title}" in as_markdown([(title, head, rows)])


class LeftCar:
    """Detector of the car at (30, 30), in some images only."""

    confidence = 0.5

    def __init__(self, images: int, score: float) -> None:
        self.images, self.score = images, score

    def find(self, image: NDArray[np.uint8]) -> ImageDetections:
        assert image.shape == (80, 100, 3)
        self.images -= 1
        boxes = np.array([[30.0, 30.0, 50.0, 50.0]])[: self.images + 1]
        return ImageDetections(boxes, np.full(len(boxes), self.score), ("car",) * len(boxes))


def test_runtime_table_compares_classes_with_torch_and_repetitions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Torch detects two of eight cars, ONNX Runtime one; the scores of the latter increase from network to network."""
    built: list[str] = []

    def build(name: str, settings: LearnedSettings) -> LeftCar:
        built.append(settings.runtime)
        onnx = settings.runtime == "onnxruntime"
        return LeftCar(1 if onnx else 2, 0.5 + (0.01 * len(built) if onnx else 0.0))

    monkeypatch.setattr(runtime_scores, "build_network", build)
    monkeypatch.setattr(runtime_scores, "is_installed", {"torch", "onnxruntime"}.__contains__)
    title, head, rows = runtime_scores.runtime_table(["yolov5"], dataset(tmp_path), 240, 0.01)
    assert title == "Runtimes: 2 held-out images"
    by_runtime = {row[1].split()[0]: dict(zip(head, row, strict=True)) for row in rows}
    assert set(by_runtime) == {"torch", "onnxruntime"}
    found = by_runtime["onnxruntime"]
    assert (found["class"], found["largest difference"]) == ("car", "0.125000")
    assert found["mean AP50"] in {"0.062", "0.063"}  # of cars and pedestrians
    assert found["equal when repeated"] == "no"
    assert by_runtime["torch"]["largest difference"] == "0.000000"
    assert by_runtime["torch"]["equal when repeated"] == "yes"
    assert built == ["onnxruntime", "onnxruntime", "torch", "torch"]


def test_score_counts_detections_of_related_classes_within_heights() -> None:
    """A bus found as truck counts for buses; the truck beside it is ignored, and the low bus is outside the subset."""
    boxes = np.array([[0.0, 0.0, 40.0, 40.0], [50.0, 0.0, 70.0, 40.0], [80.0, 0.0, 100.0, 10.0]])
    image = EvaluatedImage(
        Objects(boxes, ("bus", "truck", "bus"), np.array([40.0, 40.0, 10.0]), np.full(3, 20.0), np.ones(3, dtype=bool)),
        ImageDetections(boxes, np.array([0.9, 0.8, 0.7]), ("truck", "truck", "car")),
        "clear",
        confidence=0.5,
    )
    alone = score([image], Part(("bus",)))
    assert (alone.recall, alone.objects) == (0.0, 2)
    related = score([image], Part(("bus",), height=20.0, max_height=64.0, detected_as=("car", "truck")))
    assert (related.precision, related.recall, related.objects) == (1.0, 1.0, 1)
    low = score([image], Part(("bus",), max_height=20.0, detected_as=("car", "truck")))
    assert (low.recall, low.objects) == (1.0, 1)


def test_marked_objects_of_photographs_are_high_enough() -> None:
    """Heights of the photographs [px] are those of the files in both packages."""
    rows = dict(zip(PHOTOGRAPHS, (576, 424, 900, 680, 938), strict=True))
    for name, objects in PHOTOGRAPHS.items():
        for _, (left, top, right, bottom) in objects:
            assert 0 <= left < right
            assert 0 <= top < bottom <= rows[name]
            assert (bottom - top) * 300 / rows[name] >= HEIGHTS[-1][0]

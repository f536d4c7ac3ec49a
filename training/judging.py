"""What the detectors find in held-out pictures and in scenes, beside what is there."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.perception.learned.classes import IMAGE_CLASSES
from eidrive_scenario.perception.learned.detector import LearnedDetector, LearnedSettings
from eidrive_scenario.perception.learned.image_network import ImageNetwork
from training.dataset import Dataset, shows_enough, write
from training.labels import Label
from training.render_data import PER_WORLD, Shot, render, table
from training.scenes import Seen
from training.scoring import VEHICLES, Judged, Objects

Array = NDArray[np.float64]

MATCHED_WITHIN = 4.0
"""Lifted boxes farther from every object's center than this are not of one [m]."""


def held_out(folder: Path, seed: int, pictures: int, processes: int) -> Dataset:
    """The held-out pictures, rendered where they are missing."""
    if not (folder / "labels.npz").is_file():
        taken: list[Shot] = []
        worlds = -(-pictures // PER_WORLD)
        for number, found in enumerate(render(seed, "held_out", worlds, 0, processes)):
            taken += found
            print(f"\rrendering held-out pictures: {(number + 1) * PER_WORLD}/{worlds * PER_WORLD}", end="", flush=True)
        print()
        write(folder, [entry.data for entry in taken], table(taken))
    return Dataset.load(folder)


def judge_dataset(network: ImageNetwork, dataset: Dataset, confidence: float) -> list[Judged]:
    """What a network finds in the pictures of a dataset."""
    to_find = dataset.to_find()
    judged = []
    for number, picture in enumerate(dataset.pictures()):
        rows = dataset.objects(number)
        objects = Objects(
            boxes=dataset.box[rows].astype(float),
            names=tuple(IMAGE_CLASSES[which] for which in dataset.number[rows]),
            height=dataset.height[rows].astype(float),
            distance=dataset.distance[rows].astype(float),
            to_find=to_find[rows],
        )
        judged.append(Judged(objects, network.find(picture), str(dataset.weather[number]), confidence))
    return judged


def judge_scenes(network: ImageNetwork, scenes: Sequence[Seen], confidence: float) -> list[Judged]:
    """The same for scenes."""
    return [
        Judged(objects_of(seen.labels), network.find(seen.readings.cameras["camera"].rgb), seen.weather, confidence)
        for seen in scenes
    ]


def objects_of(labels: Sequence[Label]) -> Objects:
    """The labels of one picture."""
    boxes = np.array([label.box for label in labels], dtype=float).reshape(-1, 4)
    height = boxes[:, 3] - boxes[:, 1]
    seen, whole = (np.array([getattr(label, key) for label in labels], dtype=float) for key in ("seen", "whole"))
    return Objects(
        boxes=boxes,
        names=tuple(IMAGE_CLASSES[label.number] for label in labels),
        height=height,
        distance=np.array([label.distance for label in labels], dtype=float),
        to_find=shows_enough(height, seen, whole),
    )


def center_errors(kind: type[LearnedDetector], scenes: Iterable[Seen], use_lidar: bool) -> Array:
    """(K, 2) distance of each vehicle that was found [m], and how far off in plan view its lifted center is [m]."""
    detector = kind(LearnedSettings())
    found = []
    for seen in scenes:
        readings = seen.readings
        if not use_lidar:
            readings = type(readings)(readings.time, readings.ego, cameras=readings.cameras)
        detector.setup(seen.installation)
        detections = detector.detect(readings)
        objects = objects_of(seen.labels)
        vehicles = [
            label
            for label, enough in zip(seen.labels, objects.to_find, strict=True)
            if enough and IMAGE_CLASSES[label.number] in VEHICLES
        ]
        centers = np.array([label.place[:2] for label in vehicles], dtype=float).reshape(-1, 2)
        free = np.ones(len(vehicles), dtype=bool)
        for row in np.argsort(-detections.scores, kind="stable"):
            away = np.linalg.norm(centers - detections.boxes[row, :2], axis=1)
            away[~free] = np.inf
            if len(away) and away.min() <= MATCHED_WITHIN:
                nearest = int(np.argmin(away))
                free[nearest] = False
                found.append((vehicles[nearest].distance, float(away[nearest])))
    return np.array(found).reshape(-1, 2)


def milliseconds(network: ImageNetwork, picture: NDArray[np.uint8], repeats: int = 40) -> float:
    """Least processor time for one picture [ms]: what others do on the machine does not count."""
    times = []
    for _ in range(repeats):
        started = time.process_time()
        network.find(picture)
        times.append(time.process_time() - started)
    return min(times) * 1e3


def parameters(path: Path) -> int:
    """Numbers that were learned, in a file of weights; running means and the like aside."""
    with np.load(path) as stored:
        return sum(int(stored[name].size) for name in stored.files if name.endswith((".weight", ".bias")))

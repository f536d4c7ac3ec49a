"""Detections in held-out images and in scenes, compared with the true objects."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from eidrive_scenario.base.arrays import Array, Bytes
from eidrive_scenario.perception.learned.detector import LearnedDetector
from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES, VEHICLES, ImageNetwork
from eidrive_scenario.perception.learned.settings import LearnedSettings
from eidrive_scenario.sensing.readings import Readings
from training.dataset import Dataset, shows_enough
from training.labels import Label
from training.scenes import StationScene
from training.scoring import EvaluatedImage, Objects

MATCHED_WITHIN = 4.0
"""Maximum distance of a lifted box from the center of its object [m]."""


def evaluate_dataset(
    network: ImageNetwork, dataset: Dataset, confidence: float, images: Sequence[int] | None = None
) -> list[EvaluatedImage]:
    """Return the detections of a network in the images of a dataset, all or those of these rows."""
    to_find = dataset.to_find()
    selected = range(len(dataset)) if images is None else images
    evaluated = []
    for number, image in zip(selected, dataset.images(selected), strict=True):
        rows = dataset.objects(number)
        objects = Objects(
            boxes=dataset.box[rows].astype(float),
            names=tuple(IMAGE_CLASSES[index] for index in dataset.number[rows]),
            height=dataset.height[rows].astype(float),
            distance=dataset.distance[rows].astype(float),
            to_find=to_find[rows],
        )
        evaluated.append(EvaluatedImage(objects, network.find(image), str(dataset.weather[number]), confidence))
    return evaluated


def evaluate_scenes(network: ImageNetwork, scenes: Sequence[StationScene], confidence: float) -> list[EvaluatedImage]:
    """Return the detections of a network in scenes."""
    evaluated = []
    for scene in scenes:
        detections = network.find(scene.readings.cameras["camera"].rgb)
        evaluated.append(EvaluatedImage(objects_of(scene.labels), detections, scene.weather, confidence))
    return evaluated


def objects_of(labels: Sequence[Label]) -> Objects:
    """Return the objects of the labels of one image."""
    boxes = np.array([label.box for label in labels], dtype=float).reshape(-1, 4)
    height = boxes[:, 3] - boxes[:, 1]
    visible = np.array([label.visible_pixels for label in labels], dtype=float)
    silhouette = np.array([label.silhouette_pixels for label in labels], dtype=float)
    return Objects(
        boxes=boxes,
        names=tuple(IMAGE_CLASSES[label.number] for label in labels),
        height=height,
        distance=np.array([label.distance for label in labels], dtype=float),
        to_find=shows_enough(height, visible, silhouette),
    )


def center_errors(kind: type[LearnedDetector], scenes: Iterable[StationScene], use_lidar: bool) -> Array:
    """Return distance [m] and plan-view error of the lifted center [m] of each detected vehicle (K, 2)."""
    detector = kind(LearnedSettings())
    errors = []
    for scene in scenes:
        readings = scene.readings
        if not use_lidar:
            readings = Readings(readings.time, readings.ego, cameras=readings.cameras)
        detector.setup(scene.context)
        detections = detector.detect(readings)
        vehicles = [
            label
            for label, enough in zip(scene.labels, objects_of(scene.labels).to_find, strict=True)
            if enough and IMAGE_CLASSES[label.number] in VEHICLES
        ]
        centers = np.array([label.world_box[:2] for label in vehicles], dtype=float).reshape(-1, 2)
        for detection in np.argsort(-detections.scores, kind="stable"):
            distances = np.linalg.norm(centers - detections.boxes[detection, :2], axis=1)
            if distances.min(initial=np.inf) <= MATCHED_WITHIN:
                nearest = int(np.argmin(distances))
                errors.append((vehicles[nearest].distance, float(distances[nearest])))
                centers[nearest] = np.inf  # each vehicle is matched once
    return np.array(errors).reshape(-1, 2)


def milliseconds(network: ImageNetwork, image: Bytes) -> float:
    """Return the minimum processor time for one image [ms], which excludes the load of the machine."""
    times = []
    for _ in range(40):
        started = time.process_time()
        network.find(image)
        times.append(time.process_time() - started)
    return min(times) * 1e3


def parameters(path: Path) -> int:
    """Return the number of learned parameters in a weight file, without running statistics."""
    with np.load(path) as stored:
        return sum(int(stored[name].size) for name in stored.files if name.endswith((".weight", ".bias")))

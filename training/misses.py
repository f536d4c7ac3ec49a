"""Causes of missed vehicles, compared with detected ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from eidrive_scenario.base.arrays import Array, Bools, Integers
from eidrive_scenario.experiments.average_precision import match
from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES, VEHICLES
from eidrive_scenario.perception.learned.networks.suppression import overlap
from training.dataset import Dataset
from training.scoring import EvaluatedImage
from training.tables import Table, number

SMALL = 15.0
"""Height in the image below which a vehicle is small [px]."""
SHARE_HIDDEN = 0.5
"""Visible share of the silhouette below which a vehicle is hidden."""
FAINT = 0.2
"""Share of contrast through fog, rain or snow below which a vehicle is faint."""
KOSCHMIEDER = 3.912
DARK = -6.0
"""Sun elevation below which it is night: the end of civil twilight [degrees]."""
AT_BORDER = 1.5
"""Maximum distance of a box from the border of the image [px]."""
CROWDED = 0.3
"""Overlap with the box of another vehicle above which vehicles are crowded (intersection over union)."""
CAUSES = (
    "faint in fog, rain or snow",
    "at night",
    "lower than 15 px",
    "more than half hidden",
    "cut off by the border of the image",
    "overlaps another vehicle",
)


def misses(evaluated: Mapping[str, list[EvaluatedImage]], dataset: Dataset) -> Table:
    """Return required vehicles by the first cause that applies: number of misses, and recall."""
    cause, required = causes(dataset), _required(dataset)
    detected_vehicles = {name: _detected_vehicles(entries, dataset) for name, entries in evaluated.items()}
    rows = []
    for index, name in enumerate((*CAUSES, "none of these")):
        part = required & (cause == index)
        cells = [name, str(int(part.sum()))]
        for detected in detected_vehicles.values():
            missed = int((part & ~detected).sum())
            share = missed / max(int((required & ~detected).sum()), 1)
            recall = float(detected[part].mean()) if part.any() else float("nan")
            cells += [str(missed), f"{share:.0%}", number(recall)]
        rows.append(cells)
    head = ["cause", "vehicles"]
    for name in detected_vehicles:
        head += [f"{name} missed", "of all misses", "recall"]
    return "Held-out images, all weathers: causes of missed vehicles", head, rows


def causes(dataset: Dataset) -> Integers:
    """Return the index (N,) of the first of CAUSES for each object, len(CAUSES) if none applies."""
    contrast = np.exp(-KOSCHMIEDER * dataset.distance / dataset.visual_range[dataset.picture])
    share = dataset.seen / np.maximum(dataset.whole, 1)
    box, size = dataset.box, dataset.size[dataset.picture]
    cut = (box[:, :2] < AT_BORDER).any(axis=1) | (box[:, 2:] > size - AT_BORDER).any(axis=1)
    dark = dataset.sun_elevation[dataset.picture] < DARK
    applies = np.stack(
        [contrast < FAINT, dark, dataset.height < SMALL, share < SHARE_HIDDEN, cut, _crowding(dataset) > CROWDED]
    )
    return np.where(applies.any(axis=0), applies.argmax(axis=0), len(CAUSES))


def _required(dataset: Dataset) -> Bools:
    vehicle = np.isin(dataset.number, [IMAGE_CLASSES.index(name) for name in VEHICLES])
    return np.asarray(vehicle & dataset.to_find())


def _crowding(dataset: Dataset) -> Array:
    """Return the maximum overlap (N,) of each object with the box of another vehicle."""
    shares = np.zeros(len(dataset.number))
    vehicles = _required(dataset)
    for index in range(len(dataset)):
        rows = dataset.objects(index)
        vehicle_rows = rows[vehicles[rows]]
        if len(vehicle_rows) > 1:
            shared = overlap(dataset.box[vehicle_rows].astype(float), dataset.box[vehicle_rows].astype(float))
            np.fill_diagonal(shared, 0.0)
            shares[vehicle_rows] = shared.max(axis=1)
    return shares


def _detected_vehicles(images: list[EvaluatedImage], dataset: Dataset) -> Bools:
    """Return the vehicles (N,) that a detector detects at its confidence, as any class of vehicle."""
    detected = np.zeros(len(dataset.number), dtype=bool)
    required = _required(dataset)
    for index, image in enumerate(images):
        rows = dataset.objects(index)
        vehicle_rows = rows[required[rows]]
        confident = np.array(
            [
                name in VEHICLES and score >= image.confidence
                for name, score in zip(image.detections.classes, image.detections.scores.tolist(), strict=True)
            ],
            dtype=bool,
        )
        boxes, scores = image.detections.boxes[confident], image.detections.scores[confident]
        ignored = np.zeros(len(vehicle_rows), dtype=bool)
        detected[vehicle_rows] = match(boxes, scores, dataset.box[vehicle_rows].astype(float), ignored).found
    return detected

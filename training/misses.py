"""Why vehicles are not found: what is the matter with those that are missed, beside those that are found."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from eidrive_scenario.perception.learned.average_precision import match
from eidrive_scenario.perception.learned.classes import IMAGE_CLASSES
from eidrive_scenario.perception.learned.networks.suppression import overlap
from training.dataset import Dataset
from training.scoring import VEHICLES, Judged
from training.tables import Table, number

Bools = NDArray[np.bool_]

SMALL = 15.0
"""Lower in the picture than this [px]."""
SHARE_HIDDEN = 0.5
"""Less than this share of its silhouette is in sight."""
FAINT = 0.2
"""Less of its contrast than this arrives through fog, rain or snow."""
KOSCHMIEDER = 3.912
DARK = -6.0
"""The sun is lower: civil twilight is over [degrees]."""
AT_BORDER = 1.5
"""Of the picture, how near a box reaches [px]."""
CROWDED = 0.3
"""Its box overlaps that of another vehicle by more (intersection over union)."""
CAUSES = (
    "faint in fog, rain or snow",
    "at night",
    "lower than 15 px",
    "more than half hidden",
    "cut off by the picture's border",
    "overlaps another vehicle",
)


def misses(judged: Mapping[str, list[Judged]], dataset: Dataset) -> Table:
    """Vehicles that show enough, by the first cause that applies: how many are missed, and recall among them."""
    cause, asked = causes(dataset), _asked(dataset)
    found = {name: _found(entries, dataset) for name, entries in judged.items()}
    rows = []
    names = (*CAUSES, "none of these")
    for which, name in enumerate(names):
        part = asked & (cause == which)
        rows.append([name, str(int(part.sum()))])
        for seen in found.values():
            missed = int((part & ~seen).sum())
            share = missed / max(int((asked & ~seen).sum()), 1)
            recall = float(seen[part].mean()) if part.any() else float("nan")
            rows[-1] += [str(missed), f"{share:.0%}", number(recall)]
    head = ["what is the matter", "vehicles"]
    for name in found:
        head += [f"{name} missed", "of all misses", "recall"]
    return "Held-out pictures, all weathers: what is the matter with vehicles that are missed", head, rows


def causes(dataset: Dataset) -> NDArray[np.int64]:
    """(N,) index of the first of CAUSES that applies to each object, len(CAUSES) where none does."""
    contrast = np.exp(-KOSCHMIEDER * dataset.distance / dataset.visual_range[dataset.picture])
    share = dataset.seen / np.maximum(dataset.whole, 1)
    box, size = dataset.box, dataset.size[dataset.picture]
    cut = (box[:, :2] < AT_BORDER).any(axis=1) | (box[:, 2:] > size - AT_BORDER).any(axis=1)
    dark = dataset.sun_elevation[dataset.picture] < DARK
    applies = np.stack(
        [contrast < FAINT, dark, dataset.height < SMALL, share < SHARE_HIDDEN, cut, _crowding(dataset) > CROWDED]
    )
    return np.where(applies.any(axis=0), applies.argmax(axis=0), len(CAUSES))


def _asked(dataset: Dataset) -> Bools:
    vehicle = np.isin(dataset.number, [IMAGE_CLASSES.index(name) for name in VEHICLES])
    return np.asarray(vehicle & dataset.to_find())


def _crowding(dataset: Dataset) -> NDArray[np.float64]:
    """(N,) how much the box of another vehicle overlaps that of each object."""
    shares = np.zeros(len(dataset.number))
    vehicles = _asked(dataset)
    for index in range(len(dataset)):
        rows = dataset.objects(index)
        own = rows[vehicles[rows]]
        if len(own) > 1:
            shared = overlap(dataset.box[own].astype(float), dataset.box[own].astype(float))
            np.fill_diagonal(shared, 0.0)
            shares[own] = shared.max(axis=1)
    return shares


def _found(entries: list[Judged], dataset: Dataset) -> Bools:
    """(N,) the vehicles that a detector finds at its confidence, whatever kind of vehicle it takes them for."""
    found = np.zeros(len(dataset.number), dtype=bool)
    asked = _asked(dataset)
    for index, entry in enumerate(entries):
        rows = dataset.objects(index)
        own = rows[asked[rows]]
        sure = np.array(
            [
                name in VEHICLES and score >= entry.confidence
                for name, score in zip(entry.found.classes, entry.found.scores.tolist(), strict=True)
            ],
            dtype=bool,
        )
        boxes, scores = entry.found.boxes[sure], entry.found.scores[sure]
        free = np.zeros(len(own), dtype=bool)
        found[own] = match(boxes, scores, dataset.box[own].astype(float), free).found
    return found

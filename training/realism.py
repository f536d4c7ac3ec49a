"""An outside judge of the renderer: recall of `ssd_openimages` on rendered images, beside that on photographs.

The detector was trained on photographs only: its recall on rendered images measures their realism.
The photographs are in two packages under free licenses, `darknet` 0.0.0+git20180914 of Debian 13 (GPL-3.0+, MIT or
WTFPL) and `opencv` 7.0.0 of npm (MIT). Their objects were marked by hand: all road users that are visible to at least
a half and at least 16 pixels high at the input size of the network.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from eidrive_scenario.errors import SettingError
from eidrive_scenario.perception.learned.detector import INPUT_SIZE
from eidrive_scenario.perception.learned.image_network import ImageNetwork
from eidrive_scenario.perception.learned.openimages import SIDE, OpenImagesNetwork
from training.dataset import Dataset
from training.image_evaluation import evaluate_dataset
from training.scoring import EvaluatedImage, Objects, Part, score
from training.tables import WEATHERS, Table, number

Box = tuple[float, float, float, float]

PHOTOGRAPHS: Mapping[str, Sequence[tuple[str, Box]]] = {
    "darknet/data/dog.jpg": [("bicycle", (128, 137, 567, 419)), ("car", (466, 75, 686, 170))],
    "darknet/data/person.jpg": [("pedestrian", (192, 101, 271, 371))],
    "darknet/data/kite.jpg": [
        ("pedestrian", (113, 613, 165, 762)),
        ("pedestrian", (216, 699, 270, 854)),
        ("pedestrian", (83, 508, 102, 567)),
        ("pedestrian", (40, 510, 53, 562)),
    ],
    "opencv/examples/files/car1.jpg": [("car", (50, 197, 954, 470))],
    "opencv/examples/files/car2.jpg": [("car", (145, 352, 1388, 731))],
}
"""Objects of photographs: class and box x1 y1 x2 y2 [px]. The motorbike in dog.jpg is hidden by more than a half."""


class Kind(NamedTuple):
    """Classes of objects, and those of detections that count for them: a motorbike is boxed as vehicle or as rider."""

    title: str
    names: tuple[str, ...]
    detected_as: tuple[str, ...]

    def part(self, **limits: Any) -> Part:
        """Return the objects of these classes within limits of `Part`."""
        return Part(self.names, detected_as=self.detected_as, **limits)


KINDS = (
    Kind("car", ("car",), ("car", "truck")),
    Kind("truck", ("truck",), ("car", "truck")),
    Kind("bus", ("bus",), ("car", "truck")),
    Kind("motorbike", ("motorbike",), ("car", "truck", "bicycle", "pedestrian")),
    Kind("bicycle", ("bicycle",), ("bicycle", "pedestrian")),
    Kind("pedestrian", ("pedestrian",), ("pedestrian",)),
)
DISTANCES = ((0.0, 15.0), (15.0, 30.0), (30.0, 60.0))
HEIGHTS = ((64.0, np.inf), (32.0, 64.0), (16.0, 32.0))
"""Heights of objects at the input size of the network [px]."""


def realism_tables(
    dataset: Dataset, package: Path, photographs: Path | None, shipped: Mapping[str, ImageNetwork]
) -> list[Table]:
    """Return the tables of the judge, or none without LiteRT or the package.

    photographs  folder of the unpacked packages `darknet` and `opencv`; None: rendered images only
    shipped      networks of this project, for their recall on photographs
    """
    try:
        network = OpenImagesNetwork(package)
    except (SettingError, ImportError) as error:
        print(f"no tables of ssd_openimages: {error}")
        return []
    rendered = evaluate_dataset(network, dataset, network.confidence)
    tables = [_by_distance(rendered), _by_weather(rendered)]
    if photographs is not None:
        judged = {"ssd_openimages": network, **shipped}
        tables.append(
            _by_height(rendered, {name: _in_photographs(judge, photographs) for name, judge in judged.items()})
        )
    return tables


def _by_distance(images: Sequence[EvaluatedImage]) -> Table:
    rows = [
        _row(kind.title, images, [kind.part(nearest=near, farthest=far, weather="clear") for near, far in DISTANCES])
        for kind in KINDS
    ]
    head = ["class"] + [f"{what} {near:.0f} to {far:.0f} m" for near, far in DISTANCES for what in ("recall", "n")]
    return "Held-out images, clear: recall of ssd_openimages by class and distance", head, rows


def _by_weather(images: Sequence[EvaluatedImage]) -> Table:
    rows = [
        _row(weather, images, [kind.part(farthest=30.0, weather=weather) for kind in KINDS]) for weather in WEATHERS
    ]
    head = ["weather"] + [f"{kind.title} {what}" for kind in KINDS for what in ("recall", "n")]
    return "Held-out images: recall of ssd_openimages within 30 m by weather", head, rows


def _by_height(rendered: Sequence[EvaluatedImage], photographs: Mapping[str, list[EvaluatedImage]]) -> Table:
    """Return recall on images of clear weather and, by detector, on photographs, by the height at the input size."""
    clear = [_at_input_size(image, INPUT_SIZE[1]) for image in rendered if image.weather == "clear"]
    rows = []
    for kind in KINDS:
        for low, high in HEIGHTS:
            part = kind.part(height=low, max_height=high)
            (recall, count), *marked = (_cells(images, part) for images in (clear, *photographs.values()))
            if marked[-1][1] != "0":
                heights = f"{low:.0f} px and more" if high == np.inf else f"{low:.0f} to {high:.0f} px"
                recalls = [recall for recall, _ in marked]
                rows.append([f"{kind.title}, {heights}", recall, count, *recalls, marked[-1][1]])
    others = [str(_unmarked(images)) for images in photographs.values()]
    rows.append(["detections of nothing marked", "", "", *others, ""])
    head = ["class and height", "ssd_openimages, rendered", "n", *(f"{name}, photographs" for name in photographs), "n"]
    return f"Photographs and held-out images, clear: recall by height in images of {SIDE} x {SIDE}", head, rows


def _unmarked(images: Sequence[EvaluatedImage]) -> int:
    """Return the number of detections that match no marked object."""
    matched = 0.0
    for kind in KINDS:
        of_kind = score(images, kind.part())
        matched += of_kind.recall * of_kind.objects if of_kind.objects else 0.0
    return sum(len(image.detections) for image in images) - round(matched)


def _cells(images: Sequence[EvaluatedImage], part: Part) -> list[str]:
    scored = score(images, part)
    return [number(scored.recall if scored.objects else float("nan")), str(scored.objects)]


def _row(title: str, images: Sequence[EvaluatedImage], parts: Sequence[Part]) -> list[str]:
    return [title, *(cell for part in parts for cell in _cells(images, part))]


def _at_input_size(image: EvaluatedImage, rows: int) -> EvaluatedImage:
    """Return the image with heights of objects at the input size, given the pixel rows of its boxes."""
    boxes = image.objects.boxes
    height = (boxes[:, 3] - boxes[:, 1]) * SIDE / rows
    return dataclasses.replace(image, objects=dataclasses.replace(image.objects, height=height))


def _in_photographs(network: ImageNetwork, folder: Path) -> list[EvaluatedImage]:
    """Return the detections in all photographs. Raise FileNotFoundError if one is missing."""
    images = []
    for name, objects in PHOTOGRAPHS.items():
        pixels = cv2.imread(str(folder / name), cv2.IMREAD_COLOR)
        if pixels is None:
            raise FileNotFoundError(folder / name)
        marked = Objects(
            boxes=np.array([box for _, box in objects], dtype=float),
            names=tuple(kind for kind, _ in objects),
            height=np.zeros(len(objects)),
            distance=np.zeros(len(objects)),
            to_find=np.ones(len(objects), dtype=bool),
        )
        detections = network.find(np.asarray(cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB), dtype=np.uint8))
        images.append(_at_input_size(EvaluatedImage(marked, detections, "clear", network.confidence), len(pixels)))
    return images

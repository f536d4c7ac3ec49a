"""Average precision of the learned detectors by runtime and precision, and whether detections repeat."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import get_args

from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES, ImageNetwork
from eidrive_scenario.perception.learned.network_loading import build_network, weights_path
from eidrive_scenario.perception.learned.runtimes import Runtime, is_installed, runtime_versions, runtimes_of
from eidrive_scenario.perception.learned.settings import LearnedSettings
from eidrive_scenario.perception.learned.weights import Precision
from training.dataset import Dataset
from training.image_evaluation import evaluate_dataset
from training.scoring import EvaluatedImage, Part, score
from training.tables import Table, number

HEAD = ["detector", "runtime", "precision", "mean AP50", "largest difference", "class", "equal when repeated"]


def runtime_table(names: Sequence[str], dataset: Dataset, images: int, confidence: float) -> Table:
    """Return the table of all installed runtimes, and of int8: mean average precision of the classes, the largest
    difference of a class from that of torch, and whether a second network detects the same boxes with the same bits.

    `images` are selected at equal distances from the dataset; `confidence` is the minimum of the boxes. Without torch
    the fastest installed runtime is the reference.
    """
    count = min(images, len(dataset))
    rows = [len(dataset) * row // count for row in range(count)]
    cells = []
    for name in names:
        evaluated = {each: _evaluate_twice(name, *each, dataset, rows, confidence) for each in _installed(name)}
        scores = {each: _class_scores(images) for each, (images, _) in evaluated.items()}
        reference = scores.get(("torch", "float32")) or next(iter(scores.values()))
        cells += [_row(name, *each, scores[each], reference, evaluated[each][1]) for each in evaluated]
    return f"Runtimes: {len(rows)} held-out images", HEAD, cells


def _installed(name: str) -> list[tuple[Runtime, Precision]]:
    path = weights_path(name, LearnedSettings())
    return [
        (runtime, precision)
        for precision in get_args(Precision)
        for runtime in runtimes_of(path, "cpu", precision)
        if is_installed(runtime)
    ]


def _evaluate_twice(
    name: str, runtime: Runtime, precision: Precision, dataset: Dataset, rows: Sequence[int], confidence: float
) -> tuple[list[EvaluatedImage], bool]:
    """Return the detections in some images, and whether a second network returns equal bits."""

    def network() -> ImageNetwork:
        return build_network(name, LearnedSettings(runtime=runtime, precision=precision, confidence=confidence))

    first, second = (evaluate_dataset(network(), dataset, confidence, rows) for _ in range(2))
    return first, all(_bits(a) == _bits(b) for a, b in zip(first, second, strict=True))


def _bits(image: EvaluatedImage) -> tuple[bytes, bytes, tuple[str, ...]]:
    return image.detections.boxes.tobytes(), image.detections.scores.tobytes(), image.detections.classes


def _class_scores(evaluated: Sequence[EvaluatedImage]) -> dict[str, float]:
    """Return the average precision of each class with required objects."""
    parts = {name: score(evaluated, Part((name,))) for name in IMAGE_CLASSES}
    return {name: part.precision for name, part in parts.items() if part.objects}


def _row(
    name: str,
    runtime: Runtime,
    precision: Precision,
    scores: Mapping[str, float],
    reference: Mapping[str, float],
    repeats: bool,
) -> list[str]:
    differences = {each: abs(value - reference[each]) for each, value in scores.items()}
    difference, largest = max(((value, each) for each, value in differences.items() if value), default=(0.0, "-"))
    mean = sum(scores.values()) / len(scores) if scores else float("nan")
    version = " ".join(runtime_versions(runtime).values())
    return [
        name,
        f"{runtime} {version}",
        precision,
        number(mean),
        f"{difference:.6f}",
        largest,
        "yes" if repeats else "no",
    ]

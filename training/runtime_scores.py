"""Average precision of the learned detectors by runtime and precision, and whether detections repeat."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES
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
    selected = [len(dataset) * number // count for number in range(count)]
    rows = []
    for name in names:
        scores: dict[tuple[Runtime, Precision], dict[str, float]] = {}
        repeats: dict[tuple[Runtime, Precision], bool] = {}
        for runtime, precision in _installed(name):
            settings = LearnedSettings(runtime=runtime, precision=precision, confidence=confidence)
            first, second = (
                evaluate_dataset(build_network(name, settings), dataset, confidence, selected) for _ in range(2)
            )
            parts = {category: score(first, Part((category,))) for category in IMAGE_CLASSES}
            scores[runtime, precision] = {category: part.precision for category, part in parts.items() if part.objects}
            repeats[runtime, precision] = list(map(_bits, first)) == list(map(_bits, second))
        reference = scores.get(("torch", "float32")) or next(iter(scores.values()))
        for (runtime, precision), by_class in scores.items():
            differences = ((abs(value - reference[category]), category) for category, value in by_class.items())
            difference, largest = max((pair for pair in differences if pair[0]), default=(0.0, "-"))
            mean = sum(by_class.values()) / len(by_class) if by_class else float("nan")
            title = f"{runtime} {' '.join(runtime_versions(runtime).values())}"
            repeated = "yes" if repeats[runtime, precision] else "no"
            rows.append([name, title, precision, number(mean), f"{difference:.6f}", largest, repeated])
    return f"Runtimes: {count} held-out images", HEAD, rows


def _installed(name: str) -> list[tuple[Runtime, Precision]]:
    path = weights_path(name, LearnedSettings())
    return [
        (runtime, precision)
        for precision in get_args(Precision)
        for runtime in runtimes_of(path, "cpu", precision)
        if is_installed(runtime)
    ]


def _bits(image: EvaluatedImage) -> tuple[bytes, bytes, tuple[str, ...]]:
    return image.detections.boxes.tobytes(), image.detections.scores.tobytes(), image.detections.classes

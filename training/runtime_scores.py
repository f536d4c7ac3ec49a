"""Average precision of the learned detectors by runtime, and whether each runtime repeats its detections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from eidrive_scenario.perception.learned.image_network import IMAGE_CLASSES, ImageNetwork
from eidrive_scenario.perception.learned.network_loading import build_network, weights_path
from eidrive_scenario.perception.learned.runtimes import Runtime, is_installed, runtime_versions, runtimes_of
from eidrive_scenario.perception.learned.settings import LearnedSettings
from training.dataset import Dataset
from training.image_evaluation import evaluate_dataset
from training.scoring import EvaluatedImage, Part, score
from training.tables import Table, number

HEAD = ["detector", "runtime", "mean AP50", "largest difference", "class", "equal when repeated"]


def runtime_table(names: Sequence[str], dataset: Dataset, images: int, confidence: float) -> Table:
    """Return the table of all installed runtimes: mean average precision of the classes, the largest difference of a
    class from that of torch, and whether a second network detects the same boxes with the same bits.

    `images` are selected at equal distances from the dataset; `confidence` is the minimum of the boxes. Without torch
    the fastest installed runtime is the reference.
    """
    count = min(images, len(dataset))
    rows = [len(dataset) * row // count for row in range(count)]
    cells = []
    for name in names:
        found = {runtime: _evaluate_twice(name, runtime, dataset, rows, confidence) for runtime in _installed(name)}
        precisions = {runtime: _precisions(evaluated) for runtime, (evaluated, _) in found.items()}
        reference = precisions.get("torch") or next(iter(precisions.values()))
        cells += [_row(name, runtime, precisions[runtime], reference, found[runtime][1]) for runtime in found]
    return f"Runtimes: {len(rows)} held-out images", HEAD, cells


def _installed(name: str) -> list[Runtime]:
    return [runtime for runtime in runtimes_of(weights_path(name, LearnedSettings())) if is_installed(runtime)]


def _evaluate_twice(
    name: str, runtime: Runtime, dataset: Dataset, rows: Sequence[int], confidence: float
) -> tuple[list[EvaluatedImage], bool]:
    """Return the detections in some images, and whether a second network returns equal bits."""

    def network() -> ImageNetwork:
        return build_network(name, LearnedSettings(runtime=runtime, confidence=confidence))

    first, second = (evaluate_dataset(network(), dataset, confidence, rows) for _ in range(2))
    return first, all(_bits(a) == _bits(b) for a, b in zip(first, second, strict=True))


def _bits(image: EvaluatedImage) -> tuple[bytes, bytes, tuple[str, ...]]:
    return image.found.boxes.tobytes(), image.found.scores.tobytes(), image.found.classes


def _precisions(evaluated: Sequence[EvaluatedImage]) -> dict[str, float]:
    """Return the average precision of each class with required objects."""
    scores = {name: score(evaluated, Part((name,))) for name in IMAGE_CLASSES}
    return {name: found.precision for name, found in scores.items() if found.objects}


def _row(
    name: str, runtime: Runtime, precisions: Mapping[str, float], reference: Mapping[str, float], repeats: bool
) -> list[str]:
    differences = {each: abs(precision - reference[each]) for each, precision in precisions.items()}
    difference, largest = max(((value, each) for each, value in differences.items() if value), default=(0.0, "-"))
    mean = sum(precisions.values()) / len(precisions) if precisions else float("nan")
    version = " ".join(runtime_versions(runtime).values())
    return [name, f"{runtime} {version}", number(mean), f"{difference:.6f}", largest, "yes" if repeats else "no"]

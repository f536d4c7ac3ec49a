"""Shipped weights of `pillars` from the result of training: code book, ranges for 8-bit integers, confidence, card."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np
from msgspec.structs import replace
from scipy.cluster.vq import kmeans2

from eidrive_scenario.base.arrays import Array, Bools, Floats
from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.feature_map import FeatureMap
from eidrive_scenario.base.geometry import iou_bev, points_in_box
from eidrive_scenario.experiments.average_precision import average_precision, best_confidence, match_by_share
from eidrive_scenario.perception.learned.network_loading import SHIPPED
from eidrive_scenario.perception.learned.pillars.codec import CODES, LATENT
from eidrive_scenario.perception.learned.pillars.detector import PillarDetector, PillarSettings, grid_frame
from eidrive_scenario.perception.learned.pillars.grid import CELLS, ScanHistory
from eidrive_scenario.perception.learned.pillars.network import features_onnx
from eidrive_scenario.sensing.readings import LidarReading
from eidrive_scenario.sensing.settings import CameraSettings, LidarSettings, SensorSettings
from eidrive_scenario.world.weather import Weather
from training.pillars.scenes import CLASSES, LAG
from training.quantize import layer_ranges
from training.scenes import StationScene, random_scenes
from training.weight_files import write_card, write_weights

SENSORS: dict[str, SensorSettings] = {
    "camera": CameraSettings(width=64, height=48),
    "lidar": LidarSettings(rate=10.0, rotation=10.0),
}
FEWEST = 3
"""Fewest points on a required object; others are neither required nor errors."""
LEAST = 0.02
"""Confidence of the detections for the average precision."""
MARGIN = 0.1
"""Growth of a body on each side, for the noise of points on its surface [m]."""
OBJECT = 0.1
"""Confidence from which a cell has an object."""
WITHIN = 45.0
"""Maximum distance of required objects from the lidar along each axis [m]."""


@dataclass(frozen=True)
class Measured:
    """Grid (1, 12, 256, 256), features, detections, boxes (M, 7) of road users, and which are required (M,)."""

    grid: Floats
    features: FeatureMap
    detections: Detections
    boxes: Array
    required: Bools


def measured(scenes: Iterator[StationScene], path: Path, precision: str = "float32") -> Iterator[Measured]:
    """Yield the detections of a weight file in lidar scans of scenes at rest."""
    settings = PillarSettings.model_validate({"weights": str(path), "confidence": LEAST, "precision": precision})
    for scene in scenes:
        detector, readings = PillarDetector(settings), scene.readings
        detector.setup(scene.context)
        cloud, foot, history = readings.lidars["lidar"], float(readings.ego.position[2]), ScanHistory()
        for time in (readings.time, readings.time + LAG):
            detections = detector.detect(replace(readings, time=time))
            grid = history.add(time, [cloud], grid_frame(cloud), foot)
        boxes = scene.boxes[[row for row, name in enumerate(scene.categories) if name in CLASSES]]
        features = detector.feature_map
        assert features is not None
        yield Measured(grid.channels[None], features, detections, boxes, _required(boxes, cloud))


def _required(boxes: Array, cloud: LidarReading) -> Bools:
    points = cloud.world_points
    near = np.abs(boxes[:, :2] - cloud.pose[:2, 3]).max(axis=1, initial=0.0) < WITHIN
    grown = boxes + np.array([0.0, 0.0, 0.1, MARGIN, MARGIN, -0.1, 0.0])
    hit: Bools = np.array([points_in_box(points, box).sum() >= FEWEST for box in grown], dtype=bool)
    required: Bools = near & hit
    return required


def codebook(scans: list[Measured]) -> Floats:
    """Return the centers (256, 8) of the compressed features of cells with objects, by k-means.

    Most of the cells that a station sends have no object: they are a fifth of the sample, or they would have most of
    the entries.
    """
    rng = np.random.default_rng(1)
    parts = []
    for scan in scans:
        latent, confidence = scan.features.latent.reshape(LATENT, -1).T, scan.features.confidence.ravel()
        order = np.argsort(-confidence)
        objects = int((confidence >= OBJECT).sum())
        others = order[objects : confidence.size // 20]
        chosen = rng.choice(others, min(len(others), objects // 4), replace=False)
        parts.append(latent[np.concatenate([order[:objects], chosen])])
    centers, _ = kmeans2(np.concatenate(parts).astype(float), CODES, minit="++", rng=rng)
    return np.asarray(centers, np.float32)


def scores(results: list[Measured], overlap: float) -> tuple[float, float]:
    """Return the average precision at an overlap, and the confidence with the greatest F1 score."""
    matches = [
        match_by_share(iou_bev(scan.detections.boxes, scan.boxes), scan.detections.scores, ~scan.required, overlap)
        for scan in results
    ]
    objects = sum(int(scan.required.sum()) for scan in results)
    return average_precision(matches, objects), best_confidence(matches, objects)


def main() -> None:
    """Write weights and card."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("trained", type=Path, nargs="?", default=Path("training/out/pillars_fusion.npz"))
    parser.add_argument("--places", type=int, default=60)
    parser.add_argument("--out", type=Path, default=SHIPPED / "pillars.npz")
    options = parser.parse_args()
    with np.load(options.trained) as file:
        arrays = dict(file)
    description = {"network": "pillars", "classes": CLASSES, "input_size": [CELLS, CELLS], "confidence": 0.3}
    arrays["codebook"] = np.zeros((CODES, LATENT), dtype=np.float32)
    write_weights(options.out, arrays, description)
    training = list(measured(random_scenes(1, "train", options.places, Weather(), sensors=SENSORS), options.out))
    arrays["codebook"] = codebook(training)
    write_weights(options.out, arrays, description)
    ranges = layer_ranges(features_onnx(arrays), (scan.grid for scan in training))
    description["confidence"] = round(scores(training, 0.5)[1], 3)
    write_weights(options.out, arrays, {**description, "ranges": ranges})
    card: dict[str, object] = {**description, "date": str(date.today())}
    validation = list(random_scenes(1, "validation", options.places, Weather(), sensors=SENSORS))
    for precision in ("float32", "int8"):
        results = list(measured(iter(validation), options.out, precision))
        card[f"validation_{precision}"] = {
            "scans": len(results),
            "objects": sum(int(scan.required.sum()) for scan in results),
            **{f"ap{round(100 * overlap)}": round(scores(results, overlap)[0], 4) for overlap in (0.3, 0.5, 0.7)},
        }
    for stage in ("single", "fusion"):
        path = options.trained.with_name(f"pillars_{stage}.json")
        if path.exists():
            card[stage] = json.loads(path.read_text(encoding="utf-8"))
    write_card(options.out, card)
    print(json.dumps(card, indent=1))


if __name__ == "__main__":
    main()

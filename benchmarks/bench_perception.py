"""Accuracy of the detector `lidar` on scenarios 1 and 2, and times of all detectors on one core.

Recall and errors of the detector `lidar` for objects with at least three points, of all stations; times of sensor,
detector and tracker; simulated time per processor time of complete runs with each detector, with shares by component.
`OPENBLAS_NUM_THREADS=1` limits matrix products of numpy to one thread, as for torch and OpenCV here.

    python benchmarks/bench_perception.py [--every 5] [--seed 1] [--repeats 1] [--runs-only]
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import wraps
from statistics import median
from typing import Any

import cv2
import numpy as np
from detector_runs import AS_EI_DRIVE, DEFAULT, SCENARIO, RunTime, run
from random_scenes import random_scenes

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.geometry import points_in_box
from eidrive_scenario.extensions.library import resolve_scenario
from eidrive_scenario.perception.detector import DetectorContext
from eidrive_scenario.perception.learned.detector import LearnedDetector, YoloDetector
from eidrive_scenario.perception.learned.image_network import ImageNetwork
from eidrive_scenario.perception.lidar.detector import LidarDetector
from eidrive_scenario.perception.tracking.method import TrackerSettings
from eidrive_scenario.perception.tracking.tracker import Tracker
from eidrive_scenario.rendering.scene import SceneImage
from eidrive_scenario.sensing.camera import Camera, ImageSensor
from eidrive_scenario.sensing.lidar import Lidar
from eidrive_scenario.sensing.readings import LidarReading
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.settings import LidarSettings
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed

SCENARIOS = {"coop/scenario_1": ("Ego", "RSU"), "coop/scenario_2": ("Ego", "Spectator")}
FOUND = 2.5
"""Maximum distance of a detection from its object [m]."""
LEAST_POINTS = 3
RANDOM_SEED = 20261120


@dataclass
class LidarResults:
    """Errors [m] of detectable objects by kind, infinite for misses, number of hits with the correct class by kind,
    number of false detections and frames, and times [s]."""

    errors: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    correct_class: Counter[str] = field(default_factory=Counter)
    false: int = 0
    frames: int = 0
    sensor: list[float] = field(default_factory=list)
    detector: list[float] = field(default_factory=list)

    def add(
        self, detections: Detections, cloud: LidarReading, objects: Iterable[tuple[str, np.ndarray]], bodies: np.ndarray
    ) -> None:
        """Compare detections with kinds and boxes (7,) of the true objects; a detection at none of all `bodies` (N, 7)
        is false."""
        self.frames += 1
        points = cloud.world_points[cloud.world_points[:, 2] > 0.25]
        centers = detections.boxes[:, :2]
        for kind, box in objects:
            if np.count_nonzero(points_in_box(points, box + np.array([0, 0, 0, 0.1, 0.1, 0.1, 0]))) < LEAST_POINTS:
                continue
            distances = np.hypot(*(centers - box[:2]).T)
            is_hit = len(distances) > 0 and distances.min() < FOUND
            self.errors[kind].append(float(distances.min()) if is_hit else math.inf)
            self.correct_class[kind] += is_hit and detections.classes[int(distances.argmin())] == kind
        for center in centers:
            self.false += bool(np.hypot(*(bodies[:, :2] - center).T).min() > FOUND)


def evaluate_scenario(name: str, stations: tuple[str, ...], every: int, seed: int, results: LidarResults) -> None:
    """Run a scenario with the oracle and evaluate additional lidars."""
    simulation = Simulation(load_for_seed(resolve_scenario(name), seed, {}), seed=seed, settings=RunSettings())
    lidars: dict[str, tuple[Rig, LidarDetector]] = {}
    with simulation:
        end, tick = None, 0
        while end is None:
            _, end = simulation.tick()
            world, view = simulation.world, simulation.world.view()
            for station in stations if tick % every == 0 else ():
                if station not in lidars:
                    spec, sensors = world.spec(station), {"lidar": LidarSettings()}
                    detector = LidarDetector()
                    detector.setup(DetectorContext(spec, sensors, simulation.roads, seed))
                    lidars[station] = Rig(spec, sensors, seed=seed), detector
                rig, detector = lidars[station]
                start = time.perf_counter()
                readings = rig.read(world, view)
                read = time.perf_counter()
                detections = detector.detect(readings)
                results.detector.append(time.perf_counter() - read)
                results.sensor.append(read - start)
                objects = [
                    ("incoming car" if name == "Incoming" else category, box)
                    for name, category, box in zip(view.names, view.categories, view.boxes, strict=True)
                    if name != station and category != "misc"
                ]
                results.add(detections, readings.lidars["lidar"], objects, view.boxes)
            tick += 1


def evaluate_random_scenes(count: int, seed: int) -> None:
    """Print the results on scenes that were not used to choose anything."""
    results, detector = LidarResults(), LidarDetector()
    for scene in random_scenes(count, seed):
        detections = detector.detect(scene.readings)
        objects = zip(scene.kinds, scene.boxes, strict=True)
        results.add(detections, scene.readings.lidars["lidar"], objects, scene.boxes)
    for kind, errors in sorted(results.errors.items()):
        hits = [error for error in errors if math.isfinite(error)]
        share, correct = 100 * len(hits) / len(errors), 100 * results.correct_class[kind] / max(len(hits), 1)
        median_error, error_90 = median(hits), float(np.percentile(hits, 90))
        print(
            f"{kind:11} {share:5.1f} % of {len(errors):4}   {median_error:.2f} m, "
            f"90 % within {error_90:.2f} m   class {correct:.0f} %"
        )
    print(f"false detections per point cloud {results.false / count:.2f}")


def tracker_milliseconds(kind: str, count: int = 10, ticks: int = 200) -> float:
    """Return the median time of an update with this number of objects [ms]."""
    rng, times = np.random.default_rng(0), []
    tracker = Tracker(TrackerSettings.model_validate({"kind": kind}))
    positions, speeds = rng.uniform(-50, 50, (count, 2)), rng.uniform(-8, 8, (count, 2))
    for tick in range(ticks):
        boxes = np.tile([0, 0, 0.75, 4.6, 1.8, 1.5, 0.0], (count, 1))
        boxes[:, :2] = positions + speeds * tick * 0.05 + rng.normal(0, 0.1, (count, 2))
        unknown = np.full((count, 2), np.nan), np.tile(0.01 * np.eye(2), (count, 1, 1))
        detections = Detections(tick * 0.05, boxes, np.ones(count), ("car",) * count, *unknown)
        start = time.perf_counter()
        tracker.update(detections)
        times.append(time.perf_counter() - start)
    return 1e3 * median(times)


CASES = (
    ("yolov5", DEFAULT),
    ("ssd", DEFAULT),
    ("lidar", DEFAULT),
    ("yolov5", AS_EI_DRIVE),
)
PARTS: dict[str, tuple[tuple[type, str], ...]] = {
    "images": ((Camera, "read"), (SceneImage, "draw"), (ImageSensor, "develop")),
    "network": ((ImageNetwork, "find"),),
    "detector": ((LearnedDetector, "detect"), (LidarDetector, "detect")),
    "lidar": ((Lidar, "read"),),
}
"""Measured methods by component, each without the measured methods that it calls: a detector draws the images."""


@contextmanager
def measured_parts() -> Iterator[dict[str, float]]:
    """Measure the processor time of each of PARTS [s]."""
    times, inner = dict.fromkeys(PARTS, 0.0), [0.0]
    originals: list[tuple[type, str, Callable[..., Any]]] = []
    for part, methods in PARTS.items():
        for kind, name in methods:
            originals.append((kind, name, getattr(kind, name)))
            setattr(kind, name, _timed(originals[-1][2], times, part, inner))
    try:
        yield times
    finally:
        for kind, name, method in originals:
            setattr(kind, name, method)


def _timed(method: Callable[..., Any], times: dict[str, float], part: str, inner: list[float]) -> Callable[..., Any]:
    """Return a method that adds its time to a part; `inner` has the time of measured calls within each open call."""

    @wraps(method)
    def wrapped(*arguments: Any, **options: Any) -> Any:
        start = time.process_time()
        inner.append(0.0)
        try:
            return method(*arguments, **options)
        finally:
            elapsed = time.process_time() - start
            times[part] += elapsed - inner.pop()
            inner[-1] += elapsed

    return wrapped


def print_table(seed: int, repeats: int) -> None:
    """Run all cases repeatedly, and print the fastest run of each."""
    cv2.setNumThreads(1)
    run("yolov5", DEFAULT, seed)
    runtime = ", ".join(f"{name} {version}" for name, version in YoloDetector().library_versions.items())
    print(
        f"{SCENARIO}, complete runs, equal detectors on ego and roadside unit; {runtime}, one thread; "
        f"OpenCV {cv2.getNumThreads()} thread; simulated time per processor time, and shares by component"
    )
    print(f"{'':38}" + "".join(f"{part:>10}" for part in (*PARTS, "rest")))
    for detector, properties in CASES:
        runs: list[tuple[RunTime, dict[str, float]]] = []
        for _ in range(repeats):
            with measured_parts() as parts:
                runs.append((run(detector, properties, seed), parts))
        best, parts = min(runs, key=lambda measured: measured[0].total / measured[0].simulated)
        shares = [*parts.values(), best.total - sum(parts.values())]
        name = f"{detector}, {'800 x 600 and lidar at 20 Hz' if properties else 'default sensors'}"
        cells = "".join(f"{100 * share / best.total:8.0f} %" for share in shares)
        verdict = "passed" if best.passed else "failed"
        print(f"{name:38}{cells}   {best.simulated / best.total:.2f} times real time, {verdict}")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--every", type=int, default=5, help="number of ticks between evaluations")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=1, help="number of repetitions of each run; the fastest counts")
    parser.add_argument("--runs-only", action="store_true", help="omit the evaluation of the detector `lidar`")
    arguments = parser.parse_args()
    if not arguments.runs_only:
        print_lidar_results(arguments.every, arguments.seed)
    print_table(arguments.seed, arguments.repeats)


def print_lidar_results(every: int, seed: int) -> None:
    """Print the results of the detector `lidar`, and its times."""
    print("scenarios 1 and 2, which were used to choose thresholds")
    results = LidarResults()
    for name, stations in SCENARIOS.items():
        evaluate_scenario(name, stations, every, seed, results)
    for kind, errors in sorted(results.errors.items()):
        hits = [error for error in errors if math.isfinite(error)]
        share, median_error = 100 * len(hits) / len(errors), median(hits)
        print(f"{kind:13} detected {share:5.1f} % of {len(errors):4}   median error of the center {median_error:.2f} m")
    print(f"false detections per point cloud {results.false / results.frames:.2f}")
    print("random scenes, which were not used to choose anything")
    evaluate_random_scenes(150, RANDOM_SEED)
    print(
        f"lidar {1e3 * median(results.sensor):.1f} ms, "
        f"detector {1e3 * median(results.detector):.1f} ms per reading (medians)"
    )
    print(*(f"tracker {kind}, 10 objects: {tracker_milliseconds(kind):.2f} ms" for kind in ("cv", "ctrv")), sep="\n")


if __name__ == "__main__":
    main()

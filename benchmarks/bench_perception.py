"""What perception without learning finds on scenarios 1 and 2, and how long all detectors take on one core.

Recall and errors of the detector `lidar` for objects with three points or more, of all stations; milliseconds of
sensor, detector and tracker; simulated seconds per second of processor time of whole runs with each detector, and what
takes the time. `OPENBLAS_NUM_THREADS=1` gives numpy's matrix products one thread, as torch and OpenCV have here.

    python benchmarks/bench_perception.py [--every 5] [--seed 1] [--repeats 1] [--runs-only]
"""

from __future__ import annotations

import argparse
import math
import time
from collections import defaultdict
from dataclasses import dataclass, field
from statistics import median

import numpy as np
from detector_runs import print_table
from random_scenes import random_scenes

from eidrive_scenario.detections import Detections
from eidrive_scenario.geometry import points_in_box
from eidrive_scenario.library import resolve_scenario
from eidrive_scenario.perception.detector import DetectorContext
from eidrive_scenario.perception.lidar.detector import LidarDetector
from eidrive_scenario.perception.tracking.settings import TrackerSettings
from eidrive_scenario.perception.tracking.tracker import Tracker
from eidrive_scenario.sensing.rig import Rig
from eidrive_scenario.sensing.settings import LidarSettings
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed

SCENARIOS = {"coop/scenario_1": ("Ego", "RSU"), "coop/scenario_2": ("Ego", "Spectator")}
FOUND = 2.5
"""A detection this near to an object is of that object [m]."""
LEAST_POINTS = 3
RANDOM_SEED = 20261120


@dataclass
class Findings:
    """Distances [m] and errors [m] of what could be found, infinite where it was not, and the rest."""

    errors: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    false: int = 0
    frames: int = 0
    sensor: list[float] = field(default_factory=list)
    detector: list[float] = field(default_factory=list)


def look(name: str, stations: tuple[str, ...], every: int, seed: int, found: Findings) -> None:
    """Play a scenario with the oracle and let LiDARs look on."""
    simulation = Simulation(load_for_seed(resolve_scenario(name), seed, {}), seed=seed, settings=RunSettings())
    eyes: dict[str, tuple[Rig, LidarDetector]] = {}
    with simulation:
        end, tick = None, 0
        while end is None:
            _, end = simulation.tick()
            world, view = simulation.world, simulation.world.view()
            for station in stations if tick % every == 0 else ():
                if station not in eyes:
                    spec, sensors = world.spec(station), {"lidar": LidarSettings()}
                    detector = LidarDetector()
                    detector.setup(DetectorContext(spec, sensors, simulation.roads, seed))
                    eyes[station] = Rig(spec, sensors, seed=seed), detector
                rig, detector = eyes[station]
                began = time.perf_counter()
                readings = rig.read(world, view)
                seen = time.perf_counter()
                detections = detector.detect(readings)
                found.detector.append(time.perf_counter() - seen)
                found.sensor.append(seen - began)
                sweep = readings.lidars["lidar"]
                points = sweep.points @ sweep.pose[:3, :3].T + sweep.pose[:3, 3]
                judge(found, detections, points[points[:, 2] > 0.25], view.boxes, view.names, view.categories, station)
            tick += 1


def judge(
    found: Findings, detections: Detections, points: np.ndarray, boxes: np.ndarray, names: tuple[str, ...],
    categories: tuple[str, ...], station: str,
) -> None:  # fmt: skip
    """Compare with the truth."""
    found.frames += 1
    for name, category, box in zip(names, categories, boxes, strict=True):
        grown = box + np.array([0, 0, 0, 0.1, 0.1, 0.1, 0])
        if name == station or category == "misc" or np.count_nonzero(points_in_box(points, grown)) < LEAST_POINTS:
            continue
        away = np.hypot(*(detections.boxes[:, :2] - box[:2]).T)
        error = float(away.min()) if len(away) and away.min() < FOUND else math.inf
        found.errors["incoming car" if name == "Incoming" else category].append(error)
    for place in detections.boxes[:, :2]:
        found.false += bool(np.hypot(*(boxes[:, :2] - place).T).min() > FOUND)


def look_at_random(count: int, seed: int) -> None:
    """Print what the detector finds in scenes of which nothing was chosen by."""
    errors: dict[str, list[float]] = defaultdict(list)
    named: dict[str, int] = defaultdict(int)
    false = 0
    detector = LidarDetector()
    for scene in random_scenes(count, seed):
        found, sweep = detector.detect(scene.readings), scene.readings.lidars["lidar"]
        points = sweep.points @ sweep.pose[:3, :3].T + sweep.pose[:3, 3]
        points = points[points[:, 2] > 0.25]
        for kind, box in zip(scene.kinds, scene.boxes, strict=True):
            if np.count_nonzero(points_in_box(points, box + np.array([0, 0, 0, 0.1, 0.1, 0.1, 0]))) < LEAST_POINTS:
                continue
            away = np.hypot(*(found.boxes[:, :2] - box[:2]).T)
            hit = len(away) > 0 and away.min() < FOUND
            errors[kind].append(float(away.min()) if hit else math.inf)
            named[kind] += bool(hit and found.classes[int(away.argmin())] == kind)
        for place in found.boxes[:, :2]:
            false += bool(np.hypot(*(scene.boxes[:, :2] - place).T).min() > FOUND)
    for kind, all_of in sorted(errors.items()):
        hits = [error for error in all_of if math.isfinite(error)]
        share, right = 100 * len(hits) / len(all_of), 100 * named[kind] / max(len(hits), 1)
        off, most = median(hits), float(np.percentile(hits, 90))
        print(
            f"{kind:11} {share:5.1f} % of {len(all_of):4}   {off:.2f} m, 90 % within {most:.2f} m   class {right:.0f} %"
        )
    print(f"false detections per sweep {false / count:.2f}")


def tracker_milliseconds(kind: str, count: int = 10, ticks: int = 200) -> float:
    """The median of an update with so many objects."""
    rng, spent = np.random.default_rng(0), []
    tracker = Tracker(TrackerSettings.model_validate({"kind": kind}))
    places, speeds = rng.uniform(-50, 50, (count, 2)), rng.uniform(-8, 8, (count, 2))
    for tick in range(ticks):
        boxes = np.tile([0, 0, 0.75, 4.6, 1.8, 1.5, 0.0], (count, 1))
        boxes[:, :2] = places + speeds * tick * 0.05 + rng.normal(0, 0.1, (count, 2))
        unknown = np.full((count, 2), np.nan), np.tile(0.01 * np.eye(2), (count, 1, 1))
        detections = Detections(tick * 0.05, boxes, np.ones(count), ("car",) * count, *unknown)
        began = time.perf_counter()
        tracker.update(detections)
        spent.append(time.perf_counter() - began)
    return 1e3 * median(spent)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--every", type=int, default=5, help="look on at every n-th tick")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=1, help="of each whole run; the best counts")
    parser.add_argument("--runs-only", action="store_true", help="leave out what the detector `lidar` finds")
    arguments = parser.parse_args()
    if not arguments.runs_only:
        print_findings(arguments.every, arguments.seed)
    print_table(arguments.seed, arguments.repeats)


def print_findings(every: int, seed: int) -> None:
    """What the detector `lidar` finds, and how long a sweep takes."""
    print("scenarios 1 and 2, by which thresholds were chosen")
    found = Findings()
    for name, stations in SCENARIOS.items():
        look(name, stations, every, seed, found)
    for kind, errors in sorted(found.errors.items()):
        hits = [error for error in errors if math.isfinite(error)]
        share, middle = 100 * len(hits) / len(errors), median(hits)
        print(f"{kind:13} found {share:5.1f} % of {len(errors):4}   median error of the center {middle:.2f} m")
    print(f"false detections per sweep {found.false / found.frames:.2f}")
    print("random scenes, by which nothing was chosen")
    look_at_random(150, RANDOM_SEED)
    print(
        f"LiDAR {1e3 * median(found.sensor):.1f} ms, detector {1e3 * median(found.detector):.1f} ms per sweep (medians)"
    )
    print(*(f"tracker {kind}, 10 objects: {tracker_milliseconds(kind):.2f} ms" for kind in ("cv", "ctrv")), sep="\n")


if __name__ == "__main__":
    main()

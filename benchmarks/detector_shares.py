"""Shares of the components of a run with a detector in its processor time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import wraps
from typing import Any

import cv2
from detector_runs import AS_EI_DRIVE, DEFAULT, SCENARIO, RunTime, run

from eidrive_scenario.perception.learned.detector import LearnedDetector, YoloDetector
from eidrive_scenario.perception.learned.image_network import ImageNetwork
from eidrive_scenario.perception.lidar.detector import LidarDetector
from eidrive_scenario.rendering.scene import SceneImage
from eidrive_scenario.sensing.camera import Camera, ImageSensor
from eidrive_scenario.sensing.lidar import Lidar

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


def measured_run(detector: str, properties: Mapping[str, str], seed: int) -> tuple[RunTime, dict[str, float]]:
    """Run the scenario once; return its times, and the processor time of each of PARTS [s]."""
    with measured_parts() as parts:
        return run(detector, properties, seed), parts


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
        best, parts = min(
            (measured_run(detector, properties, seed) for _ in range(repeats)),
            key=lambda entry: entry[0].total / entry[0].simulated,
        )
        shares = [*parts.values(), best.total - sum(parts.values())]
        name = f"{detector}, {'800 x 600 and lidar at 20 Hz' if properties else 'default sensors'}"
        cells = "".join(f"{100 * share / best.total:8.0f} %" for share in shares)
        verdict = "passed" if best.passed else "failed"
        print(f"{name:38}{cells}   {best.simulated / best.total:.2f} times real time, {verdict}")

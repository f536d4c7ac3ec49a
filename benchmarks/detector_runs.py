"""How long scenario 1 takes with each detector on ego and roadside unit, and what takes the time."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import torch

from eidrive_scenario.library import library_path, resolve_scenario
from eidrive_scenario.perception.learned.detector import LearnedDetector
from eidrive_scenario.perception.learned.image_network import ImageNetwork
from eidrive_scenario.perception.lidar.detector import LidarDetector
from eidrive_scenario.sensing.camera import Camera
from eidrive_scenario.sensing.lidar import Lidar
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed

SCENARIO = "coop/scenario_1"
USUAL = ""
AS_EI_DRIVE = "{camera: {width: 800, height: 600, rate: 20}, lidar: {rate: 20}}"
"""A picture of CARLA's default size and a sweep in each tick."""
CASES = (
    ("yolov5", USUAL),
    ("ssd", USUAL),
    ("lidar", USUAL),
    ("yolov5", AS_EI_DRIVE),
)
PARTS: dict[str, tuple[tuple[type, str], ...]] = {
    "images": ((Camera, "read"),),
    "network": ((ImageNetwork, "find"),),
    "detector": ((LearnedDetector, "detect"), (LidarDetector, "detect")),
    "LiDAR": ((Lidar, "read"),),
}
"""What is measured, and where; a detector's time holds that of its network, which is taken off."""


class Spent(NamedTuple):
    """Of one run: simulated time, processor time and its parts [s], and whether it passed."""

    simulated: float
    all_of_it: float
    parts: dict[str, float]
    passed: bool


def run(detector: str, sensors: str, seed: int) -> Spent:
    """Play the scenario once; `sensors` is what the stations' property of that name says, or nothing."""
    with _scenario(sensors) as path, _watched() as parts:
        simulation = Simulation(load_for_seed(path, seed, {}), seed=seed, settings=RunSettings(detector=detector))
        began = time.process_time()
        result = simulation.run()
        spent = time.process_time() - began
    parts["detector"] -= parts["network"]
    return Spent(result.simulated_s, spent, parts, result.passed)


@contextmanager
def _scenario(sensors: str) -> Iterator[Path]:
    """The scenario's file, or a copy that says what the stations sense with."""
    path = resolve_scenario(SCENARIO)
    if not sensors:
        yield path
        return
    text = path.read_text(encoding="utf-8").replace('"../', f'"{library_path()}/')
    oracle = '<Property name="detector" value="oracle"/>'
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        copy.write_text(text.replace(oracle, f'{oracle}<Property name="sensors" value="{sensors}"/>'), encoding="utf-8")
        yield copy


@contextmanager
def _watched() -> Iterator[dict[str, float]]:
    """Processor time [s] that goes by in each of PARTS."""
    spent = dict.fromkeys(PARTS, 0.0)
    kept: list[tuple[type, str, Callable[..., Any]]] = []
    for part, places in PARTS.items():
        for kind, name in places:
            kept.append((kind, name, getattr(kind, name)))
            setattr(kind, name, _timed(kept[-1][2], spent, part))
    try:
        yield spent
    finally:
        for kind, name, method in kept:
            setattr(kind, name, method)


def _timed(method: Callable[..., Any], spent: dict[str, float], part: str) -> Callable[..., Any]:
    @wraps(method)
    def wrapped(*arguments: Any, **named: Any) -> Any:
        began = time.process_time()
        try:
            return method(*arguments, **named)
        finally:
            spent[part] += time.process_time() - began

    return wrapped


def print_table(seed: int, repeats: int) -> None:
    """Play all cases, each as often, and print the best of each."""
    cv2.setNumThreads(1)
    run("yolov5", USUAL, seed)
    print(
        f"{SCENARIO}, whole runs, ego and roadside unit alike; torch {torch.get_num_threads()} thread, "
        f"OpenCV {cv2.getNumThreads()} thread; simulated seconds per second of processor time, and how that is spent"
    )
    print(f"{'':38}" + "".join(f"{part:>10}" for part in (*PARTS, "rest")))
    for detector, sensors in CASES:
        best = min(
            (run(detector, sensors, seed) for _ in range(repeats)), key=lambda one: one.all_of_it / one.simulated
        )
        shares = [*best.parts.values(), best.all_of_it - sum(best.parts.values())]
        name = f"{detector}, {'800 x 600 and LiDAR at 20 Hz' if sensors else 'usual sensors'}"
        cells = "".join(f"{100 * share / best.all_of_it:8.0f} %" for share in shares)
        verdict = "passed" if best.passed else "failed"
        print(f"{name:38}{cells}   {best.simulated / best.all_of_it:.2f} times real time, {verdict}")

"""Time of late fusion: stations that each report the same objects at 20 Hz, received immediately.

python benchmarks/bench_fusion.py [--objects 10] [--stations 4] [--ticks 400]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from statistics import median

import numpy as np

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.randomness import generator
from eidrive_scenario.fusion.average import AverageFusion
from eidrive_scenario.fusion.covariance_intersection import CovarianceIntersectionFusion
from eidrive_scenario.fusion.method import FusionMethod, Report

DT = 0.05


def reports_of(tick: int, stations: int, objects: int, *, velocities: bool) -> list[Report]:
    """Return one report of every station: cars in a field, 9 m apart, with errors of 0.2 m."""
    rng = generator(tick, "bench_fusion")
    velocity = np.tile([10.0, 1.0], (objects, 1))
    boxes = np.zeros((objects, 7))
    columns = max(1, round(objects**0.5))
    boxes[:, 0], boxes[:, 1] = 9.0 * (np.arange(objects) % columns), 9.0 * (np.arange(objects) // columns)
    boxes[:, :2] += velocity * DT * tick
    boxes[:, 2:] = 0.75, 4.5, 1.8, 1.5, 0.1
    reports = []
    for station in range(stations):
        measured = boxes.copy()
        measured[:, :2] += 0.2 * rng.normal(size=(objects, 2))
        detections = Detections(
            DT * tick,
            measured,
            np.full(objects, 0.9),
            ("car",) * objects,
            velocity if velocities else np.full((objects, 2), np.nan),
            np.tile(0.04 * np.eye(2), (objects, 1, 1)),
        )
        reports.append(Report(f"station {station}", detections, DT * tick))
    return reports


def measure(build: Callable[[], FusionMethod], ticks: list[list[Report]], objects: int) -> tuple[float, float, float]:
    """Return median and minimum time of a tick [ms] on this thread, and the share of ticks with the correct count."""
    fusion = build()
    times, correct = [], 0
    for number, reports in enumerate(ticks):
        begin = time.thread_time()
        for report in reports:
            fusion.add_report(report)
        fused = fusion.fuse(reports, DT * number)
        times.append(time.thread_time() - begin)
        correct += len(fused) == objects
    return 1e3 * median(times), 1e3 * min(times), correct / len(ticks)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, default=10)
    parser.add_argument("--stations", type=int, default=4)
    parser.add_argument("--ticks", type=int, default=400)
    options = parser.parse_args()
    print(f"{options.objects} objects, {options.stations} stations, {options.ticks} ticks of {DT} s")
    for name, build, velocities in (
        ("average", AverageFusion, True),
        ("covariance_intersection", CovarianceIntersectionFusion, True),
        ("  positions only", CovarianceIntersectionFusion, False),
    ):
        ticks = [
            reports_of(tick, options.stations, options.objects, velocities=velocities) for tick in range(options.ticks)
        ]
        median_time, minimum, correct = measure(build, ticks, options.objects)
        print(
            f"  {name:26} median {median_time:7.3f} ms   minimum {minimum:7.3f} ms   "
            f"correct count {100 * correct:5.1f} %"
        )


if __name__ == "__main__":
    main()

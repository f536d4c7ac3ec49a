"""Sweep the latency of the channel over scenario 1 and print how often the ego avoids the collision.

    python examples/latency_sweep.py --seeds 5 --latency 0 0.1 0.2 0.3

The table has one row per latency: runs without a collision with their 95 % Wilson interval, and the mean distance
between the centers of both cars [m].
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from statistics import fmean

from scipy.stats import binomtest

from eidrive_scenario.api.run import RunResult, RunSettings, run_file

SCENARIO = "coop/scenario_1"


def results(latency: float, seeds: Sequence[int]) -> list[RunResult]:
    """Run the scenario with a constant latency [s], once per seed."""
    channel = f"{{delay: {{kind: constant, seconds: {latency}}}}}"
    return [run_file(SCENARIO, seed=seed, settings=RunSettings(channel=channel)) for seed in seeds]


def row(latency: float, runs: Sequence[RunResult]) -> str:
    """Return one line of the table."""
    passed = sum(run.metrics["collision.count"] == 0.0 for run in runs)
    interval = binomtest(passed, len(runs)).proportion_ci(method="wilson")
    distance = fmean(run.metrics["min_distance.Ego.Incoming.center"] for run in runs)
    return f"{latency:9.2f}  {passed:3d}/{len(runs)}  {interval.low:.2f}-{interval.high:.2f}  {distance:12.2f}"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seeds", type=int, default=5, help="number of seeds, from 1 on")
    parser.add_argument("--latency", type=float, nargs="+", default=[0.0, 0.1, 0.2, 0.3], help="[s]")
    given = parser.parse_args(arguments)
    print("latency_s  passed   95 %      distance_m")
    for latency in given.latency:
        print(row(latency, results(latency, range(1, given.seeds + 1))))


if __name__ == "__main__":
    main()

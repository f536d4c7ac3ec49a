"""Figures by which the speed of the project is followed, each beside its aim and the figure of version 0.1.0.

Each figure is measured in a separate process. Processor times count where a figure has one process and one thread,
since other load changes them least; sweeps count by the clock. `EIDRIVE_MAPS` names the folder of CARLA's Town04.xodr;
the figures of traffic are omitted without it.

`--profile` prints the share of time of each package and the functions that take most.

    python benchmarks/figures.py [NAME ...] [--repeats 3] [--json | --profile]
"""

from __future__ import annotations

import argparse
import json
import os
import pstats
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
TIMEOUT = 1800.0
"""Maximum duration of one measurement [s]."""
COMMAND = (sys.executable, "-m", "eidrive_scenario")
SINGLE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def scenario_1_ratio() -> float:
    """Return the time of scenario 1 per time of the bare pybullet loop."""
    from bench_scenario_1 import measure

    measured = measure(runs=5, seed=1, channel="ideal")
    return measured.run_time / measured.bare_time


def planner_tick() -> float:
    """Return the time of the planner `behavior` with ten tracks [ms per tick]."""
    from bench_planner import ROAD, TICKS, drive, timed_plans
    from timing import sum_of_minima

    from eidrive_scenario.extensions.library import library_path
    from eidrive_scenario.roads import RoadNetwork

    roads, inputs = RoadNetwork.load(library_path() / ROAD), list(drive())
    return 1e3 * sum_of_minima([timed_plans(roads, inputs) for _ in range(5)]) / TICKS


def heavy_traffic() -> float:
    """Return the simulated time of coop/scenario_5 with the planner `behavior` per processor time."""
    from bench_planner import DT, timed_run
    from timing import sum_of_minima

    ticks = [timed_run("behavior", 1) for _ in range(3)]
    return DT * len(ticks[0]) / sum_of_minima(ticks)


def detector(name: str, properties: str = "DEFAULT") -> float:
    """Return the simulated time of scenario 1 with a detector on two stations per processor time.

    properties  name of those in `detector_runs`
    """
    import cv2
    import detector_runs

    cv2.setNumThreads(1)
    for _ in range(2):  # the second run loads no network
        measured = detector_runs.run(name, getattr(detector_runs, properties), seed=1)
    return measured.simulated / measured.total


def traffic(scripted: int, swarm: int, seconds: float) -> float:
    """Return the simulated time of traffic on Town04 per processor time."""
    from bench_traffic import town_file, traffic_run

    return traffic_run(town_file("Town04"), scripted, swarm, seconds)


def stations(count: int, seconds: float, *, all_listen: bool, sight: str) -> float:
    """Return the simulated time of a run with stations that send CAM at 10 Hz per processor time."""
    from bench_radio import RATE, complete_run

    return complete_run(count, seconds, RATE, all_listen, sight)


def learning_steps() -> float:
    """Return the steps of the learning environment per second of processor time."""
    from bench_gym import environment_rate

    return environment_rate(10)[0]


def sweep_rate(runs: int = 300) -> float:
    """Return the runs per minute of a sweep of scenario 1 with the oracle on two workers."""
    with tempfile.TemporaryDirectory() as folder:
        options = ("--runs", str(runs), "--workers", "2", "--store", f"{folder}/store.db")
        started = time.perf_counter()
        subprocess.run((*COMMAND, "sweep", "coop/scenario_1", *options), check=True, stdout=subprocess.DEVNULL)
        return 60.0 * runs / (time.perf_counter() - started)


def command_time(*arguments: str) -> float:
    """Return the processor time of a command, without its compilation [s]: the first of four writes byte code."""
    times = []
    for _ in range(4):
        before = children_time()
        subprocess.run((*COMMAND, *arguments), check=True, stdout=subprocess.DEVNULL, cwd=tempfile.gettempdir())
        times.append(children_time() - before)
    return min(times[1:])


def children_time() -> float:
    """Return the processor time of the processes that this one has started and that have ended [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


@dataclass(frozen=True)
class Figure:
    """A figure that is followed.

    unit     unit
    measure  function that returns the figure
    aim      wanted figure, None for none
    before   figure of version 0.1.0, None where it was not measured
    is_less  whether less is better
    maps     whether Town04 is required
    """

    unit: str
    measure: Callable[[], float]
    aim: float | None = None
    before: float | None = None
    is_less: bool = False
    maps: bool = False


REAL_TIME = "x real time"
FIGURES: Mapping[str, Figure] = {
    "scenario_1": Figure("x bare pybullet loop", scenario_1_ratio, 2.2, 2.93, is_less=True),
    "planner": Figure("ms per tick", planner_tick, 1.0, is_less=True),
    "scenario_5": Figure(REAL_TIME, heavy_traffic, 10.0),
    "yolov5": Figure(REAL_TIME, lambda: detector("yolov5"), 3.0, 1.44),
    "ssd": Figure(REAL_TIME, lambda: detector("ssd"), 3.0, 1.37),
    "yolov5_int8": Figure(REAL_TIME, lambda: detector("yolov5", "INT8"), 3.5),
    "ssd_int8": Figure(REAL_TIME, lambda: detector("ssd", "INT8"), 3.5),
    "yolov5_800x600": Figure(REAL_TIME, lambda: detector("yolov5", "AS_EI_DRIVE"), 1.2, 0.44),
    "lidar": Figure(REAL_TIME, lambda: detector("lidar"), 5.0, 2.48),
    "cars_200": Figure(REAL_TIME, lambda: traffic(200, 100, 30.0), 20.0, 6.7, maps=True),
    "cars_1000": Figure(REAL_TIME, lambda: traffic(1000, 0, 10.0), 5.0, maps=True),
    "stations_200": Figure(
        REAL_TIME, lambda: stations(200, 0.5, all_listen=True, sight="random"), 1.0, 0.19
    ),
    "stations_200_rays": Figure(
        REAL_TIME, lambda: stations(200, 1.0, all_listen=False, sight="rays"), 1.5, 0.53
    ),
    "gym": Figure("steps per s", learning_steps, 1000.0),
    "sweep": Figure("runs per minute", sweep_rate, 1500.0),
    "run": Figure("s", lambda: command_time("run", "coop/scenario_1"), 0.8, is_less=True),
    "version": Figure("s", lambda: command_time("--version"), 0.15, is_less=True),
}  # fmt: skip


def available(names: Iterable[str] = ()) -> list[str]:
    """Return these names of figures, or all that can be measured here. Raise SystemExit if one is unknown."""
    chosen = list(names)
    if unknown := [name for name in chosen if name not in FIGURES]:
        sys.exit(f"unknown figure: {', '.join(unknown)} (there are {', '.join(FIGURES)})")
    return chosen or [name for name, figure in FIGURES.items() if os.environ.get("EIDRIVE_MAPS") or not figure.maps]


def variables(checkout: Path) -> dict[str, str]:
    """Return the environment in which the package of a checkout is imported, with byte code."""
    paths = [*(str(checkout / folder) for folder in ("", "behaviors", "criteria")), str(HERE)]
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, **SINGLE_THREAD, "PYTHONPATH": os.pathsep.join(paths)}


def measure(name: str, checkout: Path = ROOT) -> float | None:
    """Return a figure of the package of a checkout, measured in a separate process; None if it fails there."""
    try:
        done = subprocess.run(
            (sys.executable, __file__, name, "--here"), check=True, env=variables(checkout), timeout=TIMEOUT,
            capture_output=True, text=True,
        )  # fmt: skip
    except subprocess.CalledProcessError as error:
        print(f"{name}: {(error.stderr.strip().splitlines() or ['no message'])[-1]}", file=sys.stderr)
        return None
    except subprocess.TimeoutExpired:
        print(f"{name}: no figure within {TIMEOUT:g} s", file=sys.stderr)
        return None
    return float(done.stdout.split()[-1])


def better(name: str, values: Iterable[float]) -> float:
    """Return the best of several measurements of a figure, to which other load of the machine added least."""
    return min(values) if FIGURES[name].is_less else max(values)


def best(name: str, repeats: int) -> float | None:
    """Return the best of several measurements of a figure here; None if all fail."""
    values = [value for _ in range(repeats) if (value := measure(name)) is not None]
    return better(name, values) if values else None


def line(name: str, value: float | None) -> str:
    """Return the printed line of a figure."""
    figure = FIGURES[name]
    aim = "" if figure.aim is None else f"{'at most' if figure.is_less else 'at least'} {figure.aim:g}"
    before = "" if figure.before is None else f"{figure.before:g}"
    shown = "failed" if value is None else f"{value:.4g}"
    return f"{name:20}{shown:>10}  {figure.unit:24}{aim:16}{before}"


def print_profile(name: str) -> None:
    """Print where a figure spends its time in this process; other processes are not measured."""
    from timing import profiled

    FIGURES[name].measure()  # the second measurement imports no modules

    def measured() -> None:
        print(f"{name}, {FIGURES[name].measure():.4g} {FIGURES[name].unit} with the profiler")

    pstats.Stats(profiled(measured)).strip_dirs().sort_stats("tottime").print_stats(12)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help=f"figures, of {', '.join(FIGURES)} (default: all)")
    parser.add_argument("--repeats", type=int, default=1, help="number of measurements, of which the best counts")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--profile", action="store_true", help="print where the time of each figure goes")
    parser.add_argument("--here", action="store_true", help="measure in this process, and print only the number")
    options = parser.parse_args()
    names = available(options.names)
    if options.profile:
        os.environ.update(SINGLE_THREAD)
        for name in names:
            print_profile(name)
        return
    if options.here:
        print(*(FIGURES[name].measure() for name in names))
        return
    values: dict[str, float | None] = {}
    if not options.json:
        print(f"{'figure':20}{'here':>10}  {'unit':24}{'aim':16}0.1.0")
    for name in names:
        values[name] = best(name, options.repeats)
        if not options.json:
            print(line(name, values[name]), flush=True)
    if options.json:
        print(json.dumps(values))
    if None in values.values():
        sys.exit(1)


if __name__ == "__main__":
    main()

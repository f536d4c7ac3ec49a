"""Run time of scenario suites of third parties in one process, compared with esmini if available.

Every scenario under `EIDRIVE_CORPORA` (`EIDRIVE_MAPS` names the folder with CARLA's towns) is loaded and run to its
end, with steps of 0.01 s, as esmini's users choose them, and with the default step; none of the scenarios has sensors.
If `ESMINI` names the program esmini, it runs the same files immediately afterwards. The ratio of the two times is
printed for scenarios that end by themselves in both. Loading counts on both sides; the steps after the first one find
the roads of a file in memory, so compare them without loading. Results are printed for the suite in one process, and
for a process of `eidrive run` for each file, which is measured, too.

    python benchmarks/bench_corpora.py [--match cut-in] [--limit 60] [--dt 0.01 0.05] [--csv FILE]
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import geometric_mean, median
from typing import Any

import numpy as np
from timing import minimum_time

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.errors import EidriveError
from eidrive_scenario.extensions.library import definition
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.recording.text.csv_writer import neutralize_formula
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.road_map import Road
from eidrive_scenario.simulation import RunSettings, Simulation

ESMINI_STEP = 0.01
POINTS = 100_000
IMPORT = "import eidrive_scenario.simulation, eidrive_behaviors.actions, eidrive_behaviors.conditions"


@dataclass(frozen=True)
class ScenarioRun:
    """One run of a scenario: name of its file, simulated time, times of loading and running [s], and the end reason."""

    name: str
    simulated: float
    loading: float
    running: float
    end: str

    @property
    def wall(self) -> float:
        """Time of loading and running [s]."""
        return self.loading + self.running

    @property
    def rate(self) -> float:
        """Simulated time per time of loading and running."""
        return self.simulated / self.wall


def run_scenario(path: Path, dt: float, limit: float) -> ScenarioRun:
    """Load and run a scenario. Raise EidriveError if the file or its catalogs are invalid."""
    started = time.perf_counter()
    simulation = Simulation(load_scenario(path), settings=RunSettings(dt=dt, time_limit=limit))
    loading = time.perf_counter() - started
    result = simulation.run()
    return ScenarioRun(path.stem, result.simulated_s, loading, result.wall_s, result.end_reason)


def esmini_seconds(program: str, path: Path) -> float | None:
    """Return the time of esmini's process for a file [s]; None if it fails or does not end."""
    options = ["--headless", "--fixed_timestep", str(ESMINI_STEP), "--disable_stdout"]
    try:
        return process_seconds([program, "--osc", str(path), *options], cwd=path.parent, timeout=20.0, check=True)
    except subprocess.SubprocessError:
        return None


def process_seconds(command: Sequence[str], **options: Any) -> float:
    """Return the time of a process [s]; `options` are those of `subprocess.run`."""
    started = time.perf_counter()
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **{"check": False, **options})
    return time.perf_counter() - started


def start_seconds(command: Sequence[str]) -> float:
    """Return the median time to start a process [s]."""
    return median(process_seconds(command) for _ in range(5))


def roads(maps: Path) -> None:
    """Measure loading of Town04 and lane lookup."""
    town = maps / "Town04.xodr"
    loading = minimum_time(lambda: RoadNetwork.parse(town.read_bytes(), str(town)).bounds(), 3) / 1e3
    print(f"Town04.xodr loads in {loading:.3f} s, including lookup tables (aim: below 1); best of 3")
    network = RoadNetwork.load(town)
    low_x, low_y, high_x, high_y = network.bounds()
    rng = generator(0, "bench_corpora")
    x, y = rng.uniform(low_x, high_x, POINTS), rng.uniform(low_y, high_y, POINTS)
    lanes = np.concatenate([network.lane_pose(road.id, lane, s)[:2] for road, lane, s in _along_lanes(network)], axis=1)
    on_lanes = lanes[:, rng.integers(lanes.shape[1], size=POINTS)] + rng.normal(0.0, 1.0, (2, POINTS))
    for area, px, py in (("on its roads", *on_lanes), ("anywhere on the map", x, y)):
        lookup = minimum_time(partial(network.locate, px, py), 5) / 1e3
        print(f"lane lookup of {POINTS:,} points {area}: {lookup:.3f} s (aim: below 0.2), best of 5")


def _along_lanes(network: RoadNetwork) -> Iterator[tuple[Road, int, np.ndarray]]:
    for road in network.roads.values():
        for section in road.sections:
            s = np.linspace(section.s, section.end - 1e-6, max(int(section.length), 2))
            for lane in section.lanes.values():
                if lane.drivable:
                    yield road, lane.id, s


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--match", default="", help="text in the path of the selected files")
    parser.add_argument("--limit", type=float, default=60.0, help="maximum simulated time of a scenario [s]")
    parser.add_argument("--dt", type=float, nargs="+", default=[ESMINI_STEP, RunSettings().dt])
    parser.add_argument("--csv", type=Path, help="file for the table")
    options = parser.parse_args()
    folder, maps, esmini = (os.environ.get(name) for name in ("EIDRIVE_CORPORA", "EIDRIVE_MAPS", "ESMINI"))
    if not folder:
        sys.exit("bench_corpora: EIDRIVE_CORPORA is not set; it must name the folder with scenarios of third parties")
    if maps:
        roads(Path(maps))
    corpora = Path(folder).resolve()
    paths = [path for path in sorted(corpora.rglob("*.xosc")) if options.match in str(path)]
    paths = [path for path in paths if definition(path) == "scenario"]
    table: list[dict[str, object]] = []
    runs: dict[float, list[ScenarioRun]] = {dt: [] for dt in options.dt}
    pairs: list[tuple[ScenarioRun, float, float]] = []
    not_run = 0
    columns = "".join(f"{f'dt {dt:g}: wall s':>15}{'sim/wall':>10}" for dt in options.dt)
    print(f"\n{'scenario':52}{'simulated s':>12}{columns}" + (f"{'esmini s':>10}{'ratio':>8}" if esmini else ""))
    for path in paths:
        name = path.relative_to(corpora).with_suffix("").as_posix()
        try:
            by_step = {dt: run_scenario(path, dt, options.limit) for dt in options.dt}
        except EidriveError as error:
            not_run += 1
            print(f"{name:52}  not run: {str(error).splitlines()[0].replace(str(corpora) + '/', '')[:110]}")
            continue
        first = by_step[options.dt[0]]
        line = f"{name:52}{first.simulated:12.2f}"
        row: dict[str, object] = {"scenario": name, "simulated_s": first.simulated, "end": first.end}
        for dt, run in by_step.items():
            runs[dt].append(run)
            line += f"{run.wall:15.3f}{run.rate:10.1f}"
            row |= {f"wall_s_{dt:g}": run.wall, f"loading_s_{dt:g}": run.loading}
        if esmini and ESMINI_STEP in by_step:
            esmini_total = esmini_seconds(esmini, path)
            row["esmini_s"] = esmini_total
            if esmini_total is not None and by_step[ESMINI_STEP].end != "time limit":
                steps = ["--dt", str(ESMINI_STEP), "--time-limit", str(options.limit)]
                command = [sys.executable, "-m", "eidrive_scenario", "run", str(path), *steps]
                own_process = row["process_s"] = process_seconds(command)
                pairs.append((by_step[ESMINI_STEP], own_process, esmini_total))
                line += f"{esmini_total:10.3f}{by_step[ESMINI_STEP].wall / esmini_total:8.1f}"
        print(line)
        table.append(row)
    for dt, done in runs.items():
        if done:
            simulated, running = sum(run.simulated for run in done), sum(run.running for run in done)
            loading = sum(run.loading for run in done)
            print(
                f"\ndt {dt:g}: {len(done)} scenarios, {simulated:.0f} s simulated in {loading + running:.1f} s "
                f"({loading:.1f} s of it loading): {simulated / (loading + running):.1f} simulated s per wall s, "
                f"{simulated / running:.1f} without loading"
            )
    if not_run:
        print(f"{not_run} of {len(paths)} files were not run")
    if esmini and pairs:
        compare(esmini, pairs)
    elif not esmini:
        print("ESMINI is not set: no comparison with esmini")
    if options.csv and table:
        with options.csv.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, list(dict.fromkeys(key for row in table for key in row)))
            writer.writeheader()
            for row in table:
                texts = {key: neutralize_formula(value) for key, value in row.items() if isinstance(value, str)}
                writer.writerow({**row, **texts})


def compare(esmini: str, pairs: list[tuple[ScenarioRun, float, float]]) -> None:
    """Print totals of both programs, over the scenarios that end by themselves in both.

    pairs  run in this process, time of a separate process, and time of esmini's process [s]
    """
    own_total, processes, esmini_total = (
        sum(column) for column in zip(*((a.wall, b, c) for a, b, c in pairs), strict=True)
    )
    own_start, esmini_start = start_seconds([sys.executable, "-c", IMPORT]), start_seconds([esmini, "--version"])
    count = len(pairs)
    without = max(esmini_total - count * esmini_start, 1e-9)
    print(f"\ncompared with esmini, dt {ESMINI_STEP:g}, {count} scenarios that end by themselves in both:")
    print(
        f"  the suite in one process, one of esmini per file (aim: at most 1):       {own_total + own_start:8.2f} s "
        f"and {esmini_total:8.2f} s, ratio {(own_total + own_start) / esmini_total:.2f} (0.1.0: 1.15)"
    )
    print(
        f"  without starts of processes:                                             {own_total:8.2f} s and "
        f"{without:8.2f} s, ratio {own_total / without:.2f}"
    )
    print(
        f"  one process per file on both sides (aim: within 3):                      "
        f"{processes:8.2f} s and {esmini_total:8.2f} s, ratio {processes / esmini_total:.2f}"
    )
    ratios = sorted(((run.wall / esmini_time, run.name) for run, _, esmini_time in pairs), reverse=True)
    largest = ", ".join(f"{name} {ratio:.1f}" for ratio, name in ratios[:5])
    print(
        f"  by file: geometric mean {geometric_mean(ratio for ratio, _ in ratios):.2f} (aim: at most 1; 0.1.0: 1.64), "
        f"maximum {ratios[0][0]:.1f} (aim: at most 6; 0.1.0: 19); largest: {largest}"
    )
    print(f"  start of a process: {own_start:.3f} s with imports, esmini {esmini_start:.3f} s")


if __name__ == "__main__":
    main()

"""How fast whole suites of other people's scenarios replay in one process, beside esmini where it is at hand.

Every scenario under `EIDRIVE_CORPORA` (`EIDRIVE_MAPS` names the folder with CARLA's towns) is loaded and played to its
end, with steps of 0.01 s as esmini's users take them and with our default; no scenario among them has sensors. Where
`ESMINI` names esmini's program, it plays the same files right after, and the ratio of the two times is printed for
those that end by themselves in both. Loading counts on both sides; the start of a process is counted and not counted.

    python benchmarks/bench_corpora.py [--match cut-in] [--limit 60] [--dt 0.01 0.05] [--csv FILE]
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np

from eidrive_scenario.errors import EidriveError
from eidrive_scenario.library import definition
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.randomness import generator
from eidrive_scenario.recording.text.csv_writer import neutralize_formula
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.roads.model.road_map import Road
from eidrive_scenario.simulation import RunSettings, Simulation

ESMINI_STEP = 0.01
POINTS = 100_000
IMPORT = "import eidrive_scenario.simulation, eidrive_behaviors.actions, eidrive_behaviors.conditions"


@dataclass(frozen=True)
class Play:
    """One scenario played: seconds simulated, for loading and for running; `end` says how it ended."""

    simulated: float
    loading: float
    running: float
    end: str

    @property
    def wall(self) -> float:
        """Loading and running [s]."""
        return self.loading + self.running

    @property
    def rate(self) -> float:
        """Simulated seconds per second of loading and running."""
        return self.simulated / self.wall


def play(path: Path, dt: float, limit: float) -> Play:
    """Load and run, both fresh. Raises EidriveError where the file or its catalogs are wrong."""
    started = time.perf_counter()
    simulation = Simulation(load_scenario(path), settings=RunSettings(dt=dt, time_limit=limit))
    loading = time.perf_counter() - started
    result = simulation.run()
    return Play(result.simulated_s, loading, result.wall_s, result.end_reason)


def esmini_seconds(program: str, path: Path, patience: float) -> float | None:
    """Seconds that esmini's process takes for a file; None where it fails or does not come to an end."""
    command = [program, "--osc", str(path), "--headless", "--fixed_timestep", str(ESMINI_STEP), "--disable_stdout"]
    started = time.perf_counter()
    try:
        done = subprocess.run(
            command,
            cwd=path.parent,
            timeout=patience,
            check=False,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except subprocess.TimeoutExpired:
        return None
    return time.perf_counter() - started if done.returncode == 0 else None


def start_seconds(command: list[str], times: int = 5) -> float:
    """Seconds for the start of a process that does nothing else, the median of several."""
    seconds = []
    for _ in range(times):
        started = time.perf_counter()
        subprocess.run(command, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        seconds.append(time.perf_counter() - started)
    return median(seconds)


def roads(maps: Path) -> None:
    """Loading of Town04 and lane lookup."""
    town = maps / "Town04.xodr"
    seconds = []
    for _ in range(3):
        started = time.perf_counter()
        network = RoadNetwork.parse(town.read_bytes(), str(town))
        low_x, low_y, high_x, high_y = network.bounds()
        seconds.append(time.perf_counter() - started)
    print(f"Town04.xodr loads in {min(seconds):.3f} s, lookup made ready (aim: below 1); the best of {len(seconds)}")
    rng = generator(0, "bench_corpora")
    x, y = rng.uniform(low_x, high_x, POINTS), rng.uniform(low_y, high_y, POINTS)
    lanes = np.concatenate([network.lane_pose(road.id, lane, s)[:2] for road, lane, s in _along_lanes(network)], axis=1)
    chosen = lanes[:, rng.integers(lanes.shape[1], size=POINTS)] + rng.normal(0.0, 1.0, (2, POINTS))
    for what, px, py in (("on its roads", *chosen), ("anywhere on the map", x, y)):
        seconds = []
        for _ in range(5):
            started = time.perf_counter()
            network.locate(px, py)
            seconds.append(time.perf_counter() - started)
        print(f"lane lookup of {POINTS:,} points {what}: {min(seconds):.3f} s (aim: below 0.2), best of {len(seconds)}")


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
    parser.add_argument("--match", default="", help="only files with this in their path")
    parser.add_argument("--limit", type=float, default=60.0, help="simulated time after which a scenario is left [s]")
    parser.add_argument("--dt", type=float, nargs="+", default=[ESMINI_STEP, RunSettings().dt])
    parser.add_argument("--csv", type=Path, help="write the table there, too")
    given = parser.parse_args()
    folder, maps, esmini = (os.environ.get(name) for name in ("EIDRIVE_CORPORA", "EIDRIVE_MAPS", "ESMINI"))
    if not folder:
        sys.exit("bench_corpora: EIDRIVE_CORPORA is not set; it names the folder with other people's scenarios")
    if maps:
        roads(Path(maps))
    corpora = Path(folder).resolve()
    paths = [path for path in sorted(corpora.rglob("*.xosc")) if given.match in str(path)]
    paths = [path for path in paths if definition(path) == "scenario"]
    table: list[dict[str, object]] = []
    plays: dict[float, list[Play]] = {dt: [] for dt in given.dt}
    pairs: list[tuple[Play, float]] = []
    refused: Counter[str] = Counter()
    heads = "".join(f"{f'dt {dt:g}: wall s':>15}{'sim/wall':>10}" for dt in given.dt)
    print(f"\n{'scenario':52}{'simulated s':>12}{heads}" + (f"{'esmini s':>10}{'ratio':>8}" if esmini else ""))
    for path in paths:
        name = path.relative_to(corpora).with_suffix("").as_posix()
        try:
            own = {dt: play(path, dt, given.limit) for dt in given.dt}
        except EidriveError as error:
            refused[str(error).splitlines()[0].replace(str(corpora), "")] += 1
            print(f"{name:52}  not played: {str(error).splitlines()[0].replace(str(corpora) + '/', '')[:110]}")
            continue
        first = own[given.dt[0]]
        line = f"{name:52}{first.simulated:12.2f}"
        row: dict[str, object] = {"scenario": name, "simulated_s": first.simulated, "end": first.end}
        for dt, one in own.items():
            plays[dt].append(one)
            line += f"{one.wall:15.3f}{one.rate:10.1f}"
            row |= {f"wall_s_{dt:g}": one.wall, f"loading_s_{dt:g}": one.loading}
        if esmini and ESMINI_STEP in own:
            theirs = esmini_seconds(esmini, path, patience=20.0)
            row["esmini_s"] = theirs
            if theirs is not None and own[ESMINI_STEP].end != "time limit":
                pairs.append((own[ESMINI_STEP], theirs))
                line += f"{theirs:10.3f}{own[ESMINI_STEP].wall / theirs:8.1f}"
        print(line)
        table.append(row)
    for dt, done in plays.items():
        if done:
            simulated, running = sum(one.simulated for one in done), sum(one.running for one in done)
            loading = sum(one.loading for one in done)
            print(
                f"\ndt {dt:g}: {len(done)} scenarios, {simulated:.0f} s simulated in {loading + running:.1f} s "
                f"({loading:.1f} s of it loading): {simulated / (loading + running):.1f} simulated s per wall s, "
                f"{simulated / running:.1f} without loading"
            )
    if refused:
        print(f"{sum(refused.values())} of {len(paths)} files were not played")
    if esmini and pairs:
        compare(esmini, pairs)
    elif not esmini:
        print("ESMINI is not set: no comparison with esmini")
    if given.csv and table:
        with given.csv.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, list(dict.fromkeys(key for row in table for key in row)))
            writer.writeheader()
            for row in table:
                texts = {key: neutralize_formula(value) for key, value in row.items() if isinstance(value, str)}
                writer.writerow({**row, **texts})


def compare(esmini: str, pairs: list[tuple[Play, float]]) -> None:
    """Totals of both, over the scenarios that end by themselves in both."""
    ours, theirs = sum(one.wall for one, _ in pairs), sum(seconds for _, seconds in pairs)
    own_start, their_start = start_seconds([sys.executable, "-c", IMPORT]), start_seconds([esmini, "--version"])
    count = len(pairs)
    without = max(theirs - count * their_start, 1e-9)
    print(f"\nbeside esmini, dt {ESMINI_STEP:g}, {count} scenarios that end by themselves in both (aim: within 5):")
    print(
        f"  the suite in one process of ours, one process of esmini's for each file: {ours + own_start:8.2f} s and "
        f"{theirs:8.2f} s, ratio {(ours + own_start) / theirs:.2f}"
    )
    print(
        f"  starts of processes not counted:                                         {ours:8.2f} s and "
        f"{without:8.2f} s, ratio {ours / without:.2f}"
    )
    print(
        f"  a process for each file on both sides:                                   {ours + count * own_start:8.2f} s "
        f"and {theirs:8.2f} s, ratio {(ours + count * own_start) / theirs:.2f}"
    )
    print(f"  start of a process: {own_start:.3f} s ours with imports, {their_start:.3f} s esmini's")


if __name__ == "__main__":
    main()

"""Cost per car, per station and per part of an input over their number, on one core, as a table and a plot.

Scripted cars drive on Town04 (`EIDRIVE_MAPS`), as in `bench_traffic.py`. Stations drive on a straight road and send CAM
at 10 Hz by IEEE 802.11p, as in `bench_radio.py`: one receives, or all receive and fuse. On a road of 2 km the number of
messages then grows with the square of the number of stations; on one of 100 m per station it grows as the number does.
Times are processor times of whole runs without loading.

Inputs are a Nurbs of order 4 with control points 1 m apart, and a recording of two cars that is read once.

    python benchmarks/bench_growth.py [--inputs | --plot docs/figures/growth.png]
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from bench_radio import LENGTH, RATE, TICK, complete_run, received_messages
from bench_traffic import town_file, traffic_run
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from msgspec.structs import replace
from timing import minimum_time

from eidrive_scenario.openscenario import model
from eidrive_scenario.recording.recorder import Recorder
from eidrive_scenario.recording.recording import read_recording
from eidrive_scenario.roads import Pose
from eidrive_scenario.simulation import Simulation
from eidrive_scenario.storyboard.kinematics.trajectory_sampling import sample_trajectory

CARS, STATIONS = (100, 200, 500, 1000), (20, 50, 100, 200)
CAR_SECONDS, STATION_SECONDS = 5.0, 2.0
"""Simulated time of a run with cars, and of one with stations [s]."""
SPACING = 100.0
"""Length of road per station, if their density does not depend on their number [m]."""
REPEATS = 5
POINTS, FRAMES = (250, 1000, 5000, 20_000), (250, 1000, 5000, 20_000)
"""Numbers of control points, and of frames of a recording."""

Cost = Callable[[int], float]


def car_cost(count: int) -> float:
    """Return the time per car and tick [ms]."""
    return 1e3 * TICK / traffic_run(town_file("Town04"), count, 0, CAR_SECONDS, runs=REPEATS) / count


def station_cost(count: int, *, all_listen: bool, length: float = LENGTH) -> float:
    """Return the time per station and tick [ms]."""
    rate = max(complete_run(count, STATION_SECONDS, RATE, all_listen, "random", length) for _ in range(REPEATS))
    return 1e3 * TICK / rate / count


def nurbs_cost(count: int) -> float:
    """Return the time per control point to sample a curve [ms]."""
    shape = model.Nurbs(
        order=4,
        control_point=tuple(
            model.ControlPoint(position=model.Position(world_position=model.WorldPosition(x=float(i), y=i % 7.0)))
            for i in range(count)
        ),
        knot=tuple(model.Knot(value=float(value)) for value in range(count + 4)),
    )
    trajectory = model.Trajectory(name="curve", closed=False, shape=model.Shape(nurbs=shape))

    def resolve(position: model.Position) -> Pose:
        world_position = position.world_position
        assert world_position is not None
        return Pose(world_position.x, world_position.y, 0.0, 0.0, 0.0, 0.0)

    return minimum_time(lambda: sample_trajectory(trajectory, resolve), REPEATS) / count


def recording_cost(count: int) -> float:
    """Return the time per frame to check and read a recording [ms]."""
    scenario = Path(__file__).parents[1] / "tests" / "data" / "passing_by.xosc"
    with Simulation(scenario) as simulation:
        frames = [simulation.tick()[0] for _ in range(10)]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "recording.mcap"
        recorder = Recorder(path, metadata={"scenario": "passing_by", "seed": "1"})
        for tick in range(count):
            frame = frames[tick % len(frames)]
            recorder.observe(replace(frame, view=replace(frame.view, tick=tick, time=0.05 * tick)))
        recorder.close()
        return minimum_time(lambda: sum(1 for _ in read_recording(path).frames()), REPEATS) / count


INPUTS: dict[str, tuple[tuple[int, ...], Cost]] = {
    "points of a Nurbs": (POINTS, nurbs_cost),
    "frames of a recording": (FRAMES, recording_cost),
}
SERIES: dict[str, tuple[tuple[int, ...], Cost]] = {
    "scripted cars": (CARS, car_cost),
    "stations, one receives": (STATIONS, lambda count: station_cost(count, all_listen=False)),
    "stations, all receive": (STATIONS, lambda count: station_cost(count, all_listen=True)),
    "stations of equal density, all receive": (
        STATIONS,
        lambda count: station_cost(count, all_listen=True, length=SPACING * count),
    ),
}


def draw(costs: dict[str, list[tuple[int, float]]], path: Path) -> None:
    """Write a plot of the costs."""
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    for axes, names in zip(figure.subplots(1, 2), (["scripted cars"], [*SERIES][1:]), strict=True):
        for name in names:
            if name in costs:
                axes.plot(*zip(*costs[name], strict=True), "o-", label=name)
        axes.set(xlabel="number", ylabel="time per tick and vehicle [ms]", xscale="log")
        ticks = sorted({number for name in names for number in SERIES[name][0]})
        axes.set_xticks(ticks, labels=[str(number) for number in ticks])
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(axis="y", color="#e5e7eb")
        if axes.lines:
            axes.set_ylim(0.0, 1.1 * axes.get_ylim()[1])
            axes.legend(frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plot", type=Path, help="PNG file")
    parser.add_argument("--inputs", action="store_true", help="only the cost of inputs")
    options = parser.parse_args()
    costs: dict[str, list[tuple[int, float]]] = {}
    for name, (counts, cost) in (INPUTS if options.inputs else {**INPUTS, **SERIES}).items():
        if cost is car_cost and not os.environ.get("EIDRIVE_MAPS"):
            print(f"{name}: skipped, EIDRIVE_MAPS is not set")
            continue
        costs[name] = [(count, cost(count)) for count in counts]
        cells = "".join(f"{count:>8}: {value:.4f} ms" for count, value in costs[name])
        print(f"{name:40}{cells}   growth {costs[name][-1][1] / costs[name][0][1] - 1.0:+.0%}", flush=True)
    if options.inputs:
        return
    cells = "".join(
        f"{count:>8}: {value / received_messages(count, STATION_SECONDS, RATE):.4f} ms"
        for count, value in costs["stations, all receive"]
    )
    print(f"{'  per received message':40}{cells}")
    if options.plot:
        draw(costs, options.plot)
        print(f"wrote {options.plot}")


if __name__ == "__main__":
    main()

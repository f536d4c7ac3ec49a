"""Time of the planner `behavior` with ten tracks, and speed of coop/scenario_5 with it and with background traffic.

The first figure is the time of `plan` in a tick, averaged over 20 s, in which the planner decides in every second tick:
behind three vehicles, beside four oncoming ones and three pedestrians. The second one is the simulated time per time of
whole runs with the oracle on one core, for comparison with the planner `conflict_area`, too.

All times are processor times of the thread, of which a run has one. Other load of the machine only adds to the time of
a tick, so the minimum of each tick over all runs counts.

    python benchmarks/bench_planner.py [--runs 9] [--seed 1]
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator

import numpy as np
from timing import sum_of_minima, tick_times

from eidrive_scenario.base.detections import Detections
from eidrive_scenario.base.requests import Goal
from eidrive_scenario.driving.planning.behavior.planner import BehaviorPlanner
from eidrive_scenario.driving.settings import AgentSettings
from eidrive_scenario.extensions.library import library_path, resolve_scenario
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.sensing.readings import EgoState
from eidrive_scenario.simulation import RunSettings, Simulation, load_for_seed
from eidrive_scenario.world.actor import ActorSpec

SCENARIO, ROAD = "coop/scenario_5", "roads/two_lane_road.xodr"
CAR = ActorSpec("Ego", "car", "car", (4.9, 1.84, 1.5), (1.4, 0.0, 0.75), wheelbase=2.85, max_steering=0.6)
DT, TICKS = 0.05, 400
SPEED, TARGET_SPEED = 9.0, 14.0
"""Speed of the vehicle and of those ahead, and wanted speed [m/s]."""
LANE, ONCOMING, SIDEWALK = 0.0, 4.0, -4.5
"""y of the ways along x [m]."""


def tracks(now: float, x: float) -> Detections:
    """Return ten tracks around a vehicle at x [m]."""
    rows = [
        *((x + 40.0 + 15.0 * k, LANE, SPEED, 0.0, "car") for k in range(3)),
        *((x + 20.0 + 60.0 * k - 19.0 * now % 60.0, ONCOMING, -10.0, math.pi, "car") for k in range(4)),
        *((x + 30.0 + 20.0 * k, SIDEWALK, 1.0, 0.0, "pedestrian") for k in range(3)),
    ]
    sizes = {"car": (4.5, 1.8, 1.5), "pedestrian": (0.5, 0.5, 1.8)}
    return Detections(
        now,
        boxes=np.array([(at, y, 0.8, *sizes[kind], yaw) for at, y, _, yaw, kind in rows]),
        scores=np.ones(len(rows)),
        classes=tuple(kind for *_, kind in rows),
        velocity=np.array([(speed, 0.0) for _, _, speed, _, _ in rows]),
        covariance=np.tile(0.01 * np.eye(2), (len(rows), 1, 1)),
    )


def drive() -> Iterator[tuple[EgoState, Detections]]:
    """Yield what the planner receives in each tick."""
    for tick in range(TICKS):
        now = DT * tick
        x = SPEED * now - 60.0
        yield EgoState(now, np.array([x, LANE, 0.0]), 0.0, 0.0, 0.0, SPEED, 0.0, 0.0), tracks(now, x)


def timed_plans(roads: RoadNetwork, inputs: list[tuple[EgoState, Detections]]) -> list[float]:
    """Return the time of the planner in each tick [s]."""
    settings = AgentSettings.model_validate({"planner": "behavior", "target_speed": TARGET_SPEED})
    planner = BehaviorPlanner(settings, CAR, roads, dt=DT, seed=0)
    times = []
    for ego, objects in inputs:
        begin = time.thread_time()
        planner.plan(ego, objects, Goal(), ego.time)
        times.append(time.thread_time() - begin)
    return times


def timed_run(planner: str, seed: int) -> list[float]:
    """Return the time of each tick of a run of the scenario with a planner [s]."""
    settings = RunSettings(planner=planner, detector="oracle")
    scenario = load_for_seed(resolve_scenario(SCENARIO), seed, settings.parameters)
    return tick_times(Simulation(scenario, seed=seed, settings=settings), time.thread_time)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    roads = RoadNetwork.load(library_path() / ROAD)
    inputs = list(drive())
    planners = ("behavior", "conflict_area")
    plans: list[list[float]] = []
    ticks: dict[str, list[list[float]]] = {planner: [] for planner in planners}
    for _ in range(arguments.runs):
        plans.append(timed_plans(roads, inputs))
        for planner in planners:
            ticks[planner].append(timed_run(planner, arguments.seed))
    print(f"planner behavior with ten tracks, {TICKS} ticks, {arguments.runs} runs")
    print(f"  time per tick              {1e3 * sum_of_minima(plans) / TICKS:8.3f} ms   (aim: at most 1)")
    print(f"{SCENARIO} with 30 cars of background traffic, oracle, seed {arguments.seed}, {arguments.runs} runs")
    for planner in planners:
        simulated, spent = DT * len(ticks[planner][0]), sum_of_minima(ticks[planner])
        aim = "   (aim: at least 10)" if planner == "behavior" else ""
        print(f"  simulated s per s          {simulated / spent:8.1f}   {planner}{aim}")


if __name__ == "__main__":
    main()

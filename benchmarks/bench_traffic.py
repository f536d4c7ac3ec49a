"""Speed of dense traffic in a town on one core: scripted cars of a scenario, and a swarm around one of them.

The script writes the scenario: scripted cars at random positions of a CARLA town, a fifth of which change lane or speed
by triggers, and a TrafficSwarmAction. `EIDRIVE_MAPS` names the folder with the towns.

    python benchmarks/bench_traffic.py [--town Town04] [--scripted 200] [--swarm 100] [--seconds 30] [--runs 3]
"""

from __future__ import annotations

import argparse
import gc
import os
import pstats
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np
from cars import VEHICLE, start
from timing import profiled

from eidrive_scenario.base.randomness import generator
from eidrive_scenario.openscenario import load_scenario
from eidrive_scenario.roads import RoadNetwork
from eidrive_scenario.simulation import RunSettings, Simulation
from eidrive_scenario.traffic import Fleet

SWARM = """<GlobalAction><TrafficAction trafficName="swarm"><TrafficSwarmAction innerRadius="10" semiMajorAxis="{reach}"
semiMinorAxis="{reach}" numberOfVehicles="{count}" offset="0"><CentralObject entityRef="car0"/>
</TrafficSwarmAction></TrafficAction></GlobalAction>"""
GROUP = """<ManeuverGroup name="g{n}" maximumExecutionCount="1"><Actors selectTriggeringEntities="false">
<EntityRef entityRef="car{n}"/></Actors><Maneuver name="m{n}"><Event name="e{n}" priority="override">
<Action name="a{n}"><PrivateAction>{action}</PrivateAction></Action><StartTrigger><ConditionGroup>
<Condition name="c{n}" delay="0" conditionEdge="rising"><ByEntityCondition>
<TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="car{n}"/></TriggeringEntities><EntityCondition>
<TraveledDistanceCondition value="{distance:.1f}"/></EntityCondition></ByEntityCondition></Condition></ConditionGroup>
</StartTrigger></Event></Maneuver></ManeuverGroup>"""
ACTIONS = (
    """<LongitudinalAction><SpeedAction>
<SpeedActionDynamics dynamicsShape="sinusoidal" dynamicsDimension="rate" value="1.5"/>
<SpeedActionTarget><AbsoluteTargetSpeed value="4"/></SpeedActionTarget></SpeedAction></LongitudinalAction>""",
    """<LateralAction><LaneOffsetAction continuous="false">
<LaneOffsetActionDynamics dynamicsShape="cubic" maxLateralAcc="1"/>
<LaneOffsetTarget><AbsoluteTargetLaneOffset value="0.6"/></LaneOffsetTarget></LaneOffsetAction></LateralAction>""",
)
FILE = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00"
description="traffic" author="-"/>
<CatalogLocations/><RoadNetwork><LogicFile filepath="{map}"/></RoadNetwork><Entities>{entities}</Entities>
<Storyboard><Init><Actions>{swarm}{placed}</Actions></Init><Story name="story"><Act name="act">{groups}<StartTrigger>
<ConditionGroup><Condition name="start" delay="0" conditionEdge="none"><ByValueCondition>
<SimulationTimeCondition value="0" rule="greaterOrEqual"/></ByValueCondition></Condition></ConditionGroup>
</StartTrigger></Act></Story><StopTrigger><ConditionGroup>
<Condition name="stop" delay="0" conditionEdge="none"><ByValueCondition><SimulationTimeCondition value="{seconds}"
rule="greaterOrEqual"/></ByValueCondition></Condition></ConditionGroup>
</StopTrigger></Storyboard></OpenSCENARIO>"""


def scenario_text(town: Path, scripted: int, swarm: int, seconds: float) -> str:
    """Return a scenario with scripted cars, at positions of a fixed seed, and a swarm around the first."""
    lanes = Fleet(RoadNetwork.load(town)).lanes
    rng = generator(0, "bench_traffic")
    rows = np.flatnonzero(lanes.tables.lane_drivable & ~lanes.in_junction & (lanes.length > 20.0))
    shares = lanes.length[rows] / lanes.length[rows].sum()
    occupied: list[tuple[int, float]] = []
    while len(occupied) < scripted:
        row = int(rng.choice(rows, p=shares))
        progress = float(rng.uniform(5.0, lanes.length[row] - 5.0))
        if all(row != other or abs(progress - other_progress) > 12.0 for other, other_progress in occupied):
            occupied.append((row, progress))
    placed, groups = [], []
    for n, (row, progress) in enumerate(occupied):
        key = lanes.keys[row]
        s = float(lanes.s(np.array([row]), np.array([progress]))[0])
        speed = rng.uniform(5.0, 14.0)
        placed.append(start(f"car{n}", key.road, key.lane, f"{s:.2f}", f"{speed:.2f}"))
        if n % 5 == 0:
            groups.append(GROUP.format(n=n, action=ACTIONS[n // 5 % 2], distance=rng.uniform(10.0, 150.0)))
    return FILE.format(
        map=town,
        entities="".join(f'<ScenarioObject name="car{n}">{VEHICLE}</ScenarioObject>' for n in range(scripted)),
        swarm=SWARM.format(reach=350, count=swarm) if swarm else "",
        placed="".join(placed),
        groups="".join(groups),
        seconds=seconds,
    )


def town_file(name: str) -> Path:
    """Return the path of a town in EIDRIVE_MAPS. Raise SystemExit if the variable is not set."""
    folder = os.environ.get("EIDRIVE_MAPS")
    if not folder:
        sys.exit("EIDRIVE_MAPS is not set; it must name the folder with CARLA's towns (Town04.xodr)")
    return (Path(folder) / name).with_suffix(".xodr").resolve()


def build(town: Path, scripted: int, swarm: int, seconds: float) -> Simulation:
    """Return a run of the scenario."""
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "traffic.xosc"
        path.write_text(scenario_text(town, scripted, swarm, seconds), encoding="utf-8")
        return Simulation(load_scenario(path), seed=1, settings=RunSettings(time_limit=seconds + 1.0))


def traffic_run(town: Path, scripted: int, swarm: int, seconds: float, runs: int = 2) -> float:
    """Return the simulated time per processor time of the fastest of several runs, without loading."""
    rates = []
    for _ in range(runs):
        simulation = build(town, scripted, swarm, seconds)
        gc.collect()  # what loading left; the command line collects garbage rarely
        started = time.process_time()
        result = simulation.run()
        rates.append(result.simulated_s / (time.process_time() - started))
    return max(rates)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--town", default="Town04")
    parser.add_argument("--scripted", type=int, default=200)
    parser.add_argument("--swarm", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--profile", action="store_true", help="also print the functions that take the most time")
    options = parser.parse_args()
    traffic = town_file(options.town), options.scripted, options.swarm, options.seconds

    loading, running, cpu, hashes = [], [], [], set()
    for _ in range(options.runs):
        started = time.perf_counter()
        simulation = build(*traffic)
        loading.append(time.perf_counter() - started)
        started = time.process_time()
        result = simulation.run()
        cpu.append(time.process_time() - started)
        running.append(result.wall_s)
        hashes.add(result.trace_hash)
    ticks = round(result.simulated_s / 0.05) + 1
    swarm = len(simulation.storyboard.context.traffic_names)
    print(f"{options.town}: {options.scripted} scripted cars, a swarm of {options.swarm} ({swarm} at the end)")
    comparison = "equal traces" if len(hashes) == 1 else f"{len(hashes)} DIFFERENT TRACES"
    print(f"  simulated {result.simulated_s:.2f} s in {ticks} ticks of 0.05 s, {options.runs} runs, {comparison}")
    print(f"  simulated s per wall s     {result.simulated_s / median(running):8.2f}   (aim: above 1)")
    print(f"  simulated s per s of CPU   {result.simulated_s / median(cpu):8.2f}")
    print(f"  per tick                   {1e3 * median(running) / ticks:8.3f} ms")
    print(f"  loading                    {median(loading):8.3f} s")
    profile = profiled(build(*traffic).run)
    if options.profile:
        pstats.Stats(profile).sort_stats("tottime").print_stats(40)


if __name__ == "__main__":
    main()
